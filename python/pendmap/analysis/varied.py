"""Parameters that vary: their values, names and units."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap import _core
from pendmap.analysis.along import Varied, drive_said, with_stroke
from pendmap.analysis.grid import ascending
from pendmap.errors import (
    MOST_CELLS,
    InputError,
    check_number,
    check_whole,
    short_repr,
)
from pendmap.files import facts
from pendmap.model import Effect, parse_model, without_dimensions
from pendmap.model.effects import effects
from pendmap.model.labels import LABELS
from pendmap.model.quantities import COUNTERPARTS, check
from pendmap.model.rig import Rig

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from numpy.typing import ArrayLike

    from pendmap.model import Pendulum
    from pendmap.signal import Floats


def varied(
    model: Pendulum | Rig, ranges: Mapping[str, ArrayLike], count: int
) -> tuple[Varied, ...]:
    """Return the ``count`` axes along which parameters vary.

    A tuple has the first value, the last and their number; a mapping has arrays of one length, one
    axis of several parameters; anything else is an array of values. Values that fall are turned
    round: no result depends on their direction.
    """
    curves = _curves(ranges, count)
    if len(curves) != count:
        given = ", ".join(map(str, ranges)) if isinstance(ranges, Mapping) else short_repr(ranges)
        example = {"p": (0.5, 2.0, 100), "omega": (0.5, 3.0, 100)}
        few = dict(list(example.items())[:count])
        options = " ".join(f"--{name} {low:g}:{high:g}:{n}" for name, (low, high, n) in few.items())
        raise InputError(
            f"ranges must be a mapping like {few}, or on the command line {options}; "
            f"got {given or 'nothing'}"
        )
    axes = tuple(_axis(model, curve) for curve in curves)
    every = [one for axis in axes for one in axis.every]
    first = {one.parameter: one for one in reversed(every)}
    for one in every:
        if (same := first[one.parameter]) is not one:
            raise InputError(f"{same.name} and {one.name} must be two parameters, they are one")
    axes = with_stroke(model, axes)
    pendulum, _ = without_dimensions(model)
    for axis in axes:
        for one in axis.every:
            for at in (one.bare.argmin(), one.bare.argmax()):
                value, units = one.values[at], f" (without dimensions, w0 is {model.units.w0:g})"
                try:
                    with_values(pendulum, {n: x[at] for n, x in axis.kernel})
                except InputError as error:
                    reason = f"{error}{'' if value == one.bare[at] else units}"
                    raise InputError(f"{one.name} = {value:g}: {reason}") from None
    return axes


def _curves(ranges: object, count: int) -> list[dict[str, Any]]:
    """Return names and values of the parameters of each axis."""
    if not isinstance(ranges, Mapping):
        return []
    if count == 1 and not any(isinstance(values, tuple | Mapping) for values in ranges.values()):
        ranges = {"": ranges}
    curves = (
        values if isinstance(values, Mapping) else {name: values} for name, values in ranges.items()
    )
    return [dict(curve) for curve in curves if curve]


def requested(axes: Sequence[Varied], ranges: Mapping[str, ArrayLike]) -> dict[str, Any]:
    """Return ranges as a request to a store has them: tuples with the lower end first, or lists."""
    request: dict[str, Any] = {}
    for axis in axes:
        every = {one.name: one.values.tolist() for one in axis.every if not one.derived}
        given = ranges.get(axis.name)
        one = (*sorted(given[:2]), given[2]) if isinstance(given, tuple) else every[axis.name]
        request[axis.name] = every if len(every) > 1 else one
    return request


def having(model: Pendulum | Rig, ranges: Mapping[str, ArrayLike]) -> Pendulum | Rig:
    """Return the model with each effect that it lacks and whose only parameter varies."""
    there = {effect.name for effect in model.effects}
    numbers = without_dimensions(model)[0].numbers()  # gamma and theta_r are effects, too
    lacking = {
        f"{one.name}.{one.parameters[0].name}": Effect(one.name, {one.parameters[0].name: 0.0})
        for one in effects()
        if one.name not in there
        and len(one.parameters) == 1
        and one.parameters[0].name not in numbers
    }
    names = [name for curve in _curves(ranges, 0) for name in curve]
    new = (lacking[name] for name in names if name in lacking)
    return dataclasses.replace(model, effects=(*model.effects, *new))


def title(model: Pendulum | Rig, *axes: Varied) -> str:
    """Return one line: the ranges of the parameters that vary, and the other parameters."""
    every = [one for axis in axes for one in axis.every]
    ends = ((a, a.values[[0, -1]]) for a in every if a.name)
    spans = [f"{a.name} = {low:g} to {high:g} {a.unit}".rstrip() for a, (low, high) in ends]
    rest = title_without(model, *(a.parameter for a in every))
    return " and ".join(spans) + (f"; otherwise {rest}" if rest else "")


def title_without(model: Pendulum | Rig, *names: str) -> str:
    """Return the model in one line without some of its parameters, by the core's names."""
    whole = [effect.title(model.units) for effect in model.effects]
    bare_title = model.title.removesuffix(", ".join(whole)).removesuffix(", ")
    both = [(name, COUNTERPARTS[name][0]) for name in names if name in COUNTERPARTS]
    symbols = {LABELS[name].symbol for pair in both for name in pair}
    parts = [part for part in bare_title.split(", ") if part.partition(" = ")[0] not in symbols]
    return ", ".join([*parts, *(effect.title(model.units, names) for effect in model.effects)])


