"""The sensor: encoder counts, noise, lost samples, outliers, jitter; and weak disturbances.

The disturbances, which no effect describes, are a texture of the bearing (torque and friction as
random series in the angle), a slow drift of the sensor's zero, and noise with a correlation time of
a fraction of a second to some seconds. Each has a random share of their total size.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.virtual_rig.effects.base import Effect, Floats, Motion
from pendmap.virtual_rig.effects.readings import first_order_filter

if TYPE_CHECKING:
    from numpy.random import Generator
    from numpy.typing import NDArray

_LONGEST_GAP: Final = 20  # Longest gap of a dropout, samples
ORDERS: Final = (2, 40)  # Least and greatest order per turn of a texture
TERMS: Final = 8  # Number of terms of a texture and of a drift
TORQUE: Final = 0.1  # Torque of a texture, in units of w0^2, that changes readings by about 1 rad
FRICTION: Final = 0.005
"""Friction of a texture, in units of w0^2, that changes readings by about 1 rad."""


def check_ranges(owner: object, **ranges: tuple[float, float, str]) -> None:
    """Raise InputError for attributes outside (least, greatest, unit); ``None`` is allowed."""
    for name, (low, high, unit) in ranges.items():
        value = getattr(owner, name)
        if value is not None and not low <= value <= high:
            wanted = f"a number from {low:g} to {high:g} {unit}".strip()
            raise InputError(f"{name} must be {wanted}, got {value:g}")


@dataclasses.dataclass(frozen=True)
class Sensor:
    """Sensor settings; conversion of noise-free readings into a record.

    ``theta_rad = count round((reading + noise) / count)`` with ``count = 2 pi / counts``.
    """

    rate: float = 100.0  # samples a second, Hz
    counts: int = 4096  # counts per turn; 0 for no quantisation
    noise: float = 0.0  # standard deviation before quantisation, rad
    correlation: float = 0.0  # of the noise from one sample to the next, AR(1); 0 is white
    dropouts: float = 0.0  # share of the samples that are lost, in gaps of up to 20
    outliers: float = 0.0  # share of the samples with an error of 0.2 rad or more
    jitter: float = 0.0  # standard deviation of the sampling instants, s; times are nominal

    def __post_init__(self) -> None:
        check_ranges(
            self,
            rate=(1.0, 1e5, "Hz"),
            counts=(0, 10**9, ""),
            noise=(0.0, math.pi, "rad"),
            correlation=(-0.999, 0.999, ""),
            dropouts=(0.0, 0.5, ""),
            outliers=(0.0, 0.5, ""),
            jitter=(0.0, 0.1, "s"),
        )

    @property
    def count(self) -> float:
        """Angle of one count, rad; 0 without quantisation."""
        return 2 * math.pi / self.counts if self.counts else 0.0

    def times(self, duration: float) -> Floats:
        """Return the nominal sample times of a run, s."""
        return np.arange(math.floor(duration * self.rate + 1e-9) + 1) / self.rate

    def instants(self, times: Floats, rng: Generator) -> Floats:
        """Return the actual sampling instants, s, in order and not before the run begins."""
        if self.jitter == 0:
            return times
        shifted = times + self.jitter * rng.standard_normal(times.size)
        return np.sort(np.clip(shifted, times[0], times[-1]))

    def write_down(self, reading: Floats, rng: Generator) -> tuple[Floats, NDArray[np.bool_]]:
        """Return the recorded angles, rad, and which samples are kept; shapes (N,)."""
        # All draws are made whatever the settings, so that no setting changes the draws of another.
        count = reading.size
        white = rng.standard_normal(count)
        false, shift = rng.random(count), rng.uniform(0.2, math.pi, count)
        sign, lost = rng.choice((-1.0, 1.0), count), rng.random(count)
        lengths = rng.integers(1, _LONGEST_GAP, count, endpoint=True)
        if self.correlation:
            white[1:] *= math.sqrt(1 - self.correlation**2)
            white = first_order_filter(white, self.correlation)
        value = reading + self.noise * white
        value = value + np.where(false < self.outliers, sign * shift, 0.0)
        if self.counts:
            value = self.count * np.round(value / self.count)
        keep = np.ones(count, bool)
        # A sample is lost if it lies in one of the gaps, which begin at random.
        mean = (1 + _LONGEST_GAP) / 2
        begins = np.flatnonzero(lost < -math.log1p(-self.dropouts) / mean)
        for k in begins:
            keep[k : k + lengths[k]] = False
        keep[0] = True
        return value, keep


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
