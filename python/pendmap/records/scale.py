"""Scale and zero of a record, from the period of a pendulum, which grows with its swing.

    T(A) = T0 (2/pi) K(sin(A/2))

A swing of 1 rad has a period 6.6 % longer than a small one. Degrees taken for radians show no
growth, and sizes that no swing has.
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

LONGEST_PERIOD: Final = 60.0
"""Seconds of a pendulum period at most in a laboratory."""

SHORTEST_PERIOD: Final = 0.02
"""Seconds of a pendulum period at least: 0.1 mm of length."""

SAMPLES_A_PERIOD: Final = 8.0
"""Samples a period below which sampling is slow."""

UNLIKE_RIG: Final = 0.25
"""Relative difference of the period from that of [rig] that is reported."""

FEWEST_PERIODS: Final = 6
"""Periods from which a relation is taken."""

LARGEST_SWING: Final = 3.0
"""Swings in rad up to which the growth of the period is used."""

LEAST_ERROR: Final = 1e-3
"""Relative error of a factor at least."""

Z95: Final = 1.959963984540054
"""The 97.5 % point of the standard normal distribution."""

FAR_ZERO: Final = 0.15
"""Radians from 0 at which friction alone (Tr/w0^2) holds no pendulum."""

OFF_QUARTER: Final = 0.1
"""Radians by which a turned gauge may miss a multiple of 90 degrees."""

CERTAIN_MIDDLE: Final = 10
"""Half cycles about one middle that make it certain."""

AT_REST: Final = 0.02
"""Span of the last tenth over the whole, at rest."""

BEFORE_REST: Final = 4
"""Half cycles before a rest that is not a hold."""

MIDDLES_AGREE: Final = 0.1
"""Share of the swing within which its middles agree."""


@dataclasses.dataclass(frozen=True)
class Periods:
    """Periods of a free swing against its size."""

    amplitude: Floats  # of the reading, from its middle, shape (M,)
    period: Floats  # s, shape (M,)

    @property
    def small(self) -> float:
        """The median period of the smallest third of the swings, s."""
        third = np.argsort(self.amplitude)[: max(self.period.size // 3, 1)]
        return float(np.median(self.period[third]))


def check(work: Work) -> None:
    """Correct milliseconds and degrees where nothing else is possible; report disagreements."""
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
    """Return the periods of a record about its middle; None where there are too few."""
    good = work.trusted
    return _periods(work.time[good], work.theta[good] - middle, work.count)


def small_period(time: Floats, theta: Floats, count: float) -> float:
    """Return the period of small swings of a free record, s.

    Returns NaN where there are too few swings, or none below half a turn.
    """
    middle = middle_of(time, theta)
    found = _periods(time, theta - (0.0 if middle is None else middle), count)
    if found is None or float(np.min(found.amplitude)) >= math.pi:
        return math.nan
    return _small(found)


def _small(found: Periods) -> float:
    """Return the period of small swings, s, from the smallest ones and their growth."""
    if float(np.min(found.amplitude)) >= math.pi:
        return found.small
    smallest = found.amplitude[np.argsort(found.amplitude)[: max(found.period.size // 3, 1)]]
    return found.small / float(np.median(_growth(np.minimum(smallest, 3.0))))


def _periods(time: Floats, theta: Floats, count: float) -> Periods | None:
    """Return the periods of readings about 0; None where there are too few."""
    start = after_turns(theta)
    time, theta = time[start:], theta[start:]
    if time.size < 4 * FEWEST_PERIODS:
        return None
    noise = float(np.median(np.abs(np.diff(theta, 2)))) if theta.size > 2 else 0.0
    reach = float(np.quantile(np.abs(theta), 0.98))
    least = max(2.5 * count, min(4 * noise, 0.3 * reach), 0.02 * reach)
    half = swings(time, theta, least=least)
    if half.peak.size < FEWEST_PERIODS + 2:
        return None
    size = np.abs(half.peak)
    # The weighted mean of neighbours removes a small offset of the middle.
    amplitude = (size[:-2] + 2 * size[1:-1] + size[2:]) / 4
    period = half.period
    steady = np.abs(period / np.median(period) - 1) < 0.6
    inside = steady & (amplitude > 4 * least)
    if np.count_nonzero(inside) >= FEWEST_PERIODS:
        steady = inside
    if np.count_nonzero(steady) < FEWEST_PERIODS:
        return None
    return Periods(amplitude[steady], period[steady])


def _seconds(work: Work, found: Periods) -> Periods:
    """Convert times in milliseconds or less to seconds."""
    small = found.small
    for name, factor in (("milliseconds", 1e-3), ("microseconds", 1e-6), ("nanoseconds", 1e-9)):
        if small <= LONGEST_PERIOD or not SHORTEST_PERIOD < small * factor < LONGEST_PERIOD:
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
    if not SHORTEST_PERIOD < small < LONGEST_PERIOD:
        work.say("time-unit", f"a period of {small:.4g} s is no pendulum's: the unit is doubtful")
    return found


def _radians(work: Work, found: Periods) -> Periods:
    """Convert degrees to radians; report the scale that the periods show."""
    largest = float(np.max(found.amplitude))
    about = float(np.median(found.amplitude))
    if largest > math.pi and about > 0:
        degrees = largest * DEGREE <= math.pi
        declared = ("velocity" if work.integrated else "angle") in work.declared
        text = f"swings of {largest:.4g} rad are no pendulum's"
        if not degrees or declared:
            work.say("angle-unit", f"{text}: the unit or the scale is wrong")
            return found
        work.theta *= DEGREE
        if work.integrated:
            work.extra["velocity"] = work.extra["velocity"] * DEGREE
        work.count *= DEGREE
        work.seen *= DEGREE
        read = "velocities are degrees a second" if work.integrated else "angles are degrees"
        work.say("angle-unit", f"the {read}: {text}", mended=True)
        return Periods(found.amplitude * DEGREE, found.period)
    _curvature(work, found, largest)
    return found


def _curvature(work: Work, found: Periods, largest: float) -> None:
    """Report periods that do not grow with the swing as a pendulum's do."""
    grown = _growth(found.amplitude)
    if largest > LARGEST_SWING or np.ptp(grown) < 2e-3 or found.period.size < FEWEST_PERIODS + 2:
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
    """Return the growth of the periods over a pendulum's, and its standard error.

    It is 1 for radians; readings that are k times the angle show about 1/k^2.
    """
    columns = np.column_stack([np.ones(grown.size), grown - 1])
    answer, spread = _robust_line(columns, found.period)
    return float(answer[1] / answer[0]), float(spread[1] / answer[0])


