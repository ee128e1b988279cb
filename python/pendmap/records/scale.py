"""Unit, scale and zero of the readings, from the period of a pendulum.

The period of a free swing increases with its amplitude A, ``T(A) = T0 (2/pi) K(sin(A/2))``: at one
radian it is 6.6 % longer than that of small swings. Degrees mistaken for radians give periods that
hardly increase, and impossible amplitudes.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.model.quantities import GRAVITY
from pendmap.signal.half_cycles import after_turns, swings
from pendmap.signal.robust import Z95, normal_scale
from pendmap.tables.units import DEGREE, name_and_unit

if TYPE_CHECKING:
    from pendmap.records.experiment import Run
    from pendmap.records.work import Work
    from pendmap.signal import Floats, Indices
    from pendmap.tables.findings import Finding

FEWEST_PERIODS: Final = 6  # Fewest periods that are analysed
LEAST_GROWTH: Final = 1e-4  # Growth of the period, over a pendulum's, of readings that show none
ONE_SIDED: Final = 0.1  # Greatest decay of one side, over that of the other, of what is no angle
GAIN_KNOWN: Final = 0.1  # Half-width of the gain's 95 % interval above which it is reported
LARGEST_SWING: Final = 3.0  # Largest amplitude, rad, at which the increase of the period is used
LEAST_ERROR: Final = 1e-3  # Least relative error of a scale factor
LONGEST_PERIOD: Final = 60.0  # Longest period of a laboratory pendulum, s
SHORTEST_PERIOD: Final = 0.02  # Shortest period, s: a length of 0.1 mm
# Units in which times are written as seconds, in s
SHORT_UNITS: Final = {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}
SAMPLES_A_PERIOD: Final = 8.0  # Samples per period below which slow sampling is reported
UNLIKE_RIG: Final = 0.25  # Relative difference from the period of [rig] above which it is reported
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
        grown = growth(np.minimum(self.amplitude[self._smallest], 3.0))
        return self.small / float(np.median(grown))

    @property
    def corrected(self) -> Floats:
        """Periods over the growth of a pendulum's with its amplitude, s, shape (M,)."""
        return self.period / growth(np.minimum(self.amplitude, 3.0))

    @property
    def _smallest(self) -> Indices:
        return np.argsort(self.amplitude)[: max(self.period.size // 3, 1)]


def swings_of(run: Run) -> Periods | None:
    """Return the periods of a free run; None if too few are below half a turn."""
    periods = swings_about(run.time[run.trusted], run.theta[run.trusted], run.count_rad)
    return None if periods is None or float(periods.amplitude.min()) >= math.pi else periods


def swings_about(time: Floats, theta: Floats, count: float) -> Periods | None:
    """Return the periods of readings about their middle; None if there are too few."""
    middle = middle_of(time, theta)
    middle = float(np.median(theta[theta.size // 2 :])) if middle is None else middle
    return periods_of(time, theta - middle, count)


def periods_of(time: Floats, theta: Floats, count: float) -> Periods | None:
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


def share_of(periods: Periods, grown: Floats) -> tuple[float, float]:
    """Return the increase of periods over a pendulum's, 1/k^2 for k times the angle; its error."""
    columns = np.column_stack([np.ones(grown.size), grown - 1])
    answer, spread = _robust_line(columns, periods.period)
    return float(answer[1] / answer[0]), float(spread[1] / answer[0])


def gain_interval(periods: Periods) -> tuple[float, float]:
    """Return the 95 % interval of reading over angle from periods."""
    share, error = share_of(periods, growth(periods.amplitude))
    least, most = share - Z95 * error, share + Z95 * error
    # Of wide swings the growth is more than the square of the angle.
    wide = factor_of(periods, share)[0] / math.sqrt(share) if share > max(3 * error, 0.0) else 1.0
    low = 1 / (wide * math.sqrt(max(most, LEAST_GROWTH)))
    return low, 1 / (wide * math.sqrt(least)) if least > 0 else math.inf


def middle_of(time: Floats, theta: Floats) -> float | None:
    """Return the middle of the last quarter of a record, rad; None if it is short or rotates."""
    late = theta[time >= time[0] + 0.75 * (time[-1] - time[0])]
    if late.size < 20:
        return None
    low, high = (float(np.quantile(late, part)) for part in (0.02, 0.98))
    return (low + high) / 2 if (high - low) / 2 < math.pi else None


def factor_of(periods: Periods, share: float) -> tuple[float, float]:
    """Return the factor on the readings that gives a pendulum's periods, and its error."""
    best, error = math.sqrt(max(share, LEAST_GROWTH)), 0.0
    for _ in range(12):  # Gauss-Newton steps
        grown = growth(best * periods.amplitude)
        slope = (growth(1.001 * best * periods.amplitude) - grown) / (0.001 * best)
        answer, spreads = _robust_line(np.column_stack([grown, slope]), periods.period)
        step = float(np.clip(answer[1] / answer[0], -0.3 * best, 0.3 * best))
        best, error = best + step, float(spreads[1] / answer[0])
    return best, math.hypot(error, LEAST_ERROR * best)


def growth(amplitude: Floats) -> Floats:
    """Return T(A)/T0 = (2/pi) K(sin(A/2))."""
    from scipy.special import ellipkm1

    return np.asarray(2 / math.pi * ellipkm1(np.cos(amplitude / 2) ** 2))


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


def seconds(work: Work) -> Finding | None:
    """Convert times in milliseconds, microseconds or nanoseconds to seconds."""
    periods = _periods(work)
    if periods is None or SHORTEST_PERIOD < (small := periods.small) < LONGEST_PERIOD:
        return None
    for name, factor in SHORT_UNITS.items():
        if small <= LONGEST_PERIOD or not SHORTEST_PERIOD < small * factor < LONGEST_PERIOD:
            continue
        if "time" in work.declared:
            return work.finding("time-unit.declared", period=small, unit=name)
        if math.isfinite(work.plan.from_s) or math.isfinite(work.plan.to_s):
            work.refuse(f"from_s and to_s must be in s, the times look like {name}", time_unit=name)
        finding = work.finding("time-unit.short", period=small, unit=name)
        work.time *= factor
        work.theta *= factor if work.integrated else 1.0
        return finding
    return work.finding("time-unit.wrong", period=small)


def _periods(work: Work) -> Periods | None:
    """Return the periods of a free record before its scale is certain."""
    time, theta = work.time[work.trusted], work.theta[work.trusted]
    return swings_about(time, theta, work.count) if work.free else None


def radians(work: Work) -> Finding | None:
    """Convert degrees to radians where the swings are impossible otherwise."""
    periods = _periods(work)
    if periods is None or np.median(periods.amplitude) <= 0:
        return None
    largest = float(np.max(periods.amplitude))
    if largest <= math.pi:  # swings are possible
        return None
    channel = "velocity" if work.integrated else "angle"
    unit = name_and_unit(work.columns.get(channel, ""))[1] or "rad"
    if channel in work.declared or "rad" not in unit:
        return work.finding("angle-unit.wrong", largest=largest)
    if largest * DEGREE > math.pi:
        text = f"swings of {largest:.4g} rad need --angle-scale, or the counts of a turn"
        work.refuse(text, angle_unit="counts", counts_per_turn=2400)
    work.theta *= DEGREE
    if work.integrated:
        work.extra["velocity"] = work.extra["velocity"] * DEGREE
    work.count *= DEGREE
    work.estimated_step *= DEGREE
    read = "velocities are degrees a second" if work.integrated else "angles are degrees"
    return work.finding("angle-unit.degrees", read=read, largest=largest)


def one_sided(work: Work) -> None:
    """Raise InputError for readings of which one side decays alone: no angle does that."""
    theta = work.theta[work.trusted]
    moving = np.flatnonzero(np.abs(theta - theta[-1]) > work.limit) if theta.size else theta
    first, *_, last = np.array_split(theta[: moving[-1] + 1] if moving.size else theta, 4)
    if not work.free or not last.size:
        return
    ends = [np.quantile(part, (0.02, 0.98)) for part in (first, last)]
    if np.count_nonzero(np.diff(first > np.mean(ends[0]))) < FEWEST_PERIODS:
        return
    less, more = sorted(np.abs(ends[1] - ends[0]).tolist())
    if less < ONE_SIDED * more and more > ONE_SIDED * float(np.ptp(work.theta)):
        work.refuse(
            "angles must swing to both sides of the rest, and the decay of"
            f" {work.columns.get('angle')!r} is on one side of it, as of a cosine, a height or an"
            " absolute value: another column must be the angle",
            **work.other(),
        )


def curvature(work: Work) -> Finding | None:
    """Report periods that do not increase with amplitude as a pendulum's do."""
    periods = _periods(work)
    if periods is None or periods.period.size < FEWEST_PERIODS + 2:
        return None
    largest, grown = float(np.max(periods.amplitude)), growth(periods.amplitude)
    if largest > LARGEST_SWING or np.ptp(grown) < 2e-3:
        return None
    low, high = gain_interval(periods)
    share, error = share_of(periods, grown)
    unknown = Z95 * error > 2 * GAIN_KNOWN  # the gain is the root of the share
    if unknown or (low <= 1 + GAIN_KNOWN and high >= 1 - GAIN_KNOWN):
        return None
    factor, spread = factor_of(periods, share)
    return work.finding(
        "angle-unit.flat" if share < 0.1 else "angle-scale",
        low=periods.amplitude.min(),
        high=largest,
        share=share,
        error=error,
        gain=1 / factor,
        spread_gain=spread / factor**2,
        factor=factor,
        spread=spread,
    )


def period_of_rig(work: Work) -> Finding | None:
    """Report a period of small swings that differs from that of [rig]."""
    periods = _periods(work)
    if periods is None:
        return None
    expected = {}
    if "w0" in work.known:
        expected[f"w0 = {work.known['w0']:g} rad/s"] = 2 * math.pi / work.known["w0"]
    if "length_m" in work.known:
        root = math.sqrt(work.known["length_m"] / work.known.get("gravity", GRAVITY))
        expected[f"length_m = {work.known['length_m']:g} m"] = 2 * math.pi * root
    seen = periods.smallest
    other = [
        f"{period:.4g} s by {name}"
        for name, period in expected.items()
        if abs(seen / period - 1) > UNLIKE_RIG
    ]
    if not other:
        return None
    return work.finding("period-unlike-rig", seen=seen, known=" and ".join(other))


def sampling(work: Work) -> Finding | None:
    """Report a sampling rate too low for the motion."""
    interval = float(np.median(np.diff(work.time)))
    periods = _periods(work)
    number = periods.small / interval if periods else math.inf
    fastest = float(np.quantile(np.abs(np.diff(work.theta)), 0.99))
    if number < SAMPLES_A_PERIOD:
        return work.finding("sampling-slow", number=number, column=work.columns.get("angle", "..."))
    return work.finding("sampling-slow.steps", step=fastest) if fastest > 1.0 else None


def zero(work: Work) -> Finding | None:
    """Shift the zero of the angle of a free run to the rest position if it is far from it."""
    if not work.free:
        return None
    good = work.trusted
    middle = middle_of(work.time[good], work.theta[good])
    # Whole turns are due to rotations over the top.
    turns = 2 * math.pi * round((middle or 0.0) / (2 * math.pi))
    off = (middle or 0.0) - turns
    if middle is None or abs(off) < FAR_ZERO:
        return None
    quarters = round(off / (math.pi / 2))
    gauge = quarters * math.pi / 2
    if not _certain(work.time[good], work.theta[good] - middle):
        return work.finding("zero-uncertain")
    turned = quarters and abs(off - gauge) < OFF_QUARTER
    work.zero = turns + (gauge if turned else off)
    work.theta -= work.zero
    if turned:
        return work.finding("gauge-turned", degrees=90 * quarters, middle=off)
    return work.finding("zero-offset.subtracted", middle=off)


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
