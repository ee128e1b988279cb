"""Rules that segment a free record: held, swinging, at rest, handled between releases."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.formatting import counted, listed, moment
from pendmap.records.by_hand import by_hand
from pendmap.records.experiment import Segment
from pendmap.records.releases import enough, releases
from pendmap.records.rod_sensors import gyroscope_of
from pendmap.records.scale import middle_of, periods_of
from pendmap.signal.half_cycles import after_turns, swings
from pendmap.signal.local_polynomial import local_fit
from pendmap.signal.robust import between, normal_scale, stretches, widened

if TYPE_CHECKING:
    from pendmap.records.work import Work
    from pendmap.signal import Floats, Stretch
    from pendmap.tables.findings import Finding

STILL_SPAN: Final = 8.0  # Range of readings below which there is no motion, over the noise
FOLDED: Final = 0.97  # Reading over the gain, of an accelerometer, near a quarter turn
NOISE_SPAN: Final = 0.1  # Range, rad, below which readings dominated by noise show no motion
FAR_HOLD: Final = 0.05  # Distance of a hold from the middle of the swings, over their range
MOST_LISTED: Final = 6  # Most releases whose times are listed in a message
CERTAIN_OFFSET: Final = 4.0  # Standard errors above which an offset is reported


def moves(work: Work) -> Finding | None:
    """Find whether the pendulum moves; report rest; InputError for a constant angle."""
    low, high = float(work.time[0]), float(work.time[-1])
    work.segments = [Segment("motion", low, high, used=True)]
    if np.ptp(work.theta) == 0:
        raise InputError(
            f"{work.where}: must be a motion, the angle never changes{work.other('angle')}"
        )
    _measure_noise(work)
    good = work.theta[work.trusted]
    spread = float(np.ptp(good)) if good.size else 0.0
    still = good.size < 4 or (work.noise > 0.7 * float(np.std(good)) and spread < NOISE_SPAN)
    work.moves = not still and spread > work.limit
    if work.moves:
        return None
    work.segments = [Segment("rest", low, high, used=False)]
    work.trusted[:] = False
    return work.finding("no-motion", extent=spread)


def _measure_noise(work: Work) -> None:
    """Set the noise of the angle; of an integrated angle, its random walk over a period."""
    if work.integrated:
        rate = work.extra["velocity"]
        seen = gyroscope_of(work.time, work.theta, rate)
        walk = math.sqrt(float(np.median(np.diff(work.time))) * 2 * math.pi / seen.w0)
        work.noise = normal_scale(local_fit(work.time, rate).residual) * walk
    else:
        work.noise = normal_scale(local_fit(work.time, work.theta).residual)
    # With slow sampling the residuals contain motion, so the limit is bounded by the range.
    reach = 0.4 * float(np.ptp(work.theta))
    work.limit = min(reach, max(STILL_SPAN * work.noise, 2.5 * work.count))


def free_motions(work: Work) -> Finding | None:
    """Find the free motions of a record, and the period of small swings."""
    if not work.free:
        return None
    _measure_noise(work)
    good = work.theta[work.trusted]
    middle = 0.0 if work.angle_source is not None else _middle(work, work.time[work.trusted], good)
    middle = float(np.median(good)) if middle is None else middle
    period = _period(work, middle)
    if period is None:
        return work.finding("no-swing")
    work.middle, work.period = middle, period
    span = _trusted_span(work)
    parts = [(a, b) for a, b in between(_still(work, span), *span) if b - a > 5]
    work.parts = releases(work, parts)
    return None if work.angle_source is None else _below_a_quarter_turn(work)


def _middle(work: Work, time: Floats, theta: Floats) -> float | None:
    """Return the middle of the last swings, rad; before a hold at the end, where there is one."""
    middle = middle_of(time, theta)
    moving = np.flatnonzero(np.abs(theta - theta[-1]) > work.limit)
    if middle is None or not moving.size:
        return middle
    before = middle_of(time[: moving[-1]], theta[: moving[-1]])
    far = before is not None and abs(before - middle) > FAR_HOLD * float(np.ptp(theta))
    return before if far else middle


def _below_a_quarter_turn(work: Work) -> Finding | None:
    """Begin each motion where an acceleration shows swings below a quarter turn."""
    parts, late = [], []
    for low, high in work.parts:
        good = np.flatnonzero(work.trusted[low:high]) + low
        time, sine = work.time[good], work.theta[good] - work.middle
        crossing = swings(time, sine, least=work.limit).crossing
        folded = time[np.abs(sine) > FOLDED]
        after = crossing[crossing > folded[-1]] if folded.size else crossing[:0]
        begin = int(np.searchsorted(work.time, after[0])) if after.size else low
        late += [moment(work.time[begin])] if begin > low else []
        parts += [(begin, high)] if high - begin > 5 else []
    work.parts = parts
    times = listed(late, MOST_LISTED)
    return work.finding("acceleration-folded", times=times) if late else None


def _trusted_span(work: Work) -> Stretch:
    """Return the range of the trusted samples."""
    good = np.flatnonzero(work.trusted)
    return int(good[0]), int(good[-1]) + 1


def _period(work: Work, middle: float) -> float | None:
    """Return the approximate period of small swings, s."""
    if work.angle_source is not None:
        return 2 * math.pi / work.angle_source.w0
    good = work.trusted
    periods = periods_of(work.time[good], work.theta[good] - middle, work.count)
    if periods is not None:
        return periods.small
    w0 = work.known.get("w0")
    if not w0 and "gravity" in work.known and "length_m" in work.known:
        w0 = math.sqrt(work.known["gravity"] / work.known["length_m"])
    return 2 * math.pi / w0 if w0 else None


def _still(work: Work, span: Stretch) -> list[Stretch]:
    """Return the stretches without motion, a period or longer, within ``span``."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    theta, time = work.theta[slice(*span)].copy(), work.time[slice(*span)]
    bad = ~work.trusted[slice(*span)]
    theta[bad] = np.interp(time[bad], time[~bad], theta[~bad])
    width = max(round(work.period / float(np.median(np.diff(work.time)))), 5) | 1
    if width >= theta.size:
        return []
    constant = maximum_filter1d(theta, width) - minimum_filter1d(theta, width) <= work.limit
    constant[: width // 2] = constant[-(width // 2) :] = False
    return [(span[0] + a, span[0] + b) for a, b in stretches(widened(constant, width // 2))]


def used_motions(work: Work) -> Finding | None:
    """Trust the free motions that are long enough, and set the segments."""
    if not work.parts:
        return None
    span = _trusted_span(work)
    used = [enough(work, part) for part in work.parts]
    if not any(used):
        used[max(range(len(used)), key=lambda k: work.parts[k][1] - work.parts[k][0])] = True
    work.releases = [part for part, use in zip(work.parts, used, strict=True) if use]
    # The times are those of the used samples; ends of holds are estimated conservatively.
    spans = [f"{moment(work.time[a])} to {moment(work.time[b - 1])} s" for a, b in work.parts]
    taken = [text for text, use in zip(spans, used, strict=True) if use]
    short = [text for text, use in zip(spans, used, strict=True) if not use]
    if work.angle_source is not None and len(taken) > 1:
        low, high = work.releases[0]
        span_of = {"from_s": float(work.time[low]), "to_s": float(work.time[high - 1])}
        raise InputError(
            f"{work.where}: an acceleration without an angle must be of one release, got"
            f" {len(taken)}, of {listed(taken, MOST_LISTED)}; an angle or a velocity (gyroscope)"
            f" must be recorded too, or one release chosen: {by_hand(work.where, **span_of)}"
        )
    _settle(work, used, span)
    if len(used) < 2:
        return None
    what = "each taken as a run" if len(taken) > 1 else "one is used"
    number, used_from, less = counted(len(spans), "release"), listed(taken, MOST_LISTED), ""
    if short:
        less = f"; {len(short)} of fewer than three swings left out: {listed(short, MOST_LISTED)}"
    low, high = work.releases[0][0], work.releases[-1][1] - 1
    ends = float(work.time[low]), float(work.time[high])
    return work.finding(
        "several-releases", span=ends, releases=number, used=used_from, what=what, short=less
    )


def _settle(work: Work, used: list[bool], span: Stretch) -> None:
    """Set the segments, and trust the used motions."""
    trusted = np.zeros(work.time.size, bool)
    beside = between(work.parts, *span)
    segments = [] if not span[0] else [_segment(work, "motion", (0, span[0]), used=False)]
    for k, (part, use) in enumerate(zip(work.parts, used, strict=True)):
        segments += _between(work, beside[k], first=k == 0)
        segments.append(_segment(work, "motion", part, used=use))
        trusted[slice(*part)] = use
    segments += _between(work, beside[-1], first=False)
    if span[1] < work.time.size:
        segments.append(_segment(work, "motion", (span[1], work.time.size), used=False))
    work.segments = segments
    work.trusted &= trusted


def _between(work: Work, part: Stretch, *, first: bool) -> list[Segment]:
    """Return the rest, held or handled segment of a stretch without a swing, if not empty."""
    level = work.theta[slice(*part)]
    if not level.size:
        return []
    reach = float(np.max(np.abs(work.theta[work.trusted] - work.middle)))
    far = abs(float(np.median(level)) - work.middle) > 0.1 * reach
    moved = float(np.ptp(level)) > 0.2 * reach
    swings = np.min(level) < work.middle - 0.1 * reach and np.max(level) > work.middle + 0.1 * reach
    cut = any(low < part[1] and high > part[0] for low, high in work.cut)
    what = "handled" if moved and not first else "held" if far or first else "rest"
    what = "driven" if cut or (first and swings) else what
    return [_segment(work, what, part, used=False)]


def _segment(work: Work, what: str, part: Stretch, *, used: bool) -> Segment:
    """Return the segment of a range of samples."""
    return Segment(what, float(work.time[part[0]]), float(work.time[part[1] - 1]), used)


def held_or_at_rest(work: Work) -> None:
    """Report a hold before the first motion, and a rest after the last."""
    first, last = work.segments[0], work.segments[-1]
    if first.what == "held":
        begin = moment(work.segments[1].from_s)
        work.note("held-start", span=(first.from_s, first.to_s), begin=begin)
    if first.what == "driven" and len(work.segments) > 1:
        begin = moment(work.segments[1].from_s)
        work.note("driven-start", span=(first.from_s, first.to_s), begin=begin)
    if last.what == "driven" and len(work.segments) > 1:
        work.note("braked-end", span=(last.from_s, last.to_s), end=moment(last.from_s))
    if last.what == "rest" and len(work.segments) > 1:
        work.note("rest-tail", span=(last.from_s, last.to_s), begin=moment(last.from_s))


def zero(work: Work) -> Finding | None:
    """Report a rest angle, or middle of the swings, of a free run that is not 0."""
    if not work.releases or work.angle_source is not None or work.integrated:
        return None  # an angle from a sensor on the rod has its zero at the middle
    last = work.segments[-1]
    if last.what == "rest":
        tail = work.theta[work.time >= last.from_s]
        value = float(np.mean(tail))
        error = max(float(np.std(tail)) / math.sqrt(tail.size), work.count / math.sqrt(12))
        finding = work.finding("zero-offset.rest", middle=_folded(value))
    else:
        _measure_noise(work)
        time, theta = work.time[work.trusted], work.theta[work.trusted]
        middle = middle_of(time, theta)
        middle = float(np.median(theta[theta.size // 2 :])) if middle is None else middle
        theta = theta - 2 * math.pi * round(middle / (2 * math.pi))
        start = after_turns(theta)
        middles = swings(time[start:], theta[start:], least=work.limit).middle
        if middles.size < 6:
            return None
        middles = middles[middles.size // 2 :]  # small swings: no asymmetry by friction, no turns
        value = float(np.median(middles))
        error = 1.6 * normal_scale(middles - value) / math.sqrt(middles.size)
        error = max(error, work.count / math.sqrt(12 * middles.size))
        finding = work.finding("zero-offset.swing", middle=value, error=error)
    known = any(other.what == "zero-offset" for other in work.findings)
    small = abs(_folded(value)) <= max(CERTAIN_OFFSET * error, 1e-5)
    return None if known or small else finding


def _folded(angle: float) -> float:
    """Return an angle modulo a turn, in [-pi, pi]."""
    return angle - 2 * math.pi * round(angle / (2 * math.pi))
