"""Parameters that vary, and the search for attractors at each of their values."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.ndimage import find_objects, label

from pendmap import _core
from pendmap.analysis import result
from pendmap.analysis.grid import Grid, ascending, coordinate
from pendmap.analysis.result import Field, Found, point, variable
from pendmap.errors import (
    MOST_CELLS,
    InputError,
    check_number,
    check_type,
    check_whole,
    short_repr,
)
from pendmap.formatting import counted
from pendmap.model import without_dimensions
from pendmap.model.labels import LABELS
from pendmap.model.quantities import COUNTERPARTS, check
from pendmap.model.rig import Rig
from pendmap.units import RATE, VELOCITY

if TYPE_CHECKING:
    from collections.abc import Hashable, Mapping, Sequence

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from pendmap.analysis.numerics import Numerics
    from pendmap.model import Pendulum
    from pendmap.signal import Floats, Indices
    from pendmap.units import Units


@dataclasses.dataclass(frozen=True)
class Varied:
    """A parameter and its values: ascending, evenly spaced unless they were listed."""

    name: str
    """Name of the parameter, one of those of :func:`pendmap.parameter_map`."""
    values: Floats
    """Values in the units of the parameter."""
    parameter: str
    """Name of the parameter in the core."""
    bare: Floats
    """The values without dimensions."""
    unit: str
    """Unit of the values; empty where they have none."""
    meaning: str
    """Meaning of the parameter."""

    @property
    def kernel(self) -> tuple[str, list[float]]:
        """Name and values as passed to the core."""
        return self.parameter, self.bare.tolist()

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of a quantity with these values."""
        return variable((), 0.0, self.unit or "1", self.meaning)[2]

    @property
    def coordinates(self) -> dict[str, Any]:
        """Coordinate of a dataset; with more than one value also their bounds."""
        x = self.values
        if x.size == 1:
            return {self.name: (self.name, x, self.attributes)}
        if self.even:
            half = 0.5 * (x[-1] - x[0]) / (x.size - 1)
            edges = np.linspace(x[0] - half, x[-1] + half, x.size + 1)
        else:
            middle = 0.5 * (x[1:] + x[:-1])
            edges = np.array([2 * x[0] - middle[0], *middle, 2 * x[-1] - middle[-1]])
        return coordinate(self.name, x, edges, **self.attributes)

    @property
    def even(self) -> bool:
        """Whether the values are evenly spaced."""
        steps = np.diff(self.values)
        return not steps.size or bool(np.allclose(steps, steps.mean(), atol=0))

    @property
    def replaced(self) -> tuple[str, ...]:
        """Names of the model's own parameter that this one replaces."""
        return self.parameter, COUNTERPARTS.get(self.parameter, ("",))[0]


def varied(
    model: Pendulum | Rig, ranges: Mapping[str, ArrayLike], count: int, *, listed: bool = False
) -> tuple[Varied, ...]:
    """Return the ``count`` parameters that vary, from their first and last value and number.

    Where they may be ``listed``, what is no tuple is an array of values.
    """
    if not isinstance(ranges, dict) or len(ranges) != count:
        given = ", ".join(map(str, ranges)) if isinstance(ranges, dict) else short_repr(ranges)
        example = {"p": (0.5, 2.0, 100), "omega": (0.5, 3.0, 100)}
        few = dict(list(example.items())[:count])
        raise InputError(f"ranges must be a mapping like {few}, got {given or 'nothing'}")
    found = tuple(_one(model, name, given, listed=listed) for name, given in ranges.items())
    pendulum, _ = without_dimensions(model)
    for axis in found:
        for value, bare in zip(axis.values[[0, -1]], axis.bare[[0, -1]], strict=True):
            try:
                with_values(pendulum, {axis.parameter: float(bare)})
            except InputError as error:
                units = "" if value == bare else f" (without dimensions, w0 is {model.units.w0:g})"
                raise InputError(f"{axis.name} = {value:g}: {error}{units}") from None
    if len({one.parameter for one in found}) < len(found):
        raise InputError(
            f"{found[0].name} and {found[1].name} must be two parameters, they are one"
        )
    if "stroke_mm" in ranges and {"omega", "Omega", "frequency_hz"} & set(ranges):
        raise InputError(
            "stroke_mm and a frequency must not both vary: vary p = Y Omega^2 / g instead"
        )
    return found


def title(model: Pendulum | Rig, *axes: Varied) -> str:
    """Return one line: the ranges of the parameters that vary, and the other parameters."""
    spans = [f"{a.name} = {a.values[0]:g} to {a.values[-1]:g} {a.unit}".rstrip() for a in axes]
    rest = title_without(model, *(a.parameter for a in axes))
    return " and ".join(spans) + (f"; otherwise {rest}" if rest else "")


