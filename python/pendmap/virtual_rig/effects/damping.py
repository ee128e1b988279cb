"""Effects that brake: damping and dry friction, constant or with the time in the laboratory."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from pendmap.virtual_rig.effects.base import Effect, Floats, Motion, shape, size


class ViscousDamping(Effect):
    """Viscous damping beside that of the rig."""

    name = "viscous_damping"
    group = "damping"
    formula = "-gamma v"
    drawn = False

    gamma: float = size(0.0025, 0.01, "1/s")

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        return -self.gamma * motion.velocity


class CoulombFriction(Effect):
    """Coulomb friction beside that of the rig."""

    name = "coulomb_friction"
    group = "friction"
    formula = "-theta_r sign v"
    drawn = False

    theta_r: float = size(0.013, 0.053, "rad/s^2")

    def friction(self, motion: Motion, direction: Floats) -> Floats | float:
        return self.theta_r


class QuadraticDrag(Effect):
    """Drag of the air at high Reynolds numbers."""

    name = "quadratic_drag"
    group = "damping"
    formula = "-q v abs(v)"

    q: float = size(0.0002, 0.0008, "1/rad")

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        return -self.q * motion.velocity * motion.speed


class CubicDamping(Effect):
    """Damping by the next odd power of the velocity."""

    name = "cubic_damping"
    group = "damping"
    formula = "-k3 v^3"

    k3: float = size(2e-05, 8e-05, "s/rad^2")

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        return -self.k3 * motion.velocity**3


class PowerLawDrag(Effect):
    """Drag between laminar and turbulent flow."""

    name = "power_law_drag"
    group = "damping"
    formula = "-q abs(v)^n sign v"

    q: float = size(0.0009, 0.0035, "rad^(1-n) s^(n-2)")
    n: float = shape(1.3, 1.7, "", least=0.0, most=5.0)

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        # The side beyond a turn is only looked at to find the turn.
        return -self.q * motion.direction * np.maximum(motion.speed, 0.0) ** self.n


class EddyBrake(Effect):
    """Eddy currents in a plate that passes a magnet: strongest at one velocity.

    Smythe (1942), Trans. AIEE 61, 681: ``2/(x + 1/x)`` of the greatest torque at ``x = v/vc``.
    """

    name = "eddy_brake"
    group = "damping"
    formula = "-b v/(1 + (v/vc)^2)"

    b: float = size(0.008, 0.032, "1/s")
    vc: float = shape(2.0, 8.0, "rad/s", least=1e-3)

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        return -self.b * self.vc**2 * motion.velocity / (self.vc**2 + motion.velocity**2)


class StribeckFriction(Effect):
    """Dry friction that is larger when the motion is slow."""

    name = "stribeck_friction"
    group = "friction"
    formula = "-a exp(-(v/vs)^2) sign v"
    delta: ClassVar[float] = 2.0

    a: float = size(0.05, 0.2, "rad/s^2")
    vs: float = shape(0.1, 0.6, "rad/s", least=1e-3)

    def friction(self, motion: Motion, direction: Floats) -> Floats:
        # The smooth continuation beyond a turn must not grow without bound.
        slow = np.maximum(motion.speed / self.vs, -1.0)
        return self.a * np.exp(-(slow**self.delta))


class SharpStribeckFriction(StribeckFriction):
    """Stribeck friction with a cusp at rest (Tustin's form) instead of a round top."""

    variant = "sharp"
    formula = "-a exp(-abs(v/vs)) sign v"
    delta: ClassVar[float] = 1.0


class LoadDependentFriction(Effect):
    """Dry friction in proportion to the load on the bearing; at rest it is what Tr says."""

    name = "load_dependent_friction"
    group = "load"
    formula = "-k (abs((1 + a(t)) cos th + v^2/w0^2) - 1) sign v"

    k: float = size(0.003, 0.012, "rad/s^2")

    def friction(self, motion: Motion, direction: Floats) -> Floats:
        return self.k * (motion.side * motion.load - 1)

    def least_friction(self) -> float:
        return -self.k


class AsymmetricViscous(Effect):
    """Damping that differs between the two directions."""

    name = "asymmetric_viscous"
    group = "damping"
    formula = "-b abs(v)"
    signed = True

    b: float = size(0.0005, 0.002, "1/s")

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        return -self.b * motion.speed

    def least_damping(self) -> float:
        return -abs(self.b)


class AsymmetricCoulomb(Effect):
    """Dry friction that differs between the two directions."""

    name = "asymmetric_coulomb"
    group = "friction"
    formula = "-d abs(sign v)"
    signed = True

    d: float = size(0.0035, 0.014, "rad/s^2")

    def friction(self, motion: Motion, direction: Floats) -> Floats:
        return self.d * direction

    def least_friction(self) -> float:
        return -abs(self.d)


class DahlFriction(Effect):
    """Friction of a contact that yields before it slips.

    Dahl (1968), A solid friction model, with exponent 1.
    """

    name = "dahl_friction"
    group = "friction"
    formula = "-f z/zc, z' = v - abs(v) z/zc"
    states = 1

    f: float = size(0.012, 0.05, "rad/s^2")
    zc: float = shape(0.02, 0.1, "rad", least=1e-3)

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        return -self.f / self.zc * own[..., 0]

    def rates(self, motion: Motion, own: Floats, acceleration: Floats) -> Floats:
        slip = motion.velocity - motion.speed * own[..., 0] / self.zc
        return slip[..., np.newaxis]


class RoughSpot(Effect):
    """Dry friction at one angle: dirt in the bearing."""

    name = "rough_spot"
    group = "friction"
    formula = "-f exp(-(1 - cos(th - th0))/w^2) sign v"

    f: float = size(0.04, 0.16, "rad/s^2")
    th0: float = shape(-1.0, 1.0, "rad")
    w: float = shape(0.1, 0.4, "rad", least=1e-3)

    def friction(self, motion: Motion, direction: Floats) -> Floats:
        return self.f * np.exp((np.cos(motion.theta - self.th0) - 1) / self.w**2)


class CoulombDrift(Effect):
    """Wear: dry friction grows with lab time."""

    name = "coulomb_drift"
    group = "friction"
    formula = "-r t sign v, t lab time"

    r: float = size(2.5e-05, 0.0001, "rad/s^3")

    def friction(self, motion: Motion, direction: Floats) -> Floats:
        return self.r * motion.lab


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


class SlowlyWarmingCoulomb(WarmingCoulomb):
    """Friction that falls along a hyperbola: the last part takes far longer."""

    variant = "hyperbolic"
    formula = "+f t/(t + tau) sign v, t lab time"

    def friction(self, motion: Motion, direction: Floats) -> Floats:
        return -self.f * motion.lab / (motion.lab + self.tau)


class ViscousDrift(Effect):
    """Grease that thickens: viscous damping grows with lab time."""

    name = "viscous_drift"
    group = "damping"
    formula = "-r t v, t lab time"

    r: float = size(5e-06, 2e-05, "1/s^2")

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        return -self.r * motion.lab * motion.velocity


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


class SlowlyWarmingViscous(WarmingViscous):
    """Damping that falls along a hyperbola: the last part takes far longer."""

    variant = "hyperbolic"
    formula = "+b t/(t + tau) v, t lab time"

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        return self.b * motion.lab / (motion.lab + self.tau) * motion.velocity


class NaturalFrequencyDrift(Effect):
    """A rod that shortens as it cools."""

    name = "natural_frequency_drift"
    group = "inertia"
    formula = "-r t w0^2 (1 + a(t)) sin th, t lab time"

    r: float = size(1e-06, 4e-06, "1/s")

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        pull = motion.w0**2 * (1 + motion.vertical) * motion.sin
        return np.asarray(-self.r * motion.lab * pull)
