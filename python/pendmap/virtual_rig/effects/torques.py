"""Effects of damping and dry friction, of torques and of inertia."""

from __future__ import annotations

import numpy as np

from pendmap.virtual_rig.effects.base import (
    Effect,
    Floats,
    Motion,
    acceleration,
    effect,
    friction,
    shape,
    size,
)


@acceleration("damping", "-gamma v", drawn=False, gamma=size(0.0025, 0.01, "1/s"))
def viscous_damping(m: Motion, gamma: float) -> Floats:
    """Viscous damping in addition to that of the rig."""
    return -gamma * m.velocity


@friction("friction", "-theta_r sign v", drawn=False, theta_r=size(0.013, 0.053, "rad/s^2"))
def coulomb_friction(_: Motion, theta_r: float) -> float:
    """Coulomb friction in addition to that of the rig."""
    return theta_r


@acceleration("damping", "-q v abs(v)", q=size(0.0002, 0.0008, "1/rad"))
def quadratic_drag(m: Motion, q: float) -> Floats:
    """Air drag at high Reynolds numbers."""
    return -q * m.velocity * m.speed


@acceleration("damping", "-k3 v^3", k3=size(2e-05, 8e-05, "s/rad^2"))
def cubic_damping(m: Motion, k3: float) -> Floats:
    """Damping proportional to the third power of the velocity."""
    return -k3 * m.velocity**3


@acceleration(
    "damping",
    "-q abs(v)^n sign v",
    q=size(0.0009, 0.0035, "rad^(1-n) s^(n-2)"),
    n=shape(1.3, 1.7, "", least=0.0, most=5.0),
)
def power_law_drag(m: Motion, q: float, n: float) -> Floats:
    """Drag between laminar and turbulent flow, with exponent n."""
    # Values beyond a turning point are evaluated only to locate it.
    return -q * m.direction * np.maximum(m.speed, 0.0) ** n


@acceleration(
    "damping",
    "-b v/(1 + (v/vc)^2)",
    b=size(0.008, 0.032, "1/s"),
    vc=shape(2.0, 8.0, "rad/s", least=1e-3),
)
def eddy_brake(m: Motion, b: float, vc: float) -> Floats:
    """Eddy currents in a plate that passes a magnet: largest torque at velocity vc.

    Smythe (1942), Trans. AIEE 61, 681: ``2/(x + 1/x)`` of the largest torque at ``x = v/vc``.
    """
    return -b * vc**2 * m.velocity / (vc**2 + m.velocity**2)


@friction(
    "friction",
    "-a exp(-(v/vs)^2) sign v",
    a=size(0.05, 0.2, "rad/s^2"),
    vs=shape(0.1, 0.6, "rad/s", least=1e-3),
)
def stribeck_friction(m: Motion, a: float, vs: float) -> Floats:
    """Dry friction that increases at low velocity."""
    # The smooth continuation beyond a turning point must remain bounded.
    slow = np.maximum(m.speed / vs, -1.0)
    return np.asarray(a * np.exp(-(slow**2.0)))


@friction("friction", "-a exp(-abs(v/vs)) sign v", of=stribeck_friction, variant="sharp")
def sharp_stribeck_friction(m: Motion, a: float, vs: float) -> Floats:
    """Stribeck friction with a cusp at rest (Tustin's form) instead of a round top."""
    return np.asarray(a * np.exp(-np.maximum(m.speed / vs, -1.0)))


@friction(
    "load",
    "-k (abs((1 + a(t)) cos th + v^2/w0^2) - 1) sign v",
    lowers="Tr",
    k=size(0.003, 0.012, "rad/s^2"),
)
def load_dependent_friction(m: Motion, k: float) -> Floats:
    """Dry friction proportional to the load on the bearing; at rest it equals Tr."""
    return k * (m.side * m.load - 1)


@acceleration("damping", "-b abs(v)", signed=True, lowers="c/m", b=size(0.0005, 0.002, "1/s"))
def asymmetric_viscous(m: Motion, b: float) -> Floats:
    """Damping that differs between the two directions."""
    return -b * m.speed