def title_without(model: Pendulum | Rig, *names: str) -> str:
    """Return the model in one line without some of its parameters, by the core's names."""
    whole = [effect.title(model.units) for effect in model.effects]
    own = model.title.removesuffix(", ".join(whole)).removesuffix(", ")
    both = [(name, COUNTERPARTS[name][0]) for name in names if name in COUNTERPARTS]
    symbols = {LABELS[name].symbol for pair in both for name in pair}
    kept = [part for part in own.split(", ") if part.partition(" = ")[0] not in symbols]
    return ", ".join([*kept, *(effect.title(model.units, names) for effect in model.effects)])


def without_damping(model: Pendulum | Rig, *axes: Varied) -> list[str]:
    """Return a summary line if some of the pendulums have no damping, hence no attractors."""
    pendulum, _ = without_dimensions(model)
    least = {axis.parameter: float(axis.bare[0]) for axis in axes}
    if any(effect.brakes for effect in model.effects):
        return []
    if any(least.get(name, getattr(pendulum, name)) for name in ("gamma", "theta_r")):
        return []
    return ["Without damping (gamma = 0) there are no attractors: such starts stay undecided."]


def _one(model: Pendulum | Rig, name: str, given: Any, *, listed: bool) -> Varied:  # noqa: ANN401
    pendulum, units = without_dimensions(model)
    known = _core.parameter_names(pendulum)
    # Name in the core, factor and power of w0 of each quantity.
    own = {bare: (bare, 1.0, 0) for bare in known if "." not in bare}
    if isinstance(model, Rig):
        for bare in ("gamma", "omega", "phase", "theta_r"):
            si, power = COUNTERPARTS[bare]
            own[si] = (bare, 1.0, power)
        own["frequency_hz"] = ("omega", math.tau, 1)
        if model.Omega > 0:  # a stroke is an acceleration only at a known frequency
            own["stroke_mm"] = ("p", 1e-3 * model.Omega**2 / model.gravity, 0)
    effects = {e.name: e for e in model.effects}
    shared = [f"{e.name}.{parameter}" for e in model.effects for parameter in e.parameters]
    if name not in own and name not in shared:
        there = ", ".join([*own, *shared])
        raise InputError(
            f"{short_repr(name)} is no parameter of this model: it must be one of {there}"
        )
    by_ends = isinstance(given, tuple) or not listed
    values = _values(name, given) if by_ends else ascending(name, given)
    if name in own:
        bare, factor, power = own[name]
        if name in {"frequency_hz", "stroke_mm"}:
            check(name, values[0])
        plain = units.bare(factor * values, power)
        # ``torque`` has no dimensions here, also for a rig.
        unit = "" if name == "torque" else LABELS[name].unit.replace("^", "")
        meaning = LABELS[name].meaning
    else:
        bare, unit = name, ""
        which, parameter = name.split(".", 1)
        entries = effects[which].definition.parameters
        if units.si and any(entry.power_of_w0_less == parameter for entry in entries):
            raise InputError(
                f"{name} changes the units of others: the model must be one without dimensions"
            )
        one = dataclasses.replace(effects[which], ci95={})
        changed = ({**one.parameters, parameter: float(x)} for x in values)
        bared = [dataclasses.replace(one, parameters=mine).bare(units) for mine in changed]
        plain = np.array([effect.parameters[parameter] for effect in bared])
        meaning = f"{parameter} of {which}: {effects[which].definition[parameter].meaning}"
        if units.si:
            unit = effects[which].definition[parameter].unit
    if known.count(bare) > 1:
        raise InputError(f"{name} must be in the model once, got it {known.count(bare)} times")
    return Varied(name, values, bare, plain, unit, meaning)


def _values(name: str, given: object) -> Floats:
    wanted = f"{name} must be (first, last, how many), like {name}=(0.5, 2.0, 100)"
    if not isinstance(given, tuple | list) or len(given) != 3:  # noqa: PLR2004
        raise InputError(f"{wanted}, got {short_repr(given)}")
    low, high = (check_number(name, end) for end in given[:2])
    count = check_whole(f"{name}: how many", given[2], 1, MOST_CELLS)
    if not (low < high and math.isfinite(high - low)) and not (count == 1 and low == high):
        raise InputError(f"{wanted}, the lower one first, got {low:g} to {high:g}")
    if count == 1 and low < high:
        raise InputError(f"{name} is {low:g} to {high:g}: one value has one bound")
    return np.linspace(low, high, count)


