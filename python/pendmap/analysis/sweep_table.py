"""Table of a sweep: measures of each map, the attractors with one number each, and their JSON."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import basins, result
from pendmap.analysis.orbit_table import DESCRIBED, described
from pendmap.analysis.sweep_tiles import CHECKS, COUNTS, LAW, MEASURES, PLANES
from pendmap.files.variables import NO_YES, flag, variable
from pendmap.formatting import span
from pendmap.units import RATE, VELOCITY

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pendmap.analysis.grid import Grid
    from pendmap.analysis.sweep_tiles import Mapped, Numbers, Place
    from pendmap.analysis.varied import Varied
    from pendmap.units import Units

KINDS: Final = ("none", *_core.kinds())
"""Kinds of attractor by their number in the variable ``kind``."""
_NAMES: Final = {
    "boundary_stderr": "boundary_basin_entropy_stderr",
    "reached_error": "step_error",
    "bound": "max_periods",
}
"""Names of variables where they are not those in the core's result."""
_EVERY: Final = {_NAMES.get(name, name): name for name in (*MEASURES, *LAW, *CHECKS, *COUNTS)}


def varied_names(dataset: xr.Dataset) -> list[str]:
    """Return the names of the parameters of a sweep."""
    return str(dataset.attrs["varied"]).split()


def sweep_dataset(  # noqa: PLR0913, PLR0917 (the parts of a sweep)
    maps: Mapping[Place, Mapped],
    numbers: Numbers,
    axes: Sequence[Varied],
    grid: Grid,
    units: Units,
    label: Any,  # noqa: ANN401 (of xarray or numpy)
) -> xr.Dataset:
    """Return labels, measures of each map and the table of attractors."""
    dims = tuple(axis.name for axis in axes)
    shape = tuple(axis.values.size for axis in axes)
    fields = {field.name: field for field in basins.SCHEMA.fields} | {"step_error": result.REACHED}
    variables: dict[str, Any] = {}
    for name, key in _EVERY.items():
        column = [maps[place].measures.get(key) for place in np.ndindex(*shape)]
        values = np.array(column, dtype=float).reshape(shape)
        values = np.where(np.isfinite(values), values, np.nan)
        values = values.astype(np.int32) if key in COUNTS else values
        variables[name] = variable(dims, values, fields[name].unit, fields[name].meaning)
    plane = [int(maps[place].measures["plane"]) for place in np.ndindex(*shape)]
    shows, planes = "what the plane of starts shows", dict(enumerate(PLANES))
    variables["plane"] = flag(dims, np.reshape(plane, shape), shows, planes)
    table = _table(maps, numbers, axes, grid.cells, units)
    names = table["attractor"][1].tolist()
    labels = {"label": result.labels((*dims, "velocity", "theta"), label, names)}
    coordinates = {name: one for axis in axes for name, one in axis.coordinates.items()}
    return xr.Dataset(
        {**labels, **variables, **table}, coords=coordinates | grid.coordinates(units)
    )


