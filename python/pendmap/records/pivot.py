"""The pivot's recorded places and speeds: smoothed where their steps would drown the acceleration.

What pushes the pendulum is the pivot's acceleration. A step ``s`` of the places, read every ``h``
seconds, is one of ``s / h^2`` in it: 1000 m/s^2 for 1 mm at 1 kHz. There a cubic is fitted to the
readings around each one, and its second derivative (of speeds the first) is the acceleration.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.resolution import step_of
from pendmap.signal.local_polynomial import local_fit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]

DERIVATIVES: Final = {"m": 2, "m/s": 1}

SHARE: Final = 0.05
"""Share of the largest acceleration that its noise may be."""

STEPS: Final = 4.0
"""Steps that a moving pivot passes within a window: fewer look like jerks."""

LONGEST: Final = 0.2
"""Seconds that a window spans at most, unless it then holds only five readings."""

MOVING: Final = 0.2
"""Share of the largest speed from which the pivot moves."""


def smooth(work: Work) -> None:
    """Make accelerations of places or speeds that come in steps, and say so."""
    order = DERIVATIVES.get(work.pivot_unit or "", 0)
    motion = work.pivot() or {}
    if not order or work.time.size < 20 or not all(np.isfinite(v).all() for v in motion.values()):
        return
    interval = float(np.median(np.diff(work.time)))
    count = math.floor((work.time[-1] - work.time[0]) / interval) + 1
    if count > 10 * work.time.size:
        return
    even = work.time[0] + interval * np.arange(count)
    places = {way: np.interp(even, work.time, values) for way, values in motion.items()}
    windows = [
        _window(places[way], step_of(values), order, interval)
        for way, values in motion.items()
        if np.ptp(values) > 0
    ]
    if not windows or max(windows) < 7:
        return
    from scipy.signal import savgol_filter

    for way, values in places.items():
        pushed = savgol_filter(values, max(windows), 3, deriv=order, delta=interval)
        work.extra[f"pivot:{way}"] = np.interp(work.time, even, pushed)
    what = "places" if order == 2 else "speeds"
    text = (
        f"the pivot's {what} come in steps: its acceleration is that of cubics through"
        f" {max(windows)} readings, {max(windows) * interval:.3g} s"
    )
    work.say("pivot-smoothed", text, mended=True)
    work.pivot_unit = "m/s2"


def _window(values: Floats, step: float, order: int, interval: float) -> int:
    """Return how many readings a cubic is fitted to: 5 where none is needed."""
    from scipy.signal import savgol_coeffs, savgol_filter

    time = interval * np.arange(values.size, dtype=np.float64)
    rest = np.abs(local_fit(time, values).residual)
    felt = rest[rest > 1e-9 * np.ptp(values)]
    noise = max(step / math.sqrt(12), float(np.median(felt)) if felt.size else 0.0)
    most = max(min(int(LONGEST / interval), values.size // 4), 5)
    for window in range(5, most + 1, 2):
        gain = float(np.linalg.norm(savgol_coeffs(window, 3, deriv=order, delta=interval)))
        pushed = savgol_filter(values, window, 3, deriv=order, delta=interval)
        change = np.abs(savgol_filter(values, window, 3, deriv=1, delta=interval))
        speed = float(np.median(change[change >= MOVING * change.max()]))
        passed = speed * window * interval >= STEPS * step
        if passed and gain * noise <= SHARE * float(np.max(np.abs(pushed))):
            return window
    return most - (most + 1) % 2
