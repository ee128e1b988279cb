"""Bifurcation diagrams: all attractors along one parameter, and sweeps up and down."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import cell_search, continuation, result, varied
from pendmap.analysis.orbit_table import attractors_of
from pendmap.analysis.result import Field, Schema, point, rows
from pendmap.analysis.run import Numerics, RunOptions
from pendmap.errors import InputError, check_whole, core_errors
from pendmap.files.variables import variable
from pendmap.formatting import counted, span
from pendmap.model import without_dimensions
from pendmap.units import VELOCITY

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from pendmap.analysis.grid import Grid
    from pendmap.analysis.run import Keywords
    from pendmap.analysis.varied import Varied
    from pendmap.model import Pendulum, Rig
    from pendmap.units import Units


_OF = "followed_"  # Beginning of the names of variables and dimensions of followed branches
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


def followed(dataset: xr.Dataset) -> xr.Dataset:
    """Return the followed branches of its orbits with the names of a continuation, if any."""
    names = {name: str(name).removeprefix(_OF) for name in dataset if str(name).startswith(_OF)}
    sizes = {dim: str(dim).removeprefix(_OF) for dim in dataset.sizes if str(dim).startswith(_OF)}
    return dataset[[*names]].reset_coords(drop=True).rename(names | sizes)


SCHEMA = Schema(
    "bifurcation",
    result.UNITS,
    Field("varied", "", "parameter that varies"),
    Field("branches", "", "attractors followed along the parameter", read=_branches),
    Field(
        "events",
        "",
        "folds, doublings and other events of its orbits",
        read=lambda one: continuation.events(followed(one)),
    ),
    Field("points", "1", "stroboscopic points"),
    *cell_search.SEARCH,
)


def bifurcation(  # noqa: PLR0913 (physics first, numerical choices by name)
    pendulum: Pendulum | Rig,
    ranges: Mapping[str, ArrayLike],
    *,
    start: tuple[float, float] | None = None,
    branches: int = 0,
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

    With ``branches`` those of its orbits are followed as by :func:`pendmap.continuation`, unstable
    parts too, with their folds, doublings and other events.

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
    branches : int
        Longest period of the orbits whose branches are followed, unstable parts too; 0: none.
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
        ``loose``; followed branches as for :func:`pendmap.continuation`, each name after
        ``followed_``.

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
        angle, speed = continuation.state("start", start)
        first = (angle, units.bare(speed, VELOCITY))
    numerics = Numerics(RunOptions.of(run, options), tol, max_periods)
    longest = check_whole("branches", branches, 0, continuation.LONGEST)
    workers = numerics.run.workers
    search = cell_search.CellSearch(pendulum, (axis,), starts, box, numerics)

    def make(survey: _core.Survey, blocks: list[bytes]) -> cell_search.Made:
        raw = survey.diagram(blocks, first)
        dataset = _dataset(raw, axis, units)
        if longest:
            with contextlib.suppress(InputError):  # no orbit, or no law of the parameters
                dataset = dataset.assign(_followed(pendulum, dataset, axis, longest, workers))
        return raw, dataset, {"varied": axis.name, "points": dataset.sizes["point"]}

    return search.result(SCHEMA, make, _summary, {"start": start, "branches": longest})


def _dataset(raw: _core.Bifurcation, axis: Varied, units: Units) -> xr.Dataset:
    branch, owner, value = raw.branch, raw.point_entry, axis.values[raw.cell]
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


def _followed(
    model: Pendulum | Rig, dataset: xr.Dataset, axis: Varied, longest: int, workers: int
) -> Mapping[Any, Any]:
    """Return the branches of its orbits, followed from the middle of each, with unstable parts."""
    bare, units = without_dimensions(model)
    names = ("theta", "velocity", "n", "value", "branch", "kind")
    kinds, starts = dataset["kind"].values.tolist(), dict[int, list[Any]]()
    for theta, v, n, value, branch, kind in rows(dataset, *(f"entry_{name}" for name in names)):
        held = bare.theta_r > 0 and "rest" in kinds[kind]
        if 1 <= n <= longest and not held:
            speed = float(units.bare(v, VELOCITY))
            starts.setdefault(branch, []).append((theta, speed, n, value))
    middles = [entries[len(entries) // 2] for entries in starts.values()]
    if not middles or (np.diff(axis.values) <= 0).any():
        return {}
    along = axis.values.tolist(), axis.kernel
    with core_errors():
        raw = _core.continuation(bare, along, (1, None), longest, middles, workers)
    columns = continuation.columns(raw, axis, units)
    return columns.rename({k: f"{_OF}{k}" for k in [*columns, *columns.sizes]}).variables


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
    pairs = np.array([one.pair for one in attractors_of(dataset, "kind_")], dtype=object)
    on = [dataset[key].values for key in ("up", "down")]
    up, down = (np.append(pairs[dataset["entry_kind"].values], "")[sweep] for sweep in on)
    arrived = np.minimum(*on) >= 0
    differ = np.flatnonzero(arrived & (up != down))
    if 0 < differ.size < arrived.sum():  # otherwise each stays where it begins
        where, some = span(name, *values[differ[[0, -1]]]), counted(differ.size, "value")
        lines.append(f"Hysteresis: up and down differ at {where}, {some}.")
    return lines
