"""Rules that segment a free record: held, swinging, at rest, handled between releases."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted, listed, moment
from pendmap.records.angle import gyroscope_of
from pendmap.records.experiment import Segment
from pendmap.records.releases import half_cycles, releases
from pendmap.records.scale import middle_of, periods_of
from pendmap.signal.local_polynomial import local_fit
from pendmap.signal.robust import between, normal_scale, stretches, widened

if TYPE_CHECKING:
    from pendmap.records.work import Work
    from pendmap.signal import Stretch
    from pendmap.tables.findings import Finding

STILL_SPAN: Final = 8.0  # Range of readings below which there is no motion, over the noise
NOISE_SPAN: Final = 0.1  # Range, rad, below which readings dominated by noise show no motion
FAR_HOLD: Final = 0.05  # Distance of a hold from the middle of the swings, over their range
FEWEST_HALF_CYCLES: Final = 5  # Fewest half cycles of a release that is a run, about three swings
MOST_LISTED: Final = 6  # Most releases whose times are listed in a message


def moves(work: Work) -> Finding | None:
    """Find whether the pendulum moves; report rest; InputError for a constant angle."""
    low, high = float(work.time[0]), float(work.time[-1])
    work.segments = [Segment("motion", low, high, used=True)]
    if np.ptp(work.theta) == 0:
        work.refuse("must be a motion, the angle never changes", **work.other())
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
    good, w0, middle = work.trusted, work.known.get("w0"), _middle(work)
    periods = periods_of(work.time[good], work.theta[good] - middle, work.count)
    w0 = w0 if periods is None else 2 * math.pi / periods.small
    if not w0:
        return work.finding("no-swing")
    work.middle, work.period = middle, 2 * math.pi / w0
    span = _trusted_span(work)
    parts = [(a, b) for a, b in between(_still(work, span), *span) if b - a > 5]
    work.parts = releases(work, parts)
    return None


def _middle(work: Work) -> float:
    """Return the middle of the last swings, rad, before a hold far from it, or else the median."""
    time, theta = work.time[work.trusted], work.theta[work.trusted]
    moving = np.flatnonzero(np.abs(theta - theta[-1]) > work.limit)
    middle = middle_of(time, theta)
    if middle is None:
        return float(np.median(theta))
    before = middle_of(time[: moving[-1]], theta[: moving[-1]]) if moving.size else None
    if before is None or abs(before - middle) <= FAR_HOLD * float(np.ptp(theta)):
        return middle
    return before


def _trusted_span(work: Work) -> Stretch:
    """Return the range of the trusted samples."""
    good = np.flatnonzero(work.trusted)
    return int(good[0]), int(good[-1]) + 1


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
    used = [half_cycles(work, part)[2].peak.size >= FEWEST_HALF_CYCLES for part in work.parts]
    if not any(used):
        used[max(range(len(used)), key=lambda k: work.parts[k][1] - work.parts[k][0])] = True
    work.releases = [part for part, use in zip(work.parts, used, strict=True) if use]
    spans = [f"{moment(work.time[a])} to {moment(work.time[b - 1])} s" for a, b in work.parts]
    taken = [text for text, use in zip(spans, used, strict=True) if use]
    _settle(work, used, span)
    if len(used) < 2:
        return None
    what = "each taken as a run" if len(taken) > 1 else "one is used"
    number, used_from, short = counted(len(spans), "release"), listed(taken, MOST_LISTED), ""
    if len(taken) < len(spans):
        short = f"; {len(spans) - len(taken)} of fewer than three swings left out"
    low, high = work.releases[0][0], work.releases[-1][1] - 1
    ends = float(work.time[low]), float(work.time[high])
    return work.finding(
        "several-releases", span=ends, releases=number, used=used_from, what=what, short=short
    )


def _settle(work: Work, used: list[bool], span: Stretch) -> None:
    """Set the segments, and trust the used motions."""
    trusted = np.zeros(work.time.size, bool)
    known = [("motion", part, use) for part, use in zip(work.parts, used, strict=True)]
    for _, part, use in known:
        trusted[slice(*part)] = use
    known += [("motion", (0, span[0]), False), ("motion", (span[1], work.time.size), False)]
    for k, part in enumerate(between(work.parts, *span)):
        if part[0] < part[1]:
            known.append((_between(work, part, first=k == 0), part, False))
    work.segments = [
        Segment(what, float(work.time[low]), float(work.time[high - 1]), use)
        for what, (low, high), use in sorted(known, key=lambda one: one[1])
        if low < high
    ]
    work.trusted &= trusted


def _between(work: Work, part: Stretch, *, first: bool) -> str:
    """Return what a stretch without a free swing is: at rest, held, handled or driven."""
    level = work.theta[slice(*part)]
    reach = float(np.max(np.abs(work.theta[work.trusted] - work.middle)))
    far = abs(float(np.median(level)) - work.middle) > 0.1 * reach
    moved = float(np.ptp(level)) > 0.2 * reach
    swings = np.min(level) < work.middle - 0.1 * reach and np.max(level) > work.middle + 0.1 * reach
    cut = any(low < part[1] and high > part[0] for low, high in work.cut)
    if cut or (first and swings):
        return "driven"
    return "handled" if moved and not first else "held" if far or first else "rest"


def held_or_at_rest(work: Work) -> None:
    """Report a hold before the first motion, and a rest after the last."""
    if len(work.segments) < 2:
        return
    first, last = work.segments[0], work.segments[-1]
    begins = {"held": "held-start", "driven": "driven-start"}.get(first.what)
    ends = {"driven": "braked-end", "handled": "handled-end", "rest": "rest-tail"}.get(last.what)
    if begins:
        begin = moment(work.segments[1].from_s)
        work.note(begins, span=(first.from_s, first.to_s), begin=begin)
    if ends:
        work.note(ends, span=(last.from_s, last.to_s), begin=moment(last.from_s))