def gain_of(work: Work) -> tuple[float, float] | None:
    """Return the 95 % interval of reading over angle, by the periods of a free run; None without.

    The period alone depends on the scale: it grows with the square of the angle.
    """
    good = work.trusted
    middle = middle_of(work.time[good], work.theta[good])
    found = periods_of(work, 0.0 if middle is None else middle)
    if found is None or float(np.max(found.amplitude)) > LARGEST_SWING:
        return None
    share, error = _share(found, _growth(found.amplitude))
    least, most = share - Z95 * error, share + Z95 * error
    if most <= 0:
        return 0.0, math.inf
    return 1 / math.sqrt(most), 1 / math.sqrt(least) if least > 0 else math.inf


def _factor(found: Periods) -> tuple[float, float]:
    """Return the factor of the readings that gives a pendulum's periods, and its error."""
    best, least = 1.0, math.inf
    for factor in np.geomspace(0.01, 3.0 / float(np.max(found.amplitude)), 300).tolist():
        away = found.period / _growth(factor * found.amplitude)
        spread = normal_scale(away - np.median(away)) / float(np.median(away))
        if spread < least:
            best, least = factor, spread
    # The grid has steps of 2 %: Gauss-Newton steps refine its best factor.
    error = 0.02 * best
    for _ in range(4):
        grown = _growth(best * found.amplitude)
        slope = (_growth(1.001 * best * found.amplitude) - grown) / (0.001 * best)
        answer, spreads = _robust_line(np.column_stack([grown, slope]), found.period)
        step = float(np.clip(answer[1] / answer[0], -0.02 * best, 0.02 * best))
        best, error = best + step, float(spreads[1] / answer[0])
    return best, math.hypot(error, LEAST_ERROR * best)


def _growth(amplitude: Floats) -> Floats:
    """Return T(A)/T0 by the arithmetic-geometric mean."""
    a, b = np.ones_like(amplitude), np.abs(np.cos(amplitude / 2))
    for _ in range(8):
        a, b = (a + b) / 2, np.sqrt(a * b)
    return np.asarray(1 / a)


