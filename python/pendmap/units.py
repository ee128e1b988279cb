"""Units: conversion between SI and nondimensional numbers, and the names of both."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Mapping


TIME, VELOCITY, RATE = -1, 1, 1
"""Powers of ``w0`` of a time, a velocity, and a rate like a Lyapunov exponent."""


@dataclasses.dataclass(frozen=True)
class Units:
    """Units of a result's numbers.

    A number in SI is the nondimensional one times a power of ``w0``: times have the power -1 (``tau
    = w0 t``), velocities and exponents 1, accelerations 2. Angles are in rad either way.
    """

    w0: float = 1.0  # sqrt(g / l), rad/s; 1 if nondimensional
    si: bool = False  # whether results are in SI

    def given(self, value: Any, power: float) -> Any:  # noqa: ANN401 (a number, or an array)
        """Convert a nondimensional number or array to these units."""
        return value * self.w0**power

    def bare(self, value: Any, power: float) -> Any:  # noqa: ANN401 (likewise)
        """Convert a number or array in these units to a nondimensional one."""
        return value / self.w0**power

    @property
    def name(self) -> str:
        """``SI`` or ``nondimensional``: the attribute ``units`` of a dataset."""
        return "SI" if self.si else "nondimensional"

    @property
    def of_time(self) -> str:
        """Unit of time."""
        return "s" if self.si else "1 / w0"

    @property
    def of_velocity(self) -> str:
        """Unit of velocity."""
        return "rad/s" if self.si else "1"

    @property
    def of_rate(self) -> str:
        """Unit of rates, such as Lyapunov exponents."""
        return "1/s" if self.si else "1 per tau"

    @property
    def derivative(self) -> str:
        """Symbol of the velocity as a derivative."""
        return "dtheta/dt" if self.si else "dtheta/dtau"

    @property
    def clock(self) -> str:
        """Symbol of time."""
        return "t" if self.si else "tau"

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
    def per_time(self) -> str:
        """Unit of an exponent, in words."""
        return "per second" if self.si else "per unit of tau"

    @property
    def own_period(self) -> str:
        """Text of the period of small oscillations, used without drive."""
        return "2 pi / w0" if self.si else "2 pi"

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
