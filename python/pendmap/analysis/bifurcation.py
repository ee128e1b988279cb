"""Bifurcation diagrams: all attractors along one parameter, and sweeps up and down."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import xarray as xr
from scipy.ndimage import find_objects, label

from pendmap.analysis import along, cell_search, result, varied
from pendmap.analysis.numerics import Numerics
from pendmap.analysis.orbit_table import attractors_of, matched
from pendmap.analysis.result import Field, Schema, point, rows, summarised
from pendmap.analysis.run import RunOptions
from pendmap.analysis.summary import box_said
from pendmap.analysis.survey_tiles import SurveyTiles
from pendmap.errors import InputError, check_number, core_errors, short_repr
from pendmap.files import facts
from pendmap.files.variables import variable
from pendmap.formatting import counted
from pendmap.model import without_dimensions
from pendmap.units import VELOCITY

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from pendmap import _core
    from pendmap.analysis.along import Varied
    from pendmap.analysis.grid import Grid
    from pendmap.analysis.run import Keywords
    from pendmap.engine import Work
    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats, Mask
    from pendmap.units import Units


_SAME = 1e-4  # Distance, rad and units of velocity, below which points of orbits are equal
_NEAR = 0.3  # Distance, same units, below which neighbouring attractors may belong to one branch
_LISTED = 12  # Largest number of branches in a summary


def _branches(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the branches for the JSON object."""
    every = attractors_of(dataset, "kind_")
    branches = []
    for k, first, last in rows(dataset, "branch_kind", "branch_first", "branch_last"):
        one = every[k]
        names = {"name": one.name, "kind": one.kind, "n": one.n, "w": one.w if one.n else None}
        branches.append(names | {"first": first, "last": last})
    return branches


SCHEMA = Schema(
    "bifurcation",
    result.UNITS,
    Field("varied", "", "parameter that varies"),
    Field("branches", "", "attractors followed along the parameter", read=_branches),
    Field("points", "1", "stroboscopic points"),
    *cell_search.SEARCH,
)


def bifurcation(  # noqa: PLR0913 (physics first, numerical choices by name)
    pendulum: Pendulum | Rig,
    ranges: Mapping[str, ArrayLike],
    *,
    start: tuple[float, float] | None = None,
    starts: int = 9,
    box: Grid | None = None,
    tol: float = 1e-6,
    max_periods: int | None = None,
    run: RunOptions | None = None,
    **options: Unpack[Keywords],
) -> xr.Dataset:
    """Compute the stroboscopic points of the attractors against one parameter.

    At every value all attractors are searched as by :func:`pendmap.parameter_map`, from several
    starts and from the attractors at neighbouring values. In addition, one motion is followed as
    the parameter rises in steps, and one as it falls: at each value it continues from its last
    state, displaced by 1e-6, until it is on an attractor, for as long as the attractor with the
    smallest exponent there needs to shrink what decays to exp(-200). Where both have arrived and
    the two differ there is hysteresis, unless they differ at all values because each stays on the
    attractor on which it begins; where one has not arrived, the summary says so.

    Attractors at neighbouring values with the same kind, period and winding and with points near
    one another make a branch. At a bifurcation one branch ends and others begin.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; the parameter that varies replaces its own.
    ranges : mapping of str to (float, float, int) or array_like
        One parameter; as for :func:`pendmap.parameter_map`. Several with arrays are a curve.
    start : (float, float), optional
        Angle and velocity from which both sweeps start; by default each on the attractor that most
        starts end on there.
    starts, box, tol, max_periods
        As for :func:`pendmap.parameter_map`.
    run : RunOptions, optional
        As for :func:`pendmap.basins`; tiles are 16 values.

    Returns
    -------
    xarray.Dataset
        Points over ``point``: ``point_value``, ``point_theta``, ``point_velocity``,
        ``point_entry``; attractors over ``entry`` as for :func:`pendmap.parameter_map`, with
        ``entry_value`` and ``entry_branch``; ``undecided``, ``failed`` and ``chaos_periods`` over
        the parameter as for that function; branches over ``branch``: ``branch_kind``,
        ``branch_w``, ``branch_first``, ``branch_last``; ``up`` and ``down`` over the parameter: the
        entry that the sweep is on, -1 where that is none of them; its points there, if any, over
        ``loose``.

    Raises
    ------
    InputError
        If a parameter or value is not allowed, the model has an effect that no map can have, or no
        step reaches ``tol``.

    Examples
    --------
    >>> import pendmap
    >>> pendulum = pendmap.Pendulum(gamma=0.1, omega=2.0)
    >>> result = pendmap.bifurcation(pendulum, {"p": (0.1, 0.5, 3)})
    >>> sorted(result.sizes)
    ['bound', 'branch', 'entry', 'kind', 'p', 'point']
    """
    pendulum = varied.having(pendulum, ranges)
    bare, units = without_dimensions(pendulum)
    (axis,) = varied.varied(pendulum, ranges, 1)
    run = RunOptions.of(run, options)
    numerics = Numerics(run, tol, max_periods)
    search = cell_search.CellSearch(starts, box, numerics)
    first = None
    if start is not None:
        if np.asarray(start, dtype=object).shape != (2,):
            raise InputError(f"start must be (angle, velocity), got {short_repr(start)}")
        angle, speed = (check_number("start", part) for part in start)
        first = (angle, units.bare(speed, VELOCITY))
    limits = (numerics.tol, numerics.max_periods)
    job = SurveyTiles(bare, (axis.kernel,), search.initial(units), limits)

    def compute(work: Work) -> xr.Dataset:
        with core_errors():
            survey, blocks = job.run(work, run)
            raw = survey.diagram(blocks, first)
        dataset = _dataset(raw, axis, units)
        values = {
            **search.attributes(raw, units),
            **along.kept(pendulum, (axis,)),
            "varied": axis.name,
            "points": dataset.sizes["point"],
        }
        SCHEMA.complete(dataset, pendulum, values, raw, axis.replaced)
        dataset.attrs["title"] = varied.title(pendulum, axis)
        lines = [*_summary(dataset), *varied.remarks(pendulum, axis)]
        summarised(dataset, lines, pendulum, "attractors are")
        return dataset

    request = {"ranges": varied.requested([axis], ranges), "start": start, **search.request}
    return run.complete("bifurcation", pendulum, request, job, compute)


