"""Lyapunov exponents as they are drawn: titles, the value in words, exponents of stretches."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pendmap.model.units import Units
from pendmap.pictures import names
from pendmap.pictures.legend import typeset
from pendmap.words import written

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["sliding", "title", "value"]

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
    said = f"{exponent:.2g}" if math.isnan(error) else written(exponent, error)
    said += f" \N{PLUS-MINUS SIGN} {written(error, error)}" if error > 0 else ""
    said = said.replace("-", "\N{MINUS SIGN}")
    per = names.per_time(Units.of(a))
    return f"\N{GREEK SMALL LETTER LAMDA} = {said} {per}"


def sliding(dataset: xr.Dataset) -> tuple[Floats, Floats]:
    """Return where windows end along the start's own trajectory, and their exponents.

    Returns
    -------
    periods, exponents : ndarray, shape (n,)
        Of ``window`` periods each; of fewer where the trajectory is shorter.
    """
    a = dataset.attrs
    growth = dataset["growth"].values
    width = min(int(a["window"]), growth.size - 1)
    gained = growth[width:] - growth[:-width]
    return (
        dataset["elapsed"].values[width:].astype(float),
        gained / (width * float(a["forcing_period"])),
    )
