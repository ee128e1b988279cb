"""The sensor: counts, noise, lost and false samples, an unsteady clock."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.virtual_rig.effects.readings import fading

if TYPE_CHECKING:
    from numpy.random import Generator
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

_LONGEST_GAP: Final = 20
"""Samples that a dropout can swallow."""


@dataclasses.dataclass(frozen=True)
class Sensor:
    """How the angle is read and written down.

    ``theta_rad = count round((reading + noise) / count)`` with ``count = 2 pi / counts``.

    Parameters
    ----------
    rate : float
        Samples a second, Hz.
    counts : int
        Counts a turn; 0 reads without steps.
    noise : float
        Standard deviation of the noise before it is counted, rad.
    correlation : float
        Coefficient of the noise from one sample to the next (AR(1)); 0 is white.
    dropouts, outliers : float
        Shares of the samples that are lost, in gaps of up to 20, and that are false by 0.2 rad
        or more.
    jitter : float
        Standard deviation of the instants of sampling, s; the record keeps the nominal ones.

    Raises
    ------
    InputError
        If a value is not finite or outside its range.
    """

    rate: float = 100.0
    counts: int = 4096
    noise: float = 0.0
    correlation: float = 0.0
    dropouts: float = 0.0
    outliers: float = 0.0
    jitter: float = 0.0

    def __post_init__(self) -> None:
        ranges = {
            "rate": (1.0, 1e5, "Hz"),
            "counts": (0, 10**9, ""),
            "noise": (0.0, math.pi, "rad"),
            "correlation": (-0.999, 0.999, ""),
            "dropouts": (0.0, 0.5, ""),
            "outliers": (0.0, 0.5, ""),
            "jitter": (0.0, 0.1, "s"),
        }
        for name, (low, high, unit) in ranges.items():
            value = getattr(self, name)
            if not math.isfinite(value) or not low <= value <= high:
                wanted = f"a number from {low:g} to {high:g} {unit}".strip()
                raise InputError(f"{name} must be {wanted}, got {value:g}")

    @property
    def count(self) -> float:
        """One count, rad; 0 if there are none."""
        return 2 * math.pi / self.counts if self.counts else 0.0

    def times(self, duration: float) -> Floats:
        """Nominal times of the samples of a run, s."""
        return np.arange(math.floor(duration * self.rate + 1e-9) + 1) / self.rate

    def instants(self, times: Floats, rng: Generator) -> Floats:
        """When the samples are really taken, s, in order and not before the run begins."""
        if self.jitter == 0:
            return times
        shifted = times + self.jitter * rng.standard_normal(times.size)
        return np.sort(np.clip(shifted, times[0], times[-1]))

    def write_down(self, reading: Floats, rng: Generator) -> tuple[Floats, NDArray[np.bool_]]:
        """Return the angles of the record, rad, and which samples it keeps; shapes (N,).

        The draws for noise, false and lost samples follow one another whatever their sizes are, so
        that one setting does not change what another one draws.
        """
        count = reading.size
        white = rng.standard_normal(count)
        false, shift = rng.random(count), rng.uniform(0.2, math.pi, count)
        sign, lost = rng.choice((-1.0, 1.0), count), rng.random(count)
        lengths = rng.integers(1, _LONGEST_GAP, count, endpoint=True)
        value = reading + self.noise * self._coloured(white)
        value = value + np.where(false < self.outliers, sign * shift, 0.0)
        if self.counts:
            value = self.count * np.round(value / self.count)
        keep = np.ones(count, bool)
        # A sample is lost if one of the gaps that begin at random covers it.
        mean = (1 + _LONGEST_GAP) / 2
        begins = np.flatnonzero(lost < -math.log1p(-self.dropouts) / mean)
        for k in begins:
            keep[k : k + lengths[k]] = False
        keep[0] = True
        return value, keep

    def _coloured(self, white: Floats) -> Floats:
        """AR(1) noise of unit variance from white noise."""
        rho = self.correlation
        if rho == 0:
            return white
        driven = math.sqrt(1 - rho**2) * white
        driven[0] = white[0]
        return fading(driven, rho)
