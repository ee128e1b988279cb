"""Chart of closed orbits: paths and stroboscopic points in the phase plane."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from pendmap.charts import names, plane
from pendmap.charts.chart import Chart, Panel, holding
from pendmap.charts.legend import colours_of, typeset
from pendmap.charts.marks import DASHED, INK, NONE, QUIET, Line, Mark, Points, together
from pendmap.files import facts
from pendmap.formatting import counted, typographic
from pendmap.units import VELOCITY, Units

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.charts.marks import Floats

MOST: Final = 16  # Greatest number of named orbits; a legend gives the number of the others


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 0) -> Chart:
    """Return the orbits: full lines and points if stable, broken lines and open points if not."""
    del cells
    units, count = Units.of(facts(dataset)), dataset.sizes["orbit"]
    points = plane.points(dataset)
    paths = [_path(dataset, dataset["path_orbit"].values == i) for i in dataset["id"].values]
    every = np.concatenate([points, *paths])
    every = every[np.isfinite(every).all(axis=1)]
    theta = plane.angles(dataset, every[:, 0])
    box = (float(dataset.attrs["low_velocity"]), float(dataset.attrs["high_velocity"]))
    velocity = holding(every[:, 1]) if every.size else box
    marks: list[Mark] = []
    draws, over = int(dataset.attrs.get("draws", 0)), ""
    if draws:
        at = np.stack([dataset[f"drawn_{n}"].values.ravel() for n in ("theta", "velocity")], axis=1)
        at = plane.copies(dataset, at[np.isfinite(at[:, 0])], *theta)
        marks.append(Points(*at.T, marker=".", size=3.0, colour=QUIET, order=3.0))
        over = f";   grey dots: {counted(draws, 'draw')}"
    # Stable orbits are drawn last, on top.
    stable = dataset["stable"].values.astype(bool)
    colours = colours_of(dataset)
    for k in np.argsort(stable, kind="stable").tolist():
        mine = points[dataset["point_orbit"].values == dataset["id"].values[k]]
        at = plane.copies(dataset, mine, *theta)
        marks += _orbit(dataset, k, paths[k], at, colours[k])
    if count > MOST:
        marks.append(Points(NONE, NONE, marker="none", name=f"and {count - MOST} more"))
    n, w = int(dataset.attrs["n"]), int(dataset.attrs["w"])
    which = f"{n}:{typographic(f'{w:+d}') if w else 0}"
    some = "The orbit" if count == 1 else f"All {count} orbits"
    low, high = (units.bare(end, VELOCITY) for end in velocity)
    sides = names.phase_plane(theta, velocity, units)
    return Chart(
        f"{some} {which}" if count else f"No orbit {which}",
        names.parameters(facts(dataset)) + over,
        [[Panel("phase", "", *sides, marks)]],
        ratio=min(max((high - low) / (theta[1] - theta[0]), 0.6), 1.1),
    ).only(layer)


def _orbit(dataset: xr.Dataset, k: int, path: Floats, at: Floats, colour: str) -> list[Mark]:
    row = dataset.isel(orbit=k)
    number, name = int(row["id"]), str(row["orbit"].values)
    stable = bool(int(row["stable"]))
    moduli = np.hypot(*np.moveaxis(row["multipliers"].values, -1, 0))
    largest = float(np.nanmax(moduli)) if np.isfinite(moduli).any() else math.nan
    which = "stable" if stable else "unstable"
    text = f"{number}: {typeset(name)}, {which}, largest |multiplier| {largest:.4g}"
    named = number in sorted(dataset["id"].values)[:MOST]
    look: dict[str, Any] = {"colour": colour, "name": text if named else ""}
    # Pale colours on white, and all colours in grey, need an edge.
    line: dict[str, Any] = {"halo": QUIET, "path": f"{number}/path"}
    line |= {"width": 1.6} if stable else {"width": 1.0, "dash": DASHED}
    spots: dict[str, Any] = {"edge": INK, "edge_width": 1.0, "fill": "" if stable else "#ffffff"}
    spots |= {"size": 5.0, "order": 4.0, "clip": False, "path": f"{number}/points"}
    return [Line(*path.T, **(line | look)), Points(*at.T, **(spots | look))]


def _path(dataset: xr.Dataset, mine: npt.NDArray[np.bool_]) -> Floats:
    """Return the motion in the phase plane, broken by rows of nan where the angle wraps."""
    piece = dataset["path_piece"].values
    lines = []
    for k in np.unique(piece[mine]):
        values = mine & (piece == k)
        motion = dataset["path_theta"].values[values], dataset["path_velocity"].values[values]
        whole = np.stack(motion, axis=1)
        lines.append(whole if plane.on_line(dataset) else plane.broken_at_wrap(*motion))
    return np.stack(together(lines), axis=1)
