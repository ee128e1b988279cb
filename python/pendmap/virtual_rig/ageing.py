"""Effects that change with the time in the laboratory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pendmap.virtual_rig.effect import Effect, Motion, shape, size

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["AGEING"]


@dataclass(frozen=True)
class CoulombDrift(Effect):
    """Wear: dry friction grows with lab time."""

    name = "coulomb_drift"
    group = "friction"
    formula = "-r t sign v, t lab time"

    r: float = size(2.5e-05, 0.0001, "rad/s^3")

    def friction(self, motion: Motion, direction: Floats) -> Floats:
        return self.r * motion.lab


@dataclass(frozen=True)
class WarmingCoulomb(Effect):
    """A bearing that warms up: dry friction falls to a new level."""

    name = "coulomb_warm_up"
    group = "friction"
    formula = "+f (1 - exp(-t/tau)) sign v, t lab time"

    f: float = size(0.01, 0.04, "rad/s^2")
    tau: float = shape(60.0, 240.0, "s", least=1e-3)

    def friction(self, motion: Motion, direction: Floats) -> Floats:
        return self.f * np.expm1(-motion.lab / self.tau)

    def least_friction(self) -> float:
        return -self.f


@dataclass(frozen=True)
class SlowlyWarmingCoulomb(WarmingCoulomb):
    """The same with a hyperbola: the last of it takes far longer."""

    variant = "hyperbolic"
    formula = "+f t/(t + tau) sign v, t lab time"

    def friction(self, motion: Motion, direction: Floats) -> Floats:
        return -self.f * motion.lab / (motion.lab + self.tau)


@dataclass(frozen=True)
class ViscousDrift(Effect):
    """Grease that thickens: viscous damping grows with lab time."""

    name = "viscous_drift"
    group = "damping"
    formula = "-r t v, t lab time"

    r: float = size(5e-06, 2e-05, "1/s^2")

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        return -self.r * motion.lab * motion.velocity


@dataclass(frozen=True)
class WarmingViscous(Effect):
    """Grease that warms up: viscous damping falls to a new level."""

    name = "viscous_warm_up"
    group = "damping"
    formula = "+b (1 - exp(-t/tau)) v, t lab time"

    b: float = size(0.0012, 0.005, "1/s")
    tau: float = shape(60.0, 240.0, "s", least=1e-3)

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        return -self.b * np.expm1(-motion.lab / self.tau) * motion.velocity

    def least_damping(self) -> float:
        return -self.b


@dataclass(frozen=True)
class SlowlyWarmingViscous(WarmingViscous):
    """The same with a hyperbola: the last of it takes far longer."""

    variant = "hyperbolic"
    formula = "+b t/(t + tau) v, t lab time"

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        return self.b * motion.lab / (motion.lab + self.tau) * motion.velocity


@dataclass(frozen=True)
class NaturalFrequencyDrift(Effect):
    """A rod that shortens as it cools."""

    name = "natural_frequency_drift"
    group = "inertia"
    formula = "-r t w0^2 (1 + a(t)) sin th, t lab time"

    r: float = size(1e-06, 4e-06, "1/s")

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        pull = motion.w0**2 * (1 + motion.vertical) * motion.sin
        return np.asarray(-self.r * motion.lab * pull)


AGEING: tuple[type[Effect], ...] = (
    CoulombDrift,
    WarmingCoulomb,
    SlowlyWarmingCoulomb,
    ViscousDrift,
    WarmingViscous,
    SlowlyWarmingViscous,
    NaturalFrequencyDrift,
)
