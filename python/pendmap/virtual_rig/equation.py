"""The rig's equation of motion over lanes and times, with all its effects."""

from __future__ import annotations

import dataclasses
import itertools
from typing import TYPE_CHECKING

import numpy as np

from pendmap.errors import InputError, check_number
from pendmap.virtual_rig.effects.base import Floats, Motion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.virtual_rig.effects.base import Drive, Effect


@dataclasses.dataclass(frozen=True)
class Parameters:
    """Parameters of the paper's rig, in SI.

    ``th'' + c_over_m th' + w0**2 (1 + a(t)) sin th = -friction sign(th')``, eq. 2.1 of Horton,
    Wiercigroch & Xu (2008), Phil. Trans. R. Soc. A.
    """

    w0: float  # natural frequency sqrt(g / l), rad/s
    c_over_m: float  # viscous damping c / m, 1/s
    friction: float  # dry friction Tr, rad/s^2

    def __post_init__(self) -> None:
        for name, value in dataclasses.asdict(self).items():
            check_number(name, value)
            if value < 0 or (name == "w0" and value == 0):
                wanted = "a number above 0" if name == "w0" else "0 or more"
                raise InputError(f"{name} must be {wanted}, got {value:g}")


class Equation:
    """Accelerations of R runs, which begin at the lab times ``lab``, s, shape (R,)."""

    def __init__(
        self, parameters: Parameters, drive: Drive, lab: Floats, effects: Sequence[Effect]
    ) -> None:
        self.parameters = parameters
        self.effects = list(effects)
        self.lab = lab
        for effect in effects:
            drive = effect.alter(drive)
        self.drive = drive
        self.states = sum(effect.states for effect in effects)
        ends = np.cumsum([0, *(effect.states for effect in effects)])
        self._own = [slice(a, b) for a, b in itertools.pairwise(ends)]
        self.watches_load = any(effect.group == "load" for effect in effects)
        for name, value in (("Tr", parameters.friction), ("c/m", parameters.c_over_m)):
            least = value - sum(effect.strength for effect in effects if effect.lowers == name)
            if least < 0:
                names = ", ".join(effect.full_name() for effect in effects)
                raise InputError(
                    f"{names}: effects must leave {name} 0 or more, it would fall to {least:.3g}"
                )

    def motion(  # noqa: PLR0913, PLR0917 (the parts of a lane's state)
        self,
        run: NDArray[np.intp],
        time: Floats,
        theta: Floats,
        velocity: Floats,
        direction: Floats,
        side: Floats,
    ) -> Motion:
        """Return the motion of lanes; :class:`Motion` gives the shapes."""
        lab, pivot = self.lab[run] + time, self.drive.at(run, time)
        return Motion(time, lab, theta, velocity, direction, side, *pivot, self.parameters.w0)

    def smooth(self, m: Motion, states: Floats) -> Floats:
        """Return the acceleration without dry friction, rad/s^2, shape (L, K), for unit inertia."""
        p = self.parameters
        total = -p.c_over_m * m.velocity - p.w0**2 * (1 + m.vertical) * m.sin
        if not isinstance(m.lateral, float):
            total -= p.w0**2 * m.lateral * m.cos
        for effect, part in zip(self.effects, self._own, strict=True):
            total = total + effect.reaction(m, states[..., part])
        return total

    def friction(self, m: Motion) -> Floats | float:
        """Return the dry friction, rad/s^2, shape (L, K)."""
        level: Floats | float = self.parameters.friction
        for effect in self.effects:
            level = level + effect.friction(m)
        return level

    def rates(self, m: Motion, states: Floats) -> tuple[Floats, Floats]:
        """Return accelerations, 0 for sticking lanes, and rates of the effects' state variables."""
        force = self.smooth(m, states) - m.direction * self.friction(m)
        inertia: Floats | float = 1.0
        for effect in self.effects:
            inertia = inertia + effect.inertia(m)
        acceleration = np.where(m.direction == 0, 0.0, force / inertia)
        if not self.states:
            return acceleration, states
        parts = [
            effect.rates(m, states[..., part], acceleration)
            for effect, part in zip(self.effects, self._own, strict=True)
        ]
        return acceleration, np.concatenate(parts, axis=-1)

    def begin(self, m: Motion) -> Floats:
        """Return the initial values of the effects' state variables, shape (L, K, states)."""
        parts = [effect.begin(m) for effect in self.effects]
        return np.concatenate(parts, axis=-1) if parts else np.zeros((*m.theta.shape, 0))

    def kicks(self, run: int, end: float) -> list[tuple[float, float]]:
        """Return times since the run began, s, and velocity jumps at them, rad/s."""
        lab = float(self.lab[run])
        kicks = [kick for e in self.effects for kick in e.kicks(lab, lab + end)]
        return sorted((time - lab, jump) for time, jump in kicks)
