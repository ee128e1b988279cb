"""Rules of other channels: velocity, acceleration and pivot against the angle.

A step ``s`` of a pivot's position sampled every ``h`` seconds is one of ``s / h^2`` in its
acceleration (1000 m/s^2 for 1 mm at 1 kHz): stepwise positions are smoothed by cubics.
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted
from pendmap.records.resolution import step_of
from pendmap.signal.local_polynomial import local_fit
from pendmap.signal.robust import even_times

if TYPE_CHECKING:
    from collections.abc import Callable

    from pendmap.records.experiment import Finding
    from pendmap.records.work import Work
    from pendmap.signal import Floats


SAME_MOTION: Final = 0.8  # Least correlation of two channels of the same motion
GAIN_OFF: Final = 0.1  # Greatest relative error of a gain that a channel's filter may cause
CERTAIN_SIGN: Final = 8.0  # Standard errors above which a coefficient has the wrong sign
FARTHEST_PIVOT: Final = {"m": 3.0, "m/s": 60.0, "m/s2": 3000.0}  # Greatest plausible span by unit
DERIVATIVE_SPAN: Final = 0.12  # Window of the polynomials that give derivatives, periods
PIVOT_ORDER: Final = {"m": 2, "m/s": 1}  # Order of differentiation to an acceleration, by unit
NOISE_SHARE: Final = 0.05  # Greatest noise of the pivot's acceleration, over its largest value
STEPS_PASSED: Final = 4.0  # Fewest resolution steps that a moving pivot passes within a window
LONGEST_WINDOW: Final = 0.2  # Longest window of more than five readings, s
MOVING_SHARE: Final = 0.2  # Speed, over the largest, above which the pivot is moving


def velocity(work: Work) -> Finding | None:
    """Compare a velocity with the angle's derivative: invert, rescale or remove it."""
    if work.integrated or "velocity" not in work.extra:
        return None  # nothing to compare it with
    values = work.extra["velocity"]
    if missing := int(np.count_nonzero(~np.isfinite(values))):
        del work.extra["velocity"]
        return work.finding("velocity-missing", number=counted(missing, "sample"))
    fit = local_fit(work.time, work.theta)
    which = work.trusted[fit.middle]
    slope, seen = fit.slope[which], values[fit.middle][which]
    scale = float(np.max(np.abs(seen), initial=0.0))
    if slope.size < 10 or 0 in (scale, float(np.std(slope)), float(np.std(seen))):
        return None
    seen = seen / scale  # squares of huge numbers overflow
    alike = float(np.corrcoef(slope, seen)[0, 1])
    if abs(alike) < SAME_MOTION:
        del work.extra["velocity"]
        return work.finding("velocity-unlike", alike=alike)
    gain = abs(float(np.dot(slope, seen) / np.dot(slope, slope)) * scale)
    if abs(gain * math.pi / 180 - 1) < GAIN_OFF and "velocity" not in work.declared:
        work.extra["velocity"] = values * math.pi / 180
        work.doubt = work.finding("velocity-unit", gain=gain)
    elif abs(gain - 1) > GAIN_OFF:
        work.doubt = work.finding("velocity-scale", gain=gain)
    if alike > 0:
        return None
    work.extra["velocity"] = -work.extra["velocity"]
    return work.finding("sign-turned.velocity")


def pivot_unit(work: Work) -> Finding | None:
    """Report a pivot whose motion is implausible in its unit."""
    for way, values in work.pivot.items():
        span = float(np.nanmax(values) - np.nanmin(values)) if np.isfinite(values).any() else 0.0
        if work.pivot_unit and span > FARTHEST_PIVOT[work.pivot_unit]:
            return work.finding("pivot-unit.wrong", way=way, extent=span, unit=work.pivot_unit)
    return None


