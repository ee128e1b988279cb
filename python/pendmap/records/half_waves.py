"""Half swings as an accelerometer reads them: one hump each, or two beyond a quarter turn."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.swinging import QUIET
from pendmap.records.swings import swings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Places = tuple[int, int]

__all__ = ["Wave", "wave_of", "waves_of"]

DIP: Final = 0.01
"""Share of a hump by which a reading falls at least between two humps ..."""

NOISY: Final = 4.0
"""... and how many standard errors."""

TALL: Final = 0.75
"""Share of the largest reading of a swing that humps beside a dip reach at least: they are where
the sine is 1."""


@dataclasses.dataclass(frozen=True)
class Wave:
    """The readings between two passages of the middle: where it dips, how high the humps are."""

    low: int
    high: int
    humps: tuple[int, int]
    top: float
    dip: float
    half_period: float = math.nan

    def folded(self, gain: float) -> bool:
        """Whether it went beyond a quarter turn."""
        return self.dip > 0 and self.top > TALL * abs(gain)

    def amplitude(self, gain: float) -> float:
        """The angle at which it turned, rad."""
        if self.folded(gain):
            return math.pi - math.asin(1 - self.dip)
        return math.asin(min(self.top / abs(gain), 1.0))


def waves_of(time: Floats, values: Floats, part: Places, noise: float) -> list[Wave]:
    """Return the half swings of a free stretch between passages of the middle."""
    stretch = slice(*part)
    found = swings(time[stretch], values[stretch], least=max(QUIET * noise, 1e-12))
    waves = []
    for start, end in zip(found.crossing[:-1], found.crossing[1:], strict=True):
        low, high = (part[0] + int(k) for k in np.searchsorted(time[stretch], (start, end)))
        if high - low >= 3:
            waves.append(wave_of(values, low, high, noise, end - start))
    return waves


def wave_of(
    values: Floats, low: int, high: int, noise: float, half_period: float = math.nan
) -> Wave:
    """Return the half swing from one place to another; from the start of a record a part of one."""
    size = np.abs(values[low:high])
    # Noise on few samples makes no dip of three.
    smooth = np.convolve(np.pad(size, 1, mode="edge"), np.ones(3) / 3, mode="valid")
    top = int(np.argmax(smooth))
    before, after = np.maximum.accumulate(smooth), np.maximum.accumulate(smooth[::-1])[::-1]
    depth = np.minimum(before, after) - smooth
    at = int(np.argmax(depth))
    ends = (int(np.argmax(smooth[: at + 1])), at + int(np.argmax(smooth[at:])))
    height = float(smooth[top])
    dip = float(depth[at] + height - min(before[at], after[at])) / height if depth[at] > 0 else 0.0
    if min(before[at], after[at]) < 0.7 * height or depth[at] < max(DIP * height, NOISY * noise):
        dip, ends = 0.0, (top, top)  # one hump: what noise does on its slope is no dip
    humps = (low + ends[0], low + ends[1])
    return Wave(low, high, humps, height, min(dip, 1.0), half_period)