def with_values(model: Pendulum | Rig, values: Mapping[str, float]) -> Pendulum | Rig:
    """Return the model with these parameters; its effects without their intervals."""
    own = {name: x for name, x in values.items() if name in model.numbers()}
    effects = tuple(
        dataclasses.replace(
            effect,
            parameters={
                name: values.get(f"{effect.name}.{name}", x)
                for name, x in effect.parameters.items()
            },
            ci95={},
        )
        for effect in model.effects
    )
    changed: dict[str, Any] = {**own, "effects": effects}
    return dataclasses.replace(model, **changed)


CHAOS_PERIODS = ("time for which the chaos was not captured", "0: no chaos")  # Name, comment
STARTS = 9  # Default number of initial conditions of a cell
_SPREAD = 1000  # Cells on each side of the default box, without effect
_PLASTIC = 1.324717957244746
"""Plastic number, whose powers give an even additive recurrence in two dimensions."""
_CELLS = 61  # Cells after which initial conditions repeat: a prime, so that columns differ too
UNDECIDED = "undecided"  # Kind of a cell in which no attractor was found

_ORDER = (
    "rest",
    "inverted rest",
    "oscillation",
    "rotation",
    "quasiperiodic rotation",
    "libration chaos",
    "rotating chaos",
    "tumbling chaos",
    UNDECIDED,
)


def spread(grid: Grid, count: int, seed: int = 0) -> tuple[Floats, ...]:
    """Return angles and velocities that cover a box evenly; no two are mirror images."""
    shift = 0.5 + (seed * 0.6180339887498949) % 1.0
    # k = 0 may be the centre, where a pendulum at rest stays even if that is unstable.
    k = 1 + np.arange(count)
    parts = [(shift + k / _PLASTIC**power) % 1.0 for power in (1, 2)]
    ends = [(axis.low, axis.high - axis.low) for axis in (grid.theta, grid.velocity)]
    theta, velocity = (low + width * part for (low, width), part in zip(ends, parts, strict=True))
    return theta, velocity


@dataclasses.dataclass(frozen=True)
class CellSearch:
    """Starts of the search for attractors in each of many pendulums, checked."""

    starts: int
    box: Grid | None
    numerics: Numerics

    def __post_init__(self) -> None:
        check_whole("starts", self.starts, 1, MOST_CELLS)
        if self.box is not None:
            check_type("box", self.box, Grid, "Grid.square(100)")

    @property
    def request(self) -> dict[str, Any]:
        """The arguments that determine the search."""
        numerics = self.numerics
        choices = {"tol": numerics.tol, "max_periods": numerics.max_periods, "seed": numerics.seed}
        return {"starts": self.starts, "box": self.box, **choices}

    def within(self, units: Units) -> Grid:
        """Return the box, in these units; by default that of :func:`pendmap.basins`."""
        return self.box or Grid.square(_SPREAD, units.given(1.0, VELOCITY))

    def initial(self, units: Units) -> tuple[Floats, Floats, int]:
        """Return initial conditions without dimensions, and how many of them each cell takes."""
        theta, velocity = spread(self.within(units), _CELLS * self.starts, self.numerics.seed)
        return theta, units.bare(velocity, VELOCITY), self.starts

    def attributes(self, raw: _core.ParameterMap, units: Units) -> dict[str, Any]:
        """Return the attributes of the search whose result is ``raw``."""
        return {
            **self.numerics.provenance(),
            **self.within(units).attributes,
            "starts": self.starts,
            "undecided": float(raw.undecided.mean()),
            "chaos_periods": min((int(n) for n in raw.chaos_periods if n), default=0),
            "failed": float(raw.failed.mean()),
        }


