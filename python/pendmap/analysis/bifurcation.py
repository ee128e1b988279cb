"""Bifurcation diagrams: all attractors along one parameter, and sweeps up and down."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import xarray as xr

from pendmap.analysis import cell_search, result, varied
from pendmap.analysis.matching import matched, numbered
from pendmap.analysis.orbit_table import attractors_of
from pendmap.analysis.result import Field, Schema, point, rows
from pendmap.analysis.run import Numerics, RunOptions
from pendmap.errors import InputError, check_number, short_repr
from pendmap.files.variables import variable
from pendmap.formatting import counted, span
from pendmap.units import VELOCITY

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from pendmap import _core
    from pendmap.analysis.grid import Grid
    from pendmap.analysis.run import Keywords
    from pendmap.analysis.varied import Varied
    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats
    from pendmap.units import Units


_NEAR = 0.3  # Distance, rad and units of velocity, below which neighbours may be one branch
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
    smallest exponent there needs to shrink what decays to exp(-200). Where the two differ there is
    hysteresis, unless they differ at all values because each stays where it begins.

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
    (axis,) = varied.varied(pendulum, ranges, 1)
    units, first = pendulum.units, None
    if start is not None:
        if np.asarray(start, dtype=object).shape != (2,):
            raise InputError(f"start must be (angle, velocity), got {short_repr(start)}")
        angle, speed = (check_number("start", part) for part in start)
        first = (angle, units.bare(speed, VELOCITY))
    numerics = Numerics(RunOptions.of(run, options), tol, max_periods)
    search = cell_search.CellSearch(pendulum, (axis,), starts, box, numerics)

    def make(survey: _core.Survey, blocks: list[bytes]) -> cell_search.Made:
        raw = survey.diagram(blocks, first)
        dataset = _dataset(raw, axis, units)
        return raw, dataset, {"varied": axis.name, "points": dataset.sizes["point"]}

    return search.result(SCHEMA, make, _summary, {"start": start})


def _dataset(raw: _core.Bifurcation, axis: Varied, units: Units) -> xr.Dataset:
    branch, owner, value = _linked(raw, axis.values.size), raw.point_entry, axis.values[raw.cell]
    speed = units.given(raw.point_velocity, VELOCITY)
    _, first = np.unique(branch, return_index=True)
    last = branch.size - 1 - np.unique(branch[::-1], return_index=True)[1]
    loose = {
        key: np.concatenate([getattr(raw.up, key), getattr(raw.down, key)])
        for key in ("value", "theta", "velocity")
    }
    speeds = units.given(loose["velocity"], VELOCITY)
    way = np.repeat([1, -1], [raw.up.value.size, raw.down.value.size])
    kind, meanings = raw.kind[first], {k: one.name for k, one in enumerate(raw.kinds)}
    on = "entry of the attractor that the sweep {} is on"
    data: dict[str, Any] = {
        **cell_search.variables(raw, (axis.name,), axis.values.shape, units),
        "entry": variable("entry", np.arange(value.size), "1", "number of the entry"),
        "entry_value": ("entry", value, axis.attributes),
        "entry_branch": variable("entry", branch, "1", "number of the branch"),
        "branch_kind": variable("branch", kind, "", "kind of attractor", flags=meanings),
        "branch_w": variable("branch", raw.w[first], "turns", "net turns w over a period"),
        "branch_first": ("branch", value[first], axis.attributes),
        "branch_last": ("branch", value[last], axis.attributes),
        "point_entry": variable("point", owner, "1", "entry of the attractor"),
        "point_value": ("point", value[owner], axis.attributes),
        **point("point", raw.point_theta, speed, units.of_velocity, "point_{}"),
        "up": variable(axis.name, raw.up.on, "1", on.format("up"), "-1: none", missing=-1),
        "down": variable(axis.name, raw.down.on, "1", on.format("down"), "-1: none", missing=-1),
    }
    if way.size:  # a table of an empty dimension has no rows
        data |= {
            "loose_sweep": variable("loose", way, "", "sweep", flags={-1: "down", 1: "up"}),
            "loose_value": ("loose", axis.values[loose["value"]], axis.attributes),
            **point("loose", loose["theta"], speeds, units.of_velocity, "loose_{}"),
        }
    return xr.Dataset(data, coords=axis.coordinates)


def _summary(dataset: xr.Dataset) -> list[str]:
    name, count = dataset.attrs["varied"], dataset.sizes["branch"]
    values = dataset[name].values
    joined = counted(count, "branch", "branches")
    lines = [f"{span(name, *values[[0, -1]])}: {counted(values.size, 'value')}, {joined}."]
    if not count:
        return [*lines, "No attractor was found."]
    first, last = dataset["branch_first"].values, dataset["branch_last"].values
    longest = np.argsort(-(last - first), kind="stable")[:_LISTED]
    for k in sorted(longest, key=lambda k: (first[k], last[k])):
        kind = str(dataset["kind"].values[int(dataset["branch_kind"][k])])
        lines.append(f"{kind}: {name} = {first[k]:.6g} to {last[k]:.6g}.")
    if count > _LISTED:
        lines.append(f"{count - _LISTED} shorter branches are in the result.")
    return [*lines, *_hysteresis(dataset, values)]


def _hysteresis(dataset: xr.Dataset, values: Floats) -> list[str]:
    """Return summary lines on the values at which the sweeps are on different attractors."""
    up, down, name = dataset["up"].values, dataset["down"].values, dataset.attrs["varied"]
    every, kind = attractors_of(dataset, "kind_"), dataset["entry_kind"].values
    pair, single = (
        np.array([getattr(one, key) for one in every], dtype=str)[kind] for key in ("pair", "name")
    )
    arrived = (up >= 0) & (down >= 0)
    differ = arrived & (pair[up] != pair[down])
    images = arrived & ~differ & (single[up] != single[down])
    others = arrived & ~differ & ~images & (up != down)
    hysteresis = "" if differ[arrived].all() else ", with hysteresis,"
    lines = []
    for marked, text in (
        (differ, f"on different kinds of attractor{hysteresis}"),
        (images, "on mirror images of one another"),
        (others, "on different attractors of one kind"),
        (~arrived, "not both on an attractor"),
    ):
        if marked.any():
            ends = span(name, *values[np.flatnonzero(marked)[[0, -1]]])
            some = "" if marked.all() else f", {counted(int(marked.sum()), 'value')}"
            lines.append(f"Up and down are {text} at {ends}{some}.")
    return lines or ["Up and down are on the same attractors everywhere."]


def _linked(raw: _core.Bifurcation, values: int) -> NDArray[np.int32]:
    """Return the branch of each entry: near orbits, and chaos of one kind, with equal turns."""
    bounds = np.searchsorted(raw.cell, np.arange(values + 1))
    plane = np.stack([raw.point_theta, raw.point_velocity], axis=1)
    points = np.split(plane, np.searchsorted(raw.point_entry, np.arange(1, raw.cell.size)))
    kind = [raw.kinds[k].kind for k in raw.kind.tolist()]
    key = list(zip(kind, raw.n.tolist(), raw.w.tolist(), strict=True))
    links = []
    for value, (begin, low, high) in enumerate(zip(bounds, bounds[1:], bounds[2:], strict=False)):

        def reach(a: int, b: int, begin: int = begin, low: int = low) -> float:
            if key[begin + a] != key[low + b]:
                return 0.0
            return _NEAR if raw.n[low + b] else math.inf

        pairs = matched(points[begin:low], points[low:high], reach)
        links += [((value, a), (value + 1, b)) for _, _, a, b in pairs]
    branches = numbered(dict(enumerate(np.diff(bounds).tolist())), links)
    return np.array([*itertools.chain(*branches.values())], dtype=np.int32)