def drive_sign(work: Work) -> Finding | None:
    """Report a drive or pivot whose coefficient the angle shows with the wrong sign."""
    from scipy.signal import savgol_filter

    interval, even = even_times(work.time)
    count, good = even.size, work.trusted
    if count < 100 or not good.any():
        return None
    theta = np.interp(even, work.time[good], work.theta[good])
    w0 = work.known.get("w0") or 6.0
    window = max(round(DERIVATIVE_SPAN * 2 * math.pi / w0 / interval), 5) | 1
    if window > count // 4:
        return None

    smooth = functools.partial(savgol_filter, window_length=window, polyorder=3, delta=interval)
    pushes = _pushes(work, even, smooth)
    arms = {name: np.cos if name == "horizontal" else np.sin for name in pushes}
    columns = [smooth(push * arms[name](theta)) for name, push in pushes.items()]
    table = np.column_stack([smooth(np.sin(theta)), *columns])
    if not pushes or np.linalg.matrix_rank(table) < table.shape[1]:
        return None
    target = smooth(theta, deriv=2)
    answer = np.linalg.lstsq(table, target, rcond=None)[0]
    rest = target - table @ answer
    worth = max(count / window, table.shape[1] + 1.0)
    variance = float(np.sum(rest**2)) / count * (count / worth)
    errors = np.sqrt(np.maximum(np.diag(np.linalg.pinv(table.T @ table)) * variance, 1e-300))
    if answer[0] > 0:
        return None  # no oscillation about theta = 0: the sign is undetermined
    for name, value, error in zip(pushes, answer[1:], errors[1:], strict=True):
        if value > CERTAIN_SIGN * error:
            key = "sign-turned.drive" if name == "drive" else "sign-turned.pivot"
            return work.finding(key, way=name)
    return None


def _pushes(work: Work, even: Floats, smooth: Callable[..., Floats]) -> dict[str, Floats]:
    """Return the accelerations of the pivot, or a(t) of the drive, at equally spaced times."""
    pushes: dict[str, Floats] = {}
    drive = work.plan.drive or {}
    p, phi = drive.get("p"), drive.get("phi")
    if p and phi is not None:
        pushes["drive"] = p * np.cos((drive["Omega"] or 0.0) * even + phi)
    order = PIVOT_ORDER.get(work.pivot_unit or "", 0)
    for way, values in work.pivot.items():
        good = np.isfinite(values)
        if np.count_nonzero(good) < even.size // 2 or np.std(values[good]) == 0:
            continue
        if np.max(np.abs(values[good])) < 1e6:
            motion = np.interp(even, work.time[good], values[good])
            pushes[way] = smooth(motion, deriv=order) if order else motion
    return pushes


def acceleration(work: Work) -> Finding | None:
    """Report an acceleration that is not used, since there is an angle."""
    if work.angle_source is not None or "acceleration" not in work.extra:
        return None
    return work.finding("acceleration-unused")


def pivot_steps(work: Work) -> Finding | None:
    """Replace stepwise positions or velocities of the pivot by smooth accelerations."""
    order = PIVOT_ORDER.get(work.pivot_unit or "", 0)
    known = all(np.isfinite(values).all() for values in work.pivot.values())
    if not order or work.time.size < 20 or not known:
        return None
    interval, even = even_times(work.time)
    if not even.size:
        return None
    places = {way: np.interp(even, work.time, values) for way, values in work.pivot.items()}
    windows = [
        _cubic_window(places[way], step_of(values), order, interval)
        for way, values in work.pivot.items()
        if np.ptp(values) > 0
    ]
    if not windows or max(windows) < 7:
        return None
    from scipy.signal import savgol_filter

    for way, values in places.items():
        pushed = savgol_filter(values, max(windows), 3, deriv=order, delta=interval)
        work.pivot[way] = np.interp(work.time, even, pushed)
    what = "places" if order == 2 else "speeds"
    work.pivot_unit = "m/s2"
    longest = max(windows)
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
        change = np.abs(savgol_filter(values, window, 3, deriv=1, delta=interval))
        speed = float(np.median(change[change >= MOVING_SHARE * change.max()]))
        passed = speed * window * interval >= STEPS_PASSED * step
        if passed and gain * noise <= NOISE_SHARE * float(np.max(np.abs(pushed))):
            return window
    return most - (most + 1) % 2
