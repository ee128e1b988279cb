"""Rules of the pivot.

A step ``s`` of a pivot's position sampled every ``h`` seconds is one of ``s / h^2`` in its
acceleration (1000 m/s^2 for 1 mm at 1 kHz): stepwise positions are smoothed by cubics.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.resolution import step_of
from pendmap.signal.local_polynomial import local_fit
from pendmap.signal.robust import even_times

if TYPE_CHECKING:
    from pendmap.records.work import Work
    from pendmap.signal import Floats
    from pendmap.tables.findings import Finding

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
    interval, even = even_times(work.time)
    if not even.size:
        return None
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
