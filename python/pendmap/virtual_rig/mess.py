"""Weak disturbances that no effect describes, in addition to the main effect of a rig.

They are a texture of the bearing (torque and friction as random series in the angle), a slow drift
of the sensor's zero, and noise with a correlation time of a fraction of a second to some seconds.
Each has a random share of the total size, which is a multiple of the sensor's noise.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.virtual_rig.effects.base import Effect, Floats, Motion
from pendmap.virtual_rig.effects.readings import first_order_filter

if TYPE_CHECKING:
    from numpy.random import Generator

    from pendmap.virtual_rig.sensor import Sensor

ORDERS: Final = (2, 40)  # Least and greatest order per turn of a texture
TERMS: Final = 8  # Number of terms of a texture and of a drift
TORQUE: Final = 0.1  # Torque of a texture, in units of w0^2, that changes readings by about 1 rad
FRICTION: Final = 0.005
"""Friction of a texture, in units of w0^2, that changes readings by about 1 rad."""


class Texture(Effect):
    """Uneven bearing races: torque and friction vary with the angle.

    ``+torque sum c_k sin(n_k th + psi_k) - friction |sum d_k sin(n_k th + phi_k)| sign v``
    """

    name = "bearing_texture"
    group = "torque"
    formula = "+torque f(th) - friction |g(th)| sign v, f and g random series in th"
    drawn = False

    torque: float
    friction_size: float
    series: tuple[Floats, ...]

    def __post_init__(self) -> None:
        """Skip the range checks: the numbers are drawn."""

    @classmethod
    def made(cls, rng: Generator, torque: float, friction: float) -> Texture:
        """Draw a texture whose series have a root mean square of 1."""
        series: list[Floats] = []
        for _ in range(2):
            orders = rng.choice(np.arange(ORDERS[0], ORDERS[1] + 1), TERMS, replace=False)
            weights = rng.standard_normal(TERMS) / orders
            weights *= math.sqrt(2) / np.linalg.norm(weights)
            series.append(np.stack([orders, weights, rng.uniform(-math.pi, math.pi, TERMS)]))
        return cls(torque, friction, tuple(series))

    def _series(self, which: int, theta: Floats) -> Floats:
        orders, weights, phases = self.series[which]
        return np.asarray(np.sin(theta[..., None] * orders + phases) @ weights, np.float64)

    def acceleration(self, motion: Motion) -> Floats:
        """Return the torque of the texture."""
        return self.torque * self._series(0, motion.theta)

    def friction(self, motion: Motion) -> Floats:
        """Return the friction of the texture."""
        return self.friction_size * self._series(1, motion.theta) ** 2


@dataclasses.dataclass(frozen=True)
class Mess:
    """Disturbances of one experiment."""

    texture: Texture
    drift: Floats  # amplitudes (rad), angular frequencies (rad/s), phases of the zero; shape (3, k)
    noise: float  # root mean square of the correlated noise, rad
    time: float  # its correlation time, s

    @classmethod
    def made(cls, rng: Generator, size: float, w0: float, longest: float) -> Mess:
        """Draw disturbances that change readings by about ``size`` rad rms until ``longest`` s."""
        shares = size * np.sqrt(rng.dirichlet(np.ones(4)))
        slow = 2 * math.pi / np.exp(rng.uniform(math.log(60), math.log(60 + longest), TERMS))
        weights = rng.standard_normal(TERMS) / slow
        weights *= math.sqrt(2) * shares[2] / np.linalg.norm(weights)
        texture = Texture.made(rng, shares[0] * TORQUE * w0**2, shares[1] * FRICTION * w0**2)
        drift = np.stack([weights, slow, rng.uniform(-math.pi, math.pi, TERMS)])
        return cls(texture, drift, float(shares[3]), float(np.exp(rng.uniform(-3.0, 1.0))))

    def reading(self, lab: Floats, sensor: Sensor, rng: Generator) -> Floats:
        """Return the contribution of drift and noise to readings at lab times, rad."""
        weights, slow, phases = self.drift
        drift = np.sin(lab[:, None] * slow + phases) @ weights
        rho = math.exp(-1 / (sensor.rate * self.time))
        white = rng.standard_normal(lab.size)
        white[1:] *= math.sqrt(1 - rho**2)
        return np.asarray(drift + self.noise * first_order_filter(white, rho), np.float64)

    def describe(self) -> dict[str, Any]:
        """Return the entries of the truth file."""
        return {
            "torque_rms": self.texture.torque,
            "friction_rms": self.texture.friction_size,
            "drift_rms_rad": float(np.linalg.norm(self.drift[0]) / math.sqrt(2)),
            "noise_rad": self.noise,
            "correlation_time_s": self.time,
        }
