"""Disturbances that no effect describes: two further effects of the virtual rig, for blind cases.

They are a texture of the bearing (torque and friction as random series in the angle), a slow drift
of the sensor's zero, and noise with a correlation time of a fraction of a second to some seconds.
Each has a random share of their total size.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.virtual_rig import EFFECTS, PRESETS
from pendmap.virtual_rig.effects.base import Effect, Floats, Motion, Reading, shape

if TYPE_CHECKING:
    from numpy.random import Generator

    from pendmap.virtual_rig import Request

ORDERS: Final = (2, 40)  # Least and greatest order per turn of a texture
TERMS: Final = 8  # Number of terms of a texture and of a drift
TORQUE: Final = 0.1  # Torque of a texture, in units of w0^2, that changes readings by about 1 rad
FRICTION: Final = 0.005
"""Friction of a texture, in units of w0^2, that changes readings by about 1 rad."""
_STREAM: Final = 4  # The rig's parts have the streams of random numbers 0 to 3


@dataclasses.dataclass(frozen=True)
class Mess:
    """Disturbances of one experiment; a series has the rows numbers, weights and phases."""

    torque: float  # root mean square, in units of w0^2
    friction: float
    series: tuple[Floats, Floats]  # torque and friction over the angle, root mean square 1
    drift: Floats  # of the zero over lab time: angular frequencies (rad/s), amplitudes (rad)
    noise: float  # root mean square of the correlated noise, rad
    time: float  # its correlation time, s


@functools.lru_cache(maxsize=4)
def drawn(size: float, longest: float, seed: float) -> Mess:
    """Draw disturbances that change readings by about ``size`` rad rms until ``longest`` s."""
    rng = np.random.default_rng([int(seed), _STREAM])
    shares = size * np.sqrt(rng.dirichlet(np.ones(4)))
    slow = 2 * math.pi / np.exp(rng.uniform(math.log(60), math.log(60 + longest), TERMS))
    weights = rng.standard_normal(TERMS) / slow
    weights *= math.sqrt(2) * shares[2] / np.linalg.norm(weights)
    series = _texture(rng), _texture(rng)
    drift = np.stack([slow, weights, rng.uniform(-math.pi, math.pi, TERMS)])
    time = float(np.exp(rng.uniform(-3.0, 1.0)))
    torque, friction = shares[0] * TORQUE, shares[1] * FRICTION
    return Mess(torque, friction, series, drift, float(shares[3]), time)


def _texture(rng: Generator) -> Floats:
    orders = rng.choice(np.arange(ORDERS[0], ORDERS[1] + 1), TERMS, replace=False)
    weights = rng.standard_normal(TERMS) / orders
    weights *= math.sqrt(2) / np.linalg.norm(weights)
    return np.stack([orders, weights, rng.uniform(-math.pi, math.pi, TERMS)])


def _sum(series: Floats, x: Floats) -> Floats:
    numbers, weights, phases = series
    return np.asarray(np.sin(x[..., None] * numbers + phases) @ weights, np.float64)


class BearingTexture(Effect):
    """Uneven bearing races: torque and friction vary with the angle."""

    name = "bearing_texture"
    group = "torque"
    formula = "+torque f(th) - friction g(th)^2 sign v, f and g random series in th"
    drawn = False

    size: float = shape(0.0, 1.0, "rad", least=0.0)
    longest: float = shape(0.0, 1e5, "s", least=0.0)
    seed: float = shape(0, 2**31, "", whole=True, least=0)

    def acceleration(self, motion: Motion) -> Floats:
        """Return the torque of the texture."""
        mess = drawn(**vars(self))
        return mess.torque * motion.w0**2 * _sum(mess.series[0], motion.theta)

    def friction(self, motion: Motion) -> Floats:
        """Return the friction of the texture."""
        mess = drawn(**vars(self))
        return mess.friction * motion.w0**2 * _sum(mess.series[1], motion.theta) ** 2


class UnsteadyZero(Effect):
    """A zero of the sensor that drifts, with correlated noise."""

    name = "unsteady_zero"
    group = "reading"
    formula = "reading th + d(t) + slow noise, d a random series in lab time t"
    drawn = False
    order = 5

    size: float = shape(0.0, 1.0, "rad", least=0.0)
    longest: float = shape(0.0, 1e5, "s", least=0.0)
    seed: float = shape(0, 2**31, "", whole=True, least=0)

    def distort(self, seen: Reading) -> Floats:
        """Return the reading with drift and noise."""
        mess, lab = drawn(**vars(self)), seen.path.lab
        # A stream for each run, which its beginning identifies.
        rng = np.random.default_rng([int(self.seed), _STREAM, round(10 * lab)])
        memory = np.exp(-np.diff(seen.time, prepend=-np.inf) / mess.time)
        white = rng.standard_normal(memory.size) * np.sqrt(1 - memory**2)
        noise = [0.0]
        for factor, step in zip(memory.tolist(), white.tolist(), strict=True):
            noise.append(factor * noise[-1] + step)
        return seen.angle + _sum(mess.drift, lab + seen.time) + mess.noise * np.array(noise[1:])


EFFECTS.update({kind.name: kind for kind in (BearingTexture, UnsteadyZero)})
NAMES: Final = (BearingTexture.name, UnsteadyZero.name)


def added(request: Request, size: float) -> Request:
    """Return a request with disturbances of this size, rad, beside its effects."""
    preset, rng = PRESETS[request.preset], np.random.default_rng([request.seed, 0])
    w0 = preset.parameters(rng).w0
    plans = preset.plan(np.random.default_rng([request.seed, 1]), w0, request.runs)
    longest = max(plan.lab_time + plan.duration for plan in plans)
    about = f"size={size!r},longest={longest!r},seed={request.seed}"
    hidden = [effect for effect in request.effects if effect != "none"]
    effects = (*hidden, *(f"{name},{about}" for name in NAMES))
    return dataclasses.replace(request, effects=effects)
