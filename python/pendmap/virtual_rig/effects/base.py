"""An effect: parameters with their ranges, and its terms in the equation or the reading.

The equation of the virtual rig, in SI and per unit of inertia:

``M th'' = -(c/m) th' - w0**2 (1 + a(t)) sin th + torques - sign(th') F``

with ``M = 1`` plus the effects' inertia and ``F = Tr`` plus their dry friction. The pendulum
sticks while ``th' = 0`` and the sum of all other terms is at most ``F``.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Any, ClassVar, Final, NamedTuple, dataclass_transform

import numpy as np
from numpy.typing import NDArray

from pendmap.errors import InputError, check_number

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.random import Generator

    from pendmap.virtual_rig.path import Path

Floats = NDArray[np.float64]

MOST: Final = 1e4
"""Largest allowed value of a parameter over the largest drawn: bounds the integration time."""


@dataclasses.dataclass
class Motion:
    """State of L lanes at K times each; a lane is one run under integration."""

    time: Floats  # since the run began, s, shape (L, K) as all below
    lab: Floats  # since the first run began, s
    theta: Floats  # rad
    velocity: Floats  # rad/s
    direction: Floats  # sign of the velocity, held through a step; 0: sticking; shape (L, 1)
    side: Floats  # sign of the load on the bearing, held through a step; shape (L, 1)
    vertical: Floats | float  # acceleration of the pivot over g, upward
    lateral: Floats | float  # acceleration of the pivot over g, toward positive angles
    w0: float  # natural frequency, rad/s

    def __post_init__(self) -> None:
        self.sin, self.cos = np.sin(self.theta), np.cos(self.theta)
        self.speed = self.direction * self.velocity  # the smooth continuation of abs(velocity)

    @property
    def load(self) -> Floats:
        """Radial load on the bearing over the weight, ``(1 + a) cos th + th'**2 / w0**2``."""
        return (1 + self.vertical) * self.cos + (self.velocity / self.w0) ** 2


def shape(  # noqa: PLR0913 (one for each thing to say about a parameter)
    low: float,
    high: float,
    unit: str,
    *,
    whole: bool = False,
    least: float | None = None,
    most: float | None = None,
    size: bool = False,
) -> Any:  # noqa: ANN401 (of a field)
    """Describe a shape parameter, drawn uniformly in [low, high] and allowed in [least, most].

    A size is drawn log-uniformly; whether it may be negative is said by its effect.
    """
    most = MOST * max(abs(low), abs(high)) if most is None else most
    least = -most if least is None and not size else least
    metadata = {"low": low, "high": high, "unit": unit, "whole": whole, "size": size}
    return dataclasses.field(metadata=metadata | {"least": least, "most": most})


size: Final = functools.partial(shape, size=True)


class Reading(NamedTuple):
    """A sensor's reading of a path at N increasing times."""

    time: Floats  # since the run began, s, shape (N,)
    angle: Floats  # the reading, rad, shape (N,)
    path: Path  # the true motion


