"""Effects of the library, with values for their parameters."""

from __future__ import annotations

import dataclasses
import difflib
import functools
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pendmap.errors import InputError, check_flag, check_keys, check_number, short_repr

if TYPE_CHECKING:
    from collections.abc import Collection

    from pendmap.units import Units


@dataclasses.dataclass(frozen=True)
class EffectParameter:
    """A parameter of an effect.

    Attributes
    ----------
    name : str
        Its key in model files.
    role : str
        ``size``, ``width``, ``place``, ``power``, ``order`` (times in a turn), ``time constant``,
        ``phase``, ``frequency``, ``instant`` or ``mode`` (of a mode of the rig).
    unit : str
        Its unit in SI.
    power_of_w0 : float
        Its value in SI is the one without dimensions times this power of ``w0``.
    power_of_w0_less : str or None
        Another parameter of the effect, whose value is subtracted from that power.
    range : (float, float)
        The least and the greatest value allowed, without dimensions.
    typical : (float, float)
        The smallest and the largest value of interest, without dimensions.
    meaning : str
        Description in words.
    """

    name: str
    role: str
    unit: str
    power_of_w0: float
    power_of_w0_less: str | None
    range: tuple[float, float]
    typical: tuple[float, float]
    meaning: str

    @property
    def is_shape(self) -> bool:
        """Whether it is neither the strength of an effect nor its phase."""
        return self.role not in {"size", "phase"}

    @property
    def middle(self) -> float:
        """The mean of a shape's typical range, geometric if the range is positive."""
        low, high = self.typical
        value = math.sqrt(low * high) if low > 0 else 0.5 * (low + high)
        return float(round(value)) if self.role == "order" else value


@dataclasses.dataclass(frozen=True)
class EffectDefinition:
    """Definition of an effect by the library.

    Attributes
    ----------
    name : str
        The field's standard term.
    group : str
        Where it acts: ``damping``, ``torque``, ``drive`` or ``reading``.
    family : str
        Effects that it is confused with: ``damping``, ``dry friction``, ``position torque``,
        ``drive`` or ``reading``.
    formula : str
        Its term on the right of ``th'' = ...``, per moment of inertia, with ``v = th'``; of a drive
        the motion of the pivot, of a reading that of the sensor.
    parameters : tuple of EffectParameter
        Its parameters, in order.
    mappable : str
        Whether a map over initial conditions can have it: ``yes``, ``frozen`` (with the time in the
        laboratory held) or ``no``.
    revealed_by : str
        Data that show it.
    """

    name: str
    group: str
    family: str
    formula: str
    parameters: tuple[EffectParameter, ...]
    mappable: str
    revealed_by: str

    @classmethod
    def of(cls, entry: dict[str, Any]) -> EffectDefinition:
        """Return the definition of an entry of the Rust core."""
        parameters = [
            EffectParameter(**part | {key: tuple(part[key]) for key in ("range", "typical")})
            for part in entry["parameters"]
        ]
        return cls(**entry | {"parameters": tuple(parameters)})

    def __getitem__(self, name: str) -> EffectParameter:
        """Return a parameter."""
        return {parameter.name: parameter for parameter in self.parameters}[name]

    @property
    def opposing(self) -> str | None:
        """Name of the size if the effect is damping whose size is 0 or more."""
        size = next(parameter for parameter in self.parameters if parameter.role == "size")
        return size.name if self.group == "damping" and size.typical[0] >= 0 else None


@functools.cache
def library() -> dict[str, EffectDefinition]:
    """Return the definitions of the library's effects by name, which are written in Rust."""
    from pendmap import _core  # noqa: PLC0415 (only models with effects need it)

    return {entry["name"]: EffectDefinition.of(entry) for entry in _core.effects()}


def effects() -> list[EffectDefinition]:
    """Return the definitions of the library's effects, which are written in Rust.

    Examples
    --------
    >>> import pendmap
    >>> [effect.formula for effect in pendmap.effects() if effect.name == "quadratic_drag"]
    ['-q v |v|']
    """
    return [*library().values()]


def definition(name: object) -> EffectDefinition:
    """Return the library's definition of an effect; raise InputError if there is none."""
    known = library()
    if not isinstance(name, str) or name not in known:
        near = difflib.get_close_matches(str(name), known, n=1)
        hint = f", perhaps {near[0]}" if near else ""
        raise InputError(
            f"name must be an effect of the library, got {short_repr(name)}{hint}; "
            "pendmap effects lists all"
        )
    return known[name]


