"""Effects of torques and of inertia."""

from __future__ import annotations

import numpy as np

from pendmap.virtual_rig.effects.base import (
    Effect,
    Floats,
    Motion,
    acceleration,
    effect,
    shape,
    size,
)


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
