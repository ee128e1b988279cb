"""Closed orbits as they are drawn: paths in the phase plane, points, colours, the legend."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pendmap.charts import palette, plane
from pendmap.charts.legend import typeset

if TYPE_CHECKING:
    import xarray as xr


Floats = npt.NDArray[np.float64]

MOST = 16
"""Orbits that are named: of more the legend says how many there are."""


@dataclass(frozen=True, eq=False)
class Closed:
    """One orbit in a picture.

    Attributes
    ----------
    id : int
        1 and up.
    name, kind : str
        As in the dataset.
    stable : bool
        Whether it attracts, or is a centre where nothing does.
    largest : float
        Largest modulus of its multipliers.
    path : ndarray, shape (m, 2)
        Its motion in the phase plane, broken by rows of nan where the angle wraps.
    points : ndarray, shape (n, 2)
        Its stroboscopic points.
    """

    id: int
    name: str
    kind: str
    stable: bool
    largest: float
    path: Floats
    points: Floats

    @property
    def colour(self) -> str:
        """The colour of its name."""
        return palette.colour(self.name, self.kind)

    @property
    def text(self) -> str:
        """Its line in a legend."""
        says = "stable" if self.stable else "unstable"
        return f"{typeset(self.name)}, {says}, largest |multiplier| {self.largest:.4g}"


def closed(dataset: xr.Dataset) -> list[Closed]:
    """Return the orbits of a dataset, those that attract last: they are drawn on top."""
    owner, path_of = dataset["point_orbit"].values, dataset["path_orbit"].values
    points = np.stack([dataset["point_theta"].values, dataset["point_velocity"].values], axis=1)
    found = []
    for k in range(dataset.sizes["orbit"]):
        row = dataset.isel(orbit=k)
        number = int(row["id"])
        moduli = np.hypot(*np.moveaxis(row["multipliers"].values, -1, 0))
        found.append(
            Closed(
                number,
                str(row["orbit"].values),
                str(row["kind"].values),
                bool(int(row["stable"])),
                float(np.nanmax(moduli)) if np.isfinite(moduli).any() else math.nan,
                _path(dataset, path_of == number),
                points[owner == number],
            )
        )
    return sorted(found, key=lambda one: one.stable)


def _path(dataset: xr.Dataset, mine: npt.NDArray[np.bool_]) -> Floats:
    theta, velocity = dataset["path_theta"].values[mine], dataset["path_velocity"].values[mine]
    piece = dataset["path_piece"].values[mine]
    gap = np.full((1, 2), np.nan)
    parts = [np.empty((0, 2))]
    for k in np.unique(piece):
        own = piece == k
        whole = np.stack([theta[own], velocity[own]], axis=1)
        broken = plane.broken_at_wrap(theta[own], velocity[own])
        parts += [whole if plane.on_line(dataset) else broken, gap]
    return np.concatenate(parts)


def angles(orbits: list[Closed], dataset: xr.Dataset) -> tuple[float, float]:
    """Return the angles that a picture shows."""
    theta = [one.path[:, 0] for one in orbits] + [one.points[:, 0] for one in orbits]
    shown = np.concatenate([*theta, np.empty(0)])
    return plane.angles(dataset, shown[np.isfinite(shown)])


def speeds(orbits: list[Closed], dataset: xr.Dataset) -> tuple[float, float]:
    """Return the velocities that a picture shows: all of the paths, or the box where none is."""
    values = [one.path[:, 1] for one in orbits] + [one.points[:, 1] for one in orbits]
    shown = np.concatenate([*values, np.empty(0)])
    shown = shown[np.isfinite(shown)]
    if shown.size == 0:
        return float(dataset.attrs["low_velocity"]), float(dataset.attrs["high_velocity"])
    return plane.padded(shown)


def title(dataset: xr.Dataset) -> str:
    """Return what a picture of a dataset is called."""
    n, w = int(dataset.attrs["n"]), int(dataset.attrs["w"])
    count = dataset.sizes["orbit"]
    signed = "0" if w == 0 else f"{w:+d}".replace("-", "\N{MINUS SIGN}")
    if count == 0:
        return f"No orbit {n}:{signed}"
    return f"{'The orbit' if count == 1 else f'All {count} orbits'} {n}:{signed}"
