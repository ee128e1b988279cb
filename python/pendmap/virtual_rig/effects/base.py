"""An effect: parameters with their ranges, and its terms in the equation or the reading.

The equation of the virtual rig, in SI and per unit of inertia:

``M th'' = -(c/m) th' - w0**2 (1 + a(t)) sin th + torques - sign(th') F``

with ``M = 1`` plus what effects add to the inertia and ``F = Tr`` plus what they add to the dry
friction. The pendulum sticks while ``th' = 0`` and the sum of all others is at most ``F``.
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
"""Largest value of a parameter over the largest that is drawn: bounds the integrator's time."""


class Motion:
    """The state of L lanes at K times each; a lane is one run that is being integrated."""

    run: NDArray[np.intp]  # the lane's run, shape (L, 1)
    time: Floats  # since the run began, s, shape (L, K) as all below
    lab: Floats  # since the first run began, s
    theta: Floats  # rad
    velocity: Floats  # rad/s
    direction: Floats  # sign of the velocity, held through a step; 0 sticks; shape (L, 1)
    side: Floats  # sign of the load on the bearing, held through a step; shape (L, 1)
    speed: Floats  # direction * velocity: the smooth continuation of abs(velocity)
    vertical: Floats | float  # acceleration of the pivot over g, upward
    lateral: Floats | float  # acceleration of the pivot over g, toward positive angles
    w0: float  # natural frequency, rad/s
    sin: Floats  # of theta
    cos: Floats

    @property
    def load(self) -> Floats:
        """Radial load on the bearing over the weight, ``(1 + a) cos th + th'**2 / w0**2``."""
        return (1 + self.vertical) * self.cos + (self.velocity / self.w0) ** 2


def size(low: float, high: float, unit: str, most: float | None = None) -> Any:  # noqa: ANN401 (of a field)
    """Describe the size of an effect, drawn log-uniformly, in absolute value at most ``most``."""
    most = MOST * high if most is None else most
    return dataclasses.field(
        metadata={"low": low, "high": high, "unit": unit, "size": True, "most": most}
    )


def shape(  # noqa: PLR0913 (one for each thing to say about a parameter)
    low: float,
    high: float,
    unit: str,
    *,
    whole: bool = False,
    least: float | None = None,
    most: float | None = None,
) -> Any:  # noqa: ANN401 (of a field)
    """Describe a parameter of an effect's form, drawn uniformly; it is from least to most."""
    most = MOST * max(abs(low), abs(high)) if most is None else most
    least = -most if least is None else least
    metadata = {"low": low, "high": high, "unit": unit, "whole": whole}
    return dataclasses.field(metadata=metadata | {"least": least, "most": most})


class Reading(NamedTuple):
    """A sensor's reading of a path at N times, in order."""

    time: Floats  # since the run began, s, shape (N,)
    angle: Floats  # the reading, rad, shape (N,)
    path: Path  # the true motion


