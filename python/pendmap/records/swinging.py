"""Detection of free swings and holds in the readings of an accelerometer on a pendulum.

The angle computed from the readings is folded at a quarter turn, so holds are found in the readings
themselves: constant in a hold; in free swings, nearly periodic and not growing.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.signal import Stretch
from pendmap.signal.half_cycles import swings
from pendmap.signal.robust import between, stretches

if TYPE_CHECKING:
    from pendmap.signal import Floats, Mask

LEAST_SWING: Final = 5.0  # Least reading of a swing, standard deviations of the noise
STILL_SPAN: Final = 8.0  # Range over a period below which there is no motion, over the noise
STILL_SCATTER: Final = 1.5  # Scatter over half a period without motion, over the noise
STEADY_HOLD: Final = 0.1  # Greatest scatter of a hold by hand, over its distance from the middle
FEWEST_QUIET: Final = 10  # Fewest samples of half a period that are tested for scatter
FEWEST_HALF_SWINGS: Final = 3  # Fewest half swings of a motion that is not by hand
UNEVEN: Final = 0.15  # Greatest relative change in duration between half swings of one side
GROWTH: Final = 1.1  # Greatest ratio of successive maxima on one side
DECAY: Final = 0.6  # Least ratio of successive maxima on one side
RELEASE_STEP: Final = 2.5  # Least step at a release, over the fastest change of a free swing
DECAYED: Final = 0.05  # Amplitude, over the largest, below which a motion has decayed


def swinging(time: Floats, reading: Floats, noise: float) -> tuple[list[Stretch], list[Stretch]]:
    """Return the free swings and the quiet holds before releases in an acceleration."""
    from scipy.ndimage import median_filter

    least = max(LEAST_SWING * noise, 1e-12)
    # A single outlier is neither a step nor the end of a hold.
    reading = np.asarray(median_filter(reading, 3, mode="nearest"))
    crossing = swings(time, reading - middle_over(time, reading, least), least=least).crossing
    if crossing.size < FEWEST_HALF_SWINGS:
        return [(0, time.size)], []
    period = float(np.median(crossing[2:] - crossing[:-2]))
    quiet = _quiet(time, reading, period, noise)
    largest, free, held = 0.0, list[Stretch](), list[Stretch]()
    for edge, high in between(quiet, 0, time.size):
        if high - edge <= 5:
            continue
        part = reading[edge:high] - middle_over(time[edge:high], reading[edge:high], least)
        if swings(time[edge:high], part, least=least).peak.size < FEWEST_HALF_SWINGS:
            continue
        largest = max(largest, float(np.max(np.abs(part))))
        low = edge + release_after_hold(time[edge:high], part, noise)
        part = reading[low:high] - middle_over(time[low:high], reading[low:high], least)
        small = DECAYED * largest
        end = _untouched(time[low:high], part, least, small, more=high < time.size)
        held += [stretch for stretch in quiet if stretch[1] == edge]
        free.append((low, low + end))
    return free or [(0, time.size)], held


def middle_over(time: Floats, reading: Floats, least: float) -> float:
    """Return the mean reading over the later half of the full swings, the sensor's bias."""
    middle = float(np.median(reading))
    for _ in range(3):
        crossing = swings(time, reading - middle, least=least).crossing
        crossing = crossing[crossing.size // 2 :]
        if crossing.size < 3:
            return middle
        last = crossing[(crossing.size - 1) // 2 * 2]
        inside = (time >= crossing[0]) & (time < last)
        if np.count_nonzero(inside) < 3:
            return middle
        middle = float(np.mean(reading[inside]))
    return middle


def _quiet(time: Floats, reading: Floats, period: float, noise: float) -> list[Stretch]:
    """Return the stretches of constant readings, in order."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d

    interval = float(np.median(np.diff(time)))
    width = max(round(period / interval), 5) | 1
    if width >= reading.size:
        return []
    spread = maximum_filter1d(reading, width) - minimum_filter1d(reading, width)
    limit = min(STILL_SPAN * noise, 0.4 * float(np.ptp(reading)))
    still = _all_of(spread <= limit, width)
    short = (width // 2) | 1
    if short < FEWEST_QUIET:
        return stretches(still)
    middle = middle_over(time, reading, LEAST_SWING * noise)
    values = reading - middle
    away, square = (uniform_filter1d(x, short) for x in (values, values**2))
    still |= _all_of(square - away**2 <= (STILL_SCATTER * noise) ** 2, short)
    away, square = (uniform_filter1d(x, width) for x in (values, values**2))
    limits = np.where(np.abs(away) > LEAST_SWING * noise, (STEADY_HOLD * away) ** 2, -1.0)
    found = []
    for low, high in stretches(still | _all_of(square - away**2 <= limits, width)):
        # Without trembling, the release is located to a sample.
        sure = low + np.flatnonzero(still[low:high]) + 1
        exact = sure.size and sure[-1] > high - width // 2
        found.append((low, int(sure[-1]) if exact else high))
    return found


def _all_of(middles: Mask, width: int) -> Mask:
    """Return the mask of samples in windows of ``width`` about marked samples."""
    from scipy.ndimage import binary_dilation

    half = width // 2
    middles = middles.copy()
    middles[:half] = middles[-half:] = False
    return np.asarray(binary_dilation(middles, iterations=half), bool)


def release_after_hold(time: Floats, values: Floats, noise: float) -> int:
    """Return the end of a hold too short for :func:`_quiet`; 0 if there is none."""
    crossing = swings(time, values, least=max(LEAST_SWING * noise, 1e-12)).crossing
    if crossing.size < FEWEST_HALF_SWINGS + 3:
        return 0
    # A pendulum carried from rest may cross the middle twice before its release.
    begin, after = (int(np.searchsorted(time, crossing[k])) for k in (2, 5))
    steps = np.abs(np.diff(values[:after]))
    at = int(np.argmax(steps[:begin]))
    fastest = float(np.max(np.delete(steps, slice(max(at - 1, 0), at + 2)), initial=0.0))
    return at + 1 if steps[at] > max(RELEASE_STEP * fastest, STILL_SPAN * noise) else 0


def _untouched(time: Floats, values: Floats, least: float, small: float, *, more: bool) -> int:
    """Return the end (exclusive) of a free swing, at which a hand may take the pendulum.

    ``more`` is true if a quiet stretch follows.
    """
    found = swings(time, values, least=least)
    halves, tops = np.diff(found.crossing), np.abs(found.peak)
    slack = least if math.isfinite(least) else 0.0  # the noise of few samples is not known

    def follows(k: int) -> bool:
        """Return whether a half swing is a free continuation of the last one on its side."""
        even = abs(halves[k] / halves[k - 2] - 1) < UNEVEN
        return bool(even and DECAY * tops[k - 2] - slack < tops[k] < GROWTH * tops[k - 2] + slack)

    last = tops.size - 1
    # Two half swings are required: a hand may cause a single one similar to those before.
    while last > 2 and not (follows(last) and follows(last - 1)):
        last -= 1
    if last < 2 or tops[last] < max(small, 3 * least):
        return time.size  # it decays to rest
    tail = values[int(np.searchsorted(time, found.crossing[-1])) :]
    grown = np.max(np.abs(tail), initial=0.0) > tops[last - 1] * GROWTH + least
    whole = time[-1] - found.crossing[-1] < (1 + UNEVEN) * halves[last - 1]
    if whole and last == tops.size - 1 and not more and not grown:
        return time.size
    return int(np.searchsorted(time, found.crossing[last + 1]))