@friction("friction", "-d abs(sign v)", signed=True, lowers="Tr", d=size(0.0035, 0.014, "rad/s^2"))
def asymmetric_coulomb(m: Motion, d: float) -> Floats:
    """Dry friction that differs between the two directions."""
    return d * m.direction


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

    def reaction(self, motion: Motion, states: Floats) -> Floats:
        return -self.f / self.zc * states[..., 0]

    def rates(self, motion: Motion, states: Floats, acceleration: Floats) -> Floats:
        slip = motion.velocity - motion.speed * states[..., 0] / self.zc
        return slip[..., np.newaxis]


@friction(
    "friction",
    "-f exp(-(1 - cos(th - th0))/w^2) sign v",
    f=size(0.04, 0.16, "rad/s^2"),
    th0=shape(-1.0, 1.0, "rad"),
    w=shape(0.1, 0.4, "rad", least=1e-3),
)
def rough_spot(m: Motion, f: float, th0: float, w: float) -> Floats:
    """Additional dry friction near one angle, from dirt in the bearing."""
    return np.asarray(f * np.exp((np.cos(m.theta - th0) - 1) / w**2))


@friction("friction", "-r t sign v, t lab time", r=size(2.5e-05, 0.0001, "rad/s^3"))
def coulomb_drift(m: Motion, r: float) -> Floats:
    """Wear: dry friction increases with lab time."""
    return r * m.lab


@friction(
    "friction",
    "+f (1 - exp(-t/tau)) sign v, t lab time",
    lowers="Tr",
    f=size(0.01, 0.04, "rad/s^2"),
    tau=shape(60.0, 240.0, "s", least=1e-3),
)
def coulomb_warm_up(m: Motion, f: float, tau: float) -> Floats:
    """A bearing that warms up: dry friction decays exponentially to a new level."""
    return np.asarray(f * np.expm1(-m.lab / tau))


@friction("friction", "+f t/(t + tau) sign v, t lab time", of=coulomb_warm_up, variant="hyperbolic")
def slow_coulomb_warm_up(m: Motion, f: float, tau: float) -> Floats:
    """A bearing that warms up: dry friction decays hyperbolically, with a longer tail."""
    return -f * m.lab / (m.lab + tau)


@acceleration("damping", "-r t v, t lab time", r=size(5e-06, 2e-05, "1/s^2"))
def viscous_drift(m: Motion, r: float) -> Floats:
    """Grease that thickens: viscous damping increases with lab time."""
    return -r * m.lab * m.velocity


@acceleration(
    "damping",
    "+b (1 - exp(-t/tau)) v, t lab time",
    lowers="c/m",
    b=size(0.0012, 0.005, "1/s"),
    tau=shape(60.0, 240.0, "s", least=1e-3),
)
def viscous_warm_up(m: Motion, b: float, tau: float) -> Floats:
    """Grease that warms up: viscous damping decays exponentially to a new level."""
    return np.asarray(-b * np.expm1(-m.lab / tau) * m.velocity)


@acceleration("damping", "+b t/(t + tau) v, t lab time", of=viscous_warm_up, variant="hyperbolic")
def slow_viscous_warm_up(m: Motion, b: float, tau: float) -> Floats:
    """Grease that warms up: viscous damping decays hyperbolically, with a longer tail."""
    return b * m.lab / (m.lab + tau) * m.velocity


@acceleration("inertia", "-r t w0^2 (1 + a(t)) sin th, t lab time", r=size(1e-06, 4e-06, "1/s"))
def natural_frequency_drift(m: Motion, r: float) -> Floats:
    """A rod that shortens as it cools."""
    pull = m.w0**2 * (1 + m.vertical) * m.sin
    return np.asarray(-r * m.lab * pull)


@acceleration("torque", "+torque", signed=True, torque=size(0.004, 0.015, "rad/s^2"))
def bias_torque(_: Motion, torque: float) -> float:
    """A constant torque: a cable, a tilted fan."""
    return torque


@acceleration(
    "torque",
    "+amplitude sin(n th + psi)",
    amplitude=size(0.016, 0.065, "rad/s^2"),
    n=shape(2, 6, "", whole=True, least=1, most=100),
    psi=shape(-np.pi, np.pi, "rad"),
)
def bearing_harmonic(m: Motion, amplitude: float, n: float, psi: float) -> Floats:
    """Cogging or uneven bearing races: a torque with n periods per turn."""
    return np.asarray(amplitude * np.sin(n * m.theta + psi))


