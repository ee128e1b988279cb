"""Parameters that vary: their values, names and units; what of the drive is constant then."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap import _core
from pendmap.analysis.grid import ascending, coordinate, evenly
from pendmap.analysis.result import Field, Found, summarised
from pendmap.errors import MOST_CELLS, InputError, check_number, check_whole, short_repr
from pendmap.files import facts
from pendmap.files.variables import variable
from pendmap.formatting import span
from pendmap.model import Effect, Rig, parse_model, without_dimensions
from pendmap.model.effects import effects
from pendmap.model.labels import LABELS
from pendmap.model.quantities import COUNTERPARTS, amplitude, check

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    import xarray as xr
    from numpy.typing import ArrayLike

    from pendmap.analysis.result import Schema
    from pendmap.model import Pendulum
    from pendmap.signal import Floats

DRIVE: Final = (
    Field("kept", "", "p or stroke_mm: what of the drive is constant where its frequency varies"),
    Found("stroke_mm", "mm", "stroke Y that is constant where the frequency varies", None),
)
"""Fields of an analysis that may vary the frequency of the drive."""


@dataclasses.dataclass(frozen=True)
class Varied:
    """A parameter and its values: ascending, evenly spaced unless they were listed."""

    name: str  # one of those of :func:`pendmap.parameter_map`
    values: Floats  # in the units of the parameter
    parameter: str  # its name in the core
    bare: Floats  # the values without dimensions
    unit: str  # unit of the values; empty where they have none
    meaning: str
    along: tuple[Varied, ...] = ()  # parameters that vary with it, on the same dimension
    derived: bool = False
    """Whether it follows from a constant stroke; a factor of ``p`` of another axis has no name."""

    @property
    def every(self) -> tuple[Varied, ...]:
        """All parameters of the dimension."""
        return (self, *self.along)

    @property
    def kernel(self) -> list[tuple[str, list[float]]]:
        """Names and values as passed to the core."""
        return [(one.parameter, one.bare.tolist()) for one in self.every]

    @property
    def request(self) -> dict[str, list[float]]:
        """Names and values as a request to a store has them."""
        return {one.name: one.values.tolist() for one in self.every if not one.derived}

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of a quantity with these values."""
        return variable((), 0.0, self.unit or "1", self.meaning)[2]

    @property
    def coordinates(self) -> dict[str, Any]:
        """Coordinates of a dataset; those of several values of the first also have bounds."""
        x = self.values
        more = {one.name: (self.name, one.values, one.attributes) for one in self.along if one.name}
        known = {one.parameter: one for one in self.every}
        if "omega" in known and "p" in known and known["p"].name == "stroke_mm":
            more["p"] = self.name, known["p"].bare, variable((), 0.0, "1", LABELS["p"].meaning)[2]
        if x.size == 1:
            return {self.name: (self.name, x, self.attributes), **more}
        if evenly(x):
            half = 0.5 * (x[-1] - x[0]) / (x.size - 1)
            edges = np.linspace(x[0] - half, x[-1] + half, x.size + 1)
        else:
            middle = 0.5 * (x[1:] + x[:-1])
            edges = np.array([2 * x[0] - middle[0], *middle, 2 * x[-1] - middle[-1]])
        return {**coordinate(self.name, x, edges, **self.attributes), **more}


def varied(
    model: Pendulum | Rig, ranges: Mapping[str, ArrayLike], count: int
) -> tuple[Varied, ...]:
    """Return the ``count`` axes along which parameters vary; values that fall are turned round."""
    curves = _curves(ranges, count)
    if len(curves) != count:
        given = ", ".join(map(str, ranges)) if isinstance(ranges, Mapping) else short_repr(ranges)
        both = ", 'omega': (0.5, 3.0, 100)", " --omega 0.5:3:100"
        second, more = both if count > 1 else ("", "")
        raise InputError(
            f"ranges must be a mapping like {{'p': (0.5, 2.0, 100){second}}}, or on the command "
            f"line --p 0.5:2:100{more}; got {given or 'nothing'}"
        )
    axes = tuple(_axis(model, curve) for curve in curves)
    every = _every(axes)
    first = {one.parameter: one for one in reversed(every)}
    for one in every:
        if (same := first[one.parameter]) is not one:
            raise InputError(f"{same.name} and {one.name} must be two parameters, they are one")
    axes = _with_stroke(model, axes)
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


