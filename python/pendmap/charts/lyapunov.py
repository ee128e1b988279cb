"""Lyapunov exponents as they are drawn: titles, the value in words, exponents of stretches."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pendmap.charts import names
from pendmap.charts.legend import typeset
from pendmap.formatting import with_error
from pendmap.units import Units

if TYPE_CHECKING:
    import xarray as xr


Floats = npt.NDArray[np.float64]


def title(dataset: xr.Dataset) -> str:
    """Return what a picture of an exponent is called."""
    head = "Largest Lyapunov exponent"
    if dataset.sizes["attractor"]:
        return f"{head}: {typeset(str(dataset['attractor'].values[0]))}"
    words = {
        "undamped": "motion without damping",
        "undecided": "undecided",
        "failed": "the motion leaves the range of numbers",
    }
    return f"{head}: {words[str(dataset.attrs['end'])]}"


def value(dataset: xr.Dataset) -> str:
    """Return the exponent with its error and unit, empty where there is none."""
    a = dataset.attrs
    exponent, error = float(a["exponent"]), float(a["stderr"])
    if not math.isfinite(exponent):
        return ""
    said = with_error(exponent, error, "\N{PLUS-MINUS SIGN}")
    said = said.replace("-", "\N{MINUS SIGN}")
    per = names.per_time(Units.of(a))
    return f"\N{GREEK SMALL LETTER LAMDA} = {said} {per}"


def elapsed(dataset: xr.Dataset) -> tuple[float, float]:
    """Return the first and the last period of a curve, one apart at least."""
    periods = dataset["elapsed"].values
    return float(periods[0]), float(max(periods[-1], periods[0] + 1))


def sliding(dataset: xr.Dataset) -> tuple[Floats, Floats]:
    """Return where windows end along the start's own trajectory, and their exponents.

    Returns
    -------
    periods, exponents : ndarray, shape (n,)
        Of ``window`` periods each; of fewer where the trajectory is shorter.
    """
    a = dataset.attrs
    growth, elapsed = dataset["growth"].values, dataset["elapsed"].values
    width = min(int(a["window"]), int(elapsed[-1] - elapsed[0]))
    # Of a selection only those periods have an exponent that begin at one that is there too.
    begin = np.searchsorted(elapsed, elapsed - width)
    whole = (elapsed[begin] == elapsed - width) & (width > 0)
    gained = growth[whole] - growth[begin[whole]]
    return elapsed[whole].astype(float), gained / (max(width, 1) * float(a["forcing_period"]))
