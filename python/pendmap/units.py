"""Units: conversion between SI and nondimensional numbers, and the names of both."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Mapping


TIME, VELOCITY, RATE = -1, 1, 1  # Powers of ``w0`` of a time, a velocity and an exponent


class _Word:
    """A word that depends on the units: without dimensions, or in SI."""

    def __init__(self, bare: str, si: str) -> None:
        self._bare, self._si = bare, si

    def __get__(self, units: Units | None, owner: type[Units]) -> str:
        return self._bare if units is None or not units.si else self._si


@dataclasses.dataclass(frozen=True)
class Units:
    """Units of a result's numbers.

    A number in SI is the nondimensional one times a power of ``w0``: times have the power -1 (``tau
    = w0 t``), velocities and exponents 1, accelerations 2. Angles are in rad either way.
    """

    w0: float = 1.0  # sqrt(g / l), rad/s; 1 if nondimensional
    si: bool = False  # whether results are in SI

    name = _Word("nondimensional", "SI")  # The attribute ``units`` of a dataset
    clock = _Word("tau", "t")  # Symbol of time
    derivative = _Word("dtheta/dtau", "dtheta/dt")  # Symbol of the velocity
    of_time = _Word("1 / w0", "s")
    of_velocity = _Word("1", "rad/s")
    of_rate = _Word("1 per tau", "1/s")  # Unit of rates, such as Lyapunov exponents
    per_time = _Word("per unit of tau", "per second")  # Unit of an exponent, in words
    own_period = _Word("2 pi", "2 pi / w0")  # Period of small oscillations, used without drive

    def given(self, value: Any, power: float) -> Any:  # noqa: ANN401 (a number, or an array)
        """Convert a nondimensional number or array to these units."""
        return value * self.w0**power

    def bare(self, value: Any, power: float) -> Any:  # noqa: ANN401 (likewise)
        """Convert a number or array in these units to a nondimensional one."""
        return value / self.w0**power

    def spoken(self, velocity: str) -> str:
        """Return the text of a velocity with its unit, if it has one."""
        return f"{velocity} rad/s" if self.si else velocity

    def at(self, time: str) -> str:
        """Return ``tau = 5`` or ``t = 5 s``."""
        return f"{self.clock} = {self.seconds(time)}"

    def seconds(self, time: str) -> str:
        """Return the text of a time with its unit, if it has one."""
        return f"{time} s" if self.si else time

    @property
    def section(self) -> str:
        """Definition of the stroboscopic section."""
        period = f"2 pi / {'Omega' if self.si else 'omega'} ({self.own_period} without drive)"
        return f"{self.clock} = 0 mod T, T = {period}, at the drive's phase"

    @classmethod
    def of(cls, attributes: Mapping[Any, Any]) -> Units:
        """Return the units of a dataset with these attributes."""
        if attributes.get("units") == SI:
            return cls(float(attributes["w0"]), si=True)
        return NONDIMENSIONAL


SI: Final = Units(si=True).name
NONDIMENSIONAL: Final = Units()  # Units of :class:`pendmap.Pendulum`
