"""Signs and scales that two channels show of each other: gyroscope, accelerometer, angle, pivot."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted
from pendmap.records import acceleration_check
from pendmap.records.units import PIVOT_UNITS
from pendmap.signal.local_polynomial import local_fit

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pendmap.records.work import Work

    Floats = NDArray[np.float64]

ALIKE: Final = 0.8
"""Correlation from which two channels show the same motion."""

GAIN: Final = 0.1
"""Share by which a velocity may miss the angle's derivative: filtered ones are a few per cent."""

CERTAIN: Final = 8.0
"""Standard errors that a turned sign must have: samples of smoothed signals are not independent,
about four of them are worth one."""

FARTHEST: Final = {"m": 3.0, "m/s": 60.0, "m/s2": 3000.0}
"""What no pivot of a laboratory spans, of each quantity."""

SHARE: Final = 0.12
"""Periods that derivatives are taken over: shorter ones drown in noise, longer ones lose the
shape."""


def check(work: Work) -> None:
    """Turn a velocity that runs against the angle; say so where a drive acts the wrong way."""
    if "velocity" in work.extra:
        _velocity(work)
    if "acceleration" in work.extra:
        acceleration_check.check(work)
    if work.plan.kind == "forced":
        _far(work)
        _drive(work)


def _far(work: Work) -> None:
    """Say so where the pivot moves as no pivot does: its unit is another."""
    unit, _ = PIVOT_UNITS[(work.plan.pivot or {}).get("unit", "m/s2")]
    for way, values in (work.pivot() or {}).items():
        good = values[np.isfinite(values)]
        span = float(np.ptp(good)) if good.size else 0.0
        if span > FARTHEST[unit]:
            text = f"the pivot's {way} motion spans {span:.4g} {unit}: its unit is another"
            work.say("pivot-unit", text)


def _velocity(work: Work) -> None:
    velocity = work.extra["velocity"]
    missing = ~np.isfinite(velocity)
    if missing.any():
        text = f"{counted(int(missing.sum()), 'sample')} without velocity: the channel is left out"
        work.say("velocity-missing", text)
        del work.extra["velocity"]
        return
    if work.integrated:
        return  # nothing to compare it with
    fit = local_fit(work.time, work.theta)
    which = work.trusted[fit.middle]
    slope, seen = fit.slope[which], velocity[fit.middle][which]
    scale = float(np.max(np.abs(seen), initial=0.0))
    if slope.size < 10 or scale == 0 or float(np.std(slope)) == 0 or float(np.std(seen)) == 0:
        return
    seen = seen / scale  # squares of huge numbers overflow
    alike = float(np.corrcoef(slope, seen)[0, 1])
    if abs(alike) < ALIKE:
        text = f"the velocity does not follow the angle (correlation {alike:.2f}): it is left out"
        work.say("velocity-unlike", text)
        del work.extra["velocity"]
        return
    gain = float(np.dot(slope, seen) / np.dot(slope, slope)) * scale
    if alike < 0:
        work.extra["velocity"] = -velocity
        text = "the velocity has the other sign than the angle: turned round, the angle counts"
        work.say("sign-turned", text, mended=True)
    gain = abs(gain)
    if abs(gain * math.pi / 180 - 1) < GAIN and "velocity" not in work.declared:
        work.extra["velocity"] = work.extra["velocity"] * math.pi / 180
        text = f"the velocity is {gain:.3g} times the angle's: degrees a second"
        work.say("velocity-unit", text, mended=True)
    elif abs(gain - 1) > GAIN:
        work.say("velocity-scale", f"the velocity is {gain:.3g} times the angle's derivative")


def _drive(work: Work) -> None:
    """Regress the angle's second derivative on gravity and on what the pivot does.

    th'' = -w0^2 sin th - (a_vertical / l) sin th + (-a_lateral / l) cos th, so that both have
    a negative coefficient where upward and toward positive theta are positive.
    """
    from scipy.signal import savgol_filter

    interval = float(np.median(np.diff(work.time)))
    count = math.floor((work.time[-1] - work.time[0]) / interval) + 1
    if count < 100 or count > 10 * work.time.size or not work.trusted.any():
        return
    even = work.time[0] + interval * np.arange(count)
    good = work.trusted
    theta = np.interp(even, work.time[good], work.theta[good])
    w0 = work.known.get("w0") or 6.0
    window = max(round(SHARE * 2 * math.pi / w0 / interval), 5) | 1
    if window > count // 4:
        return

    def smooth(values: Floats, derivative: int = 0) -> Floats:
        smoothed: Floats = savgol_filter(values, window, 3, deriv=derivative, delta=interval)
        return smoothed

    sine, cosine = np.sin(theta), np.cos(theta)
    columns, names = [smooth(sine)], [""]
    for name, accelerating in _pushes(work, even, smooth).items():
        columns.append(smooth(accelerating * (cosine if name == "horizontal" else sine)))
        names.append(name)
    table = np.column_stack(columns)
    if len(names) == 1 or np.linalg.matrix_rank(table) < len(names):
        return
    target = smooth(theta, 2)
    answer = np.linalg.lstsq(table, target, rcond=None)[0]
    rest = target - table @ answer
    worth = max(count / window, len(names) + 1.0)
    variance = float(np.sum(rest**2)) / count * (count / worth)
    errors = np.sqrt(np.maximum(np.diag(np.linalg.pinv(table.T @ table)) * variance, 1e-300))
    if answer[0] > 0:
        return  # no pendulum about 0: nothing to tell a sign by
    for name, value, error in zip(names[1:], answer[1:], errors[1:], strict=True):
        if value > CERTAIN * error:
            said = "the drive" if name == "drive" else f"the pivot's {name} acceleration"
            text = f"{said} acts with the other sign than the angle shows: turned by 180 degrees?"
            text += "" if name == "drive" else " sign = -1 in pivot turns it"
            work.say("sign-turned", text)


def _pushes(work: Work, even: Floats, smooth: Callable[..., Floats]) -> dict[str, Floats]:
    """Return the accelerations of the pivot, or a(t) of the drive, at even times."""
    found: dict[str, Floats] = {}
    plan = work.plan
    if plan.drive is not None and plan.drive["phi"] is not None:
        p, omega = plan.drive["p"] or 0.0, plan.drive["Omega"] or 0.0
        if p:
            found["drive"] = p * np.cos(omega * even + plan.drive["phi"])
    unit, _ = PIVOT_UNITS[(plan.pivot or {}).get("unit", "m/s2")]
    order = {"m/s": 1, "m": 2}.get(unit, 0)
    for way, values in (work.pivot() or {}).items():
        good = np.isfinite(values)
        if np.count_nonzero(good) < even.size // 2 or np.std(values[good]) == 0:
            continue
        if np.max(np.abs(values[good])) < 1e6:
            motion = np.interp(even, work.time[good], values[good])
            found[way] = smooth(motion, order) if order else motion
    return found