def remarks(model: Pendulum | Rig, *axes: Varied) -> list[str]:
    """Return summary lines on what of the drive is constant, and on a lack of damping."""
    lines = drive_said(model, axes)
    pendulum, _ = without_dimensions(model)
    least = {one.parameter: float(one.bare.min()) for axis in axes for one in axis.every}
    damping = [least.get(name, getattr(pendulum, name)) for name in ("gamma", "theta_r")]
    if not any([*damping, *(effect.brakes for effect in model.effects)]):
        lines.append(
            "Without damping (gamma = 0) there are no attractors: such starts stay undecided."
        )
    return lines


def _axis(model: Pendulum | Rig, curve: Mapping[str, Any]) -> Varied:
    """Return the parameters of one dimension; the first of a curve rises, or is turned round."""
    name, given = next(iter(curve.items()))
    if len(curve) == 1 and isinstance(given, tuple):
        return _one(model, name, _values(name, given))
    arrays = {one: ascending(one, values, any_order=True) for one, values in curve.items()}
    count, order = arrays[name].size, -1 if arrays[name][0] > arrays[name][-1] else 1
    for one, array in arrays.items():
        if array.size != count:
            raise InputError(f"{one} must have as many values as {name}, {count}, got {array.size}")
    first, *along = (_one(model, one, values[::order]) for one, values in arrays.items())
    if not (np.diff(first.values) > 0).all():
        raise InputError(f"{name} must be ascending or descending values, got {short_repr(given)}")
    return dataclasses.replace(first, along=tuple(along))


def _one(model: Pendulum | Rig, name: str, values: Floats) -> Varied:
    pendulum, units = without_dimensions(model)
    known = _core.parameter_names(pendulum)
    # Name in the core, factor and power of w0 of each quantity.
    conversions = {bare: (bare, 1.0, 0) for bare in known if "." not in bare}
    if isinstance(model, Rig):
        for bare in ("gamma", "omega", "phase", "theta_r"):
            si, power = COUNTERPARTS[bare]
            conversions[si] = (bare, 1.0, power)
        conversions["frequency_hz"] = ("omega", math.tau, 1)
        conversions["stroke_mm"] = ("p", 1e-3 * model.Omega**2 / model.gravity, 0)
    effects = {e.name: e for e in model.effects}
    shared = [f"{e.name}.{parameter}" for e in model.effects for parameter in e.parameters]
    if name not in conversions and name not in shared:
        there = ", ".join([*conversions, *shared])
        raise InputError(
            f"{short_repr(name)} is no parameter of this model: it must be one of {there}"
            f"{_of_effect(name)}"
        )
    if name in conversions:
        bare, factor, power = conversions[name]
        if name in {"frequency_hz", "stroke_mm"}:
            check(name, values.min())
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


