"""Scale and zero of a record, from the period of a pendulum, which increases with amplitude.

    T(A) = T0 (2/pi) K(sin(A/2))

At an amplitude of 1 rad the period is 6.6 % longer than that of small swings. Degrees mistaken for
radians give periods that hardly increase, and impossible amplitudes.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.model.quantities import GRAVITY
from pendmap.records.units import DEGREE
from pendmap.signal.half_cycles import after_turns, swings
from pendmap.signal.robust import Z95, normal_scale

if TYPE_CHECKING:
    from pendmap.records.work import Work
    from pendmap.signal import Floats, Indices


LONGEST_PERIOD: Final = 60.0  # Longest period of a laboratory pendulum, s
SHORTEST_PERIOD: Final = 0.02  # Shortest period, s: a length of 0.1 mm
SAMPLES_A_PERIOD: Final = 8.0  # Samples per period below which slow sampling is reported
UNLIKE_RIG: Final = 0.25  # Relative difference from the period of [rig] above which it is reported
FEWEST_PERIODS: Final = 6  # Fewest periods that are analysed
LARGEST_SWING: Final = 3.0  # Largest amplitude, rad, at which the increase of the period is used
LEAST_ERROR: Final = 1e-3  # Least relative error of a scale factor
FAR_ZERO: Final = 0.15  # Rest angle, rad, above which friction (Tr/w0^2) cannot explain it
OFF_QUARTER: Final = 0.1  # Greatest deviation of a rotated gauge from multiples of 90 degrees, rad
CERTAIN_MIDDLE: Final = 10  # Fewest half cycles that determine the middle
AT_REST: Final = 0.02  # Range of the last tenth of a record at rest, over the greatest angle
BEFORE_REST: Final = 4  # Fewest half cycles before a rest; else it may be a hold
MIDDLES_AGREE: Final = 0.1  # Greatest scatter of the middles, over the amplitude


@dataclasses.dataclass(frozen=True)
class Periods:
    """Periods of a free swing against its amplitude."""

    amplitude: Floats  # amplitude of the readings about their middle, shape (M,)
    period: Floats  # s, shape (M,)

    @property
    def small(self) -> float:
        """Median period of the smallest third of the swings, s."""
        return float(np.median(self.period[self._smallest]))

    @property
    def smallest(self) -> float:
        """Period of infinitesimal swings, s: ``small``, corrected for its amplitude if below pi."""
        if float(np.min(self.amplitude)) >= math.pi:
            return self.small
        growth = _growth(np.minimum(self.amplitude[self._smallest], 3.0))
        return self.small / float(np.median(growth))

    @property
    def _smallest(self) -> Indices:
        return np.argsort(self.amplitude)[: max(self.period.size // 3, 1)]


def check(work: Work) -> None:
    """Convert milliseconds and degrees if these are the only explanation; report disagreements."""
    found = None
    if work.plan.kind == "free":
        middle = middle_of(work.time[work.trusted], work.theta[work.trusted])
        if middle is None:
            middle = float(np.median(work.theta[work.theta.size // 2 :]))
        found = periods_of(work, middle)
    if found is not None:
        found = _radians(work, _seconds(work, found))
        _known(work, found)
    _slow_sampling(work, found)
    if work.plan.kind == "free":
        turn_to_rest(work)


def periods_of(work: Work, middle: float) -> Periods | None:
    """Return the periods of a record about its middle; None if there are too few."""
    good = work.trusted
    return _periods(work.time[good], work.theta[good] - middle, work.count)


def small_period(time: Floats, theta: Floats, count: float) -> float:
    """Return the period of small swings of a free record, s.

    Returns NaN if there are too few swings, or none with an amplitude below half a turn.
    """
    found = _periods(time, theta - (middle_of(time, theta) or 0.0), count)
    if found is None or float(np.min(found.amplitude)) >= math.pi:
        return math.nan
    return found.smallest


def _periods(time: Floats, theta: Floats, count: float) -> Periods | None:
    """Return the periods of readings about 0; None if there are too few."""
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
    """Convert times in milliseconds, microseconds or nanoseconds to seconds."""
    small = found.small
    for name, factor in (("milliseconds", 1e-3), ("microseconds", 1e-6), ("nanoseconds", 1e-9)):
        if small <= LONGEST_PERIOD or not SHORTEST_PERIOD < small * factor < LONGEST_PERIOD:
            continue
        if "time" in work.declared:
            text = f"a period of {small:.4g} s: times look like {name}, contrary to [columns]"
            work.report("time-unit", text)
            return found
        text = f"the times are {name}: as seconds the period would be {small:.4g} s"
        work.report("time-unit", text, mended=True)
        size = factor if work.integrated else 1.0
        work.time *= factor
        work.theta *= size
        return Periods(found.amplitude * size, found.period * factor)
    if not SHORTEST_PERIOD < small < LONGEST_PERIOD:
        work.report(
            "time-unit",
            f"a period of {small:.4g} s is implausible for a pendulum: is the unit right?",
        )
    return found


def _radians(work: Work, found: Periods) -> Periods:
    """Convert degrees to radians; report a scale that the periods contradict."""
    largest = float(np.max(found.amplitude))
    if largest <= math.pi or float(np.median(found.amplitude)) <= 0:
        _curvature(work, found, largest)
        return found
    channel = "velocity" if work.integrated else "angle"
    text = f"swings of {largest:.4g} rad are impossible for a pendulum"
    if largest * DEGREE > math.pi or channel in work.declared:
        work.report("angle-unit", f"{text}: the unit or the scale is wrong")
        return found
    work.theta *= DEGREE
    if work.integrated:
        work.extra["velocity"] = work.extra["velocity"] * DEGREE
    work.count *= DEGREE
    work.estimated_step *= DEGREE
    read = "velocities are degrees a second" if work.integrated else "angles are degrees"
    work.report("angle-unit", f"the {read}: {text}", mended=True)
    return Periods(found.amplitude * DEGREE, found.period)


def _curvature(work: Work, found: Periods, largest: float) -> None:
    """Report periods that do not increase with amplitude as a pendulum's do."""
    grown = _growth(found.amplitude)
    if largest > LARGEST_SWING or np.ptp(grown) < 2e-3 or found.period.size < FEWEST_PERIODS + 2:
        return
    share, error = _share(found, grown)
    if error >= 0.1 or abs(share - 1) <= 0.3 + 5 * error:
        return
    factor, spread = _factor(found)
    flat = share < 0.1
    text = (
        f"from {found.amplitude.min():.2g} to {largest:.2g} rad the period grows by"
        f" {share:.2f} +- {error:.2f} of what a pendulum's does: the true angle is"
        f" {factor:.4g} +- {spread:.1g} times the reading{' (degrees?)' if flat else ''}, or"
        " another force acts"
    )
    if not flat:
        channel = "velocity" if work.integrated else "angle"
        text += f"; --effect encoder_gain fits it, or scale the {channel} in [columns]"
    work.report("angle-unit" if flat else "angle-scale", text)


