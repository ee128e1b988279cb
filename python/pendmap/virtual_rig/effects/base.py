"""What an effect is: parameters with their ranges, and what it adds to the equation or the reading.

The equation of the virtual rig, in SI and per unit of inertia:

``M th'' = -(c/m) th' - w0**2 (1 + a(t)) sin th + torques - sign(th') F``

with ``M = 1`` plus what effects add to the inertia and ``F = Tr`` plus what they add to the dry
friction. The pendulum sticks while ``th' = 0`` and the sum of all others is at most ``F``.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np

from pendmap.errors import InputError

if TYPE_CHECKING:
    from numpy.random import Generator
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


MOST: Final = 1e4
"""Largest value of a parameter, in the largest that is drawn: what is quicker takes for ever."""


class Motion:
    """The state of L lanes at K times each; a lane is one run that is being integrated.

    Attributes
    ----------
    run : array of int, shape (L, 1)
        Which run a lane belongs to.
    time, lab : array, shape (L, K)
        Time since the run began and since the first run began, s.
    theta, velocity : array, shape (L, K)
        Angle in rad and angular velocity in rad/s.
    direction : array, shape (L, 1)
        Sign of the velocity, held through a step: -1, 1, or 0 for a lane that sticks.
    side : array, shape (L, 1)
        Sign of the load on the bearing, held through a step: -1 or 1.
    speed : array, shape (L, K)
        ``direction * velocity``, the smooth continuation of ``abs(velocity)``.
    vertical, lateral : array, shape (L, K)
        Acceleration of the pivot over g, positive upward and toward positive angles.
    w0 : float
        Natural frequency, rad/s.
    """

    __slots__ = (
        "cos",
        "direction",
        "lab",
        "lateral",
        "run",
        "side",
        "sin",
        "speed",
        "theta",
        "time",
        "velocity",
        "vertical",
        "w0",
    )

    cos: Floats
    direction: Floats
    lab: Floats
    lateral: Floats | float
    run: NDArray[np.intp]
    side: Floats
    sin: Floats
    speed: Floats
    theta: Floats
    time: Floats
    velocity: Floats
    vertical: Floats | float
    w0: float

    @property
    def load(self) -> Floats:
        """Radial load on the bearing over the weight, ``(1 + a) cos th + th'**2 / w0**2``."""
        return (1 + self.vertical) * self.cos + (self.velocity / self.w0) ** 2


def size(low: float, high: float, unit: str, most: float | None = None) -> Any:  # noqa: ANN401 (of a field)
    """Describe the parameter that says how strong an effect is.

    It is drawn log-uniformly between ``low`` and ``high``; the absolute value may be ``most``, by
    default :data:`MOST` times ``high``.
    """
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
    """Describe a parameter that says what form an effect has.

    It is drawn uniformly between ``low`` and ``high``; it may be from ``least`` to ``most``, by
    default up to :data:`MOST` times the larger of them, of either sign.
    """
    most = MOST * max(abs(low), abs(high)) if most is None else most
    least = -most if least is None else least
    metadata = {"low": low, "high": high, "unit": unit, "whole": whole}
    return dataclasses.field(metadata=metadata | {"least": least, "most": most})


