"""Closed orbits over draws: spread of each, and probability that it exists and is stable."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap.analysis.draws import drawn_field, interval
from pendmap.analysis.orbit_table import matched, points_of
from pendmap.analysis.result import records
from pendmap.formatting import counted, with_error

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.analysis.draws import Draws, Run


def orbits_over(dataset: xr.Dataset, draws: Draws, run: Run) -> xr.Dataset:
    """Return K closed orbits with statistics of the orbits of D draws.

    Orbits are matched by name, and among those of one name by their points. Of each the point and
    the multipliers nearest to those of the model's orbit are taken. Adds ``drawn_theta``,
    ``drawn_velocity`` (K, D) and ``drawn_multipliers`` (K, eigenvalue, part, D), nan where a draw
    has no such orbit; ``theta_spread``, ``velocity_spread`` and ``multipliers_spread``, their
    standard deviations over the draws; ``exists`` and ``stable_share``, the shares of the draws in
    which it exists, and exists and is stable; ``drawn`` (D, parameter). Attribute ``drawn_others``:
    mean number of orbits of a draw that the model itself lacks.
    """
    names, points = dataset["orbit"].values.tolist(), points_of(dataset, "orbit")
    count, total = len(names), len(draws)
    state = np.full((count, 2, total), np.nan)
    multipliers = np.full((*dataset["multipliers"].shape, total), np.nan)
    there, stable = np.zeros((count, total), bool), np.zeros((count, total), bool)
    others = 0
    for d, one in enumerate(draws.each(run)):
        theirs = points_of(one, "orbit")
        for j, k in enumerate(matched(names, points, one["orbit"].values.tolist(), theirs)):
            if k < 0:
                others += 1
                continue
            there[k, d], stable[k, d] = True, bool(one["stable"][j])
            point = np.array([dataset["theta_point"][k], dataset["velocity_point"][k]])
            away = theirs[j] - point
            away[:, 0] = np.remainder(away[:, 0] + math.pi, math.tau) - math.pi
            state[k, :, d] = point + away[np.argmin(np.hypot(*away.T))]
            own, pair = dataset["multipliers"].values[k], one["multipliers"].values[j]
            swapped = np.abs(pair[::-1] - own).sum() < np.abs(pair - own).sum()
            multipliers[k, ..., d] = pair[::-1] if swapped else pair
    spread = interval(state)[1]
    dims = dataset["multipliers"].dims
    found = dataset.assign(
        drawn_theta=(("orbit", "draw"), state[:, 0], {"units": "rad"}),
        drawn_velocity=(("orbit", "draw"), state[:, 1], dataset["velocity_point"].attrs),
        drawn_multipliers=((*dims, "draw"), multipliers),
        theta_spread=("orbit", spread[:, 0], {"units": "rad"}),
        velocity_spread=("orbit", spread[:, 1], dataset["velocity_point"].attrs),
        multipliers_spread=(dims, interval(multipliers)[1]),
        exists=("orbit", there.mean(axis=1)),
        stable_share=("orbit", stable.mean(axis=1)),
    )
    found.attrs["drawn_others"] = others / total
    return draws.complete(found, _summary(found, others))


@drawn_field
def drawn_orbits(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the draws of closed orbits for the JSON object."""
    spreads = {key: key for key in ("theta_spread", "velocity_spread", "multipliers_spread")}
    orbits = records(dataset, name="orbit", exists="exists", stable="stable_share", **spreads)
    return {"orbits": orbits, "others": dataset.attrs["drawn_others"]}


def _summary(found: xr.Dataset, others: int) -> list[str]:
    lines = []
    for k, name in enumerate(found["orbit"].values):
        theta, velocity = (
            with_error(float(found[f"{what}_point"][k]), float(found[f"{what}_spread"][k]))
            for what in ("theta", "velocity")
        )
        sizes = np.hypot(*np.moveaxis(found["drawn_multipliers"].values[k], 1, 0))
        mean, error, _, _ = interval(sizes.max(axis=0))
        largest = f", largest multiplier {with_error(float(mean), float(error))} in size"
        lines.append(
            f"{name}: there in {100 * float(found['exists'][k]):.3g} % of the draws, stable in "
            f"{100 * float(found['stable_share'][k]):.3g} %; theta = {theta}, velocity = {velocity}"
            f"{largest if math.isfinite(mean) else ''}."
        )
    if others:
        more = counted(others, "orbit")
        lines.append(f"All draws together have {more} more, which the own model has not.")
    return lines