def _share(found: Periods, grown: Floats) -> tuple[float, float]:
    """Return the increase of the periods over a pendulum's, and its standard error.

    It is 1 for radians, and about 1/k^2 for readings that are k times the angle.
    """
    columns = np.column_stack([np.ones(grown.size), grown - 1])
    answer, spread = _robust_line(columns, found.period)
    return float(answer[1] / answer[0]), float(spread[1] / answer[0])


def gain_of(work: Work) -> tuple[float, float] | None:
    """Return the 95 % interval of reading over angle from the periods of a free run, or None.

    Only the period depends on the scale: it increases with the square of the angle.
    """
    good = work.trusted
    found = periods_of(work, middle_of(work.time[good], work.theta[good]) or 0.0)
    if found is None or float(np.max(found.amplitude)) > LARGEST_SWING:
        return None
    share, error = _share(found, _growth(found.amplitude))
    least, most = share - Z95 * error, share + Z95 * error
    low = 1 / math.sqrt(most) if most > 0 else 0.0
    return low, 1 / math.sqrt(least) if least > 0 else math.inf


def _factor(found: Periods) -> tuple[float, float]:
    """Return the factor on the readings that gives a pendulum's periods, and its error."""
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
    """Return T(A)/T0, computed by the arithmetic-geometric mean."""
    a, b = np.ones_like(amplitude), np.abs(np.cos(amplitude / 2))
    for _ in range(8):
        a, b = (a + b) / 2, np.sqrt(a * b)
    return np.asarray(1 / a)


