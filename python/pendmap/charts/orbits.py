"""Chart of closed orbits: paths and stroboscopic points in the phase plane."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from pendmap.charts import names, plane
from pendmap.charts.chart import Chart, Panel
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
    units = Units.of(facts(dataset))
    points = plane.points(dataset)
    paths = [_path(dataset, dataset["path_orbit"].values == i) for i in dataset["id"].values]
    every = np.concatenate([points, *paths])
    every = every[np.isfinite(every).all(axis=1)]
    theta = plane.angles(dataset, every[:, 0])
    box = (float(dataset.attrs["low_velocity"]), float(dataset.attrs["high_velocity"]))
    velocity = plane.padded(every[:, 1]) if every.size else box
    marks = _drawn(dataset, theta)
    count = int(dataset.attrs.get("draws", 0))
    over = f";   grey dots: {counted(count, 'draw')}" if count else ""
    # Stable orbits are drawn last, on top.
    stable = dataset["stable"].values.astype(bool)
    colours = colours_of(dataset)
    for k in [*np.flatnonzero(~stable), *np.flatnonzero(stable)]:
        own = points[dataset["point_orbit"].values == dataset["id"].values[k]]
        at = plane.copies(dataset, own, *theta)
        marks += _orbit(dataset, int(k), paths[k], at, colours[k])
    if dataset.sizes["orbit"] > MOST:
        more = f"and {dataset.sizes['orbit'] - MOST} more"
        marks.append(Points(NONE, NONE, marker="none", name=more))
    across, up = names.phase_plane(theta, velocity, units)
    low, high = (units.bare(end, VELOCITY) for end in velocity)
    return Chart(
        _title(dataset),
        names.parameters(facts(dataset)) + over,
        [[Panel("phase", "", across, up, marks)]],
        ratio=min(max((high - low) / (theta[1] - theta[0]), 0.6), 1.1),
        remark="" if dataset.sizes["orbit"] else "No orbit was found.",
    ).only(layer)


def _drawn(dataset: xr.Dataset, theta: tuple[float, float]) -> list[Mark]:
    """Return the points of the orbits over draws of the parameters."""
    if not int(dataset.attrs.get("draws", 0)):
        return []
    at = [dataset[f"drawn_{name}"].values.ravel() for name in ("theta", "velocity")]
    points = plane.copies(dataset, np.stack(at, axis=1)[np.isfinite(at[0])], *theta)
    return [Points(*points.T, marker=".", size=3.0, colour=QUIET, order=3.0)]


def _orbit(dataset: xr.Dataset, k: int, path: Floats, at: Floats, colour: str) -> list[Mark]:
    row = dataset.isel(orbit=k)
    number, name = int(row["id"]), str(row["orbit"].values)
    stable = bool(int(row["stable"]))
    moduli = np.hypot(*np.moveaxis(row["multipliers"].values, -1, 0))
    largest = float(np.nanmax(moduli)) if np.isfinite(moduli).any() else math.nan
    says = "stable" if stable else "unstable"
    said = f"{number}: {typeset(name)}, {says}, largest |multiplier| {largest:.4g}"
    named = number in sorted(dataset["id"].values)[:MOST]
    look: dict[str, Any] = {"colour": colour, "name": said if named else ""}
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
        own = mine & (piece == k)
        motion = dataset["path_theta"].values[own], dataset["path_velocity"].values[own]
        whole = np.stack(motion, axis=1)
        lines.append(whole if plane.on_line(dataset) else plane.broken_at_wrap(*motion))
    return np.stack(together(lines), axis=1)


def _title(dataset: xr.Dataset) -> str:
    n, w = int(dataset.attrs["n"]), int(dataset.attrs["w"])
    count = dataset.sizes["orbit"]
    signed = "0" if w == 0 else typographic(f"{w:+d}")
    if count == 0:
        return f"No orbit {n}:{signed}"
    return f"{'The orbit' if count == 1 else f'All {count} orbits'} {n}:{signed}"