def _table(
    maps: Mapping[Place, Mapped], numbers: Numbers, axes: Sequence[Varied], cells: int, units: Units
) -> dict[str, Any]:
    """Return the attractors as variables."""
    dims = (*(axis.name for axis in axes), "attractor")
    shape = tuple(axis.values.size for axis in axes)
    every = [
        (place, k, one)
        for place in np.ndindex(*shape)
        for one, k in zip(maps[place].found, numbers[place], strict=True)
    ]
    count = 1 + max((k for _, k, _ in every), default=-1)
    at = tuple(np.array([(*place, k) for place, k, _ in every], int).reshape(-1, len(dims)).T)

    def column(values: Sequence[Any], none: Any) -> Any:  # noqa: ANN401 (an array)
        """Return values of the attractors over the dimensions, ``none`` elsewhere."""
        array = np.full((*shape, count, *np.shape(none)), none)
        if values:
            array[at] = values
        return array

    def measure(key: str, none: float = math.nan) -> Any:  # noqa: ANN401 (an array)
        return column([getattr(one, key) for *_, one in every], none)

    twin = np.zeros(count, dtype=np.int32)
    names: list[Counter[tuple[Any, ...]]] = [Counter() for _ in range(count)]
    for place, k, one in every:
        names[k][one.described] += 1
        if one.twin and not twin[k]:
            twin[k] = numbers[place][one.twin - 1] + 1
    # What it is called in most of the models, the first of equally frequent names.
    most = [_core.Attractor(*one.most_common(1)[0][0]) for one in names]
    kind = column([KINDS.index(one.kind) for *_, one in every], 0)
    exists, none = (kind > 0).astype(np.int8), (math.nan, math.nan)
    closed = column([one.points[0] if one.n else none for *_, one in every], none)
    points = [(*place, k + 1, *point) for place, k, one in every for point in one.points]
    *places, owner, theta, velocity = np.array(points).reshape(-1, len(axes) + 3).T
    speeds, speed = (units.given(values, VELOCITY) for values in (closed[..., 1], velocity))
    rate, error = (units.given(measure(key), RATE) for key in ("exponent", "exponent_stderr"))
    alone, there = "number of the attractor", exists.sum(axis=-1, dtype=np.int32)
    image = "its own number where symmetric, 0 if not known"
    first = {k: place for place, k, _ in reversed(every)}
    unique = _names([one.name for one in most], [first[k] for k in range(count)], axes)
    of_models = {
        f"point_{axis.name}": ("point", axis.values[at.astype(int)], axis.attributes)
        for axis, at in zip(axes, places, strict=True)
    }
    return {
        "attractor": variable(
            "attractor", np.array(unique, dtype=str), long_name="name of the attractor"
        ),
        "id": variable("attractor", np.arange(1, count + 1, dtype=np.int32), "1", alone),
        "twin": variable("attractor", twin, "1", "number of the mirror image", image),
        "exists": flag(dims, exists, "whether it exists", NO_YES),
        "kind": flag(dims, kind, "kind of attractor", dict(enumerate(KINDS))),
        **{
            key: variable(dims, measure(key, 0).astype(np.int32), *DESCRIBED[key])
            for key in DESCRIBED
        },
        **described(most, "attractor", "branch_"),
        **result.shares(dims, measure("fraction", 0.0), cells),
        "exponent": variable(dims, rate, units.of_rate, "largest Lyapunov exponent"),
        "exponent_stderr": variable(dims, error, units.of_rate, "standard error of the exponent"),
        **result.point(dims, closed[..., 0], speeds, units.of_velocity, "{}_point"),
        "attractors": variable(dims[:-1], there, "1", "attractors that coexist"),
        **of_models,
        "point_attractor": variable("point", owner.astype(np.int32), "1", alone),
        **result.point("point", theta, speed, units.of_velocity, "point_{}"),
    }


def _names(names: list[str], first: list[Place], axes: Sequence[Varied]) -> list[str]:
    """Return names of which no two are the same: where each one appears tells equal ones apart."""
    distinct: list[str] = []
    for name, place in zip(names, first, strict=True):
        at = ", ".join(span(a.name, *a.values[[k, k]]) for a, k in zip(axes, place, strict=True))
        apart = name if names.count(name) == 1 else f"{name} from {at}"
        numbered = (f"{apart} ({number})" for number in range(2, len(names) + 2))
        distinct.append(next(one for one in (apart, *numbered) if one not in distinct))
    return distinct


# ---- JSON


def attractors(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the attractors for JSON, with the ranges in which each exists."""
    dims = varied_names(dataset)
    objects = result.records(dataset, id="id", name="attractor", twin="twin")
    for k, one in enumerate(objects):
        exists = dataset["exists"].values[..., k]
        places = zip(dims, np.nonzero(exists), strict=True)
        values = {dim: dataset[dim].values[at] for dim, at in places}
        one["twin"] = one["twin"] or None
        one["models"] = int(exists.sum())
        one["ranges"] = {dim: [float(x.min()), float(x.max())] for dim, x in values.items()}
        one["largest_fraction"] = float(dataset["fraction"].values[..., k].max())
    return objects


def maps_of(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the maps for JSON, each with its attractors."""
    reals = ("fraction", "stderr", "exponent", "exponent_stderr", "theta_point", "velocity_point")
    data = {name: dataset[name].values for name in (*_EVERY, "kind", "n", "w", *reals, "ci95")}
    maps = []
    for place in np.ndindex(dataset["plane"].shape):
        at = zip(varied_names(dataset), place, strict=True)
        one: dict[str, Any] = {dim: float(dataset[dim].values[k]) for dim, k in at}
        one["plane"] = PLANES[int(dataset["plane"].values[place])]
        one |= {name: data[name][place].item() for name in _EVERY}
        one["attractors"] = attractors = []
        for k in np.flatnonzero(dataset["exists"].values[place]).tolist():
            kind, n, w = (int(data[name][place][k]) for name in ("kind", "n", "w"))
            names = {"id": k + 1, "kind": KINDS[kind], "n": n or None, "w": w if n else None}
            values = {name: data[name][place][k].item() for name in reals}
            attractors.append(names | values | {"ci95": data["ci95"][place][k].tolist()})
        maps.append(one)
    return maps
