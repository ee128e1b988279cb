"""Branches of periodic orbits along a parameter: where orbits are born, change and end."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final, Unpack

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import backbone, curves, result, varied
from pendmap.analysis import regions as in_plane
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
MOST: Final = 16  # Longest period up to which all orbits are followed
_LISTED: Final = curves.LISTED  # Largest number of events in a summary
_PLACES: Final = 33  # Values along a range, from which the core knows how parameters depend on it


def events(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the events for the JSON object."""
    if "event_kind" not in dataset:
        return []
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
    if "branch_n" not in dataset:
        return []
    keys = "n w kind symmetric begin end first last low high twin begin_event end_event"
    entries = result.records(dataset, **{name: f"branch_{name}" for name in keys.split()})
    for entry in entries:
        entry["symmetric"] = bool(entry["symmetric"])
        entry["ends"] = [entry.pop("begin"), entry.pop("end")]
        entry["from"], entry["to"] = entry.pop("first"), entry.pop("last")
        entry["events"] = [result.none_below_0(entry.pop(f"{at}_event")) for at in ("begin", "end")]
        entry["twin"] = result.none_below_0(entry["twin"])
    return entries


def regions(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the regions between events for the JSON object, with their stable orbits."""
    if "region_part" in dataset:
        return in_plane.entries(dataset)
    if "region_from" not in dataset:
        return []
    names = {"from": "region_from", "to": "region_to"}
    every: list[dict[str, Any]] = [one | {"stable": []} for one in result.records(dataset, **names)]
    kinds = list(rows(dataset, "branch_kind", "branch_n", "branch_w"))
    for region, branch in rows(dataset, "stable_region", "stable_branch"):
        kind, n, w = kinds[branch]
        name = _core.Attractor(kind, n, w).name
        every[region]["stable"].append({"name": name, "n": n, "w": w, "branch": branch})
    return every


SCHEMA = Schema(
    "continuation",
    result.UNITS,
    Field("varied", "", "parameter that varies"),
    Field("events", "", "folds, doublings and other events of the branches", read=events),
    Field("branches", "", "branches of orbits", read=_branches),
    Field("regions", "", "regions between events, with their stable orbits", read=regions),
    Field("curves", "", "curves in the plane of two parameters", read=curves.entries),
    Field("points", "", "points of codimension 2 on them", read=curves.points),
    Field("n", "periods", "smallest period of the orbits searched"),
    Field("w", "turns", "net turns over it"),
    Field("up_to", "periods", "longest period of the orbits searched, of all types"),
    Field("longest", "periods", "longest period of branches begun at doublings"),
    Field("start", "", "angle and velocity where one branch was begun", None, json=False),
    Field("low", "", "lower end of the range, or of both"),
    Field("high", "", "upper end of the range, or of both"),
    *(field.hidden for field in varied.DRIVE),
    *result.TIMED,
    *result.END,
    result.SECTION,
    *result.VERSIONS,
)


def continuation(  # noqa: PLR0913 (physics first, numerical choices by name)
    pendulum: Pendulum | Rig,
    ranges: Mapping[str, ArrayLike],
    n: int | None = None,
    w: int | None = None,
    *,
    start: tuple[float, float] | None = None,
    up_to: int | None = None,
    longest: int | None = None,
    run: RunOptions | None = None,
    **options: Unpack[Keywords],
) -> xr.Dataset:
    """Follow periodic orbits along a parameter: branches, and what happens on them; or two.

    An orbit is a zero of ``P(x_i) - x_(i+1)`` over its points, ``P`` the stroboscopic map. Branches
    are followed by pseudo-arclength, around folds and where orbits are unstable. Orbits are
    searched, of mirror images one, at sections of the range until three in a row have none
    that no branch passes through. Folds (a multiplier passes 1), period doublings (-1), symmetry
    breakings and passages of a complex pair are located to rounding; the orbits that are born
    there are followed too, both twins of a symmetry breaking. Under dry friction so are the values
    at which a turn becomes a stick, the velocity touches 0, or friction holds the orbit for ever.

    With two parameters: curves of folds, period doublings and symmetry breakings in their plane, of
    all orbits up to some period and of both rests, from sections in both directions until several
    in a row have no event off the curves; under dry friction also of the changes of slips and
    sticks. Points of codimension 2 are located: cusps, where a doubling or a symmetry breaking
    changes between super- and subcritical, and where a curve reaches a change of slips and sticks.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; the parameter that varies replaces its own.
    ranges : mapping of str to (float, float) or array_like
        One parameter, or two, and the ends of their ranges; several with arrays are a curve. Names
        are those of :func:`pendmap.parameter_map`.
    n : int, optional
        Smallest period of the orbits, in forcing periods; 1 to 64, by default 1.
    w : int, optional
        Net turns over that period, forward positive; by default 0.
    start : (float, float), optional
        Angle and velocity from which Newton's method finds the one orbit that is followed, at the
        model's own value of the parameter; by default all orbits are searched.
    up_to : int, optional
        Longest period of the orbits, in forcing periods; 1 to 16, with two parameters by default 4:
        all types are followed, instead of one, with the mirror images of rotations.
    longest : int, optional
        Longest period of the branches that are begun at doublings, in forcing periods; by default
        32, or ``up_to``.
    run : RunOptions, optional
        As for :func:`pendmap.basins`.

    Returns
    -------
    xarray.Dataset
        Variables begin with their dimension, like ``branch_n``. ``branch``: ``n``, ``w``, ``kind``,
        ``symmetric``, ``twin``, ``begin`` and ``end`` (why it ends), ``begin_event``, ``end_event``
        (where it meets another branch), ``first``, ``last``, ``low``, ``high``. ``orbit``:
        ``branch``, ``value``, ``multipliers``, ``stable``, ``phases`` (under friction: + - slips, 0
        sticks), ``amplitude`` (half the angle between its outermost turns; nan of rotations),
        ``swings``. ``point``: ``orbit``, ``theta``, ``velocity``. ``event``: ``kind``, ``value``,
        ``theta``, ``velocity``, ``n``, ``w``, ``multipliers``, ``supercritical``, ``smooth``,
        ``branch``, ``orbit``. ``section``: where orbits were searched. With ``up_to`` the ``from``
        and ``to`` of each ``region`` in which the same orbits up to that period are ``stable``,
        without what friction holds. Along a frequency, ``backbone_amplitude`` of free swings over
        their rate ``backbone_value``: ``k`` swings in ``n`` periods lie near ``n/k`` times it.

        Of two parameters, ``curve``: ``kind``, ``n``, ``w``, ``symmetric``, ``begin``, ``end``;
        their ``place``: ``curve``, ``theta``, ``velocity``, ``multipliers``, ``supercritical``,
        ``jump`` (what a jump of a multiplier does as slips and sticks change) and both parameters;
        points of codimension 2, ``degenerate``: ``kind``, ``n`` and so on. ``stable_count``, over
        ``type`` and a lattice of both parameters: how many orbits of a type are stable; ``region``:
        ``type``, ``stable``, ``part`` of the plane, and a point inside.

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
    if isinstance(ranges, Mapping) and len(ranges) == 2 and _are_axes(ranges):  # noqa: PLR2004
        if (n, w, start, longest) != (None,) * 4:
            raise InputError("n, w, start and longest must not be given with two parameters")
        pendulum = varied.having(pendulum, ranges)
        pairs = {k: (*x[:2], _PLACES) if isinstance(x, tuple) else x for k, x in ranges.items()}
        axes = varied.varied(pendulum, pairs, 2)
        numerics = Numerics(RunOptions.of(run, options).in_memory("continuation"))
        up_to = 4 if up_to is None else up_to
        dataset, request = curves.in_plane(pendulum, axes, up_to, numerics, counted=True)
        known = numerics.provenance() | request
        say, what = curves.summary, "curves are"
        varied.complete(SCHEMA, dataset, pendulum, axes, known, summary=say, what=what)
        return dataset
    ranges = _with_count(ranges)
    pendulum = varied.having(pendulum, ranges)
    (axis,) = varied.varied(pendulum, ranges, 1)
    bare, units = without_dimensions(pendulum)
    asked: dict[str, Any] = {}
    if up_to is None:
        asked["n"] = n = check_whole("n", 1 if n is None else n, 1, LONGEST)
        asked["w"] = w = check_whole("w", w or 0, -MOST_CELLS, MOST_CELLS)
    else:
        if (n, w, start) != (None, None, None):
            raise InputError("n, w and start must not be given with up_to")
        asked["up_to"] = n = check_whole("up_to", up_to, 1, MOST)
    longest = check_whole("longest", (up_to or 32) if longest is None else longest, 1, LONGEST)
    numerics = Numerics(RunOptions.of(run, options).in_memory("continuation"))
    begun = None if start is None else [_start(pendulum, axis, start, n, units)]
    with core_errors():
        run = numerics.run
        along = axis.values.tolist(), axis.kernel
        raw = _core.continuation(bare, along, (n, w), longest, begun, run.workers, run.progress)
    dataset = columns(raw, axis, units)
    ends = [float(end) for end in axis.values[[0, -1]]]
    asked |= {"longest": longest, "low": ends[0], "high": ends[1], "varied": axis.name}
    asked |= {} if start is None else {"start": f"{start}"}
    if axis.name in {"omega", "frequency_hz"}:
        dataset.update(backbone.along(pendulum, axis.name))
    values = numerics.provenance() | asked
    what = "orbits are"
    varied.complete(SCHEMA, dataset, pendulum, (axis,), values, summary=_summary, what=what)
    return dataset


def _are_axes(ranges: Mapping[str, ArrayLike]) -> bool:
    """Return whether each of the ranges is an axis: not those of one curve."""
    return all(isinstance(values, tuple | Mapping) for values in ranges.values())


def stable_orbits(dataset: xr.Dataset, value: float | Mapping[str, float]) -> list[dict[str, Any]]:
    """Return the orbits that are stable at a value of the parameter, or of both.

    ``dataset`` is a result of :func:`pendmap.continuation` with ``up_to``; orbits are known up to
    that period. Each has ``name``, ``n``, ``w`` and ``branch``; twins and both senses of a rotation
    are there, what friction holds is not. Outside the range there are none. In two parameters,
    given as a mapping, each entry is a type of orbits with their number ``stable``.
    """
    if isinstance(value, Mapping):
        return in_plane.stable_orbits(dataset, value) if "stable_count" in dataset else []
    inside = [one["stable"] for one in regions(dataset) if one["from"] <= value <= one["to"]]
    return inside[0] if inside else []


def _with_count(ranges: Mapping[str, ArrayLike]) -> Mapping[str, ArrayLike]:
    """Return a range of two ends with a number of values."""
    pairs = dict(ranges) if isinstance(ranges, Mapping) else {}
    ends = {k: one for k, one in pairs.items() if isinstance(one, tuple) and len(one) in {2, 3}}
    got = {k: one[:2] for k, one in ends.items()} or "nothing"
    if not pairs or len(ends) > 1 or any(one[0] == one[1] for one in ends.values()):
        raise InputError(
            "one parameter, or two, must vary over a range of two values, as {'p': (0.3, 1.6)}, on"
            f" the command line --vary p 0.3:1.6; got {got}"
        )
    return pairs | {k: (*one[:2], _PLACES) for k, one in ends.items()}


def state(name: str, value: tuple[float, float]) -> tuple[float, float]:
    """Return angle and velocity of a start."""
    if np.asarray(value, dtype=object).shape != (2,):
        raise InputError(f"{name} must be (angle, velocity), got {short_repr(value)}")
    return check_number(name, value[0]), check_number(name, value[1])


def _start(
    model: Pendulum | Rig, axis: Varied, start: tuple[float, float], n: int, units: Units
) -> tuple[float, float, int, float]:
    """Return angle, velocity without dimensions, period, the model's value of the parameter."""
    angle, speed = state("start", start)
    of_effects = {f"{e.name}.{key}": x for e in model.effects for key, x in e.parameters.items()}
    value = {**model.attributes, **of_effects}.get(axis.name)
    if axis.name == "frequency_hz" and isinstance(model, Rig):
        value = model.Omega / math.tau
    low, high = axis.values[[0, -1]]
    if not isinstance(value, float) or not low <= value <= high:
        raise InputError(
            f"{axis.name} of the model must be in the range where a start is given, got {value}"
        )
    return angle, float(units.bare(speed, VELOCITY)), n, value


def columns(raw: _core.Continuation, axis: Varied, units: Units) -> xr.Dataset:
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
        "branch_kind": variable(
            "branch", np.array(raw.kind, dtype=str), long_name="kind of orbits"
        ),
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
        "orbit_amplitude": variable(
            "orbit", raw.amplitude, "rad", "half the angle between its outermost turns"
        ),
        "orbit_swings": variable("orbit", raw.swings, "1", "swings to and fro over its period"),
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
            "event", raw.supercritical, "whether new orbits live beyond it", curves.CRITICALITY
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
    if raw.regions:
        low, high = np.array(raw.regions).T
        of, stable = np.array(raw.stable, dtype=np.int32).reshape(-1, 2).T
        data["region_from"] = ("region", low, axis.attributes)
        data["region_to"] = ("region", high, axis.attributes)
        data["stable_region"] = variable("stable", of, "1", "number of the region")
        data["stable_branch"] = variable("stable", stable, "1", "branch of an orbit stable there")
    return xr.Dataset(data)


def _summary(dataset: xr.Dataset) -> list[str]:
    a, count = facts(dataset), dataset.sizes["branch"]
    name = str(a["varied"])
    which = f"all up to period {a.get('up_to')}"
    if "n" in a:
        which = f"from those of period {a['n']} and {counted(abs(a['w']), 'net turn')}"
    every = counted(count, "branch", "branches")
    lines = [f"{span(name, a['low'], a['high'])}: {every} of orbits, {which}."]
    names = ("kind", "value", "n", "w", "supercritical")
    happens = list(rows(dataset, *(f"event_{key}" for key in names)))
    for kind, value, n, w, side in happens[:_LISTED]:
        of = {0: ", subcritical", 1: ", supercritical"}.get(side, "")
        lines.append(f"{kind.replace('_', ' ')} of {n}:{w} at {name} = {value:.12g}{of}.")
    parts = regions(dataset)
    for part in parts[:_LISTED]:
        stable = ", ".join(orbit["name"] for orbit in part["stable"]) or "none"
        lines.append(f"{span(name, part['from'], part['to'])}: stable orbits: {stable}.")
    for what, k in (("events", len(happens)), ("regions", len(parts))):
        if k > _LISTED:
            lines.append(f"{k - _LISTED} more {what} are in the result.")
    if "section_value" in dataset:
        sections = counted(dataset.sizes["section"], "section")
        lines.append(f"Orbits were searched at {sections} of the range.")
    ends = [*rows(dataset, "branch_begin", "branch_first")]
    ends += rows(dataset, "branch_end", "branch_last")
    if lost := [at for why, at in ends if why in {"precision lost", "branches cross"}]:
        where = counted(len(lost), "branch is lost", "branches are lost")
        lines.append(f"{where} at {span(name, min(lost), max(lost))}.")
    return lines
