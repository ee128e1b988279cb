"""Lifetimes as they are drawn: survival curves, the fitted tail, what they are called."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pendmap.charts import palette
from pendmap.charts.legend import typeset
from pendmap.formatting import written

if TYPE_CHECKING:
    import xarray as xr


Floats = npt.NDArray[np.float64]

SIGMAS = 2.0
"""Standard errors on each side that a band covers."""

FEW = 0.01
"""Share of starts given up at the bound above which curves of single attractors would end there."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Shares of all starts that are still alive.

    Attributes
    ----------
    name, kind : str
        What captures them in the end; of all of them together both are empty.
    periods, share : ndarray, shape (n,)
        After so many periods; nan where none is left.
    """

    name: str
    kind: str
    periods: Floats
    share: Floats

    @property
    def colour(self) -> str:
        """The colour of the name; dark for all."""
        return palette.colour(self.name, self.kind) if self.name else "#222222"

    @property
    def text(self) -> str:
        """Its line in a legend."""
        return typeset(self.name) if self.name else "all starts"


@dataclass(frozen=True, eq=False)
class Fit:
    """The fitted tail.

    Attributes
    ----------
    periods, share, low, high : ndarray, shape (n,)
        The curve and its band, from where it begins.
    text : str
        Its line in a legend.
    """

    periods: Floats
    share: Floats
    low: Floats
    high: Floats
    text: str


def curves(dataset: xr.Dataset) -> list[Curve]:
    """Return the curve of all starts, then of each attractor's that captured any.

    Those of single attractors are left out where the bound cut many trajectories off.
    """
    periods = dataset["elapsed"].values.astype(float)
    captured = dataset["captured"].values
    a = dataset.attrs
    starts = int(a["starts"])
    if a["persistent"]:
        return [Curve("", "", np.array([0.0, float(a["chaos_bound"])]), np.ones(2))]
    lasting = round(float(a["chaotic_share"]) * starts)
    everything = starts - int(a["failed"]) - lasting - captured.sum(axis=0)
    total = np.rint(dataset["fraction"].values * starts).astype(np.int64)
    made = [Curve("", "", periods, _shares(everything, starts))]
    whole = int(a["censored"]) <= FEW * starts
    for k in range(dataset.sizes["attractor"] if whole else 0):
        own = captured[k]
        if own.any():
            row = dataset.isel(attractor=k)
            name, kind = str(row["attractor"].values), str(row["kind"].values)
            made.append(Curve(name, kind, periods, _shares(total[k] - own, starts)))
    return made


def _shares(count: npt.NDArray[np.int64], starts: int) -> Floats:
    share = count / starts
    return np.where(share > 0, share, np.nan)


def fit(dataset: xr.Dataset) -> Fit | None:
    """Return the fitted tail, None where there is no transient chaos, or it begins later."""
    a = dataset.attrs
    if not a["transient_chaos"]:
        return None
    mean, error, begin = (float(a[key]) for key in ("mean_periods", "stderr", "from_period"))
    everything = curves(dataset)[0]
    last = everything.periods[-1]
    begin = max(begin, everything.periods[0])
    if begin > last:
        return None
    periods = np.linspace(begin, max(last, begin + 1), 200)
    first = float(np.interp(begin, everything.periods, np.nan_to_num(everything.share)))
    low, share, high = (
        first * np.exp((periods - begin) * np.log1p(-1 / max(mean + way * SIGMAS * error, 1.01)))
        for way in (-1, 0, 1)
    )
    said = f"{written(mean, error)} \N{PLUS-MINUS SIGN} {written(error, error)} periods"
    text = f"tail from period {a['from_period']}: mean lifetime {said}"
    return Fit(periods, share, low, high, text)


def title(dataset: xr.Dataset) -> str:
    """Return what a picture of lifetimes is called."""
    a = dataset.attrs
    if a["persistent"]:
        return f"Persistent chaos: {typeset(str(dataset['attractor'].values[0]))}"
    if a["transient_chaos"]:
        mean, error = float(a["mean_periods"]), float(a["stderr"])
        return f"Transient chaos: lives {written(mean, error)} periods on average"
    return "No transient chaos" if math.isfinite(a["escape_rate"]) or a["captured"] else "Undecided"
