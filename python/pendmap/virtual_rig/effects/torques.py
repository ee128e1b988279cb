"""Effects that pull, and those of inertia."""

from __future__ import annotations

import numpy as np

from pendmap.virtual_rig.effects.base import Effect, Floats, Motion, shape, size


class BiasTorque(Effect):
    """A constant pull: a cable, a tilted fan."""

    name = "bias_torque"
    group = "torque"
    formula = "+torque"
    signed = True

    torque: float = size(0.004, 0.015, "rad/s^2")

    def acceleration(self, motion: Motion, own: Floats) -> float:
        return self.torque


class BearingHarmonic(Effect):
    """Cogging or uneven races: a torque that repeats n times a turn."""

    name = "bearing_harmonic"
    group = "torque"
    formula = "+amplitude sin(n th + psi)"

    amplitude: float = size(0.016, 0.065, "rad/s^2")
    n: float = shape(2, 6, "", whole=True, least=1, most=100)
    psi: float = shape(-np.pi, np.pi, "rad")

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        return np.asarray(self.amplitude * np.sin(self.n * motion.theta + self.psi))


class Magnet(Effect):
    """A magnet under the lowest point: a narrow well."""

    name = "magnet"
    group = "torque"
    formula = "-amplitude (x/width) exp(-x^2/(2 width^2)), x = th wrapped"
    signed = True

    amplitude: float = size(0.04, 0.16, "rad/s^2")
    width: float = shape(0.08, 0.2, "rad", least=1e-3)

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        x = (motion.theta - 2 * np.pi * np.round(motion.theta / (2 * np.pi))) / self.width
        return np.asarray(-self.amplitude * x * np.exp(-(x**2) / 2))


class DipoleMagnet(Effect):
    """Two dipoles in line, a gap apart at the lowest point: U ~ r^-3, its tails far wider."""

    name = "magnet"
    variant = "dipole"
    group = "torque"
    formula = "-amplitude (sin th/d) (1 + 2 (1 - cos th)/d^2)^(-5/2)"
    signed = True

    amplitude: float = size(0.07, 0.3, "rad/s^2")
    d: float = shape(0.15, 0.4, "rad", least=1e-3)

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        distance = 1 + 2 * (1 - motion.cos) / self.d**2
        return np.asarray(-self.amplitude * motion.sin / self.d * distance**-2.5)


class ElasticRestoring(Effect):
    """A cable that winds up: it counts turns."""

    name = "elastic_restoring"
    group = "torque"
    formula = "-k th, th not wrapped"

    k: float = size(0.0003, 0.0012, "1/s^2")

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        return -self.k * motion.theta


class RigTilt(Effect):
    """The rig leans: gravity does not pull along the line of the drive and of the zero."""

    name = "rig_tilt"
    group = "torque"
    formula = "-w0^2 (sin(th + d) - sin th)"
    signed = True

    d: float = size(0.0004, 0.0015, "rad")

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        return np.asarray(-(motion.w0**2) * (np.sin(motion.theta + self.d) - motion.sin))


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

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        angle = self.n * motion.theta + self.psi
        return np.asarray(self.e * self.n / 2 * np.sin(angle) * motion.velocity**2)


class AddedMass(Effect):
    """The fluid that moves along: it has inertia, also against the pivot's motion, but no weight.

    It leaves no trace in free decays; under drive it cannot be told from drive_amplitude.
    """

    name = "added_mass"
    group = "inertia"
    formula = "-e (th'' + w0^2 a(t) sin th)"
    needs = "forced"

    e: float = size(0.0008, 0.0035, "", most=10.0)

    def inertia(self, motion: Motion) -> float:
        return self.e

    def acceleration(self, motion: Motion, own: Floats) -> Floats:
        return np.asarray(-self.e * motion.w0**2 * motion.vertical * motion.sin)


class LateAddedMass(Effect):
    """A weight at the pivot's hub (a clamp, a cable tie) from some lab time on: inertia alone."""

    name = "added_mass"
    variant = "late"
    group = "inertia"
    formula = "-e th'' in runs that begin after lab time t0"

    e: float = size(0.0004, 0.0015, "", most=10.0)
    t0: float = shape(60.0, 200.0, "s")

    def inertia(self, motion: Motion) -> Floats:
        return np.asarray(self.e * (motion.lab - motion.time > self.t0))
