"""Effects of the support of the pivot, and of the drive."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Final

import numpy as np

from pendmap.virtual_rig.effects.base import (
    Drive,
    Effect,
    Floats,
    Motion,
    acceleration,
    effect,
    shape,
    size,
)

_drive: Final = functools.partial(effect, "alter", "drive", needs="forced")


def _recoil(motion: Motion, states: Floats, mode: tuple[float, float, float]) -> Floats:
    """Return ``-2 z wx x' - wx^2 x + mu v^2 sin th``, the lateral mode's ``x''`` without th''."""
    mu, wx, z = mode
    x, rate = states[..., 0], states[..., 1]
    return np.asarray(-2 * z * wx * rate - wx**2 * x + mu * motion.velocity**2 * motion.sin)


class PivotCompliance(Effect):
    """A pivot that yields laterally, with an oscillation mode driven by the pendulum's force."""

    name = "pivot_compliance"
    group = "stand"
    formula = "-x'' cos th, x'' + 2 z wx x' + wx^2 x = -mu (th'' cos th - v^2 sin th)"
    states = 2

    mu: float = size(0.008, 0.03, "", most=0.3)
    wx: float = shape(40.0, 80.0, "rad/s", least=1.0, most=1000.0)
    z: float = shape(0.01, 0.05, "", least=0.0, most=2.0)

    def _modes(self) -> list[tuple[float, float, float]]:
        return [(self.mu, self.wx, self.z)]

    def begin(self, motion: Motion) -> Floats:
        # Deflected by the force of the rod, and at rest.
        pull = motion.sin * (motion.w0**2 * (1 + motion.vertical) * motion.cos + motion.velocity**2)
        state = np.zeros((*motion.theta.shape, self.states))
        for k, (mu, wx, _) in enumerate(self._modes()):
            state[..., 2 * k] = mu * pull / wx**2
        return state

    def reaction(self, motion: Motion, states: Floats) -> Floats:
        total = np.zeros_like(motion.theta)
        for k, mode in enumerate(self._modes()):
            total -= _recoil(motion, states[..., 2 * k : 2 * k + 2], mode) * motion.cos
        return total

    def inertia(self, motion: Motion) -> Floats:
        return -sum(mode[0] for mode in self._modes()) * motion.cos**2

    def rates(self, motion: Motion, states: Floats, acceleration: Floats) -> Floats:
        result = np.empty_like(states)
        for k, mode in enumerate(self._modes()):
            pair = states[..., 2 * k : 2 * k + 2]
            pull = mode[0] * acceleration * motion.cos
            result[..., 2 * k] = pair[..., 1]
            result[..., 2 * k + 1] = _recoil(motion, pair, mode) - pull
        return result


class TwoModePivot(PivotCompliance):
    """A pivot with two modes: its post, and the table under it."""

    variant = "two_modes"
    formula = "-(x1 + x2)'' cos th, each as in pivot_compliance, mu2 = share mu"
    states = 4

    share: float = shape(0.05, 0.2, "", least=0.0, most=1.0)
    wx2: float = shape(28.0, 38.0, "rad/s", least=1.0, most=1000.0)
    z2: float = shape(0.02, 0.08, "", least=0.0, most=2.0)

    def _modes(self) -> list[tuple[float, float, float]]:
        return [(self.mu, self.wx, self.z), (self.share * self.mu, self.wx2, self.z2)]


@acceleration(
    "stand",
    "-w0^2 amplitude cos(ws t + psi) cos th, t lab time",
    amplitude=size(0.00017, 0.0007, "g"),
    ws=shape(2.0, 10.0, "rad/s", least=0.0, most=100.0),
    psi=shape(-np.pi, np.pi, "rad"),
)
def base_sway(m: Motion, amplitude: float, ws: float, psi: float) -> Floats:
    """A steady lateral oscillation of the floor, independent of the pendulum."""
    sway = amplitude * np.cos(ws * m.lab + psi)
    return np.asarray(-(m.w0**2) * sway * m.cos)


class Impulses(Effect):
    """A knock against the rig: a jump of the velocity at a lab time."""

    name = "impulses"
    group = "stand"
    formula = "v jumps by J at lab time t0"

    J: float = size(0.01, 0.04, "rad/s")
    t0: float = shape(3.0, 12.0, "s", least=0.0)

    def kicks(self, begin: float, end: float) -> list[tuple[float, float]]:
        return [(self.t0, self.J)] if begin < self.t0 < end else []


class ImpulseTrain(Effect):
    """Knocks at a mean interval of ``every`` seconds of lab time, of either sign."""

    name = "impulses"
    variant = "train"
    group = "stand"
    formula = "v jumps by +J or -J at lab times t_k"

    J: float = size(0.01, 0.04, "rad/s")
    every: float = shape(10.0, 25.0, "s", least=0.1)
    pattern: float = shape(0, 999_999, "", whole=True, least=0)

    def kicks(self, begin: float, end: float) -> list[tuple[float, float]]:
        # The pattern has its own random stream, so that all parts of a run share it.
        rng = np.random.default_rng(int(self.pattern))
        kicks, time = [], 0.0
        while time < end:
            time += self.every * float(rng.uniform(0.3, 1.7))
            jump = self.J * float(rng.choice((-1.0, 1.0)))
            if begin < time < end:
                kicks.append((time, jump))
        return kicks


@_drive("p (1 + e)", signed=True, e=size(0.0015, 0.006, "", most=0.9))
def drive_amplitude(drive: Drive, e: float) -> Drive:
    """The drive's amplitude differs from the value in the experiment file."""
    return dataclasses.replace(drive, p=drive.p * (1 + e))


@_drive("phi + d", signed=True, d=size(0.001, 0.004, "rad"))
def drive_phase(drive: Drive, d: float) -> Drive:
    """The drive has a phase offset, equal in all runs."""
    return dataclasses.replace(drive, phase=drive.phase + d)


@_drive("Omega (1 + e)", signed=True, e=size(1e-05, 4e-05, "", most=0.9))
def drive_frequency(drive: Drive, e: float) -> Drive:
    """The drive's frequency differs from the value in the experiment file."""
    return dataclasses.replace(drive, frequency=drive.frequency * (1 + e))


@_drive("phase Omega t + r t^2/2 + phi", signed=True, r=size(1.5e-05, 6e-05, "rad/s^2"))
def drive_chirp(drive: Drive, r: float) -> Drive:
    """The drive's frequency changes linearly during a run."""
    return dataclasses.replace(drive, chirp=np.full_like(drive.p, r))


@_drive(
    "a(t) + e p cos(2 (Omega t + phi) + phase)",
    e=size(0.0027, 0.011, "", most=10.0),
    phase=shape(-math.pi, math.pi, "rad"),
)
def drive_second_harmonic(drive: Drive, e: float, phase: float) -> Drive:
    """A shaker with harmonic distortion: a second harmonic of the drive."""
    phi = np.full_like(drive.p, phase)
    return dataclasses.replace(drive, p_second=e * drive.p, phi_second=phi)


@_drive(
    "-w0^2 e p cos(Omega t + phi + phase) cos th",
    e=size(0.0007, 0.003, "", most=10.0),
    phase=shape(-math.pi, math.pi, "rad"),
)
def lateral_drive(drive: Drive, e: float, phase: float) -> Drive:
    """A shaker that does not move along a straight line: a lateral component of the drive."""
    phi = np.full_like(drive.p, phase)
    return dataclasses.replace(drive, p_lateral=e * drive.p, phi_lateral=phi)