@acceleration(
    "torque",
    "-amplitude (x/width) exp(-x^2/(2 width^2)), x = th wrapped",
    signed=True,
    amplitude=size(0.04, 0.16, "rad/s^2"),
    width=shape(0.08, 0.2, "rad", least=1e-3),
)
def magnet(m: Motion, amplitude: float, width: float) -> Floats:
    """A magnet under the lowest point: a narrow potential well."""
    x = (m.theta - 2 * np.pi * np.round(m.theta / (2 * np.pi))) / width
    return np.asarray(-amplitude * x * np.exp(-(x**2) / 2))


@acceleration(
    "torque",
    "-amplitude (sin th/d) (1 + 2 (1 - cos th)/d^2)^(-5/2)",
    name="magnet",
    variant="dipole",
    signed=True,
    amplitude=size(0.07, 0.3, "rad/s^2"),
    d=shape(0.15, 0.4, "rad", least=1e-3),
)
def dipole_magnet(m: Motion, amplitude: float, d: float) -> Floats:
    """Two dipoles in line, separated by a gap at the lowest point: U ~ r^-3, with wide tails."""
    distance = 1 + 2 * (1 - m.cos) / d**2
    return np.asarray(-amplitude * m.sin / d * distance**-2.5)


@acceleration("torque", "-k th, th not wrapped", k=size(0.0003, 0.0012, "1/s^2"))
def elastic_restoring(m: Motion, k: float) -> Floats:
    """A cable that winds up: a torque proportional to the unwrapped angle."""
    return -k * m.theta


@acceleration("torque", "-w0^2 (sin(th + d) - sin th)", signed=True, d=size(0.0004, 0.0015, "rad"))
def rig_tilt(m: Motion, d: float) -> Floats:
    """A tilted rig: gravity is not aligned with the drive and the sensor's zero."""
    return np.asarray(-(m.w0**2) * (np.sin(m.theta + d) - m.sin))


class InertiaRipple(Effect):
    """An inertia that varies with the angle: a joint, a belt, a camera on the arm."""

    name = "inertia_ripple"
    group = "inertia"
    formula = "inertia 1 + e cos(n th + psi): -e cos(..) th'' + (e n/2) sin(..) v^2"

    e: float = size(0.0007, 0.0028, "", most=0.9)
    n: float = shape(1, 3, "", whole=True, least=1, most=100)
    psi: float = shape(-np.pi, np.pi, "rad")

    def inertia(self, motion: Motion) -> Floats:
        return np.asarray(self.e * np.cos(self.n * motion.theta + self.psi))

    def acceleration(self, motion: Motion) -> Floats:
        angle = self.n * motion.theta + self.psi
        return np.asarray(self.e * self.n / 2 * np.sin(angle) * motion.velocity**2)


class AddedMass(Effect):
    """Mass of the fluid that moves along: it adds inertia, also to the drive's term, but no weight.

    It has no effect on free decays; under drive it is indistinguishable from drive_amplitude.
    """

    name = "added_mass"
    group = "inertia"
    formula = "-e (th'' + w0^2 a(t) sin th)"
    needs = "forced"

    e: float = size(0.0008, 0.0035, "", most=10.0)

    def inertia(self, motion: Motion) -> float:
        return self.e

    def acceleration(self, motion: Motion) -> Floats:
        return np.asarray(-self.e * motion.w0**2 * motion.vertical * motion.sin)


@effect(
    "inertia",
    "inertia",
    "-e th'' in runs that begin after lab time t0",
    name="added_mass",
    variant="late",
    e=size(0.0004, 0.0015, "", most=10.0),
    t0=shape(60.0, 200.0, "s"),
)
def late_added_mass(m: Motion, e: float, t0: float) -> Floats:
    """A weight at the pivot's hub (a clamp, a cable tie), added at lab time t0: inertia alone."""
    return np.asarray(e * (m.lab - m.time > t0))
