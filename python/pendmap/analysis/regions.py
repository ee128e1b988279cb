"""Where orbits are stable in the plane of two parameters: the regions between the curves."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from pendmap import _core
from pendmap.analysis import result
from pendmap.analysis.orbits import orbit
from pendmap.analysis.varied import pendulum_of, with_values
from pendmap.files.variables import variable

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr
    from numpy.typing import NDArray

    from pendmap.analysis.varied import Varied

    Floats = NDArray[np.float64]

_FINER = 8  # Points of a line for each that was computed
_SURE = 0.2  # Distance, cells of the lattice, to which lines between computed points are exact


def variables(raw: _core.BifurcationSet, axes: tuple[Varied, ...]) -> dict[str, Any]:
    """Return where orbits are stable as variables."""
    side = math.isqrt(raw.stable[0].size)
    kinds, *turns = (np.array(column) for column in zip(*raw.types, strict=True))
    n, w = (column.astype(np.int32) for column in turns)
    of, x, y, part, stable = (np.array(column) for column in zip(*raw.regions, strict=True))
    border = np.array(raw.borders, np.int32).reshape(-1, 2)
    counts, number = np.stack(raw.stable).reshape(-1, side, side), "number of the type"
    text, (x_name, y_name) = ("stable orbits", "-1: not known"), (axis.name for axis in axes)
    data: dict[str, Any] = {
        "type_kind": variable("type", kinds, long_name="kind of orbits"),
        "type_n": variable("type", n, "periods", "smallest period"),
        "type_w": variable("type", w, "turns", "net turns over it"),
        "border_type": variable("border", border[:, 0], "1", number),
        "border_curve": variable("border", border[:, 1], "1", "curve at which stability changes"),
        "region_type": variable("region", of.astype(np.int32), "1", number),
        "region_part": variable("region", part, "1", "part of the plane"),
        "region_stable": variable("region", stable.astype(np.int32), "1", *text, missing=-1),
        "stable_count": variable(("type", y_name, x_name), counts, "1", *text, missing=-1),
    }
    for axis, part in zip(axes, (x, y), strict=True):
        low, high = axis.values[[0, -1]]
        data[f"region_{axis.name}"] = "region", low + (high - low) * part, axis.attributes
        places = low + (high - low) * (np.arange(side) + 0.5) / side
        data[axis.name] = axis.name, places, axis.attributes
    return data


def entries(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the regions of each type of orbits for the JSON object: how many are stable there."""
    types = list(result.rows(dataset, "type_kind", "type_n", "type_w"))
    names = {"type": "region_type", "stable": "region_stable", "part": "region_part"}
    listed = result.records(dataset, **names)
    varied = str(dataset.attrs["varied"]).split(", ")
    every = [dataset[f"region_{name}"].values.tolist() for name in varied]
    for entry, values in zip(listed, zip(*every, strict=True), strict=True):
        entry.update(_named(*types[entry.pop("type")]))
        entry["stable"] = result.none_below_0(entry["stable"])
        entry["values"] = dict(zip(varied, values, strict=True))
    return listed


def _named(kind: str, n: int, w: int) -> dict[str, Any]:
    """Return name, kind, period and net turns of a type of orbits."""
    return {"name": _core.Attractor(kind, n, w).name, "kind": kind, "n": n, "w": w}


def stable_orbits(dataset: xr.Dataset, at: Mapping[str, float]) -> list[dict[str, Any]]:
    """Return the types of orbits of which some are stable at a point of the plane, and how many.

    The number is that of the nearest point of the lattice from which no curve at which it changes
    parts the point or what is near it; where there is none or its number is not known, that of a
    search at the point itself. Outside the plane there are none.
    """
    varied, stable = str(dataset.attrs["varied"]).split(", "), dataset["stable_count"].values
    low, high = np.array(dataset.attrs["low"]), np.array(dataset.attrs["high"])
    side = stable.shape[-1]
    here = (np.array([at[name] for name in varied]) - low) / (high - low) * side - 0.5
    if (np.abs(here + 0.5 - side / 2) > side / 2).any():
        return []
    near = np.clip(np.floor(here), 0, side - 2) + np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
    near = near[np.argsort(np.linalg.norm(near - here, axis=1))]
    places = np.stack([dataset[f"place_{name}"].values for name in varied], axis=-1)
    places, owner = (places - low) / (high - low) * side - 0.5, dataset["place_curve"].values
    lines = [places[owner == k] for k in range(dataset.sizes["curve"])]
    lines = [np.vstack([smooth(x)[0] if len(x) > 1 else x, (np.nan, np.nan)]) for x in lines]
    around = here + _SURE * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    totals: dict[tuple[str, int, int], int] = {}
    doubtful = set()
    for number, of in enumerate(result.rows(dataset, "type_kind", "type_n", "type_w")):
        borders = dataset["border_curve"].values[dataset["border_type"].values == number]
        line = np.vstack([near[:1], *(lines[k] for k in borders)])
        free = [c for c in near if not any(_crosses(line, a, c) for a in around)]
        count = int(stable[number, int(free[0][1]), int(free[0][0])]) if free else -1
        totals[of] = totals.get(of, 0) + count
        doubtful |= {of} if count < 0 else set()
    for kind, n, w in doubtful:
        searched = orbit(with_values(pendulum_of(dataset), at), n=n, w=w)
        alike = (searched["kind"].values == kind) & searched["stable"].values.astype(bool)
        totals[kind, n, w] = int(alike.sum())
    return [_named(*of) | {"stable": count} for of, count in totals.items() if count]


def _crosses(line: Floats, a: Floats, b: Floats) -> bool:
    """Return whether a line through points crosses the straight one from a to b."""

    def side(u: Floats, v: Floats, w: Floats) -> Floats:
        return (v - u)[..., 0] * (w - u)[..., 1] - (v - u)[..., 1] * (w - u)[..., 0]

    c, d = line[:-1], line[1:]
    apart = side(a, b, c) * side(a, b, d) < 0
    return bool((apart & (side(c, d, a) * side(c, d, b) < 0)).any())


def smooth(points: Floats) -> tuple[Floats, Any]:
    """Return a curve through points, with the number of the point before each of its own."""
    pieces = np.linalg.norm(np.diff(points, axis=0) / np.ptp(points, axis=0).clip(1e-12), axis=1)
    along = np.concatenate([[0.0], pieces.clip(1e-12).cumsum()])
    part = np.linspace(0.0, along.size - 1, _FINER * (along.size - 1) + 1)
    at = np.interp(part, np.arange(along.size), along)
    first = np.minimum(part.astype(int), along.size - 2)
    return PchipInterpolator(along, points)(at), first