def complete(  # noqa: PLR0913, PLR0917 (the parts of a result)
    schema: Schema,
    dataset: xr.Dataset,
    model: Pendulum | Rig,
    axes: Sequence[Varied],
    values: Mapping[str, Any],
    raw: object = None,
    *,
    summary: Callable[[xr.Dataset], list[str]],
    what: str,
) -> None:
    """Set the facts, the title and the summary of a result over parameters."""
    every, known = _every(axes), _kept(model, axes)
    replaced = [one.parameter for one in every]
    replaced += [COUNTERPARTS[name][0] for name in replaced if name in COUNTERPARTS]
    schema.complete(dataset, model, {**known, **values}, raw, replaced)
    named = [one for one in every if one.name]
    spans = [f"{span(one.name, *one.values[[0, -1]])} {one.unit}".rstrip() for one in named]
    rest = title_without(model, *(one.parameter for one in every))
    dataset.attrs["title"] = " and ".join(spans) + (f"; otherwise {rest}" if rest else "")
    lines = summary(dataset)
    if known["stroke_mm"] is not None and model.p:
        p = next(one.values for one in every if one.parameter == "p")
        stroke = span("The stroke Y", known["stroke_mm"], known["stroke_mm"])
        by = span("p", p.min(), p.max())
        lines.append(f"{stroke} mm is constant: {by} by p = Y Omega^2/g.")
    elif known["kept"] and isinstance(model, Rig) and model.p:
        lines.append(
            f"{span('p', model.p, model.p)} is constant, as the model gives it: not the stroke."
        )
    pendulum, _ = without_dimensions(model)
    least = {one.parameter: float(one.bare.min()) for one in every}
    damping = [least.get(name, getattr(pendulum, name)) for name in ("gamma", "theta_r")]
    if not any([*damping, *(effect.brakes for effect in model.effects)]):
        lines.append(
            "Without damping (gamma = 0) there are no attractors: such starts stay undecided."
        )
    summarised(dataset, lines, model, what)


def having(model: Pendulum | Rig, ranges: Mapping[str, ArrayLike]) -> Pendulum | Rig:
    """Return the model with each effect that it lacks and whose only parameter varies."""
    varying = {name for curve in _curves(ranges, 0) for name in curve}
    there = {effect.name for effect in model.effects}
    numbers = without_dimensions(model)[0].numbers()  # gamma and theta_r are effects, too
    lacking = (one for one in effects() if one.name not in there and len(one.parameters) == 1)
    pairs = [(one.name, one.parameters[0].name) for one in lacking]
    new = [(e, p) for e, p in pairs if p not in numbers and f"{e}.{p}" in varying]
    added = [Effect(name, {parameter: 0.0}) for name, parameter in new]
    return dataclasses.replace(model, effects=(*model.effects, *added))


def title_without(model: Pendulum | Rig, *names: str) -> str:
    """Return the model in one line without some of its parameters, by the core's names."""
    whole = [effect.title(model.units) for effect in model.effects]
    bare_title = model.title.removesuffix(", ".join(whole)).removesuffix(", ")
    both = [(name, COUNTERPARTS[name][0]) for name in names if name in COUNTERPARTS]
    symbols = {LABELS[name].symbol for pair in both for name in pair}
    parts = [part for part in bare_title.split(", ") if part.partition(" = ")[0] not in symbols]
    return ", ".join([*parts, *(effect.title(model.units, names) for effect in model.effects)])


def _every(axes: Iterable[Varied]) -> list[Varied]:
    """Return the parameters of all axes."""
    return [one for axis in axes for one in axis.every]


def _curves(ranges: object, count: int) -> list[dict[str, Any]]:
    """Return names and values of the parameters of each axis."""
    if not isinstance(ranges, Mapping):
        return []
    if count == 1 and not any(isinstance(values, tuple | Mapping) for values in ranges.values()):
        ranges = {"": ranges}
    curves = ({n: x} if not isinstance(x, Mapping) else dict(x) for n, x in ranges.items())
    return [curve for curve in curves if curve]


def _kept(model: Pendulum | Rig, axes: Sequence[Varied]) -> dict[str, Any]:
    """Return the facts :data:`DRIVE`, None where the frequency is constant or ``p`` varies."""
    every = _every(axes)
    derived = [one.derived for one in every if one.parameter == "p"]
    if all(one.parameter != "omega" for one in every) or not all(derived):
        return {"kept": None, "stroke_mm": None}
    if derived and isinstance(model, Rig) and model.given_stroke is not None:
        return {"kept": "stroke_mm", "stroke_mm": 1e3 * model.given_stroke}
    return {"kept": "p", "stroke_mm": None}


