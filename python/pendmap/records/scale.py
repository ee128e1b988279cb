"""The scale of angle and time, from what only a pendulum does: its period grows with its swing.

    T(A) = T0 (2/pi) K(sin(A/2))

A pendulum of 1 rad takes 6.6 % longer for a period than one of small swings. Readings in degrees
that are taken for radians show the period of a small swing at all sizes, and sizes that no swing
has.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.model.quantities import GRAVITY
from pendmap.signal.half_cycles import after_turns, swings
from pendmap.signal.robust import normal_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]


DEGREE: Final = math.pi / 180

LONGEST: Final = 60.0
"""Seconds of a period that no pendulum in a laboratory has: it would hang 900 m high."""

SHORTEST: Final = 0.02
"""Seconds of a period that no pendulum has: 0.1 mm of length."""

SAMPLES: Final = 8.0
"""Samples a period under which the shape of a swing is lost; 2 are the least of any frequency."""

UNLIKE: Final = 0.25
"""Share by which a period may miss what is known of the rig: a starting value may be wrong."""

FEWEST: Final = 6
"""Periods that a relation is taken from."""

LARGEST: Final = 3.0
"""Swings, rad, up to which the period grows smoothly: near the top it does without bounds."""

LEAST: Final = 1e-3
"""Share by which a factor errs at least: a swing shrinks within the period that it is seen for."""

Z95: Final = 1.959963984540054
"""The 97.5 % point of the standard normal distribution."""


@dataclasses.dataclass(frozen=True)
class Periods:
    """Periods of a free swing against its size.

    Parameters
    ----------
    amplitude : ndarray, shape (M,)
        Of the reading, from its middle.
    period : ndarray, shape (M,)
        s.
    """

    amplitude: Floats
    period: Floats

    @property
    def small(self) -> float:
        """The period of the smallest swings, s: the median of the last third by size."""
        third = np.argsort(self.amplitude)[: max(self.period.size // 3, 1)]
        return float(np.median(self.period[third]))


def check(work: Work) -> None:
    """Mend milliseconds and degrees where nothing else is possible; say what does not agree."""
    if work.plan.kind != "free":
        _slow_sampling(work, None)
        return
    good = work.trusted
    middle = middle_of(work.time[good], work.theta[good])
    if middle is None:
        middle = float(np.median(work.theta[work.theta.size // 2 :]))
    found = periods_of(work, middle)
    if found is not None:
        found = _seconds(work, found)
        found = _radians(work, found)
        _known(work, found)
    _slow_sampling(work, found)
    turn_to_rest(work)


def periods_of(work: Work, middle: float) -> Periods | None:
    """Return the periods of a record about its middle; none where there are too few."""
    good = work.trusted
    return _periods(work.time[good], work.theta[good] - middle, work.count)


def small_period(time: Floats, theta: Floats, count: float) -> float:
    """Return the period of small swings, s, by the swings of a free record about its middle.

    Parameters
    ----------
    time, theta : array, shape (N,)
        s, and rad.
    count : float
        The step of the readings, rad.

    Returns
    -------
    float
        No number where there are too few swings, or none of less than half a turn.
    """
    middle = middle_of(time, theta)
    found = _periods(time, theta - (0.0 if middle is None else middle), count)
    if found is None or float(np.min(found.amplitude)) >= math.pi:
        return math.nan
    return _small(found)


def _small(found: Periods) -> float:
    """Return the period of small swings, by how that of the smallest ones has grown."""
    if float(np.min(found.amplitude)) >= math.pi:
        return found.small
    smallest = found.amplitude[np.argsort(found.amplitude)[: max(found.period.size // 3, 1)]]
    return found.small / float(np.median(_growth(np.minimum(smallest, 3.0))))


def _periods(time: Floats, theta: Floats, count: float) -> Periods | None:
    start = after_turns(theta)
    time, theta = time[start:], theta[start:]
    if time.size < 4 * FEWEST:
        return None
    noise = float(np.median(np.abs(np.diff(theta, 2)))) if theta.size > 2 else 0.0
    reach = float(np.quantile(np.abs(theta), 0.98))
    least = max(2.5 * count, min(4 * noise, 0.3 * reach), 0.02 * reach)
    half = swings(time, theta, least=least)
    if half.peak.size < FEWEST + 2:
        return None
    size = np.abs(half.peak)
    # The mean of neighbours takes out a middle that is a little off, for odd and even half cycles.
    amplitude = (size[:-2] + 2 * size[1:-1] + size[2:]) / 4
    period = half.period
    steady = np.abs(period / np.median(period) - 1) < 0.6
    inside = steady & (amplitude > 4 * least)
    if np.count_nonzero(inside) >= FEWEST:
        steady = inside
    if np.count_nonzero(steady) < FEWEST:
        return None
    return Periods(amplitude[steady], period[steady])


def _seconds(work: Work, found: Periods) -> Periods:
    """Take milliseconds (or less) for what they are."""
    small = found.small
    for name, factor in (("milliseconds", 1e-3), ("microseconds", 1e-6), ("nanoseconds", 1e-9)):
        if small <= LONGEST or not SHORTEST < small * factor < LONGEST:
            continue
        if "time" in work.declared:
            text = f"a period of {small:.4g} s: times look like {name}, [columns] says otherwise"
            work.say("time-unit", text)
            return found
        work.time *= factor
        text = f"the times are {name}: as seconds the period would be {small:.4g} s"
        work.say("time-unit", text, mended=True)
        size = factor if work.integrated else 1.0
        work.theta *= size
        return Periods(found.amplitude * size, found.period * factor)
    if not SHORTEST < small < LONGEST:
        work.say("time-unit", f"a period of {small:.4g} s is no pendulum's: the unit is doubtful")
    return found


def _radians(work: Work, found: Periods) -> Periods:
    """Take degrees for what they are; say what scale the periods speak for."""
    largest = float(np.max(found.amplitude))
    about = float(np.median(found.amplitude))
    if largest > math.pi and about > 0:
        degrees = largest * DEGREE <= math.pi
        declared = ("velocity" if work.integrated else "angle") in work.declared
        text = f"swings of {largest:.4g} rad are no pendulum's"
        if not degrees or declared:
            work.say("angle-unit", f"{text}: the unit or the scale is wrong")
            return found
        _rescale(work, DEGREE)
        read = "velocities are degrees a second" if work.integrated else "angles are degrees"
        work.say("angle-unit", f"the {read}: {text}", mended=True)
        return Periods(found.amplitude * DEGREE, found.period)
    _curvature(work, found, largest)
    return found


def _rescale(work: Work, factor: float) -> None:
    work.theta *= factor
    if work.integrated:
        work.extra["velocity"] = work.extra["velocity"] * factor
    work.count *= factor
    work.seen *= factor


def _curvature(work: Work, found: Periods, largest: float) -> None:
    """Say so where the period does not grow with the swing as a pendulum's does."""
    grown = _growth(found.amplitude)
    if largest > LARGEST or np.ptp(grown) < 2e-3 or found.period.size < FEWEST + 2:
        return
    share, error = _share(found, grown)
    if error < 0.1 and abs(share - 1) > 0.3 + 5 * error:
        factor, spread = _factor(found)
        flat = share < 0.1
        degrees = " (degrees?)" if flat else ""
        channel = "velocity" if work.integrated else "angle"
        mended = f"--effect encoder_gain fits it, or scale the {channel} in [columns]"
        taken = "" if flat else f"; {mended}"
        text = (
            f"from {found.amplitude.min():.2g} to {largest:.2g} rad the period grows by"
            f" {share:.2f} +- {error:.2f} of what a pendulum's does: the true angle is"
            f" {factor:.4g} +- {spread:.1g} times the reading{degrees}, or another force"
            f" acts{taken}"
        )
        work.say("angle-unit" if flat else "angle-scale", text)