def _robust_line(columns: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return coefficients and standard errors of a robust linear fit with Huber weights."""
    weights = np.ones(values.size)
    for _ in range(8):
        root = np.sqrt(weights)[:, None]
        answer = np.linalg.lstsq(columns * root, values * root[:, 0], rcond=None)[0]
        away = np.abs(values - columns @ answer)
        scale = max(normal_scale(away), 1e-12)
        weights = np.minimum(1.0, 1.345 * scale / np.maximum(away, 1e-12))
    inverse = np.linalg.pinv((columns * weights[:, None]).T @ columns)
    return np.asarray(answer, float), scale * np.sqrt(np.diag(inverse))


def _known(work: Work, found: Periods) -> None:
    """Report a period of small swings that differs from that of [rig]."""
    known, expected = work.known, {}
    if "w0" in known:
        expected[f"w0 = {known['w0']:g} rad/s"] = 2 * math.pi / known["w0"]
    if "length_m" in known:
        root = math.sqrt(known["length_m"] / known.get("gravity", GRAVITY))
        expected[f"length_m = {known['length_m']:g} m"] = 2 * math.pi * root
    seen = found.smallest
    for said, period in expected.items():
        if abs(seen / period - 1) > UNLIKE_RIG:
            text = f"small swings take {seen:.4g} s, but {period:.4g} s by {said}: one is wrong"
            work.report("period-unlike-rig", text)


def _slow_sampling(work: Work, found: Periods | None) -> None:
    """Report a sampling rate too low for the motion."""
    number = found.small / float(np.median(np.diff(work.time))) if found else math.inf
    fastest = float(np.quantile(np.abs(np.diff(work.theta)), 0.99))
    if number < SAMPLES_A_PERIOD:
        text = f"{number:.1f} samples a period: the shape of the swing is not resolved"
        work.report("sampling-slow", text)
    elif fastest > 1.0:
        text = f"up to {fastest:.2g} rad from sample to sample: too slow for this motion"
        work.report("sampling-slow", text)


def middle_of(time: Floats, theta: Floats) -> float | None:
    """Return the middle of the last quarter of a record, rad; None if it is short or rotates."""
    late = theta[time >= time[0] + 0.75 * (time[-1] - time[0])]
    if late.size < 20:
        return None
    low, high = (float(np.quantile(late, part)) for part in (0.02, 0.98))
    return (low + high) / 2 if (high - low) / 2 < math.pi else None


def turn_to_rest(work: Work) -> None:
    """Shift the zero of the angle to the rest position if it is far from it."""
    good = work.trusted
    middle = middle_of(work.time[good], work.theta[good])
    # Whole turns are due to rotations over the top.
    turns = 2 * math.pi * round((middle or 0.0) / (2 * math.pi))
    off = (middle or 0.0) - turns
    if middle is None or abs(off) < FAR_ZERO:
        return
    text = f"it swings about {off:.4g} rad"
    quarters = round(off / (math.pi / 2))
    gauge = quarters * math.pi / 2
    if not _certain(work.time[good], work.theta[good] - middle):
        text = "too few whole swings to determine their middle: the zero is left to the fit"
        work.report("zero-uncertain", text)
    elif "angle" in work.declared and abs(off) < math.pi / 2 - OFF_QUARTER:
        work.report("zero-offset", f"{text}: the zero that is given is wrong")
    elif quarters and abs(off - gauge) < OFF_QUARTER:
        work.theta -= turns + gauge
        text = f"the gauge is turned by {90 * quarters} degrees: {text}, turned back"
        work.report("gauge-turned", text, mended=True)
    else:
        work.theta -= turns + off
        text = f"{text}, not about its zero: subtracted"
        work.report("zero-offset", text, mended=True)


def _certain(time: Floats, theta: Floats) -> bool:
    """Return whether rest or many swings confirm that the middle of a record is 0."""
    start = after_turns(theta)
    time, theta = time[start:], theta[start:]
    if theta.size < 20:
        return False
    still = AT_REST * float(np.max(np.abs(theta)))
    half = swings(time, theta, least=still)
    tail = theta[-max(theta.size // 10, 10) :]
    if float(np.ptp(tail)) < still and float(np.abs(tail).max()) < still:
        return half.peak.size >= BEFORE_REST
    if half.peak.size < CERTAIN_MIDDLE:
        return False
    late = slice(-2 * CERTAIN_MIDDLE, None)
    size = float(np.median(np.abs(half.peak[late])))
    middle = half.middle[2 - 2 * CERTAIN_MIDDLE :]
    return float(np.median(np.abs(middle))) < MIDDLES_AGREE * size