def _robust_line(columns: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return coefficients and standard errors by Huber weights."""
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
    """Compare the period of small swings with that of [rig]."""
    expected = {}
    if "w0" in work.known:
        expected[f"w0 = {work.known['w0']:g} rad/s"] = 2 * math.pi / work.known["w0"]
    if "length_m" in work.known:
        length, gravity = work.known["length_m"], work.known.get("gravity", GRAVITY)
        expected[f"length_m = {length:g} m"] = 2 * math.pi * math.sqrt(length / gravity)
    seen = _small(found)
    for said, period in expected.items():
        if abs(seen / period - 1) > UNLIKE_RIG:
            text = f"small swings take {seen:.4g} s, by {said} {period:.4g} s: one of them is wrong"
            work.say("period-unlike-rig", text)


def _slow_sampling(work: Work, found: Periods | None) -> None:
    """Report sampling that is slow against the motion."""
    interval = float(np.median(np.diff(work.time)))
    if found is not None and found.small / interval < SAMPLES_A_PERIOD:
        text = f"{found.small / interval:.1f} samples a period: the shape of the swing is lost"
        work.say("sampling-slow", text)
        return
    fastest = float(np.quantile(np.abs(np.diff(work.theta)), 0.99))
    if fastest > 1.0:
        text = f"up to {fastest:.2g} rad from sample to sample: too slow for this motion"
        work.say("sampling-slow", text)


def middle_of(time: Floats, theta: Floats) -> float | None:
    """Return the middle of the last quarter of a free swing, rad; None for larger swings."""
    start = time[0] + 0.75 * (time[-1] - time[0])
    late = theta[time >= start]
    if late.size < 20:
        return None
    middle = (float(np.quantile(late, 0.02)) + float(np.quantile(late, 0.98))) / 2
    swing = float(np.quantile(late, 0.98) - np.quantile(late, 0.02)) / 2
    return middle if swing < math.pi else None


def turn_to_rest(work: Work) -> None:
    """Move a zero that is far from the rest of a free pendulum to it."""
    good = work.trusted
    middle = middle_of(work.time[good], work.theta[good])
    if middle is None:
        return
    # Whole turns are those of a pendulum that went over the top.
    turns = 2 * math.pi * round(middle / (2 * math.pi))
    off = middle - turns
    if abs(off) < FAR_ZERO:
        return
    if not _certain(work.time[good], work.theta[good] - middle):
        text = "too few whole swings to tell what it swings about: the zero is left to the fit"
        work.say("zero-uncertain", text)
        return
    if "angle" in work.declared and abs(off) < math.pi / 2 - OFF_QUARTER:
        work.say("zero-offset", f"it swings about {off:.4g} rad: the zero that is given is off")
        return
    quarters = round(off / (math.pi / 2))
    gauge = quarters * math.pi / 2
    if quarters and abs(off - gauge) < OFF_QUARTER:
        work.theta -= turns + gauge
        text = f"the gauge is turned by {90 * quarters} degrees: it swings about {off:.4g} rad"
        work.say("gauge-turned", f"{text}, turned back", mended=True)
        return
    work.theta -= turns + off
    text = f"it swings about {off:.4g} rad, the rest is elsewhere than the zero: taken off"
    work.say("zero-offset", text, mended=True)


def _certain(time: Floats, theta: Floats) -> bool:
    """Return whether the middle of a free swing is certainly 0: at rest, or by many swings."""
    start = after_turns(theta)
    time, theta = time[start:], theta[start:]
    if theta.size < 20:
        return False
    reach = float(np.max(np.abs(theta)))
    peaks = swings(time, theta, least=AT_REST * reach).peak
    tail = theta[-max(theta.size // 10, 10) :]
    if float(np.ptp(tail)) < AT_REST * reach and float(np.abs(tail).max()) < AT_REST * reach:
        return peaks.size >= BEFORE_REST
    if peaks.size < CERTAIN_MIDDLE:
        return False
    peaks = peaks[-2 * CERTAIN_MIDDLE :]
    middles = (peaks[:-2] + 2 * peaks[1:-1] + peaks[2:]) / 4
    size = float(np.median(np.abs(peaks)))
    return float(np.median(np.abs(middles))) < MIDDLES_AGREE * size
