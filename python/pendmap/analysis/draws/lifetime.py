"""Lifetimes of transient chaos over draws of the parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap.analysis.draws import drawn_field, interval

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.analysis.draws import Draws, Run


_KEYS = ("mean_periods", "stderr", "transient_chaos", "persistent")


def lifetime_over(dataset: xr.Dataset, draws: Draws, run: Run) -> xr.Dataset:
    """Return a lifetime with the lifetimes of D draws from the same starts.

    Adds ``drawn_mean_periods`` and ``drawn_stderr`` (D), nan without transient chaos,
    ``drawn_persistent`` (D) and ``drawn`` (D, parameter); attributes ``mean_periods_low`` and
    ``mean_periods_high``, the 95 % interval over the draws, which includes the counting error;
    ``transient_share`` and ``persistent_share``.
    """
    rows = [[float(one.attrs[key]) for key in _KEYS] for one in draws.each(run)]
    mean, error, transient, persistent = np.array(rows).T
    _, _, low, high = interval(mean)
    found = dataset.assign(
        drawn_mean_periods=("draw", mean),
        drawn_stderr=("draw", error),
        drawn_persistent=("draw", persistent.astype(np.int8)),
    )
    found.attrs |= {
        "mean_periods_low": float(low),
        "mean_periods_high": float(high),
        "transient_share": float(transient.mean()),
        "persistent_share": float(persistent.mean()),
    }
    return draws.complete(found, _summary(found.attrs))


@drawn_field
def drawn_lifetimes(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the draws of a lifetime for the JSON object."""
    a = dataset.attrs
    return {
        "mean_periods_ci95": [a["mean_periods_low"], a["mean_periods_high"]],
        "transient_share": a["transient_share"],
        "persistent_share": a["persistent_share"],
    }


def _summary(a: dict[str, Any]) -> list[str]:
    lines = []
    if a["transient_share"]:
        lines.append(
            f"Mean lifetime: 95 % of the draws in [{a['mean_periods_low']:.4g}, "
            f"{a['mean_periods_high']:.4g}] periods."
        )
    lines.append(
        f"{100 * a['transient_share']:.3g} % of the draws have transient chaos; in "
        f"{100 * a['persistent_share']:.3g} % chaos persists."
    )
    return lines