@dataclass_transform(frozen_default=True)
@dataclasses.dataclass(frozen=True)
class Effect:
    """One term that is missing in the paper's equation.

    A subclass sets the name and the formula in SI, lists its parameters as fields made by
    :func:`size` and :func:`shape`, and overrides the methods that it changes; it becomes a frozen
    dataclass. An effect that overrides one method is made from a function by :func:`effect`.
    """

    name: ClassVar[str]
    group: ClassVar[str]
    formula: ClassVar[str]
    variant: ClassVar[str] = ""
    signed: ClassVar[bool] = False  # Whether the size may have either sign
    states: ClassVar[int] = 0  # Number of variables that the effect integrates
    drawn: ClassVar[bool] = True  # Whether a random draw may choose the effect
    needs: ClassVar[str] = ""
    """Kind of run in which the effect is observable, ``free`` or ``forced``; empty for any."""
    lowers: ClassVar[str] = ""
    """Rig parameter, ``Tr`` or ``c/m``, that the effect lowers by at most its size, or empty."""
    order: ClassVar[int] = 0  # Position of a reading effect in the chain: the lowest acts first

    def __init_subclass__(cls) -> None:
        dataclasses.dataclass(frozen=True)(cls)

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            about, what = field.metadata, f"effect {self.full_name()}: {field.name}"
            value = check_number(what, getattr(self, field.name))
            least = about["least"]
            if least is None:
                least = -about["most"] if self.signed else 0.0
            if not least <= value <= about["most"]:
                raise InputError(
                    f"{what} must be a number from {least:g} to {about['most']:g}, got {value:g}"
                )
            if about["whole"] and value != round(value):
                raise InputError(f"{what} must be a whole number, got {value:g}")
            object.__setattr__(self, field.name, value)

    @classmethod
    def full_name(cls) -> str:
        """Return name and variant as a user types them: ``magnet`` or ``magnet:dipole``."""
        return f"{cls.name}:{cls.variant}" if cls.variant else cls.name

    @classmethod
    def draw(cls, rng: Generator, scale: float, given: dict[str, float]) -> Effect:
        """Draw the parameters, the size times ``scale``; values in ``given`` replace drawn ones."""
        known = {field.name: field.metadata for field in dataclasses.fields(cls)}
        for name in given:
            if name not in known:
                has = ", ".join(known) or "none"
                raise InputError(f"effect {cls.full_name()} has no parameter {name!r}: {has}")
        # All are drawn, given or not, so that given values do not change later draws.
        values = {name: cls._draw_one(rng, about, scale) for name, about in known.items()}
        return cls(**(values | given))

    @classmethod
    def _draw_one(cls, rng: Generator, about: Any, scale: float) -> float:  # noqa: ANN401 (data)
        low, high = about["low"], about["high"]
        if about["size"]:
            sign = rng.choice((-1.0, 1.0)) if cls.signed else 1.0
            return float(sign * scale * math.exp(rng.uniform(math.log(low), math.log(high))))
        if about["whole"]:
            return float(rng.integers(int(low), int(high), endpoint=True))
        return float(rng.uniform(low, high))

    @property
    def strength(self) -> float:
        """Absolute value of the size, which is the first parameter."""
        size: float = next(iter(vars(self).values()))
        return abs(size)

    def acceleration(self, motion: Motion) -> Floats | float:
        """Return the acceleration of the effect, rad/s^2, shape (L, K)."""
        return 0.0

    def friction(self, motion: Motion) -> Floats | float:
        """Return the dry friction of the effect, rad/s^2, shape (L, K)."""
        return 0.0

    def inertia(self, motion: Motion) -> Floats | float:
        """Return the inertia of the effect as a share of the rig's, shape (L, K)."""
        return 0.0

    def begin(self, motion: Motion) -> Floats:
        """Return the initial values of the effect's state variables, shape (L, K, states)."""
        return np.zeros((*motion.theta.shape, self.states))

    def reaction(self, motion: Motion, states: Floats) -> Floats:
        """Return the acceleration, rad/s^2, with the effect's state variables."""
        return np.asarray(self.acceleration(motion))

    def rates(self, motion: Motion, states: Floats, acceleration: Floats) -> Floats:
        """Return the time derivatives of the state variables, shape (L, K, states)."""
        return np.zeros_like(states)

    def alter(self, drive: Drive) -> Drive:
        """Return the actual drive, given the nominal one."""
        return drive

    def kicks(self, begin: float, end: float) -> list[tuple[float, float]]:
        """Return lab times, s, and sizes, rad/s, of velocity jumps between two lab times."""
        return []

    def clock(self, time: Floats) -> Floats:
        """Return the true times, s, of samples recorded at ``time``."""
        return time

    def distort(self, seen: Reading) -> Floats:
        """Return the distorted reading, rad, of the angle that the sensor measures, shape (N,)."""
        return seen.angle


def effect(
    method: str,
    group: str,
    formula: str,
    of: type[Effect] = Effect,
    **fields: Any,  # noqa: ANN401 (parameters and class variables)
) -> Callable[[Callable[..., Any]], type[Effect]]:
    """Return an Effect class, named after the function that implements its one ``method``.

    The function takes the method's arguments, then the effect's parameters. ``fields`` holds these,
    made by :func:`size` and :func:`shape`, and class variables; a variant has those ``of`` another.
    """
    parameters = [name for name, value in fields.items() if isinstance(value, dataclasses.Field)]

    def make(function: Callable[..., Any]) -> type[Effect]:
        def term(self: Effect, *given: Any) -> Any:  # noqa: ANN401 (those of the method)
            return function(*given, **vars(self))

        body = {
            "__doc__": function.__doc__,
            "__module__": function.__module__,
            "__annotations__": dict.fromkeys(parameters, float),
            "name": getattr(of, "name", function.__name__),
            "group": group,
            "formula": formula,
            method: term,
        }
        return type(function.__name__, (of,), body | fields)

    return make


acceleration: Final = functools.partial(effect, "acceleration")
friction: Final = functools.partial(effect, "friction")


@dataclasses.dataclass(frozen=True)
class Drive:
    """Acceleration of the pivot over g in each of R runs; all arrays have the shape (R,).

    Upward: ``a(t) = p cos(psi) + p_second cos(2 psi + phi_second)`` with the phase
    ``psi = Omega t + chirp t**2 / 2 + phi``; toward positive angles
    ``p_lateral cos(psi + phi_lateral)``.
    """

    p: Floats  # 0 in a free run
    frequency: Floats  # Omega, rad/s
    phase: Floats  # rad
    chirp: Floats  # rad/s^2
    p_second: Floats
    phi_second: Floats
    p_lateral: Floats
    phi_lateral: Floats

    @classmethod
    def harmonic(cls, p: Floats, frequency: Floats, phase: Floats) -> Drive:
        """Return the nominal drive: ``p cos(Omega t + phi)`` upward."""
        none = np.zeros_like(p)
        return cls(p, frequency, phase, none, none, none, none, none)

    def at(self, run: NDArray[np.intp], time: Floats) -> tuple[Floats | float, Floats | float]:
        """Return upward and lateral acceleration over g, shape (L, K), as in :class:`Motion`."""
        if not self.p.any():
            return 0.0, 0.0
        psi = (self.frequency[run] + self.chirp[run] * time / 2) * time + self.phase[run]
        upward = self.p[run] * np.cos(psi)
        if self.p_second.any():
            upward = upward + self.p_second[run] * np.cos(2 * psi + self.phi_second[run])
        if not self.p_lateral.any():
            return upward, 0.0
        return upward, self.p_lateral[run] * np.cos(psi + self.phi_lateral[run])
