"""An angle from an accelerometer alone: where a fit begins, and what pictures show.

Of a free swing ``th'' = -w0**2 sin(th)`` but for the damping, so that a tangential sensor reads
``(g - r w0**2) sin(th)``, an angular acceleration ``-w0**2 sin(th)``. Beyond a quarter turn the
sine falls again: such half swings have two humps with a dip between them, where the angle is
``pi - arcsin``. The damping's part of the reading is left out here; the fit has it, since it
compares readings and not these angles.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.records.noise import noise_of
from pendmap.records.swinging import QUIET, middle_over, swinging
from pendmap.signal.half_cycles import swings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.rod_sensors import Accelerometer
    from pendmap.records.swinging import Swinging

    Floats = NDArray[np.float64]
    Places = tuple[int, int]


FEWEST: Final = 4
"""Half swings that a period is taken from."""

FOLDED: Final = 0.3
"""Share by which it falls where nobody can take it for noise."""

MOST: Final = 1.15
"""Times the largest reading that a swing has, beyond which place or unit are wrong."""

ONE_SIDED: Final = 0.15
"""Smaller side of the readings over the larger one, below which they are those of a radial axis."""

BLIND: Final = 0.05
"""Distance from the centre of oscillation, over its own, within which no swing is seen ..."""

DIM: Final = 0.2
"""... and within which little is left of it."""

WIDE: Final = 1.18
"""Period of a swing of a quarter turn to either side over that of a small one."""


@dataclasses.dataclass(frozen=True)
class FromAcceleration:
    """An angle made of readings.

    Parameters
    ----------
    theta : ndarray, shape (N,)
        rad.
    accelerometer : Accelerometer
        With the natural frequency that the readings show.
    signal : float
        The largest reading over the noise.
    doubt : str
        What speaks against trusting it, if anything.
    """

    theta: Floats
    accelerometer: Accelerometer
    signal: float
    doubt: str


def angle_from(
    time: Floats, reading: Floats, accelerometer: Accelerometer, where: str
) -> FromAcceleration:
    """Return the angle that a tangential or angular acceleration shows.

    Parameters
    ----------
    time, reading : ndarray, shape (N,)
        s, increasing; m/s^2, or rad/s^2 of an angular acceleration.
    accelerometer : Accelerometer
        Where it was measured.
    where : str
        What messages begin with.

    Raises
    ------
    InputError
        If the readings are not those of a swing at this place: too few half swings, all on one
        side, too large, over the top, or at the centre of oscillation.
    """
    noise = noise_of(time, reading).sigma
    noise = noise if math.isfinite(noise) else 0.0
    moves = swinging(time, reading, noise)
    least = max(QUIET * noise, 1e-12)
    middles = [middle_over(time[a:b], reading[a:b], least) for a, b in moves.free]
    middle = float(np.average(middles, weights=[b - a for a, b in moves.free]))
    free = np.concatenate([reading[a:b] for a, b in moves.free])
    _refuse_radial(free, middle, accelerometer, where)
    values = reading - middle
    each = [waves_of(time, values, part, noise) for part in moves.free]
    waves = [wave for part in each for wave in part]
    if len(waves) < FEWEST:
        raise InputError(
            f"{where}: the acceleration must show {FEWEST} half swings or more where no angle is"
            f" beside it, got {len(waves)}"
        )
    found = dataclasses.replace(accelerometer, w0=_frequency(waves, accelerometer))
    largest = max(wave.top for wave in waves)
    signal = largest / noise if noise else math.inf
    weak = signal < 4 * QUIET
    doubt = _refuse_blind(found, waves, where, weak=weak)
    _refuse_large(each, found, where)
    _refuse_held(values, moves, found, where)
    if weak:
        doubt = f"the largest reading is {signal:.2g} times the noise{doubt and f'; {doubt}'}"
    theta = _unfolded(values, each, moves, found, noise)
    return FromAcceleration(theta, found, signal, doubt)


def _refuse_radial(reading: Floats, middle: float, sensor: Accelerometer, where: str) -> None:
    """Refuse readings of an axis along the rod, which always point the same way."""
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
    """Return ``w0`` from the smaller half swings, their amplitude taken into account."""
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
    """Refuse a place that sees nothing of the swing; return what speaks against one near it."""
    if not sensor.gravity:
        return ""
    length = sensor.gravity / sensor.w0**2
    away = abs(sensor.distance_m / length - 1)
    if weak:
        # What noise and damping alone may be says little about the amplitude, which up to a quarter
        # turn makes a period WIDE times longer.
        slow = math.pi / float(np.median([wave.half_period for wave in waves]))
        lengths = sensor.gravity / slow**2 / WIDE**2, sensor.gravity / slow**2
        if (1 - BLIND) * lengths[0] < sensor.distance_m < (1 + BLIND) * lengths[1]:
            length, away = min(lengths, key=lambda x: abs(x - sensor.distance_m)), 0.0
    if away < BLIND:
        # Where little of the swing is felt its frequency, and with it the place, is not known well.
        raise InputError(
            f"{where}: distance_m is {sensor.distance_m:g}, that of the centre of oscillation,"
            " g/w0^2 from the pivot, where gravity and the swing cancel: nothing but damping is"
            " felt there; it must be another place on the rod, or have an angle beside it"
        )
    if away > DIM:
        return ""
    per_mm = 0.1 / abs(length - sensor.distance_m)
    return (
        f"distance_m is {sensor.distance_m:g} and the centre of oscillation g/w0^2 about"
        f" {length:.2g} m from the pivot, where gravity and the swing cancel to {100 * away:.0f} %:"
        f" an error of 1 mm makes angles {per_mm:.2g} % wrong"
    )


def _refuse_large(each: list[list[Wave]], sensor: Accelerometer, where: str) -> None:
    """Refuse readings that no swing has there, and turns over the top."""
    top = float(np.quantile([wave.top for waves in each for wave in waves], 0.8))
    most = abs(sensor.gain)
    if top > MOST * most:
        removed = "" if sensor.gravity else ", gravity removed"
        place = f" at distance_m = {sensor.distance_m:g}{removed}"
        place = "" if sensor.direction == "angular" else place
        raise InputError(
            f"{where}: the acceleration reaches {top:.3g} {sensor.unit}, and a swing of this period"
            f" at most {most:.3g}{place}: unit, distance_m, direction or gravity_removed is wrong"
        )
    for waves in each:
        folds = [k for k, wave in enumerate(waves) if wave.dip > FOLDED]
        before = waves[: folds[-1]] if folds else []
        if not any(not wave.folded(most) and wave.top > 0.9 * most for wave in before):
            continue
        raise InputError(
            f"{where}: the pendulum turns over the top, which an acceleration alone does not show:"
            " it must have an angle or a velocity beside it, or a later from_s"
        )


def _refuse_held(values: Floats, moves: Swinging, sensor: Accelerometer, where: str) -> None:
    """Refuse what no hold shows: there a tangential axis reads gravity alone, ``g sin(th)``."""
    for low, high in moves.held:
        level = abs(float(np.median(values[low:high])))
        if sensor.gravity and level > MOST * sensor.gravity:
            raise InputError(
                f"{where}: the acceleration is {level:.3g} {sensor.unit} while the pendulum is"
                f" held, and gravity gives at most {sensor.gravity:.3g}: unit is wrong"
            )


def _unfolded(
    values: Floats,
    each: list[list[Wave]],
    moves: Swinging,
    sensor: Accelerometer,
    noise: float,
) -> Floats:
    """Return the angle of each sample."""
    most = abs(sensor.gain)
    theta = np.arcsin(np.clip(values / most, -1, 1)) * math.copysign(1.0, sensor.gain)
    for (begin, _), waves in zip(moves.free, each, strict=True):
        for wave in _from_start(values, begin, waves, most, noise):
            if wave.folded(most):
                low, high = wave.humps
                inside = values[low : high + 1]
                folded = np.arcsin(np.clip(np.abs(inside) / wave.top, 0, 1))
                sign = np.sign(inside) * math.copysign(1.0, sensor.gain)
                theta[low : high + 1] = sign * (math.pi - folded)
    for low, high in moves.held:
        # Held it does not fall: gravity alone is read, or nothing where it is removed.
        pull = values[low:high] / sensor.gravity if sensor.gravity else np.zeros(high - low)
        theta[low:high] = np.arcsin(np.clip(pull, -1, 1))
    return np.asarray(theta)


def _from_start(
    values: Floats, begin: int, waves: list[Wave], most: float, noise: float
) -> list[Wave]:
    """Return the half swings, with what comes before the first passage of the middle."""
    if not waves or waves[0].low <= begin + 2:
        return waves
    first = waves[0]
    # Released beyond a quarter turn it begins in a dip.
    start = wave_of(values, begin, first.low, noise)
    if not start.folded(most) and first.folded(most):
        start = dataclasses.replace(start, humps=(begin, start.humps[1]), dip=first.dip)
    return [start, *waves]


# Half swings as an accelerometer reads them: one hump each, or two beyond a quarter turn.


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
