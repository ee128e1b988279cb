"""What summaries and JSON say of draws."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from pendmap.formatting import counted

if TYPE_CHECKING:
    from collections.abc import Iterable

    import xarray as xr


def draws_line(found: xr.Dataset) -> str:
    """Return the line that says how many draws were made, and of what."""
    names = ", ".join(str(name) for name in found["parameter"].values)
    return f"{counted(found.attrs['draws'], 'draw')} of {names} from the covariance of the fit."


def fields(dataset: xr.Dataset) -> dict[str, Any]:
    """Return what the JSON object of a result says of draws: ``draws``, null without.

    Results that take no draws say nothing.
    """
    kind = str(dataset.attrs.get("kind"))
    if kind not in _FIELDS:
        return {}
    if "draws" not in dataset.attrs:
        return {"draws": None}
    a = dataset.attrs
    own = {
        "count": a["draws"],
        "seed": a["draws_seed"],
        "parameters": [str(name) for name in dataset["parameter"].values],
    }
    return {"draws": own | _FIELDS[kind](dataset)}


def _basins(dataset: xr.Dataset) -> dict[str, Any]:
    a = dataset.attrs
    outcomes = [
        {"name": str(name), "fraction": mean, "ci95": [low, high], "exists": exists}
        for name, mean, low, high, exists in _rows(
            dataset, "outcome", "share_mean", "share_low", "share_high", "exists"
        )
    ]
    doubt = {name: a[name] for name in ("sure_cells", "doubt_start", "doubt_parameters")}
    return {"attractors": outcomes} | doubt


def _parameter_map(dataset: xr.Dataset) -> dict[str, Any]:
    regimes = [
        {"kinds": json.loads(str(text)), "share": mean, "ci95": [low, high]}
        for text, mean, low, high in _rows(
            dataset, "outcome_kinds", "share_mean", "share_low", "share_high"
        )
    ]
    return {"regimes": regimes, "sure_cells": dataset.attrs["sure_cells"]}


def _orbits(dataset: xr.Dataset) -> dict[str, Any]:
    spreads = ("theta_spread", "velocity_spread", "multipliers_spread")
    keys = ("orbit", "exists", "stable_share", *spreads)
    orbits = [
        {"name": str(name), "exists": there, "stable": stable}
        | dict(zip(spreads, (theta, velocity, spread.tolist()), strict=True))
        for name, there, stable, theta, velocity, spread in _rows(dataset, *keys)
    ]
    return {"orbits": orbits, "others": dataset.attrs["drawn_others"]}


def _lifetime(dataset: xr.Dataset) -> dict[str, Any]:
    a = dataset.attrs
    return {
        "mean_periods_ci95": [a["mean_periods_low"], a["mean_periods_high"]],
        "transient_share": a["transient_share"],
        "persistent_share": a["persistent_share"],
    }


def _tongues(dataset: xr.Dataset) -> dict[str, Any]:
    asked = dataset["asked"].values.astype(bool)
    found = {}
    for prefix, key in (("", "curves"), ("inverted_", "inverted")):
        names = ("index", "multiplier", "p", "p_low", "p_high", "exists")
        found[key] = [
            {
                "omega": float(dataset["omega"].values[index]),
                "multiplier": multiplier,
                "p": p,
                "ci95": [low, high],
                "exists": exists,
            }
            for index, multiplier, p, low, high, exists in _rows(
                dataset, *(f"{prefix}{name}" for name in names)
            )
            if asked[index]
        ]
    return found


def _rows(dataset: xr.Dataset, *names: str) -> Iterable[tuple[Any, ...]]:
    return zip(*(dataset[name].values for name in names), strict=True)


_FIELDS = {
    "basins": _basins,
    "lifetime": _lifetime,
    "orbits": _orbits,
    "parameter_map": _parameter_map,
    "tongues": _tongues,
}