def _share(found: Periods, grown: Floats) -> tuple[float, float]:
    """Return how much of a pendulum's growth the periods show, with its standard error.

    1 for radians; readings that are k times the angle show about 1/k^2.
    """
    columns = np.column_stack([np.ones(grown.size), grown - 1])
    answer, spread = _robust_line(columns, found.period)
    return float(answer[1] / answer[0]), float(spread[1] / answer[0])


def gain_of(work: Work) -> tuple[float, float] | None:
    """Return between which factors the readings are the angle, by the periods of a free run.

    The motion of small swings has no scale: the period alone grows with the square of the angle.

    Parameters
    ----------
    work : Work
        A run whose angle is in rad about its rest.

    Returns
    -------
    tuple of float or None
        Ends of the interval of 95 %, the upper one infinite where nothing bounds it; none where
        there are too few periods, or none of half a turn or less.
    """
    good = work.trusted
    middle = middle_of(work.time[good], work.theta[good])
    found = periods_of(work, 0.0 if middle is None else middle)
    if found is None or float(np.max(found.amplitude)) > LARGEST:
        return None
    share, error = _share(found, _growth(found.amplitude))
    least, most = share - Z95 * error, share + Z95 * error
    if most <= 0:
        return 0.0, math.inf
    return 1 / math.sqrt(most), 1 / math.sqrt(least) if least > 0 else math.inf


