"""Table of a sweep: measures of each map, and the attractors with one number each."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import result
from pendmap.analysis.grid import coordinate
from pendmap.analysis.orbit_table import DESCRIBED, described
from pendmap.analysis.sweeps.tiles import PLANES
from pendmap.files.variables import NO_YES, flag, variable
from pendmap.formatting import span
from pendmap.units import RATE, VELOCITY

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pendmap.analysis.along import Varied
    from pendmap.analysis.grid import Grid
    from pendmap.analysis.sweeps.tiles import Mapped, Place
    from pendmap.units import Units

    Maps = Mapping[Place, Mapped]
    Numbers = Mapping[Place, Sequence[int]]
    """Number of the branch, from 0, of each attractor of each map."""

KINDS: Final = ("none", *_core.kinds())
"""Kinds of attractor by their number in the variable ``kind``."""
MEASURES: Final = {
    "basin_entropy": ("basin_entropy", "nat", "mean entropy of the labels in boxes of 5 x 5 cells"),
    "boundary_basin_entropy": (
        "boundary_basin_entropy",
        "nat",
        "the same, of boxes with more than one label",
    ),
    "boundary_stderr": ("boundary_basin_entropy_stderr", "nat", "its standard error over boxes"),
    "neighbours_agree": ("neighbours_agree", "1", "share of neighbouring cells with equal labels"),
    "exponent": ("uncertainty_exponent", "1", "uncertainty exponent of the labels on the grid"),
    "exponent_stderr": ("uncertainty_exponent_stderr", "1", "its standard error"),
    "undecided": ("undecided", "1", "share of the starts that no attractor captured"),
    "failed": ("failed", "1", "share of the starts that failed or diverged"),
    "reached_error": ("step_error", "1", "error after 5 periods that was reached"),
    "periods": ("mean_periods", "periods", "periods computed for a start, on average"),
    "unreliable": ("unreliable", "1", "share of labels that half the step or mirroring changes"),
    "unreliable_half_step": ("unreliable_half_step", "1", "share that half the step changes"),
    "unreliable_mirror": ("unreliable_mirror", "1", "share that mirroring changes"),
}
"""Measures of each map: variable, unit and meaning."""
COUNTS: Final = {
    "boundary_boxes": ("boundary_boxes", "1", "boxes with more than one label"),
    "bound": ("max_periods", "periods", "bound after which a start is undecided"),
    "chaos_bound": ("chaos_bound", "periods", "bound within which chaos was watched"),
    "searched": ("searched_starts", "1", "starts of the first search for attractors"),
    "steps": ("steps_per_period", "1", "steps of the integrator in a forcing period"),
    "labels_sampled": ("labels_sampled", "1", "labels checked; 0: not checked here"),
}


def sweep_dataset(  # noqa: PLR0913, PLR0917 (the parts of a sweep)
    maps: Maps,
    numbers: Numbers,
    axes: Sequence[Varied],
    grid: Grid,
    units: Units,
    label: Any,  # noqa: ANN401 (of xarray or numpy)
) -> xr.Dataset:
    """Return labels, measures of each map and the table of attractors."""
    dims = tuple(axis.name for axis in axes)
    shape = tuple(axis.values.size for axis in axes)
    measured = {
        key: np.array([maps[place].measures[key] for place in np.ndindex(*shape)]).reshape(shape)
        for key in (*MEASURES, *COUNTS, "plane")
    }
    one_box = ~np.isfinite(measured["boundary_stderr"])
    measured["boundary_stderr"][one_box] = np.nan
    names, table = _table(maps, numbers, axes, grid.cells, units)
    angle, speed = grid.theta, grid.velocity
    data: dict[str, Any] = {
        "label": variable(
            (*dims, "velocity", "theta"),
            label,
            long_name="attractor",
            comment="number of the attractor; 0 undecided within the bound, -1 failed or diverged",
            flags=dict(enumerate(["failed", "undecided", *names], -1)),
        ),
        **{
            name: variable(dims, measured[key], *description)
            for key, (name, *description) in MEASURES.items()
        },
        **{
            name: variable(dims, np.nan_to_num(measured[key]).astype(np.int32), *description)
            for key, (name, *description) in COUNTS.items()
        },
        "plane": flag(
            dims, measured["plane"], "what the plane of starts shows", dict(enumerate(PLANES))
        ),
        **table,
    }
    return xr.Dataset(
        data,
        coords={
            **{name: one for axis in axes for name, one in axis.coordinates.items()},
            **coordinate("theta", angle.centres, angle.edges, "rad", "initial angle"),
            **coordinate(
                "velocity",
                speed.centres,
                speed.edges,
                units.of_velocity,
                f"initial velocity {units.derivative}",
            ),
        },
    )


def _table(
    maps: Maps, numbers: Numbers, axes: Sequence[Varied], cells: int, units: Units
) -> tuple[list[str], dict[str, Any]]:
    """Return the names of the attractors, and their variables."""
    dims = (*(axis.name for axis in axes), "attractor")
    shape = tuple(axis.values.size for axis in axes)
    count = 1 + max((k for indices in numbers.values() for k in indices), default=-1)
    whole = {key: np.zeros((*shape, count), dtype=np.int32) for key in ("kind", *DESCRIBED)}
    real = {key: np.full((*shape, count), np.nan) for key in ("exponent", "exponent_stderr")}
    fraction = np.zeros((*shape, count))
    closed = np.full((*shape, count, 2), np.nan)
    twin = np.zeros(count, dtype=np.int32)
    called: dict[int, Counter[tuple[Any, ...]]] = {}
    first: dict[int, Place] = {}
    points: list[tuple[float, ...]] = []
    for at, place in enumerate(np.ndindex(*shape)):
        for attractor, k in zip(maps[place].found, numbers[place], strict=True):
            here = (*place, k)
            for key in DESCRIBED:
                whole[key][here] = getattr(attractor, key)
            whole["kind"][here] = KINDS.index(attractor.kind)
            real["exponent"][here], real["exponent_stderr"][here] = (
                attractor.exponent,
                attractor.exponent_stderr,
            )
            fraction[here] = attractor.fraction
            if attractor.n:
                closed[here] = attractor.points[0]
            first.setdefault(k, place)
            called.setdefault(k, Counter())[attractor.described] += 1
            if attractor.twin and not twin[k]:
                twin[k] = numbers[place][attractor.twin - 1] + 1
            points += [(at, k + 1, *point) for point in attractor.points.tolist()]
    # What it is called in most of the models, the first of equally frequent names.
    most = [_core.Attractor(*called[k].most_common(1)[0][0]) for k in range(count)]
    names = _names([one.name for one in most], [first[k] for k in range(count)], axes)
    flat = np.array(points, dtype=float).reshape(-1, 4)
    speed = np.asarray(units.given(flat[:, 3], VELOCITY))
    speeds = np.asarray(units.given(closed[..., 1], VELOCITY))
    rate, error = (np.asarray(units.given(one, RATE)) for one in real.values())
    exists = (whole["kind"] > 0).astype(np.int8)
    kinds = dict(enumerate(KINDS))
    table = {
        "attractor": variable(
            "attractor", np.array(names, dtype=str), long_name="name of the attractor"
        ),
        "id": variable(
            "attractor", np.arange(1, count + 1, dtype=np.int32), "1", "number of the attractor"
        ),
        "twin": variable(
            "attractor",
            twin,
            "1",
            "number of the mirror image",
            "its own number where symmetric, 0 if not known",
        ),
        "exists": flag(dims, exists, "whether it exists", NO_YES),
        "kind": flag(dims, whole["kind"], "kind of attractor", kinds),
        **{key: variable(dims, whole[key], *texts) for key, texts in DESCRIBED.items()},
        **described(most, "attractor", "branch_"),
        **result.shares(dims, fraction, cells),
        "exponent": variable(dims, rate, units.of_rate, "largest Lyapunov exponent"),
        "exponent_stderr": variable(dims, error, units.of_rate, "standard error of the exponent"),
        **result.point(dims, closed[..., 0], speeds, units.of_velocity, "{}_point"),
        "attractors": variable(
            dims[:-1], exists.sum(axis=-1, dtype=np.int32), "1", "attractors that coexist"
        ),
        **{
            f"point_{axis.name}": variable(
                "point", axis.values[index], axis.unit or "1", f"{axis.name} of the model"
            )
            for axis, index in zip(
                axes, np.unravel_index(flat[:, 0].astype(int), shape), strict=True
            )
        },
        "point_attractor": variable(
            "point", flat[:, 1].astype(np.int32), "1", "number of the attractor"
        ),
        **result.point("point", flat[:, 2], speed, units.of_velocity, "point_{}"),
    }
    return names, table


def _names(names: list[str], first: list[Place], axes: Sequence[Varied]) -> list[str]:
    """Return names of which no two are the same: where each one appears tells equal ones apart."""
    distinct: list[str] = []
    for name, place in zip(names, first, strict=True):
        at = ", ".join(span(a.name, *a.values[[k, k]]) for a, k in zip(axes, place, strict=True))
        candidate = name if names.count(name) == 1 else f"{name} from {at}"
        number = 2
        while candidate in distinct:
            candidate = f"{name} from {at} ({number})"
            number += 1
        distinct.append(candidate)
    return distinct