def undecided_cells(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return groups of touching cells with undecided starts, the largest first."""
    share = dataset["undecided"]
    groups, _ = label(share.values > 0, structure=np.ones((3,) * share.ndim))
    found = []
    for number, box in enumerate(find_objects(groups), 1):
        mine = groups == number
        ranges = {
            str(name): (float(dataset[name].values[at][0]), float(dataset[name].values[at][-1]))
            for name, at in zip(reversed(share.dims), reversed(box), strict=True)
        }
        mean = float(share.values[mine].mean())
        found.append({"ranges": ranges, "cells": int(mine.sum()), "undecided": mean})
    return sorted(found, key=lambda one: -one["cells"])


def kind_of(kind: str, n: int, w: int) -> str:
    """Return the name of a kind of attractor, like ``rotation 1:2``; mirror images have one."""
    if kind == "oscillation":
        return f"oscillation period {n}"
    if kind == "rotation":
        return f"rotation {n}:{abs(w)}"
    return kind.replace("_", " ")


def order(name: str) -> tuple[int, int, int]:
    """Return the rank of a kind: rest first, chaos last, short periods before long."""
    place = next(k for k, word in enumerate(_ORDER) if name.startswith(word))
    digits = name.rsplit(" ", 1)[-1]
    n, _, w = digits.partition(":")
    return (place, int(n) if n.isdigit() else 0, int(w) if w.isdigit() else 0)


def regimes(
    names: Sequence[str], cell: NDArray[np.int32], cells: int
) -> tuple[list[tuple[str, ...]], NDArray[np.int16], Floats]:
    """Return the sets of kinds, the most frequent first; the set of each cell; their shares."""
    bounds = np.searchsorted(cell, np.arange(cells + 1))
    own = [
        tuple(sorted(set(names[low:high]), key=order)) or (UNDECIDED,)
        for low, high in itertools.pairwise(bounds)
    ]
    count = Counter(own)
    sets = sorted(count, key=lambda one: (-count[one], [order(name) for name in one]))
    place = {one: k for k, one in enumerate(sets)}
    share = np.array([count[one] / cells for one in sets])
    return sets, np.array([place[one] for one in own], dtype=np.int16), share


def kinds_of(raw: _core.ParameterMap) -> tuple[NDArray[np.str_], Indices]:
    """Return the kinds of all attractors, sorted, and the index of the kind of each."""
    each = zip(raw.kind, raw.n.tolist(), raw.w.tolist(), strict=True)
    names = np.array([kind_of(*one) for one in each], dtype=str)
    kinds, which = np.unique(names, return_inverse=True)
    return kinds, which


def entries(
    raw: _core.ParameterMap, kinds: NDArray[np.str_], kind: Indices, units: Units
) -> dict[str, Any]:
    """Return all attractors, each with the index of its kind, over ``entry``."""
    one, rate, speed = "entry", units.of_rate, units.of_velocity
    velocity = units.given(raw.velocity, VELOCITY)
    growth, error = (units.given(each, RATE) for each in (raw.exponent, raw.exponent_stderr))
    none, place = "0: no meaning", "cell of the whole result, row by row"
    meanings = dict(enumerate(kinds.tolist()))
    return {
        "entry_cell": variable(one, raw.cell, "1", place),
        "entry_kind": variable(one, kind.astype(np.int16), "", "kind of attractor", flags=meanings),
        "entry_n": variable(one, raw.n, "periods", "period n", none),
        "entry_w": variable(one, raw.w, "turns", "net turns w over a period"),
        **point(one, raw.theta, velocity, speed, "entry_{}"),
        "entry_exponent": variable(one, growth, rate, "largest Lyapunov exponent"),
        "entry_exponent_stderr": variable(one, error, rate, "standard error of the exponent"),
        "entry_share": variable(one, raw.share, "1", "share of the starts"),
    }


def shares(
    raw: _core.ParameterMap, dims: tuple[Hashable, ...], shape: tuple[int, ...]
) -> dict[str, Any]:
    """Return the shares of undecided and failed starts, and how long chaos was followed."""
    lost, failed, watched = (
        each.reshape(shape) for each in (raw.undecided, raw.failed, raw.chaos_periods)
    )
    return {
        "undecided": variable(dims, lost, "1", "share of the starts that no attractor captured"),
        "failed": variable(dims, failed, "1", "share of the starts that failed or diverged"),
        "chaos_periods": variable(dims, watched, "periods", *CHAOS_PERIODS),
    }


def chaos(attributes: Mapping[str, Any]) -> list[str]:
    """Return a summary line on how long chaos was followed, if there is any."""
    periods = attributes["least_chaos_periods"]
    if not periods:
        return []
    line = (
        f"Chaos: not captured within {counted(periods, 'period')} (the smallest of all cells; "
        "chaos_periods contains each); a longer transient looks the same."
    )
    return [line]


def undecided(attributes: Mapping[str, Any]) -> list[str]:
    """Return summary lines on the shares of undecided and failed starts."""
    return [
        f"{100 * attributes[f'{key}_share']:.3g} % of the starts {word}."
        for key, word in (("undecided", "undecided"), ("failed", "failed or diverged"))
        if attributes[f"{key}_share"] > 0
    ]


SEARCH = (
    Field("starts", "1", "initial conditions of each pendulum"),
    Found(
        "undecided",
        "1",
        "share of the starts that no attractor captured",
        variable="undecided_share",
    ),
    Found("failed", "1", "share of the starts that failed or diverged", variable="failed_share"),
    Found(
        "chaos_periods",
        "periods",
        "least time for which chaos was not captured; 0: no chaos",
        variable="least_chaos_periods",
    ),
    *result.TIMED,
    result.REACHED,
    Field("undecided_at", "", "groups of cells with undecided starts", read=undecided_cells),
    *result.END,
    result.SECTION,
    *result.BOX,
    result.TOL.hidden,
    Found("searched_again", "1", "cells searched again for attractors of a neighbour", json=False),
    result.SEED.hidden,
    *result.VERSIONS,
)
"""Fields of a search for attractors in many pendulums."""