@dataclass_transform(frozen_default=True)
@dataclasses.dataclass(frozen=True)
class Effect:
    """One term that the paper's equation leaves out.

    A subclass names it, gives its formula in SI, lists its parameters as fields made by
    :func:`size` and :func:`shape`, and overrides what it changes; it becomes a frozen dataclass.
    Where it changes one thing by a formula, :func:`effect` makes it of a function.
    """

    name: ClassVar[str]
    group: ClassVar[str]
    formula: ClassVar[str]
    variant: ClassVar[str] = ""
    signed: ClassVar[bool] = False
    """Whether the size may have either sign."""
    states: ClassVar[int] = 0
    """Number of variables that the effect integrates."""
    drawn: ClassVar[bool] = True
    """Whether a draw may choose it."""
    needs: ClassVar[str] = ""
    """The kind of run that shows it, ``free`` or ``forced``; empty if any does."""
    lowers: ClassVar[str] = ""
    """The number of the rig, ``Tr`` or ``c/m``, that it lowers by up to its size, if any."""
    order: ClassVar[int] = 0
    """Place of an effect of the reading in the chain: the lowest acts first."""

    def __init_subclass__(cls) -> None:
        dataclasses.dataclass(frozen=True)(cls)

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            about, what = field.metadata, f"effect {self.full_name()}: {field.name}"
            value = check_number(what, getattr(self, field.name))
            least = about.get("least", -about["most"] if self.signed else 0.0)
            if not least <= value <= about["most"]:
                raise InputError(
                    f"{what} must be a number from {least:g} to {about['most']:g}, got {value:g}"
                )
            if about.get("whole") and value != round(value):
                raise InputError(f"{what} must be a whole number, got {value:g}")
            object.__setattr__(self, field.name, value)

    @classmethod
    def full_name(cls) -> str:
        """Name and variant, as typed: ``magnet`` or ``magnet:dipole``."""
        return f"{cls.name}:{cls.variant}" if cls.variant else cls.name

    @classmethod
    def draw(cls, rng: Generator, scale: float, given: dict[str, float]) -> Effect:
        """Draw the parameters; the size is multiplied by ``scale``, those ``given`` are taken."""
        known = {field.name: field.metadata for field in dataclasses.fields(cls)}
        for name in given:
            if name not in known:
                has = ", ".join(known) or "none"
                raise InputError(f"effect {cls.full_name()} has no parameter {name!r}: {has}")
        # All are drawn, given or not, so that the other draws do not change.
        values = {name: cls._draw_one(rng, about, scale) for name, about in known.items()}
        return cls(**(values | given))

    @classmethod
    def _draw_one(cls, rng: Generator, about: Any, scale: float) -> float:  # noqa: ANN401 (metadata)
        low, high = about["low"], about["high"]
        if about.get("size"):
            sign = rng.choice((-1.0, 1.0)) if cls.signed else 1.0
            return float(sign * scale * math.exp(rng.uniform(math.log(low), math.log(high))))
        if about["whole"]:
            return float(rng.integers(int(low), int(high), endpoint=True))
        return float(rng.uniform(low, high))

    @property
    def strength(self) -> float:
        """The absolute value of the size, which is the first parameter."""
        size: float = next(iter(vars(self).values()))
        return abs(size)

    def acceleration(self, motion: Motion) -> Floats | float:
        """Return the acceleration by the effect, rad/s^2, shape (L, K)."""
        return 0.0

    def friction(self, motion: Motion) -> Floats | float:
        """Return the dry friction by the effect, rad/s^2, shape (L, K)."""
        return 0.0

    def inertia(self, motion: Motion) -> Floats | float:
        """Return the inertia by the effect, as a share of the rig's, shape (L, K)."""
        return 0.0

    def begin(self, motion: Motion) -> Floats:
        """Return the variables of the effect where a motion begins, shape (L, K, states)."""
        return np.zeros((*motion.theta.shape, self.states))

    def reaction(self, motion: Motion, own: Floats) -> Floats:
        """Return the acceleration, rad/s^2, by an effect with variables, in place of the other."""
        raise NotImplementedError

    def rates(self, motion: Motion, own: Floats, acceleration: Floats) -> Floats:
        """Return the time derivatives of the variables, shape (L, K, states)."""
        raise NotImplementedError

    def alter(self, drive: Drive) -> Drive:
        """Return the drive that acts, given the one that was meant."""
        return drive

    def kicks(self, begin: float, end: float) -> list[tuple[float, float]]:
        """Return the lab times, s, and sizes, rad/s, of jumps of the velocity between two times."""
        return []

    def clock(self, time: Floats) -> Floats:
        """Return the true times, s, of what the record says was read at ``time``."""
        return time

    def distort(self, seen: Reading) -> Floats:
        """Return what is read, rad, of what the sensor sees, shape (N,)."""
        return seen.angle


def effect(
    method: str,
    group: str,
    formula: str,
    **said: Any,  # noqa: ANN401 (parameters and class variables)
) -> Callable[[Callable[..., Any]], type[Effect]]:
    """Make an effect of the function that is its one ``method``, under the function's name.

    The function takes what the method takes, then the effect's parameters. ``said`` holds these,
    made by :func:`size` and :func:`shape`, and class variables.
    """
    parameters = [name for name, value in said.items() if isinstance(value, dataclasses.Field)]

    def make(function: Callable[..., Any]) -> type[Effect]:
        def term(self: Effect, *given: Any) -> Any:  # noqa: ANN401 (those of the method)
            return function(*given, **vars(self))

        body = {
            "__doc__": function.__doc__,
            "__module__": function.__module__,
            "__annotations__": dict.fromkeys(parameters, float),
            "name": function.__name__,
            "group": group,
            "formula": formula,
            method: term,
        }
        return type(function.__name__, (Effect,), body | said)

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
        """Return the drive that is meant: ``p cos(Omega t + phi)`` upward."""
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