def _factor(found: Periods) -> tuple[float, float]:
    """Return what the readings are to be multiplied by for a pendulum's periods, and its error."""
    best, least = 1.0, math.inf
    for factor in np.geomspace(0.01, 3.0 / float(np.max(found.amplitude)), 300).tolist():
        away = found.period / _growth(factor * found.amplitude)
        spread = normal_scale(away - np.median(away)) / float(np.median(away))
        if spread < least:
            best, least = factor, spread
    # The grid is 2 % wide: lines about what it says find the rest.
    error = 0.02 * best
    for _ in range(4):
        grown = _growth(best * found.amplitude)
        slope = (_growth(1.001 * best * found.amplitude) - grown) / (0.001 * best)
        answer, spreads = _robust_line(np.column_stack([grown, slope]), found.period)
        step = float(np.clip(answer[1] / answer[0], -0.02 * best, 0.02 * best))
        best, error = best + step, float(spreads[1] / answer[0])
    return best, math.hypot(error, LEAST * best)


def _growth(amplitude: Floats) -> Floats:
    """Return T(A)/T0 by the arithmetic-geometric mean."""
    a, b = np.ones_like(amplitude), np.abs(np.cos(amplitude / 2))
    for _ in range(8):
        a, b = (a + b) / 2, np.sqrt(a * b)
    return np.asarray(1 / a)


