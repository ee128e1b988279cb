"""Resolution of readings: their step, encoder edges, and whether they suffice; steps of a pivot.

An encoder that logs each edge has no readings between edges; its angles are exact, its stamps have
errors: ``theta_k = (n_k - sign(n_k - n_(k-1)) / 2) * step``.

A step ``s`` of a pivot's position sampled every ``h`` seconds is one of ``s / h^2`` in its
acceleration (1000 m/s^2 for 1 mm at 1 kHz): stepwise positions are smoothed by cubics.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted, moment
from pendmap.records.by_hand import by_hand
from pendmap.records.scale import GAIN_KNOWN, LARGEST_SWING, gain_interval, swings_about
from pendmap.signal.local_polynomial import local_fit

if TYPE_CHECKING:
    from pendmap.records.work import Work
    from pendmap.signal import Floats
    from pendmap.tables.findings import Finding

NYQUIST: Final = 2.0  # Fewest readings per period of the drive that resolve it
LEFT_OUT: Final = 0.1  # Share of readings in motion that a fit may leave out without a warning
MOVING: Final = ("motion", "driven", "handled")  # Segments that may belong to a decay
# Findings that leave readings in motion out
ENDS: Final = ["braked-end", "driven-start", "handled-end", "held-start"]
REASONS: Final = ["clipped", "frozen", "missed-counts", "outliers"]
LEAVES_OUT: Final = [*ENDS, *REASONS, "several-releases", "trigger-release"]
ON_STEPS: Final = 0.12  # Greatest rms distance from multiples of a step, in steps; chance: 0.29
EDGE_SHARE: Final = 0.95  # Share of single-count steps above which a record is a log of edges
FEWEST_EDGES: Final = 50  # Fewest readings from which edges are recognized


def used_share(work: Work) -> Finding | None:
    """Report a record of which more than a tenth of the motion is not for fitting."""
    moving = work.trusted.copy()
    for part in work.segments:
        if part.what in MOVING:
            moving |= (work.time >= part.from_s) & (work.time <= part.to_s)
    used, whole = int(work.trusted.sum()), int(moving.sum())
    if not 0 < used < (1 - LEFT_OUT) * whole:
        return None
    at = work.time[moving]
    command = by_hand(work.where, **{"from": moment(at[0]), "to": moment(at[-1])})
    why = "; ".join(finding.text for finding in work.findings if finding.what in LEAVES_OUT)
    readings = counted(whole, "reading")
    return work.finding("few-used", used=used, readings=readings, why=why, command=command)


def drive(work: Work) -> Finding | None:
    """Report a drive that is sampled too slowly."""
    rate = 1 / float(np.median(np.diff(work.time)))
    drive = (work.plan.drive.Omega if work.plan.drive else 0.0) / math.tau
    if rate >= NYQUIST * drive:
        return None
    return work.finding("drive-unresolved", drive=drive, rate=rate, least=NYQUIST * drive)


def gain(work: Work) -> Finding | None:
    """Report swings too small to determine the gain of the sensor."""
    free = work.free and not work.integrated
    good = work.trusted
    periods = swings_about(work.time[good], work.theta[good], work.count) if free else None
    if periods is None or float(np.max(periods.amplitude)) > LARGEST_SWING:
        return None
    low, high = gain_interval(periods)
    if high - low <= 2 * GAIN_KNOWN:
        return None
    between = f"{low:.2g} to {high:.2g}" if math.isfinite(high) else f"{low:.2g} or more"
    return work.finding("gain-unknown", between=between)


def step_of(theta: Floats) -> float:
    """Return the step of readings that repeat and are multiples of it, rad; 0 if there is none."""
    values = np.unique(np.round(theta, 12))
    if values.size < 3 or values.size > 0.7 * theta.size:
        return 0.0
    apart = np.diff(values)
    # Written digits round the multiples of a step: neighbours differ by the step to a digit.
    least = float(np.quantile(apart, 0.02))
    near = apart[(apart >= 0.5 * least) & (apart < 1.5 * least)]
    multiples = np.round(apart / (np.median(near) if near.size else least))
    small = multiples < 50
    if not np.any(multiples[small] > 0):
        return 0.0
    step = float(np.sum(apart[small]) / np.sum(multiples[small]))
    turns = np.exp(2j * np.pi * (values - values[0]) / step)
    away = np.angle(turns / np.mean(turns)) / (2 * np.pi)
    return step if float(np.sqrt(np.mean(away**2))) < ON_STEPS else 0.0


def logs_edges(theta: Floats) -> bool:
    """Return whether nearly every reading differs by one count from its predecessor."""
    good = theta[np.isfinite(theta)]
    step = step_of(good) if good.size >= FEWEST_EDGES else 0.0
    if not step:
        return False
    return bool(np.mean(np.abs(np.abs(np.diff(good)) / step - 1) < 0.25) > EDGE_SHARE)


def spread_stamps(time: Floats) -> Floats:
    """Return times with those of equal stamps spread evenly over a clock tick, s, shape (N,)."""
    stamps, first, number = np.unique(time, return_index=True, return_counts=True)
    tick = float(np.min(np.diff(stamps))) if stamps.size > 1 else 0.0
    place = np.arange(time.size) - np.repeat(first, number)
    share = (place + 0.5) / np.repeat(number, number) - 0.5
    return np.asarray(time + share * tick)


def edges(work: Work) -> None:
    """Shift the readings of a log of edges by half a count to the edges."""
    if work.plan.pivot is not None or not logs_edges(work.theta):
        return
    work.edges, work.estimated_step = True, step_of(work.theta)
    way = np.sign(np.round(np.diff(work.theta) / work.estimated_step))
    # A log of the edges themselves shows an edge twice at a turning point.
    if np.count_nonzero(way == 0) <= np.count_nonzero(way[1:] * way[:-1] < 0):
        work.theta -= 0.5 * work.estimated_step * np.append(way[0], way)
        work.trusted[0] = False  # it may be the initial count, not an edge
        work.trusted[1:] &= way != 0  # a line between two edges or at rest


FARTHEST_PIVOT: Final = {"m": 3.0, "m/s": 60.0, "m/s2": 3000.0}  # Greatest plausible span by unit
PIVOT_ORDER: Final = {"m": 2, "m/s": 1}  # Order of differentiation to an acceleration, by unit
NOISE_SHARE: Final = 0.05  # Greatest noise of the pivot's acceleration, over its largest value
LONGEST_WINDOW: Final = 0.2  # Longest window of more than five readings, s


def pivot_unit(work: Work) -> Finding | None:
    """Report a pivot whose motion is implausible in its unit."""
    for way, values in work.pivot.items():
        span = float(np.nanmax(values) - np.nanmin(values)) if np.isfinite(values).any() else 0.0
        if work.pivot_unit and span > FARTHEST_PIVOT[work.pivot_unit]:
            return work.finding("pivot-unit.wrong", way=way, extent=span, unit=work.pivot_unit)
    return None


def pivot_steps(work: Work) -> Finding | None:
    """Replace stepwise positions or velocities of the pivot by smooth accelerations."""
    order = PIVOT_ORDER.get(work.pivot_unit or "", 0)
    known = all(np.isfinite(values).all() for values in work.pivot.values())
    if not order or work.time.size < 20 or not known:
        return None
    interval = float(np.median(np.diff(work.time)))
    count = math.floor((work.time[-1] - work.time[0]) / interval) + 1
    if count > 10 * work.time.size:  # gaps are long
        return None
    even = work.time[0] + interval * np.arange(count)
    longest, places = 0, {}
    for way, values in work.pivot.items():
        places[way] = np.interp(even, work.time, values)
        if np.ptp(values) > 0:
            window = _cubic_window(places[way], step_of(values), order, interval)
            longest = max(longest, window)
    if longest < 7:
        return None
    from scipy.signal import savgol_filter

    for way, values in places.items():
        pushed = savgol_filter(values, longest, 3, deriv=order, delta=interval)
        work.pivot[way] = np.interp(work.time, even, pushed)
    what = "places" if order == 2 else "speeds"
    work.pivot_unit = "m/s2"
    seconds = longest * interval
    return work.finding("pivot-smoothed", what=what, readings=longest, seconds=seconds)


def _cubic_window(values: Floats, step: float, order: int, interval: float) -> int:
    """Return the number of readings to which a cubic is fitted: 5 if no smoothing is needed."""
    from scipy.signal import savgol_coeffs, savgol_filter

    time = interval * np.arange(values.size, dtype=np.float64)
    rest = np.abs(local_fit(time, values).residual)
    felt = rest[rest > 1e-9 * np.ptp(values)]
    noise = max(step / math.sqrt(12), float(np.median(felt)) if felt.size else 0.0)
    most = max(min(int(LONGEST_WINDOW / interval), values.size // 4), 5)
    for window in range(5, most + 1, 2):
        gain = float(np.linalg.norm(savgol_coeffs(window, 3, deriv=order, delta=interval)))
        pushed = savgol_filter(values, window, 3, deriv=order, delta=interval)
        if gain * noise <= NOISE_SHARE * float(np.max(np.abs(pushed))):
            return window
    return most - (most + 1) % 2
