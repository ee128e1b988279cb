"""Branches of periodic orbits along a parameter: where orbits are born, change and end."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final, Unpack

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import result, varied
from pendmap.analysis.result import Field, Schema, point, rows
from pendmap.analysis.run import Numerics, RunOptions
from pendmap.errors import (
    MOST_CELLS,
    InputError,
    check_number,
    check_whole,
    core_errors,
    short_repr,
)
from pendmap.files import facts
from pendmap.files.variables import flag, variable
from pendmap.formatting import counted, span
from pendmap.model import Rig, without_dimensions
from pendmap.units import VELOCITY

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from pendmap.analysis.run import Keywords
    from pendmap.analysis.varied import Varied
    from pendmap.model import Pendulum
    from pendmap.units import Units


LONGEST: Final = 64  # Longest period of an orbit, in forcing periods
_PLACES: Final = 33  # Values along a range, from which the core knows how parameters depend on it
_LISTED: Final = 16  # Largest number of events in a summary
_CRITICALITY: Final = {-1: "no meaning", 0: "subcritical", 1: "supercritical"}


def _events(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the events for the JSON object."""
    names = ("kind", "value", "theta", "velocity", "n", "w", "multipliers", "supercritical")
    more = ("branch", "smooth")
    entries = result.records(dataset, **{name: f"event_{name}" for name in (*names, *more)})
    for entry in entries:
        known = entry["supercritical"]
        entry["supercritical"] = None if known < 0 else bool(known)
        entry["smooth"] = bool(entry["smooth"])
    return entries