@dataclasses.dataclass(frozen=True)
class Effect:
    """An effect of the library, or a formula, with values for its parameters.

    In a :class:`pendmap.Pendulum` its parameters are without dimensions, in a
    :class:`pendmap.Rig` in the SI units of its definition; each is the one without dimensions
    times a power of ``w0``.

    Parameters
    ----------
    name : str
        Effect of the library (``pendmap effects``), like ``quadratic_drag``.
    parameters : mapping of str to float
        A value for each of its parameters.
    ci95 : mapping of str to (float, float), optional
        95 % intervals of fitted parameters.
    probability : float, optional
        Probability that the name of a diagnosed effect is right.
    approximate : bool, optional
        Whether its form is only nearly right.
    formula : Formula, optional
        The user's own formula, if the library has none of that name.

    Raises
    ------
    InputError
        If the library has no such effect, a parameter is missing, not known or not finite, or an
        interval is not valid.

    Examples
    --------
    >>> Effect("quadratic_drag", {"q": 0.01}).sizes
    ['q']
    """

    name: str
    parameters: Mapping[str, float]
    ci95: Mapping[str, tuple[float, float]] = dataclasses.field(default_factory=dict)
    probability: float | None = None
    approximate: bool | None = None
    formula: Any = None  # a Formula, which makes effects itself

    def __post_init__(self) -> None:
        if self.formula is not None and self.formula.name != self.name:
            raise InputError(f"name must be {self.formula.name}, got {short_repr(self.name)}")
        names = [parameter.name for parameter in self.definition.parameters]
        given = _mapping(f"{self.name}: parameters", self.parameters, names)
        missing = [name for name in names if name not in given]
        if missing:
            needed = ", ".join(
                f"{parameter.name} ({parameter.unit})" for parameter in self.definition.parameters
            )
            raise InputError(f"{self.name}: {missing[0]} is missing: it needs {needed}")
        values = {name: check_number(f"{self.name}: {name}", given[name]) for name in names}
        object.__setattr__(self, "parameters", values)
        given = _mapping(f"{self.name}: ci95", self.ci95, names)
        bounds = {n: _interval(f"{self.name}: ci95 of {n}", given[n]) for n in names if n in given}
        object.__setattr__(self, "ci95", bounds)
        if self.probability is not None:
            share = check_number(f"{self.name}: probability", self.probability)
            if not 0 <= share <= 1:
                raise InputError(
                    f"{self.name}: probability must be a number from 0 to 1, got {share:g}"
                )
            object.__setattr__(self, "probability", share)
        if self.approximate is not None:
            check_flag(f"{self.name}: approximate", self.approximate)

    def __hash__(self) -> int:
        return hash((self.name, *self.parameters.values()))

    @property
    def definition(self) -> EffectDefinition:
        """The definition by the library, or by the formula."""
        return definition(self.name) if self.formula is None else self.formula.definition

    @classmethod
    def blank(cls, name: str, units: Units) -> Effect:
        """Return an effect as the start of a search: smallest typical size, middle shape."""
        values = {
            parameter.name: float(f"{parameter.middle:.1g}")
            if parameter.is_shape
            else parameter.typical[0]
            for parameter in definition(name).parameters
        }
        return cls(name, values).given(units)

    @property
    def sizes(self) -> list[str]:
        """Names of the parameters that are its strength or the phase at which it acts."""
        return [
            parameter.name for parameter in self.definition.parameters if not parameter.is_shape
        ]

    @property
    def values(self) -> list[float]:
        """The parameters in the library's order."""
        return list(self.parameters.values())

    def held(self, names: Collection[str]) -> Effect:
        """Return it with its parameters among ``names`` (``EFFECT.PARAMETER``) at 0."""
        zeros = {n: 0.0 for n in self.parameters if f"{self.name}.{n}" in names}
        return dataclasses.replace(self, parameters={**self.parameters, **zeros})

    @property
    def drives(self) -> bool:
        """Whether it moves the pivot, or is a torque with the phase of the drive."""
        return self.definition.group == "drive"

    @property
    def brakes(self) -> bool:
        """Whether it is damping or friction."""
        return self.definition.group == "damping"

    @property
    def reads(self) -> bool:
        """Whether it changes the sensor's reading alone."""
        return self.definition.group == "reading"

    @property
    def drifts(self) -> bool:
        """Whether it changes with the time in the laboratory, which is fixed in maps."""
        return self.definition.mappable == "frozen"

    def title(self, units: Units, without: Collection[str] = ()) -> str:
        """Return name and parameters, those of ``without`` (``EFFECT.PARAMETER``) left out."""
        shown = []
        for parameter in self.definition.parameters:
            if f"{self.name}.{parameter.name}" in without:
                continue
            has_unit = units.si or (
                parameter.power_of_w0 == 0 and parameter.power_of_w0_less is None
            )
            unit = parameter.unit if has_unit and parameter.unit != "1" else ""
            shown.append(
                f"{parameter.name} = {self.parameters[parameter.name]:.4g} {unit}".rstrip()
            )
        return f"{self.name} ({', '.join(shown)})" if shown else self.name

    def given(self, units: Units) -> Effect:
        """Convert the effect, without dimensions, to ``units``."""
        return self._scaled(units.given)

    def bare(self, units: Units) -> Effect:
        """Convert the effect, in ``units``, to one without dimensions."""
        return self._scaled(units.bare)

    def _scaled(self, scale: Any) -> Effect:  # noqa: ANN401 (a method of Units)
        # Exponents have the power 0: they are the same in all units.
        powers = {
            parameter.name: parameter.power_of_w0
            - self.parameters.get(parameter.power_of_w0_less or "", 0)
            for parameter in self.definition.parameters
        }
        return dataclasses.replace(
            self,
            parameters={n: scale(value, powers[n]) for n, value in self.parameters.items()},
            ci95={n: (scale(a, powers[n]), scale(b, powers[n])) for n, (a, b) in self.ci95.items()},
        )


def is_driven(p: float, effects: tuple[Effect, ...]) -> bool:
    """Return whether the pivot's motion or an effect drives the pendulum."""
    return p != 0 or any(effect.drives for effect in effects)


def _mapping(what: str, value: object, names: list[str]) -> Mapping[str, object]:
    if not isinstance(value, Mapping):
        raise InputError(f"{what} must be a mapping of {', '.join(names)}, got {short_repr(value)}")
    check_keys(f"{what}: ", value, names)
    return value


def _interval(what: str, value: object) -> tuple[float, float]:
    if not isinstance(value, list | tuple) or len(value) != 2:  # noqa: PLR2004
        raise InputError(f"{what} must be [low, high], got {short_repr(value)}")
    low, high = (check_number(what, bound) for bound in value)
    if low > high:
        raise InputError(f"{what} must be [low, high], the lower first, got [{low:g}, {high:g}]")
    return low, high