def _of_effect(name: str) -> str:
    """Return what else a name like EFFECT.PARAMETER may be."""
    which = name.partition(".")[0]
    known = next((one for one in effects() if one.name == which), None)
    if known is None:
        return ""
    has = ", ".join(f"{which}.{one.name}" for one in known.parameters)
    return f"; {which} has {has}" + ("" if len(known.parameters) == 1 else " if it is in the model")


def _values(name: str, given: tuple[Any, ...]) -> Floats:
    wanted = f"{name} must be (first, last, how many), like {name}=(0.5, 2.0, 100)"
    if len(given) != 3:  # noqa: PLR2004
        raise InputError(f"{wanted}, got {short_repr(given)}")
    low, high = sorted(check_number(name, end) for end in given[:2])
    count = check_whole(f"{name}: how many", given[2], 1, MOST_CELLS)
    if not (low < high and math.isfinite(high - low)) and not (count == 1 and low == high):
        raise InputError(f"{wanted}, two finite values a finite distance apart, got {given[:2]}")
    if count == 1 and low < high:
        raise InputError(f"{name} is {low:g} to {high:g}: one value has one bound")
    return np.linspace(low, high, count)


def pendulum_of(dataset: xr.Dataset) -> Pendulum | Rig:
    """Return the model that made a result, with its effects, formulas and notes.

    Of a sweep or a map over parameters it is the model given; where one value of a parameter that
    varies was selected, the model with that value.

    Parameters
    ----------
    dataset : xarray.Dataset
        A result of any analysis, or a selection of it.

    Returns
    -------
    Pendulum or Rig
        Equal to the model given: a :class:`pendmap.Rig` for a result in SI.

    Raises
    ------
    InputError
        If it is not a result of pendmap.

    Examples
    --------
    >>> import pendmap
    >>> made = pendmap.Pendulum(gamma=0.1, p=0.6, omega=2.0)
    >>> pendmap.pendulum_of(pendmap.simulate(made, 1.0, 0.0, 5.0)) == made
    True
    >>> result = pendmap.sweep(made, {"p": (0.4, 0.7, 4)}, grid=10, check=False)
    >>> pendmap.pendulum_of(result.isel(p=-1)).p
    0.7
    """
    text = getattr(dataset, "attrs", {}).get("model")
    if not isinstance(text, str):
        raise InputError(f"dataset must be a result of pendmap, got {short_repr(type(dataset))}")
    model = parse_model(text, "dataset")
    known, stored = model.attributes, facts(dataset)
    names = [*LABELS, *(f"{e.name}.{p}" for e in model.effects for p in e.parameters)]
    chosen = {
        name: float(stored[name])
        for name in names
        if name in dataset.coords and name in stored and known.get(name) != stored[name]
    }
    of_effects = {name: x for name, x in chosen.items() if name not in LABELS}
    if len(chosen) > len(of_effects):
        plain = {name: x for name, x in chosen.items() if name in LABELS}
        model = parse_model(text, "dataset", plain)
    return with_values(model, of_effects) if of_effects else model


def with_values(model: Pendulum | Rig, values: Mapping[str, float]) -> Pendulum | Rig:
    """Return the model with these parameters; its effects without their intervals."""
    numbers = {name: x for name, x in values.items() if name in model.numbers()}
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
    changed: dict[str, Any] = {**numbers, "effects": effects}
    return dataclasses.replace(model, **changed)