def _branches(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the branches for the JSON object."""
    names = ("n", "w", "symmetric", "begin", "end", "first", "last", "low", "high", "twin")
    entries = result.records(dataset, **{name: f"branch_{name}" for name in names})
    for entry in entries:
        entry["symmetric"] = bool(entry["symmetric"])
        entry["ends"] = [entry.pop("begin"), entry.pop("end")]
        entry["from"], entry["to"] = entry.pop("first"), entry.pop("last")
        entry["twin"] = result.none_below_0(entry["twin"])
    return entries


SCHEMA = Schema(
    "continuation",
    result.UNITS,
    Field("varied", "", "parameter that varies"),
    Field("events", "", "folds, doublings and other events of the branches", read=_events),
    Field("branches", "", "branches of orbits", read=_branches),
    Field("n", "periods", "smallest period of the orbits searched"),
    Field("w", "turns", "net turns over it"),
    Field("longest", "periods", "longest period of branches begun at doublings"),
    Field("start", "", "angle and velocity where one branch was begun", None, json=False),
    Field("low", "", "lower end of the range"),
    Field("high", "", "upper end of the range"),
    *(field.hidden for field in varied.DRIVE),
    *result.TIMED,
    *result.END,
    result.SECTION,
    *result.VERSIONS,
)


def continuation(  # noqa: PLR0913 (physics first, numerical choices by name)
    pendulum: Pendulum | Rig,
    ranges: Mapping[str, ArrayLike],
    n: int = 1,
    w: int = 0,
    *,
    start: tuple[float, float] | None = None,
    longest: int = 32,
    run: RunOptions | None = None,
    **options: Unpack[Keywords],
) -> xr.Dataset:
    """Follow periodic orbits along one parameter: branches, and what happens on them.

    An orbit is a zero of ``P(x_i) - x_(i+1)`` over its points, ``P`` the stroboscopic map. Branches
    are followed by pseudo-arclength, around folds and where orbits are unstable. Orbits are
    searched, as by :func:`pendmap.orbit`, at sections of the range until three in a row have none
    that no branch passes through. Folds (a multiplier passes 1), period doublings (-1), symmetry
    breakings and passages of a complex pair are located to rounding; the orbits that are born
    there are followed too, both twins of a symmetry breaking. Under dry friction so are the values
    at which a turn becomes a stick, the velocity touches 0, or friction holds the orbit for ever.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; the parameter that varies replaces its own.
    ranges : mapping of str to (float, float) or array_like
        One parameter and the ends of its range; several with arrays are a curve. Names are those
        of :func:`pendmap.parameter_map`.
    n : int
        Smallest period of the orbits, in forcing periods; 1 to 64.
    w : int
        Net turns over that period, forward positive.
    start : (float, float), optional
        Angle and velocity from which Newton's method finds the one orbit that is followed, at the
        model's own value of the parameter; by default all orbits are searched.
    longest : int
        Longest period of the branches that are begun at doublings, in forcing periods.
    run : RunOptions, optional
        As for :func:`pendmap.basins`.

    Returns
    -------
    xarray.Dataset
        Branches over ``branch``: ``branch_n``, ``branch_w``, ``branch_symmetric``, ``branch_begin``
        and ``branch_end`` (why it ends), ``branch_first`` and ``branch_last`` (the values there),
        ``branch_low`` and ``branch_high``, ``branch_begin_event`` and ``branch_end_event`` (the
        event that it meets another branch at), ``branch_twin``. Their orbits over ``orbit``:
        ``orbit_value``, ``orbit_branch``, ``orbit_multipliers``, ``orbit_stable``,
        ``orbit_phases`` (under friction: + - slips, 0 sticks); all points over ``point``. Events
        over ``event``: ``event_kind``, ``event_value``, ``event_theta``, ``event_velocity``,
        ``event_n``, ``event_w``, ``event_multipliers``, ``event_supercritical``, ``event_smooth``,
        ``event_branch``, ``event_orbit``. Sections searched over ``section``.

    Raises
    ------
    InputError
        If a parameter or value is not allowed, the model has an effect that no map can have, or
        there is no orbit near ``start``.

    Notes
    -----
    H. B. Keller (1977), Numerical solution of bifurcation and nonlinear eigenvalue problems.

    Examples
    --------
    >>> import pendmap
    >>> pendulum = pendmap.Pendulum(gamma=0.1, omega=2.0)
    >>> result = pendmap.continuation(pendulum, {"p": (0.3, 1.5)}, n=1, w=1, longest=1)
    >>> result.event_kind.values.tolist(), result.event_value.values.round(9)
    (['period_doubling', 'fold'], array([1.34685852, 0.41678757]))
    """
    ranges = _with_count(ranges)
    pendulum = varied.having(pendulum, ranges)
    (axis,) = varied.varied(pendulum, ranges, 1)
    bare, units = without_dimensions(pendulum)
    n = check_whole("n", n, 1, LONGEST)
    w = check_whole("w", w, -MOST_CELLS, MOST_CELLS)
    longest = check_whole("longest", longest, 1, LONGEST)
    numerics = Numerics(RunOptions.of(run, options).in_memory("continuation"))
    begun = None if start is None else _start(pendulum, axis, start, units)
    with core_errors():
        run = numerics.run
        along = axis.values.tolist(), axis.kernel
        raw = _core.continuation(bare, along, (n, w), longest, begun, run.workers, run.progress)
    dataset = _dataset(raw, axis, units)
    ends = [float(end) for end in axis.values[[0, -1]]]
    asked: dict[str, Any] = {"n": n, "w": w, "longest": longest, "low": ends[0], "high": ends[1]}
    asked |= {"varied": axis.name} | ({} if start is None else {"start": f"{start}"})
    values = numerics.provenance() | asked
    what = "orbits are"
    varied.complete(SCHEMA, dataset, pendulum, (axis,), values, summary=_summary, what=what)
    return dataset


def _with_count(ranges: Mapping[str, ArrayLike]) -> Mapping[str, ArrayLike]:
    """Return a range of two ends with a number of values."""
    pairs = dict(ranges) if isinstance(ranges, Mapping) else {}
    ends = {k: one for k, one in pairs.items() if isinstance(one, tuple) and len(one) in {2, 3}}
    got = {k: one[:2] for k, one in ends.items()} or "nothing"
    if not pairs or len(ends) > 1 or any(one[0] == one[1] for one in ends.values()):
        raise InputError(
            "one parameter must vary over a range of two values, like {'p': (0.3, 1.6)}, or on the"
            f" command line --vary p 0.3:1.6; got {got}"
        )
    return pairs | {k: (*one[:2], _PLACES) for k, one in ends.items()}


def _start(
    model: Pendulum | Rig, axis: Varied, start: tuple[float, float], units: Units
) -> tuple[float, float, float]:
    """Return angle, velocity without dimensions, and the model's own value of the parameter."""
    if np.asarray(start, dtype=object).shape != (2,):
        raise InputError(f"start must be (angle, velocity), got {short_repr(start)}")
    angle, speed = (check_number("start", part) for part in start)
    of_effects = {f"{e.name}.{key}": x for e in model.effects for key, x in e.parameters.items()}
    value = {**model.attributes, **of_effects}.get(axis.name)
    if axis.name == "frequency_hz" and isinstance(model, Rig):
        value = model.Omega / math.tau
    low, high = axis.values[[0, -1]]
    if not isinstance(value, float) or not low <= value <= high:
        raise InputError(
            f"{axis.name} of the model must be in the range where a start is given, got {value}"
        )
    return angle, float(units.bare(speed, VELOCITY)), value


def _dataset(raw: _core.Continuation, axis: Varied, units: Units) -> xr.Dataset:
    """Return branches, orbits, points and events as variables."""
    branches, owner, value = raw.n.size, raw.orbit_branch, raw.value
    multipliers = raw.multipliers.reshape(-1, 2, 2)
    stable = np.hypot(*np.moveaxis(multipliers, -1, 0)).max(axis=-1, initial=0.0) < 1
    at, first = raw.event_orbit, np.searchsorted(raw.point_orbit, np.arange(value.size))
    speed = units.given(raw.velocity, VELOCITY)
    inner = np.searchsorted(owner, np.arange(branches + 1))
    parts = [value[low:high] for low, high in itertools.pairwise(inner)]

    def of_branch(choose: Any) -> Any:  # noqa: ANN401 (a function, an attribute)
        numbers = np.array([choose(part) for part in parts], dtype=float)
        return "branch", numbers, axis.attributes

    def number_or_none(values: Any, meaning: str) -> Any:  # noqa: ANN401 (arrays)
        return variable("branch", values, "1", meaning, "-1: none", missing=-1)

    meets = np.array(raw.meets, dtype=np.int32).reshape(-1, 2)
    words = np.array(raw.ends, dtype=str).reshape(-1, 2)
    multiplier, pair = "Floquet multiplier, real and imaginary part", ("eigenvalue", "part")
    phases, kinds = (np.array(x, dtype=str) for x in (raw.phases, raw.event_kind))
    place = raw.event_orbit.astype(np.int64)
    data: dict[str, Any] = {
        "branch_n": variable("branch", raw.n, "periods", "smallest period"),
        "branch_w": variable("branch", raw.w, "turns", "net turns over it"),
        "branch_symmetric": flag("branch", raw.symmetric, "whether orbits are mirror symmetric"),
        "branch_begin": variable("branch", words[:, 0], long_name="why it ends at its beginning"),
        "branch_end": variable("branch", words[:, 1], long_name="why it ends"),
        "branch_first": of_branch(lambda part: part[0]),
        "branch_last": of_branch(lambda part: part[-1]),
        "branch_low": of_branch(np.min),
        "branch_high": of_branch(np.max),
        "branch_begin_event": number_or_none(meets[:, 0], "event at its beginning"),
        "branch_end_event": number_or_none(meets[:, 1], "event at its end"),
        "branch_twin": number_or_none(raw.twin, "branch of the mirror images"),
        "orbit_branch": variable("orbit", owner, "1", "number of the branch"),
        "orbit_value": ("orbit", value, axis.attributes),
        "orbit_multipliers": variable(("orbit", *pair), multipliers, "1", multiplier),
        "orbit_stable": flag("orbit", stable, "whether it is stable"),
        "orbit_phases": variable("orbit", phases, long_name="slips + -, sticks 0, in turn"),
        "point_orbit": variable("point", raw.point_orbit, "1", "number of the orbit"),
        **point("point", raw.theta, speed, units.of_velocity, "point_{}"),
        "event_kind": variable("event", kinds, long_name="what happens"),
        "event_value": ("event", value[place], axis.attributes),
        **point(
            "event", raw.theta[first[place]], speed[first[place]], units.of_velocity, "event_{}"
        ),
        "event_n": variable("event", raw.n[owner[place]], "periods", "smallest period"),
        "event_w": variable("event", raw.w[owner[place]], "turns", "net turns over it"),
        "event_multipliers": variable(("event", *pair), multipliers[place], "1", multiplier),
        "event_supercritical": flag(
            "event", raw.supercritical, "whether new orbits live beyond it", _CRITICALITY
        ),
        "event_smooth": flag("event", raw.smooth, "whether the map is smooth there"),
        "event_branch": variable("event", owner[place], "1", "number of the branch"),
        "event_orbit": variable("event", at, "1", "number of the orbit"),
    }
    if raw.sections:  # a table of an empty dimension has no rows
        places, counts = zip(*raw.sections, strict=True)
        data["section_value"] = ("section", np.array(places, float), axis.attributes)
        counted_there = np.array(counts, np.int32)
        data["section_orbits"] = variable("section", counted_there, "1", "orbits found there")
    return xr.Dataset(data)


def _summary(dataset: xr.Dataset) -> list[str]:
    a, count = facts(dataset), dataset.sizes["branch"]
    name = str(a["varied"])
    which = f"of period {a['n']} and {counted(abs(a['w']), 'net turn')}"
    every = counted(count, "branch", "branches")
    lines = [f"{span(name, a['low'], a['high'])}: {every} of orbits, from those {which}."]
    names = ("kind", "value", "n", "w", "supercritical")
    events = list(rows(dataset, *(f"event_{key}" for key in names)))
    for kind, value, n, w, side in events[:_LISTED]:
        of = {0: ", subcritical", 1: ", supercritical"}.get(side, "")
        lines.append(f"{kind.replace('_', ' ')} of {n}:{w} at {name} = {value:.12g}{of}.")
    if len(events) > _LISTED:
        lines.append(f"{len(events) - _LISTED} more events are in the result.")
    if "section_value" in dataset:
        searched = counted(dataset.sizes["section"], "section")
        lines.append(f"Orbits were searched at {searched} of the range.")
    lost = [end for side in ("begin", "end") for end in dataset[f"branch_{side}"].values.tolist()]
    open_ends = sum(end in {"precision lost", "branches cross"} for end in lost)
    if open_ends:
        lines.append(f"{counted(open_ends, 'end')} of branches could not be followed further.")
    return lines
