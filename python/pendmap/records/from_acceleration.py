"""Angle from an accelerometer alone, as initial guess of a fit and for figures.

A free swing has ``th'' = -w0**2 sin(th)`` without damping: a tangential sensor reads
``(g - r w0**2) sin(th)``, an angular acceleration is ``-w0**2 sin(th)``. The readings of a half
swing beyond a quarter turn have two maxima with a dip between, in which the angle is
``pi - arcsin``.

The angle is folded at a quarter turn, so holds are found in the readings themselves: constant in a
hold; in free swings, nearly periodic and not growing.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.records.noise import noise_of
from pendmap.signal import Stretch
from pendmap.signal.half_cycles import swings
from pendmap.signal.robust import between, stretches, widened

if TYPE_CHECKING:
    from pendmap.records.rod_sensors import Accelerometer
    from pendmap.records.work import Work
    from pendmap.signal import Floats, Mask


FEWEST_HALF_SWINGS: Final = 4  # Fewest half swings from which a period is estimated
CERTAIN_DIP: Final = 0.3  # Relative dip that noise cannot cause
LARGEST_READING: Final = 1.15  # Greatest reading, over the theoretical maximum: else wrong unit
ONE_SIDED: Final = 0.15  # Smaller over larger side of the readings below which the axis is radial
BLIND_SPOT: Final = 0.05  # Relative distance to the centre of oscillation that is refused
WEAK_SPOT: Final = 0.2  # Relative distance to the centre of oscillation that gives a warning
QUARTER_TURN_PERIOD: Final = 1.18  # Period at an amplitude of a quarter turn, over that at 0
LEAST_DIP: Final = 0.01  # Least relative dip between two maxima
DIP_NOISE: Final = 4.0  # Least dip, standard deviations of the noise
LEAST_HUMP: Final = 0.75  # Least maximum beside a dip, over the greatest reading (sine 1)
LEAST_SWING: Final = 5.0  # Least reading of a swing, standard deviations of the noise
STILL_SPAN: Final = 8.0  # Range of readings below which there is no motion, over the noise
STILL_SCATTER: Final = 1.5  # Scatter over half a period without motion, over the noise
STEADY_HOLD: Final = 0.1  # Greatest scatter of a hold by hand, over its distance from the middle
FEWEST_QUIET: Final = 10  # Fewest samples of half a period that are tested for scatter
FEWEST_IN_MOTION: Final = 3  # Fewest half swings of a motion that is not by hand
UNEVEN: Final = 0.15  # Greatest relative change in duration between half swings of one side
GROWTH: Final = 1.1  # Greatest ratio of successive maxima on one side
DECAY: Final = 0.6  # Least ratio of successive maxima on one side
RELEASE_STEP: Final = 2.5  # Least step at a release, over the fastest change of a free swing
DECAYED: Final = 0.05  # Amplitude, over the largest, below which a motion has decayed


def angle_from(work: Work, accelerometer: Accelerometer) -> str:
    """Compute the angle from an acceleration; return a doubt; InputError if it is no swing."""
    time, reading, where = work.time, work.extra["acceleration"], work.where
    noise = noise_of(time, reading).sigma
    noise = noise if math.isfinite(noise) else 0.0
    free, held = swinging(time, reading, noise)
    least = max(LEAST_SWING * noise, 1e-12)
    middles = [middle_over(time[a:b], reading[a:b], least) for a, b in free]
    middle = float(np.average(middles, weights=[b - a for a, b in free]))
    swung = np.concatenate([reading[a:b] for a, b in free])
    _refuse_radial(swung, middle, accelerometer, where)
    values = reading - middle
    by_swing = [waves_of(time, values, part, noise) for part in free]
    waves = [wave for part in by_swing for wave in part]
    if len(waves) < FEWEST_HALF_SWINGS:
        raise InputError(
            f"{where}: the acceleration must show {FEWEST_HALF_SWINGS} half swings or more if"
            f" there is no angle, got {len(waves)}"
        )
    sensor = dataclasses.replace(accelerometer, w0=_frequency(waves, accelerometer))
    largest = max(wave.top for wave in waves)
    signal = largest / noise if noise else math.inf
    weak = signal < 4 * LEAST_SWING
    doubt = _refuse_blind(sensor, waves, where, weak=weak)
    _refuse_large(by_swing, sensor, where)
    for low, high in held:
        level = abs(float(np.median(values[low:high])))
        if sensor.gravity and level > LARGEST_READING * sensor.gravity:
            raise InputError(
                f"{where}: the acceleration is {level:.3g} {sensor.unit} while the pendulum is"
                f" held, and gravity gives at most {sensor.gravity:.3g}: unit is wrong"
            )
    if weak:
        doubt = f"the largest reading is {signal:.2g} times the noise{doubt and f'; {doubt}'}"
    work.theta, work.accelerometer = _unfolded(values, by_swing, free, sensor, noise), sensor
    for low, high in held:
        # A held pendulum has no acceleration: the sensor reads gravity, or nothing.
        pull = values[low:high] / sensor.gravity if sensor.gravity else np.zeros(high - low)
        work.theta[low:high] = np.arcsin(np.clip(pull, -1, 1))
    return doubt


def _refuse_radial(reading: Floats, middle: float, sensor: Accelerometer, where: str) -> None:
    """Raise InputError for readings of an axis along the rod, which have one sign."""
    low, high = (float(x) for x in np.quantile(reading, (0.02, 0.98)))
    sided = low * high > 0 or min(abs(low), abs(high)) < ONE_SIDED * max(abs(low), abs(high))
    if not sided or sensor.direction == "angular":
        return
    if abs(middle) > 0.5 * (sensor.gravity or math.inf):
        why = f"it reads {middle:+.3g} m/s^2 in the middle of the swing, as gravity along the rod"
    else:
        why = f"its readings lie on one side, {low:.3g} to {high:.3g} m/s^2, as those along the rod"
    raise InputError(
        f'{where}: direction is "tangential", but {why}: it must be the column of the axis across'
        " the rod"
    )


def _frequency(waves: list[Wave], sensor: Accelerometer) -> float:
    """Return ``w0`` from the smaller half swings and their amplitudes."""
    from scipy.special import ellipk

    smaller = sorted(waves, key=lambda wave: wave.top * (1 + wave.dip))[: max(len(waves) // 3, 3)]
    halves = np.array([wave.half_period for wave in smaller])
    w0 = math.pi / float(np.median(halves))
    for _ in range(20):
        gain = dataclasses.replace(sensor, w0=w0).gain or 1e-9
        size = np.array([wave.amplitude(gain) for wave in smaller])
        new = float(np.median(2 * ellipk(np.sin(size / 2) ** 2) / halves))
        w0, last = 0.5 * (w0 + new), w0
        if abs(w0 - last) < 1e-9 * w0:
            break
    return w0


def _refuse_blind(sensor: Accelerometer, waves: list[Wave], where: str, *, weak: bool) -> str:
    """Raise InputError for a sensor at the centre of oscillation; return a warning near it."""
    if not sensor.gravity:
        return ""
    length = sensor.gravity / sensor.w0**2
    away = abs(sensor.distance_m / length - 1)
    if weak:
        # Readings near the noise do not show the amplitude: the period may be longer than that of
        # small swings by up to QUARTER_TURN_PERIOD.
        slow = math.pi / float(np.median([wave.half_period for wave in waves]))
        lengths = sensor.gravity / slow**2 / QUARTER_TURN_PERIOD**2, sensor.gravity / slow**2
        if (1 - BLIND_SPOT) * lengths[0] < sensor.distance_m < (1 + BLIND_SPOT) * lengths[1]:
            length, away = min(lengths, key=lambda x: abs(x - sensor.distance_m)), 0.0
    if away < BLIND_SPOT:
        # Weak readings give an uncertain frequency and thus centre of oscillation.
        raise InputError(
            f"{where}: distance_m is {sensor.distance_m:g}, that of the centre of oscillation,"
            " g/w0^2 from the pivot, where gravity and the swing cancel: only damping is"
            " measured there; it must be another place on the rod, or an angle must be recorded too"
        )
    if away > WEAK_SPOT:
        return ""
    per_mm = 0.1 / abs(length - sensor.distance_m)
    return (
        f"distance_m is {sensor.distance_m:g} and the centre of oscillation g/w0^2 about"
        f" {length:.2g} m from the pivot, where gravity and the swing cancel to {100 * away:.0f} %:"
        f" an error of 1 mm makes angles {per_mm:.2g} % wrong"
    )


def _refuse_large(by_swing: list[list[Wave]], sensor: Accelerometer, where: str) -> None:
    """Raise InputError for readings larger than those of any swing, and for rotations."""
    top = float(np.quantile([wave.top for waves in by_swing for wave in waves], 0.8))
    most = abs(sensor.gain)
    if top > LARGEST_READING * most:
        place = ""
        if sensor.direction != "angular":
            removed = "" if sensor.gravity else ", gravity removed"
            place = f" at distance_m = {sensor.distance_m:g}{removed}"
        raise InputError(
            f"{where}: the acceleration reaches {top:.3g} {sensor.unit}, and a swing of this period"
            f" at most {most:.3g}{place}: unit, distance_m, direction or gravity_removed is wrong"
        )
    for waves in by_swing:
        folds = [k for k, wave in enumerate(waves) if wave.dip > CERTAIN_DIP]
        before = waves[: folds[-1]] if folds else []
        if any(not wave.folded(most) and wave.top > 0.9 * most for wave in before):
            raise InputError(
                f"{where}: the pendulum turns over the top, which an acceleration alone does not"
                " show: it must also have an angle or a velocity, or a later from_s"
            )


def _unfolded(
    values: Floats,
    by_swing: list[list[Wave]],
    free: list[Stretch],
    sensor: Accelerometer,
    noise: float,
) -> Floats:
    """Return the angle of each sample of free swings, rad."""
    most, sense = abs(sensor.gain), math.copysign(1.0, sensor.gain)
    theta = np.arcsin(np.clip(values / most, -1, 1)) * sense
    for (begin, _), whole in zip(free, by_swing, strict=True):
        waves = list(whole)
        if waves and waves[0].low > begin + 2:
            # Readings of a swing released beyond a quarter turn begin in a dip.
            start = wave_of(values, begin, waves[0].low, noise)
            if not start.folded(most) and waves[0].folded(most):
                start = dataclasses.replace(start, humps=(begin, start.humps[1]), dip=waves[0].dip)
            waves.insert(0, start)
        for wave in waves:
            if wave.folded(most):
                low, high = wave.humps
                inside = values[low : high + 1]
                folded = np.arcsin(np.clip(np.abs(inside) / wave.top, 0, 1))
                theta[low : high + 1] = np.sign(inside) * sense * (math.pi - folded)
    return np.asarray(theta)


@dataclasses.dataclass(frozen=True)
class Wave:
    """Readings between two crossings of the middle: maxima, height and relative dip."""

    low: int
    high: int
    humps: tuple[int, int]
    top: float
    dip: float
    half_period: float = math.nan

    def folded(self, gain: float) -> bool:
        """Return whether the amplitude exceeds a quarter turn."""
        return self.dip > 0 and self.top > LEAST_HUMP * abs(gain)

    def amplitude(self, gain: float) -> float:
        """Return the angle of the turning point, rad."""
        if self.folded(gain):
            return math.pi - math.asin(1 - self.dip)
        return math.asin(min(self.top / abs(gain), 1.0))


def waves_of(time: Floats, values: Floats, part: Stretch, noise: float) -> list[Wave]:
    """Return the half swings of a free stretch between crossings of the middle."""
    stretch = slice(*part)
    half = swings(time[stretch], values[stretch], least=max(LEAST_SWING * noise, 1e-12))
    waves = []
    for start, end in zip(half.crossing[:-1], half.crossing[1:], strict=True):
        low, high = (part[0] + int(k) for k in np.searchsorted(time[stretch], (start, end)))
        if high - low >= 3:
            waves.append(wave_of(values, low, high, noise, end - start))
    return waves


def wave_of(
    values: Floats, low: int, high: int, noise: float, half_period: float = math.nan
) -> Wave:
    """Return the half swing between two indices."""
    size = np.abs(values[low:high])
    # The mean of three samples removes dips of single samples.
    smooth = np.convolve(np.pad(size, 1, mode="edge"), np.ones(3) / 3, mode="valid")
    top = int(np.argmax(smooth))
    before, after = np.maximum.accumulate(smooth), np.maximum.accumulate(smooth[::-1])[::-1]
    depth = np.minimum(before, after) - smooth
    at = int(np.argmax(depth))
    ends = (int(np.argmax(smooth[: at + 1])), at + int(np.argmax(smooth[at:])))
    height = float(smooth[top])
    dip = float(depth[at] + height - min(before[at], after[at])) / height if depth[at] > 0 else 0.0
    if min(before[at], after[at]) < 0.7 * height or depth[at] < max(
        LEAST_DIP * height, DIP_NOISE * noise
    ):
        dip, ends = 0.0, (top, top)  # one maximum: fluctuations on its slope are noise
    humps = (low + ends[0], low + ends[1])
    return Wave(low, high, humps, height, min(dip, 1.0), half_period)


def swinging(time: Floats, reading: Floats, noise: float) -> tuple[list[Stretch], list[Stretch]]:
    """Return the free swings and the quiet holds before releases in an acceleration."""
    from scipy.ndimage import median_filter

    least = max(LEAST_SWING * noise, 1e-12)
    # A single outlier is neither a step nor the end of a hold.
    reading = np.asarray(median_filter(reading, 3, mode="nearest"))
    crossing = swings(time, reading - middle_over(time, reading, least), least=least).crossing
    if crossing.size < FEWEST_IN_MOTION:
        return [(0, time.size)], []
    period = float(np.median(crossing[2:] - crossing[:-2]))
    quiet = _quiet(time, reading, period, noise)
    largest, free, held = 0.0, list[Stretch](), list[Stretch]()
    for edge, high in between(quiet, 0, time.size):
        if high - edge <= 5:
            continue
        part = reading[edge:high] - middle_over(time[edge:high], reading[edge:high], least)
        if swings(time[edge:high], part, least=least).peak.size < FEWEST_IN_MOTION:
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
    from scipy.ndimage import uniform_filter1d

    interval = float(np.median(np.diff(time)))
    width = max(round(period / interval), 5) | 1
    if width >= reading.size:
        return []
    limit = min(STILL_SPAN * noise, 0.4 * float(np.ptp(reading)))
    still = constant(reading, width, limit)
    short = (width // 2) | 1
    if short < FEWEST_QUIET:
        return stretches(still)
    middle = middle_over(time, reading, LEAST_SWING * noise)
    values = reading - middle
    away, square = (uniform_filter1d(x, short) for x in (values, values**2))
    still |= _all_of(square - away**2 <= (STILL_SCATTER * noise) ** 2, short)
    away, square = (uniform_filter1d(x, width) for x in (values, values**2))
    limits = np.where(np.abs(away) > LEAST_SWING * noise, (STEADY_HOLD * away) ** 2, -1.0)
    holds = []
    for low, high in stretches(still | _all_of(square - away**2 <= limits, width)):
        # Without trembling, the release is located to a sample.
        sure = low + np.flatnonzero(still[low:high]) + 1
        exact = sure.size and sure[-1] > high - width // 2
        holds.append((low, int(sure[-1]) if exact else high))
    return holds


def constant(values: Floats, width: int, limit: float) -> Mask:
    """Return the mask of samples in windows of ``width`` whose range is at most ``limit``."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    spread = maximum_filter1d(values, width) - minimum_filter1d(values, width)
    return _all_of(spread <= limit, width)


