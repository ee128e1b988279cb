"""The library of effects as ``pendmap.effects()`` returns it."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from pendmap.model.effects import library

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pendmap.model.formula import Formula


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


def effects() -> list[EffectDefinition]:
    """Return the definitions of the library's effects, which are written in Rust.

    Examples
    --------
    >>> import pendmap
    >>> [effect.formula for effect in pendmap.effects() if effect.name == "quadratic_drag"]
    ['-q v |v|']
    """
    return [_effect(entry) for entry in library().values()]


def of_formulas(formulas: Iterable[Formula]) -> list[EffectDefinition]:
    """Return the definitions of formulas of the user's own."""
    return [_effect(formula.entry) for formula in formulas]


def _effect(entry: dict[str, Any]) -> EffectDefinition:
    return EffectDefinition(**entry | {"parameters": tuple(map(_parameter, entry["parameters"]))})


def _parameter(entry: dict[str, Any]) -> EffectParameter:
    return EffectParameter(**entry | {key: tuple(entry[key]) for key in ("range", "typical")})