def _dataset(raw: _core.Bifurcation, axis: Varied, units: Units) -> xr.Dataset:
    kinds = cell_search.names(raw)
    of_entry, members = _linked(raw, axis.values.size)
    owner = raw.point_entry
    value = axis.values[raw.cell]
    speed = units.given(raw.point_velocity, VELOCITY)
    ends = np.array([[branch[0], branch[-1]] for branch in members], dtype=np.intp).reshape(-1, 2)
    loose = {
        key: np.concatenate([getattr(raw.up, key), getattr(raw.down, key)])
        for key in ("value", "theta", "velocity")
    }
    speeds = units.given(loose["velocity"], VELOCITY)
    way = np.repeat([1, -1], [raw.up.value.size, raw.down.value.size])
    kind, meanings = raw.kind[ends[:, 0]], dict(enumerate(kinds))
    on = "entry of the attractor that the sweep {} is on"
    data: dict[str, Any] = {
        **cell_search.entries(raw, units),
        "entry_value": ("entry", value, axis.attributes),
        "entry_branch": variable("entry", of_entry, "1", "number of the branch"),
        "branch_kind": variable("branch", kind, "", "kind of attractor", flags=meanings),
        "branch_w": variable("branch", raw.w[ends[:, 0]], "turns", "net turns w over a period"),
        "branch_first": ("branch", value[ends[:, 0]], axis.attributes),
        "branch_last": ("branch", value[ends[:, 1]], axis.attributes),
        "point_entry": variable("point", owner, "1", "entry of the attractor"),
        "point_value": ("point", value[owner], axis.attributes),
        **point("point", raw.point_theta, speed, units.of_velocity, "point_{}"),
        "up": variable(axis.name, raw.up.on, "1", on.format("up"), "-1: none", missing=-1),
        "down": variable(axis.name, raw.down.on, "1", on.format("down"), "-1: none", missing=-1),
        **cell_search.shares(raw, (axis.name,), axis.values.shape),
    }
    if way.size:  # a table of an empty dimension has no rows
        data |= {
            "loose_sweep": variable("loose", way, "", "sweep", flags={-1: "down", 1: "up"}),
            "loose_value": ("loose", axis.values[loose["value"]], axis.attributes),
            **point("loose", loose["theta"], speeds, units.of_velocity, "loose_{}"),
        }
    coordinates = {
        **axis.coordinates,
        "kind": variable("kind", np.array(kinds, dtype=str), long_name="kind of attractor"),
        "entry": variable("entry", np.arange(raw.kind.size), "1", "number of the entry"),
    }
    return xr.Dataset(data, coords=coordinates)


def _summary(dataset: xr.Dataset) -> list[str]:
    a = facts(dataset)
    name = a["varied"]
    values = dataset[name].values
    count = dataset.sizes["branch"]
    joined = counted(count, "branch", "branches")
    lines = [
        f"{name} = {values[0]:g} to {values[-1]:g}: {counted(values.size, 'value')}, {joined}."
    ]
    first, last = dataset["branch_first"].values, dataset["branch_last"].values
    longest = np.argsort(-(last - first), kind="stable")[:_LISTED]
    for k in sorted(longest, key=lambda k: (first[k], last[k])):
        kind = str(dataset["kind"].values[int(dataset["branch_kind"][k])])
        lines.append(f"{kind}: {name} = {first[k]:.6g} to {last[k]:.6g}.")
    if count > _LISTED:
        lines.append(f"{count - _LISTED} shorter branches are in the result.")
    lines += _hysteresis(dataset, name) if count else ["No attractor was found."]
    lines.append(cell_search.missed(a, values.size, "value"))
    lines += [*cell_search.chaos(a), *cell_search.undecided(a)]
    where = dataset["undecided"].values > 0
    if where.any():
        lines.append(f"Undecided starts are at {name} = {_spans(values, where)}.")
    lines.append(
        f"{counted(a['starts'], 'start')} a value, {box_said(a)}; {counted(a['points'], 'point')}; "
        f"error after 5 periods {a['reached_error']:.2g}; {a['seconds']:.1f} s on "
        f"{counted(a['threads'], 'thread')}."
    )
    return lines