def _with_stroke(model: Pendulum | Rig, axes: tuple[Varied, ...]) -> tuple[Varied, ...]:
    """Return axes with ``p`` where the frequency varies and the stroke is given, or varies too."""
    every = {one.parameter: one for one in _every(axes)}
    omega, p = every.get("omega"), every.get("p")
    varies = p is not None and p.name == "stroke_mm"
    if not isinstance(model, Rig) or not (varies or (p is None and model.given_stroke is not None)):
        return axes
    if omega is None:
        if varies and model.Omega == 0:
            raise InputError("stroke_mm needs a frequency: Omega or frequency_hz must be given")
        return axes
    scale = {"frequency_hz": math.tau, "omega": model.w0}.get(omega.name, 1.0)
    gravity, speeds = model.gravity, (scale * omega.values).tolist()

    def amplitudes(metres: Floats) -> Floats:
        both = zip(metres.tolist(), speeds, strict=True)
        return np.array([amplitude(y, speed, gravity) for y, speed in both])

    with_omega = next(axis for axis in axes if any(one is omega for one in axis.every))
    changed, more = p, []
    if p is None:
        bare = amplitudes(np.full(len(speeds), model.given_stroke))
        more = [Varied("p", bare, "p", bare, "", LABELS["p"].meaning, derived=True)]
    elif any(one is p for one in with_omega.every):
        changed = dataclasses.replace(p, bare=amplitudes(1e-3 * p.values))
    else:  # p is a product: of the stroke in m, and of Omega^2 / g
        changed = dataclasses.replace(p, bare=1e-3 * p.values)
        bare = amplitudes(np.ones(len(speeds)))
        more = [Varied("", bare, "p", bare, "", LABELS["p"].meaning, derived=True)]
    new_axes = []
    for axis in axes:
        first, *along = [changed if one is p and changed else one for one in axis.every]
        along += more if axis is with_omega else []
        new_axes.append(dataclasses.replace(first, along=tuple(along)))
    return tuple(new_axes)


def _axis(model: Pendulum | Rig, curve: Mapping[str, Any]) -> Varied:
    """Return the parameters of one dimension; the first of a curve rises, or is turned round."""
    name, given = next(iter(curve.items()))
    if len(curve) == 1 and isinstance(given, tuple):
        return _one(model, name, _values(name, given))
    arrays = {one: ascending(one, values, any_order=True) for one, values in curve.items()}
    count, order = arrays[name].size, -1 if arrays[name][0] > arrays[name][-1] else 1
    for one, x in arrays.items():
        if x.size != count:
            raise InputError(f"{one} must have as many values as {name}, {count}, got {x.size}")
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
        pairs = {bare: COUNTERPARTS[bare] for bare in ("gamma", "omega", "phase", "theta_r")}
        conversions |= {si: (bare, 1.0, power) for bare, (si, power) in pairs.items()}
        conversions["frequency_hz"] = ("omega", math.tau, 1)
        conversions["stroke_mm"] = ("p", 1e-3 * model.Omega**2 / model.gravity, 0)
    effects = {e.name: e for e in model.effects}
    shared = [f"{e.name}.{parameter}" for e in model.effects for parameter in e.parameters]
    if name not in conversions and name not in shared:
        raise InputError(
            f"{short_repr(name)} is no parameter of this model: it must be one of "
            f"{', '.join([*conversions, *shared])}, or EFFECT.PARAMETER as pendmap effects lists"
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
        bare, (which, parameter) = name, name.split(".", 1)
        definition = effects[which].definition
        if units.si and any(one.power_of_w0_less == parameter for one in definition.parameters):
            raise InputError(
                f"{name} changes the units of others: the model must be one without dimensions"
            )
        old = effects[which].parameters
        one = dataclasses.replace(effects[which], ci95={})
        changed = [
            dataclasses.replace(one, parameters={**old, parameter: float(x)}) for x in values
        ]
        plain = np.array([effect.bare(units).parameters[parameter] for effect in changed])
        unit = definition[parameter].unit if units.si else ""
        meaning = f"{parameter} of {which}: {definition[parameter].meaning}"
    if known.count(bare) > 1:
        raise InputError(f"{name} must be in the model once, got it {known.count(bare)} times")
    return Varied(name, values, bare, plain, unit, meaning)


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
    there = (name for name in names if name in dataset.coords and name in stored)
    chosen = {name: float(stored[name]) for name in there if known.get(name) != stored[name]}
    plain = {name: x for name, x in chosen.items() if name in LABELS}
    model = parse_model(text, "dataset", plain) if plain else model
    return with_values(model, chosen) if len(chosen) > len(plain) else model


def with_values(model: Pendulum | Rig, values: Mapping[str, float]) -> Pendulum | Rig:
    """Return the model with these parameters; its effects without their intervals."""
    numbers: dict[str, Any] = {name: x for name, x in values.items() if name in model.numbers()}
    effects = []
    for one in model.effects:
        changed = {name: values.get(f"{one.name}.{name}", x) for name, x in one.parameters.items()}
        effects.append(dataclasses.replace(one, parameters=changed, ci95={}))
    return dataclasses.replace(model, **numbers, effects=tuple(effects))
