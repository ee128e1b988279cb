"""The sensor: encoder counts, noise, lost samples, outliers, jitter."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.signal import lfilter

from pendmap.errors import InputError

if TYPE_CHECKING:
    from numpy.random import Generator
    from numpy.typing import NDArray

    from pendmap.virtual_rig.effects.base import Floats

_LONGEST_GAP: Final = 20  # Longest gap of a dropout, samples


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
            white = lfilter([1.0], [1.0, -self.correlation], white)
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