def _hysteresis(dataset: xr.Dataset, name: str) -> list[str]:
    """Return summary lines on the values at which the sweeps are on different attractors."""
    up, down, values = dataset["up"].values, dataset["down"].values, dataset[name].values
    pairs = np.array([one.pair for one in attractors_of(dataset, "kind_")], dtype=str)
    kind = pairs[dataset["entry_kind"].values]
    arrived = (up >= 0) & (down >= 0)
    differ = arrived & (kind[up] != kind[down])
    where = "everywhere" if arrived.all() else "wherever both have arrived"
    lines = [f"Up and down are on the same kinds of attractor {where}."]
    if differ[arrived].all() and arrived.any():
        lines = [f"Up and down are on different kinds of attractor {where}, as they begin."]
    elif differ.any():
        lines = [f"Up and down differ at {name} = {_spans(values, differ)}: hysteresis."]
    if not arrived.all():
        late = _spans(values, ~arrived)
        lines.append(f"A sweep has arrived on no attractor at {name} = {late}: no difference.")
    others = arrived & ~differ & (up != down)
    if others.any():
        images = all(_mirrored(dataset, up[k], down[k]) for k in np.flatnonzero(others))
        which = "mirror images of one another" if images else "different attractors of one kind"
        lines.append(f"They are on {which} at {name} = {_spans(values, others)}.")
    return lines


def _spans(values: Floats, where: Mask) -> str:
    """Return the three widest ranges of the marked values, as text."""
    every = [(place.start, place.stop - 1) for (place,) in find_objects(label(where)[0])]
    spans = sorted(every, key=lambda s: s[0] - s[1])[:3]
    text = ", ".join(
        f"{values[i]:.4g} to {values[j]:.4g}" if j > i else f"{values[i]:.4g}"
        for i, j in sorted(spans)
    )
    return text + (" and less" if len(every) > len(spans) else "")


def _mirrored(dataset: xr.Dataset, one: int, other: int) -> bool:
    """Return whether two attractors are mirror images: orbits by a point, chaos by its sense."""
    n, w = dataset["entry_n"].values, dataset["entry_w"].values
    if n[one] != n[other] or w[one] != -w[other]:
        return False
    if n[one] == 0:
        return bool(w[one] != 0)
    # Points are sorted by attractor.
    owner = dataset["point_entry"].values
    first, there = (slice(*np.searchsorted(owner, (k, k + 1))) for k in (one, other))
    theta, velocity = dataset["point_theta"].values, dataset["point_velocity"].values
    apart = np.abs(np.exp(1j * theta[there]) - np.exp(-1j * theta[first][0]))
    apart += np.abs(velocity[there] + velocity[first][0])
    return bool(apart.min() < _SAME)


def _linked(raw: _core.Bifurcation, values: int) -> tuple[NDArray[np.int32], list[list[int]]]:
    """Return the branch of each entry, and the entries of each branch, value by value.

    Orbits near one another and chaos of one kind are one branch, if they have equal turns.
    """
    cell = raw.cell
    bounds = np.searchsorted(cell, np.arange(values + 1))
    plane = np.stack([raw.point_theta, raw.point_velocity], axis=1)
    points = np.split(plane, np.searchsorted(raw.point_entry, np.arange(1, cell.size)))
    kind = np.array([one.kind for one in raw.kinds], dtype=str)[raw.kind]
    key = list(zip(kind.tolist(), raw.n.tolist(), raw.w.tolist(), strict=True))
    of_entry = np.full(cell.size, -1, dtype=np.int32)
    members: list[list[int]] = []
    for value in range(values):
        low, high = bounds[value : value + 2]
        begin = bounds[max(value - 1, 0)]

        def reach(a: int, b: int, begin: int = begin, low: int = low) -> float:
            if key[begin + a] != key[low + b]:
                return 0.0
            return _NEAR if raw.n[low + b] else math.inf

        for _, _, a, b in matched(points[begin:low], points[low:high], reach):
            of_entry[low + b] = of_entry[begin + a]
            members[of_entry[begin + a]].append(low + b)
        for b in range(low, high):
            if of_entry[b] < 0:
                of_entry[b] = len(members)
                members.append([b])
    return of_entry, members