def _robust_line(columns: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return coefficients and standard errors with outliers weighed down (Huber)."""
    weights = np.ones(values.size)
    for _ in range(8):
        root = np.sqrt(weights)[:, None]
        answer = np.linalg.lstsq(columns * root, values * root[:, 0], rcond=None)[0]
        away = np.abs(values - columns @ answer)
        scale = max(1.4826 * float(np.median(away)), 1e-12)
        weights = np.minimum(1.0, 1.345 * scale / np.maximum(away, 1e-12))
    inverse = np.linalg.pinv((columns * weights[:, None]).T @ columns)
    return np.asarray(answer, float), scale * np.sqrt(np.diag(inverse))


def _known(work: Work, found: Periods) -> None:
    """Compare the period of small swings with each thing that is known of the rig."""
    expected = {}
    if "w0" in work.known:
        expected[f"w0 = {work.known['w0']:g} rad/s"] = 2 * math.pi / work.known["w0"]
    if "length_m" in work.known:
        length, gravity = work.known["length_m"], work.known.get("gravity", GRAVITY)
        expected[f"length_m = {length:g} m"] = 2 * math.pi * math.sqrt(length / gravity)
    seen = _small(found)
    for said, period in expected.items():
        if abs(seen / period - 1) > UNLIKE:
            text = f"small swings take {seen:.4g} s, by {said} {period:.4g} s: one of them is wrong"
            work.say("period-unlike-rig", text)


def _slow_sampling(work: Work, found: Periods | None) -> None:
    interval = float(np.median(np.diff(work.time)))
    if found is not None and found.small / interval < SAMPLES:
        text = f"{found.small / interval:.1f} samples a period: the shape of the swing is lost"
        work.say("sampling-slow", text)
        return
    fastest = float(np.quantile(np.abs(np.diff(work.theta)), 0.99))
    if fastest > 1.0:
        text = f"up to {fastest:.2g} rad from sample to sample: too slow for this motion"
        work.say("sampling-slow", text)


# Where the reading is zero: a gauge that is turned round, a rest that is not at 0.


FAR: Final = 0.15
"""Radians from 0 at which no pendulum rests for friction alone (Tr/w0^2 is 0.002 to 0.02): the
gauge has its zero elsewhere. Less is left to the fit, which estimates the offset."""

QUARTER: Final = 0.1
"""Radians by which a gauge may miss a multiple of 90 degrees and count as turned by it."""

ENOUGH: Final = 10
"""Half cycles about one middle that make it certain."""

STILL: Final = 0.02
"""Share of the whole way that the last tenth of a record stays within at rest."""

CROSSED: Final = 4
"""Half cycles about a rest, without which the end may be held by hand."""

AGREE: Final = 0.1
"""Share of the swing within which the middles of a free swing agree."""


def middle_of(time: Floats, theta: Floats) -> float | None:
    """Return what a free swing ends around, rad: its last quarter's, of whole half cycles."""
    start = time[0] + 0.75 * (time[-1] - time[0])
    late = theta[time >= start]
    if late.size < 20:
        return None
    middle = (float(np.quantile(late, 0.02)) + float(np.quantile(late, 0.98))) / 2
    swing = float(np.quantile(late, 0.98) - np.quantile(late, 0.02)) / 2
    return middle if swing < math.pi else None


def turn_to_rest(work: Work) -> None:
    """Take a zero that is far from the rest to it; the rest is where a free pendulum ends."""
    good = work.trusted
    middle = middle_of(work.time[good], work.theta[good])
    if middle is None:
        return
    # Whole turns are the pendulum's own: it went over the top before.
    turns = 2 * math.pi * round(middle / (2 * math.pi))
    off = middle - turns
    if abs(off) < FAR:
        return
    if not _certain(work.time[good], work.theta[good] - middle):
        text = "too few whole swings to tell what it swings about: the zero is left to the fit"
        work.say("zero-uncertain", text)
        return
    if "angle" in work.declared and abs(off) < math.pi / 2 - QUARTER:
        work.say("zero-offset", f"it swings about {off:.4g} rad: the zero that is given is off")
        return
    quarters = round(off / (math.pi / 2))
    gauge = quarters * math.pi / 2
    if quarters and abs(off - gauge) < QUARTER:
        work.theta -= turns + gauge
        text = f"the gauge is turned by {90 * quarters} degrees: it swings about {off:.4g} rad"
        work.say("gauge-turned", f"{text}, turned back", mended=True)
        return
    work.theta -= turns + off
    text = f"it swings about {off:.4g} rad, the rest is elsewhere than the zero: taken off"
    work.say("zero-offset", text, mended=True)


def _certain(time: Floats, theta: Floats) -> bool:
    """Whether a free swing is seen to have its middle at 0: at its rest, or by many swings."""
    start = after_turns(theta)
    time, theta = time[start:], theta[start:]
    if theta.size < 20:
        return False
    reach = float(np.max(np.abs(theta)))
    peaks = swings(time, theta, least=STILL * reach).peak
    tail = theta[-max(theta.size // 10, 10) :]
    if float(np.ptp(tail)) < STILL * reach and float(np.abs(tail).max()) < STILL * reach:
        return peaks.size >= CROSSED
    if peaks.size < ENOUGH:
        return False
    peaks = peaks[-2 * ENOUGH :]
    middles = (peaks[:-2] + 2 * peaks[1:-1] + peaks[2:]) / 4
    size = float(np.median(np.abs(peaks)))
    return float(np.median(np.abs(middles))) < AGREE * size
