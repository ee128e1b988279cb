"""Parameters that vary, and the search for attractors at each of their values."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.ndimage import find_objects, label

from pendmap import _core
from pendmap.analysis import result
from pendmap.analysis.grid import Grid, coordinate
from pendmap.analysis.result import Field
from pendmap.errors import (
    MOST_CELLS,
    InputError,
    check_number,
    check_type,
    check_whole,
    short_repr,
)
from pendmap.model import without_dimensions
from pendmap.model.labels import LABELS
from pendmap.model.quantities import COUNTERPARTS, check
from pendmap.model.rig import Rig
from pendmap.units import VELOCITY

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from pendmap.analysis.numerics import Numerics
    from pendmap.model import Pendulum
    from pendmap.units import Units


@dataclasses.dataclass(frozen=True)
class Varied:
    """A parameter and the values that it takes: ascending, evenly spaced."""

    name: str
    """Name of the parameter, one of those of :func:`pendmap.parameter_map`."""
    values: NDArray[np.float64]
    """Values in the units of the parameter."""
    parameter: str
    """Name of the parameter in the core."""
    bare: NDArray[np.float64]
    """The values without dimensions."""
    unit: str
    """Unit of the values; empty where they have none."""

    @property
    def kernel(self) -> tuple[str, list[float]]:
        """Name and values as passed to the core."""
        return self.parameter, self.bare.tolist()

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of a quantity with these values."""
        return {"units": self.unit or "1", "long_name": self.name}

    @property
    def coordinates(self) -> dict[str, Any]:
        """Coordinate of a dataset; with more than one value also their bounds."""
        x = self.values
        if x.size == 1:
            return {self.name: (self.name, x, self.attributes)}
        half = 0.5 * (x[-1] - x[0]) / (x.size - 1)
        edges = np.linspace(x[0] - half, x[-1] + half, x.size + 1)
        return coordinate(self.name, x, edges, **self.attributes)


def varied(
    model: Pendulum | Rig, ranges: Mapping[str, Sequence[float]], count: int
) -> tuple[Varied, ...]:
    """Return the ``count`` parameters that vary, from their first and last value and number."""
    if not isinstance(ranges, dict) or len(ranges) != count:
        given = ", ".join(map(str, ranges)) if isinstance(ranges, dict) else short_repr(ranges)
        example = {"p": (0.5, 2.0, 100), "omega": (0.5, 3.0, 100)}
        few = dict(list(example.items())[:count])
        raise InputError(f"ranges must be a mapping like {few}, got {given or 'nothing'}")
    found = tuple(_one(model, name, given) for name, given in ranges.items())
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


def _one(model: Pendulum | Rig, name: str, given: object) -> Varied:
    pendulum, units = without_dimensions(model)
    known = _core.parameter_names(pendulum)
    powers: dict[str, tuple[str, float]] = {bare: (bare, 0) for bare in known if "." not in bare}
    # Parameter of the rig that each laboratory quantity changes, and the factor.
    laboratory: dict[str, tuple[str, float]] = {}
    if isinstance(model, Rig):
        laboratory["frequency_hz"] = ("Omega", math.tau)
        if model.Omega > 0:  # a stroke is an acceleration only at a known frequency
            laboratory["stroke_mm"] = ("p", 1e-3 * model.Omega**2 / model.gravity)
        own = {si: (bare, power) for bare, (si, power) in COUNTERPARTS.items()}
        powers |= {si: own[si] for si in ("c_over_m", "Omega", "phi", "Tr")}
        powers |= {name: own[si] for name, (si, _) in laboratory.items()}
    effects = {e.name: e for e in model.effects}
    shared = [f"{e.name}.{parameter}" for e in model.effects for parameter in e.parameters]
    if name not in powers and name not in shared:
        there = ", ".join([*powers, *shared])
        raise InputError(
            f"{short_repr(name)} is no parameter of this model: it must be one of {there}"
        )
    values = _values(name, given)
    if name in powers:
        bare, power = powers[name]
        factor = 1.0
        if name in laboratory:
            check(name, values[0])
            factor = laboratory[name][1]
        plain = units.bare(factor * values, power)
        # ``torque`` has no dimensions here, also for a rig.
        unit = "" if name == "torque" else LABELS[name].unit.replace("^", "")
    else:
        bare, unit = name, ""
        which, parameter = name.split(".", 1)
        entries = effects[which].definition["parameters"]
        if units.si and any(entry["power_of_w0_less"] == parameter for entry in entries):
            raise InputError(
                f"{name} changes the units of others: the model must be one without dimensions"
            )
        one = dataclasses.replace(effects[which], ci95={})
        changed = ({**one.parameters, parameter: float(x)} for x in values)
        bared = [dataclasses.replace(one, parameters=own).bare(units) for own in changed]
        plain = np.array([effect.parameters[parameter] for effect in bared])
        if units.si:
            unit = next(entry["unit"] for entry in entries if entry["name"] == parameter)
    if known.count(bare) > 1:
        raise InputError(f"{name} must be in the model once, got it {known.count(bare)} times")
    return Varied(name, values, bare, plain, unit)


def _values(name: str, given: object) -> NDArray[np.float64]:
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


STARTS = 9  # Default number of initial conditions of a cell
_SPREAD = 1000  # Cells on each side of the default box, without effect
_PLASTIC = 1.324717957244746
"""Plastic number, whose powers give an even additive recurrence in two dimensions."""
_CELLS = 61  # Cells after which initial conditions repeat: a prime, so that columns differ too


def spread(grid: Grid, count: int, seed: int = 0) -> tuple[NDArray[np.float64], ...]:
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

    def within(self, units: Units) -> Grid:
        """Return the box, in these units; by default that of :func:`pendmap.basins`."""
        return self.box or Grid.square(_SPREAD, units.given(1.0, VELOCITY))

    def initial(self, units: Units) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return initial conditions without dimensions; each cell takes the next ``starts``."""
        theta, velocity = spread(self.within(units), _CELLS * self.starts, self.numerics.seed)
        return theta, units.bare(velocity, VELOCITY)

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


SEARCH = (
    Field("starts", "1", "initial conditions of each pendulum"),
    Field("undecided", "1", "share of the starts that no attractor captured"),
    Field("failed", "1", "share of the starts that failed or diverged"),
    Field("chaos_periods", "periods", "least time for which chaos was not captured; 0: no chaos"),
    result.SECONDS,
    result.SIMD,
    result.THREADS,
    result.REACHED,
    Field("undecided_at", "", "groups of cells with undecided starts", read=undecided_cells),
    *result.END,
    result.SECTION,
    *result.BOX,
    result.TOL.hidden,
    Field("searched_again", "1", "cells searched again for attractors of a neighbour", json=False),
    result.SEED.hidden,
    *result.VERSIONS,
)
"""Fields of a search for attractors in many pendulums."""