@dataclasses.dataclass(frozen=True)
class Effect:
    """One thing that the paper's equation leaves out.

    A subclass names it, gives its formula in SI, lists its parameters as fields made by
    :func:`size` and :func:`shape`, and overrides what it changes.

    Raises
    ------
    InputError
        If a parameter is not finite or outside its range.
    """

    name: ClassVar[str]
    group: ClassVar[str]
    formula: ClassVar[str]
    variant: ClassVar[str] = ""
    signed: ClassVar[bool] = False
    """Whether either sign of the size makes sense."""
    states: ClassVar[int] = 0
    """How many variables of its own the effect integrates."""
    drawn: ClassVar[bool] = True
    """Whether a draw may choose it."""
    needs: ClassVar[str] = ""
    """The kind of run that shows it, ``free`` or ``forced``; empty if any does."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = float(getattr(self, field.name))
            what = f"effect {self.title}: {field.name} must be"
            if not math.isfinite(value):
                raise InputError(f"{what} a finite number, got {value:g}")
            about = field.metadata
            least = about.get("least", -about["most"] if self.signed else 0.0)
            if not least <= value <= about["most"]:
                raise InputError(
                    f"{what} a number from {least:g} to {about['most']:g}, got {value:g}"
                )
            if about.get("whole") and value != round(value):
                raise InputError(f"{what} a whole number, got {value:g}")
            object.__setattr__(self, field.name, value)

    @property
    def title(self) -> str:
        """Name and variant, as typed."""
        return self.full_name()

    @classmethod
    def full_name(cls) -> str:
        """Name and variant, as typed: ``magnet`` or ``magnet:dipole``."""
        return f"{cls.name}:{cls.variant}" if cls.variant else cls.name

    @classmethod
    def draw(cls, rng: Generator, scale: float, given: dict[str, float]) -> Effect:
        """Draw the parameters; the size is multiplied by ``scale``, those ``given`` are taken.

        Raises
        ------
        InputError
            If a parameter that is given does not exist or is outside its range.
        """
        known = {field.name: field.metadata for field in dataclasses.fields(cls)}
        for name in given:
            if name not in known:
                has = ", ".join(known) or "none"
                raise InputError(f"effect {cls.full_name()} has no parameter {name!r}: {has}")
        values = {}
        for name, about in known.items():
            # Drawn even where it is given, so that the other draws stay what they were.
            values[name] = cls._draw_one(rng, about, scale)
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

    def least_friction(self) -> float:
        """The least that the effect ever adds to the dry friction, rad/s^2."""
        return 0.0

    def least_damping(self) -> float:
        """The least that the effect ever adds to c/m, 1/s."""
        return 0.0

    def acceleration(self, motion: Motion, own: Floats) -> Floats | float:
        """Acceleration that the effect adds, rad/s^2, shape (L, K)."""
        return 0.0

    def friction(self, motion: Motion, direction: Floats) -> Floats | float:
        """What the effect adds to the dry friction in a direction, rad/s^2, shape (L, K)."""
        return 0.0

    def inertia(self, motion: Motion) -> Floats | float:
        """What the effect adds to the inertia, as a share of it, shape (L, K)."""
        return 0.0

    def begin(self, motion: Motion) -> Floats:
        """The effect's own variables where a motion begins, shape (L, K, states)."""
        return np.zeros((*motion.theta.shape, self.states))

    def rates(self, motion: Motion, own: Floats, acceleration: Floats) -> Floats:
        """Time derivatives of the effect's own variables ``own``, shape (L, K, states).

        Most effects have none, so that there is nothing to change.
        """
        return own[..., :0]

    def alter(self, drive: Drive, lab: Floats) -> Drive:
        """Return the drive that acts, given the one that was meant and when the runs began."""
        return drive

    def kicks(self, begin: float, end: float) -> list[tuple[float, float]]:
        """Lab times in s, and jumps of the velocity in rad/s, between two lab times."""
        return []


# The pivot's motion that is meant, and that acts.


@dataclasses.dataclass(frozen=True)
class Drive:
    """Acceleration of the pivot over g in each of R runs.

    Upward: ``a(t) = p cos(psi) + p_second cos(2 psi + phi_second)`` with the phase
    ``psi = Omega t + chirp t**2 / 2 + phi``; toward positive angles
    ``p_lateral cos(psi + phi_lateral)``.

    Parameters
    ----------
    p, frequency, phase, chirp, p_second, phi_second, p_lateral, phi_lateral : array, shape (R,)
        ``p`` and its like without unit and 0 in a free run, ``frequency`` (Omega) in rad/s,
        phases in rad, ``chirp`` in rad/s^2.
    """

    p: Floats
    frequency: Floats
    phase: Floats
    chirp: Floats
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
        """Return upward and lateral acceleration over g, each of shape (L, K).

        Parameters
        ----------
        run : array of int, shape (L, 1)
            Which run each lane belongs to.
        time : array, shape (L, K)
            Time since that run began, s.
        """
        if not self.p.any():
            return 0.0, 0.0
        psi = (self.frequency[run] + self.chirp[run] * time / 2) * time + self.phase[run]
        upward = self.p[run] * np.cos(psi)
        if self.p_second.any():
            upward = upward + self.p_second[run] * np.cos(2 * psi + self.phi_second[run])
        if not self.p_lateral.any():
            return upward, 0.0
        return upward, self.p_lateral[run] * np.cos(psi + self.phi_lateral[run])