def _all_of(middles: Mask, width: int) -> Mask:
    """Return the mask of samples in windows of ``width`` about marked samples."""
    half = width // 2
    middles = middles.copy()
    middles[:half] = middles[-half:] = False
    return widened(middles, half)


def release_after_hold(time: Floats, values: Floats, noise: float) -> int:
    """Return the end of a hold too short for :func:`_quiet`; 0 if there is none."""
    crossing = swings(time, values, least=max(LEAST_SWING * noise, 1e-12)).crossing
    if crossing.size < FEWEST_IN_MOTION + 3:
        return 0
    # A pendulum carried from rest may cross the middle twice before its release.
    begin, after = (int(np.searchsorted(time, crossing[k])) for k in (2, 5))
    steps = np.abs(np.diff(values[:after]))
    at = int(np.argmax(steps[:begin]))
    fastest = float(np.max(np.delete(steps, slice(max(at - 1, 0), at + 2)), initial=0.0))
    return at + 1 if steps[at] > max(RELEASE_STEP * fastest, STILL_SPAN * noise) else 0


def _untouched(time: Floats, values: Floats, least: float, small: float, *, more: bool) -> int:
    """Return the end (exclusive) of a free swing; ``more`` if a quiet stretch follows."""
    half = swings(time, values, least=least)
    halves, tops = np.diff(half.crossing), np.abs(half.peak)
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
    tail = values[int(np.searchsorted(time, half.crossing[-1])) :]
    grown = np.max(np.abs(tail), initial=0.0) > tops[last - 1] * GROWTH + least
    whole = time[-1] - half.crossing[-1] < (1 + UNEVEN) * halves[last - 1]
    if whole and last == tops.size - 1 and not more and not grown:
        return time.size
    return int(np.searchsorted(time, half.crossing[last + 1]))
