"""Peaks and crossings of a record with few samples per period, from fitted pendulum swings.

A quartic around a peak needs more samples than such a record has within a quarter swing. Instead,
solutions of the equation of motion are fitted, with new parameters every few swings.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import median_filter
from scipy.special import ellipk

from pendmap.identification.swing_fit import Windows, fit_swings
from pendmap.identification.turning import End, Outline, outline, stop, zigzags
from pendmap.records.resolution import levels_shared, step_of
from pendmap.signal.half_cycles import after_turns

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.identification.swing_fit import SwingFit
    from pendmap.signal import Floats


COARSE: Final = 20.0
"""Samples per period of small swings below which the nine of a quartic span too long a time."""
_FINE: Final = 32  # Points per period of the interpolated curve in which turns are searched for
_GAP: Final = 2.5  # Shortest gap, sampling intervals
_CLEAR: Final = 0.02
"""Noise over the range of the angle, assumed until it is estimated: only large swings are used."""
_LONGEST: Final = 0.8
"""Greatest half-width of a turn's window, half swings: friction changes sign at the next turn."""
_LEAST: Final = 3.2
"""Half-width of a turn's window, samples, if this is more than a quarter swing."""
_BESIDE: Final = 0.95  # Half-width of a crossing's window, over the time to the nearer peak


def is_coarse(time: Floats, theta: Floats) -> bool:
    """Return whether a record has fewer than 20 samples per period of small swings."""
    _, swing = _swinging(theta)
    time, theta = time[swing:], theta[swing:]
    raw = _natural(time, theta)
    if raw is None or 2 * math.pi / raw >= COARSE * float(np.median(np.diff(time))):
        return False
    # The median removes single spikes, but also fast swings, which lowers the frequency.
    calm = _natural(time, median_filter(theta, 5, mode="nearest"))
    return calm is None or calm > 0.6 * raw


def _swinging(theta: Floats) -> tuple[float, int]:
    """Return a record's rest angle, in whole turns (rad), and the first sample after rotations."""
    tail = theta[-max(theta.size // 4, 1) :]
    rest = math.tau * round(float(np.median(tail)) / math.tau) if theta.size else 0.0
    return rest, after_turns(theta - rest)


def _natural(time: Floats, theta: Floats) -> float | None:
    """Return the natural frequency from the turning points of large swings, rad/s."""
    if time.size < 8:  # noqa: PLR2004 (two half swings, roughly)
        return None
    turns = zigzags(theta, 0.1 * float(np.ptp(theta)) + 1e-12, np.empty(0, np.intp))
    if turns.size < 3:  # noqa: PLR2004
        return None
    size = np.minimum(np.abs(np.diff(theta[turns])) / 2, 3.1)
    return float(np.median(2 * ellipk(np.sin(size / 2) ** 2) / np.diff(time[turns])))


def coarse_finder(time: Floats, theta: Floats, sigma: float | None) -> CoarseFinder:
    """Return the cached finder of a record, shared by all methods."""
    return _finder(time.tobytes(), theta.tobytes(), sigma)


@functools.lru_cache(maxsize=4)
def _finder(time: bytes, theta: bytes, sigma: float | None) -> CoarseFinder:
    return CoarseFinder(np.frombuffer(time), np.frombuffer(theta), sigma)


class CoarseFinder:
    """Peaks and crossings of one record, from swings fitted to its samples.

    Without ``sigma`` (rad) the noise is the residual of fits to large swings.
    """

    def __init__(self, time: Floats, theta: Floats, sigma: float | None) -> None:
        # Rotations before the swings have no turning points and are excluded.
        rest, swing = _swinging(theta)
        self.rotated = swing > 0
        time, theta = time[swing:], theta[swing:] - rest
        self.step = float(np.median(np.diff(time)))
        self.time, self.theta, self.count = time, theta, step_of(theta)
        self.w0 = _natural(time, theta) or 1.0
        self.fine = _through(time, theta, max(math.ceil(_FINE * self.step * self.w0 / math.tau), 2))
        least = self.count / math.sqrt(12)
        self.sigma = max(sigma or 0.0, least, 1e-15)
        self.course: Outline | None = None
        if sigma is None:
            clear = _CLEAR * float(np.ptp(theta))
            self._follow(clear)
            self.sigma = max(clear / 4, least)
            if self.course is not None and self.course.turns.size > 3:  # noqa: PLR2004
                self.sigma = max(self._turns(None)[0].sigma, least)
        self._follow(self.sigma)

    def _follow(self, sigma: float) -> None:
        """Set the outline; the running mean of the interpolated curve has a sample's noise."""
        t, x = self.fine
        points = max(0.2 * math.tau / self.w0 / float(np.median(np.diff(t))), 1.0)
        self.course = outline(t, x, sigma * math.sqrt(points))

    def _turns(self, sigma: float | None) -> tuple[SwingFit, bool, bool]:
        """Return the fit of all turns, whether the first is the record's start, and if held."""
        course = self.course
        assert course is not None  # noqa: S101 (checked by callers)
        t, x = self.fine
        instants, states = list(t[course.turns]), list(x[course.turns])
        begins, held = True, False
        first = int(course.turns[0])
        extreme = int(np.argmax(np.abs(x[: first // 2 + 1] - x[first])))
        leaves = float(t[max(course.left - 1, 0)])
        if self.rotated:
            begins = False
        elif leaves - t[0] > 3 * self.step:
            held = True
            instants, states = [leaves, *instants], [float(np.median(x[: course.left])), *states]
        else:
            begins = bool(t[extreme] - t[0] <= 0.75 * self.step)
            first = 0 if begins else extreme
            instants, states = [float(t[first]), *instants], [float(x[first]), *states]
        at, size = np.array(instants), np.clip(np.array(states), -3.1, 3.1)
        zero = float(np.median(x[course.turns][-3:-1] + x[course.turns][-2:])) / 2
        zero = zero if abs(zero) < 0.5 * float(np.abs(size).max()) else 0.0
        quarter = ellipk(np.sin((size - zero) / 2) ** 2) / self.w0
        half = np.minimum(2 * _LONGEST * quarter, np.maximum(quarter, _LEAST * self.step))
        apart = np.diff(at, prepend=-math.inf, append=math.inf)
        low = at - np.minimum(half, 0.85 * apart[:-1])
        high = at + np.minimum(half, 0.85 * apart[1:])
        low[0] = t[0] if held else low[0]
        windows = Windows.around(
            (self.time, self.theta),
            list(zip(low, high, strict=True)),
            np.sign(size).tolist(),
            held=held,
        )
        form = np.tile([self.w0**2, 0.01 * self.w0, 0.0, zero], (at.size, 1))
        return fit_swings(windows, (at, size, form), sigma=sigma), begins, held

    @functools.cached_property
    def ends(self) -> list[End]:
        """All peaks, in order of time."""
        if self.course is None:
            return []
        fit, begins, held = self._turns(self.sigma)
        result: list[End] = []
        self.fit, rows = fit, []
        for k, (instant, angle) in enumerate(zip(fit.instant, fit.state, strict=True)):
            shared = self._shared(instant)
            stderr_time = float(fit.stderr_instant[k]) * shared
            stderr_angle = float(fit.stderr_state[k]) * shared
            kind = "turn"
            if k == 0 and begins:
                # A first peak before the record was not recorded.
                if not held and instant < self.time[0] - max(3 * stderr_time, 0.05 * self.step):
                    continue
                kind = "release"
            end = End(float(instant), float(angle), stderr_time, stderr_angle, kind)
            if stderr_time * self.w0 > 1 or not math.isfinite(stderr_angle):
                continue
            if result and not end.resolved_from(result[-1]):
                continue
            result.append(end)
            rows.append(k)
        self.rows = rows
        t, x = self.time, self.theta
        rest = self.course.rest
        if rest is not None:
            later = int(np.searchsorted(t, self.fine[0][rest]))
            course = dataclasses.replace(self.course, rest=min(later, t.size - 1))
            last = stop(t, x, self.sigma, course, result)
            result = result if last is None else [*result, last]
        return result

    def _shared(self, instant: float) -> float:
        """Return the factor on standard errors near a turn by quantization."""
        if self.count <= 2 * self.sigma:
            return 1.0
        near = np.abs(self.time - instant) <= max(math.pi / 2 / self.w0, 2 * self.step)
        return levels_shared(self.theta[near], self.count)

    def crossings(self, index: NDArray[np.int64]) -> tuple[Floats, Floats, NDArray[np.int64]]:
        """Return times of zero crossings between peaks, their errors and half cycles."""
        spans, at, speed, half, rows = [], [], [], [], []
        pairs = zip(itertools.pairwise(self.ends), index[:-1], self.rows, strict=False)
        for (before, after), k, row in pairs:
            if after.kind == "stop" or before.angle * after.angle >= 0:
                continue
            t, x = self.fine
            inside = np.flatnonzero((t > before.time) & (t < after.time))
            passed = inside[x[inside] * before.angle <= 0]
            if passed.size == 0:
                continue
            size = min(abs(before.angle), abs(after.angle), 3.1)
            reach = _BESIDE * min(
                float(t[passed[0]]) - before.time, after.time - float(t[passed[0]])
            )
            spans.append((float(t[passed[0]]) - reach, float(t[passed[0]]) + reach))
            at.append(float(t[passed[0]]))
            w = math.sqrt(self.fit.form[row, 0])
            speed.append(math.copysign(2 * w * math.sin(size / 2), -before.angle))
            half.append(k)
            rows.append(row)
        if not spans:
            return np.empty(0), np.empty(0), np.empty(0, np.int64)
        of_form = ("form", "form_covariance", "factor")
        known = dataclasses.replace(self.fit, **{n: getattr(self.fit, n)[rows] for n in of_form})
        windows = Windows.around(
            (self.time, self.theta), spans, np.sign(speed).tolist(), crossing=True
        )
        start = np.array(at), np.array(speed), known.form
        fit = fit_swings(windows, start, sigma=self.sigma, known=known)
        good = np.isfinite(fit.stderr_instant) & (fit.stderr_instant * self.w0 < 1)
        return fit.instant[good], fit.stderr_instant[good], np.array(half, np.int64)[good]


def _through(time: Floats, theta: Floats, factor: int) -> tuple[Floats, Floats]:
    """Return cubic splines through the samples between gaps, with ``factor`` points per sample."""
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > _GAP * float(np.median(steps))) + 1
    parts = []
    for t, x in zip(np.split(time, gaps), np.split(theta, gaps), strict=True):
        if t.size < 4:  # noqa: PLR2004 (a cubic)
            continue
        places = np.arange(factor * (t.size - 1) + 1) / factor
        fine = np.interp(places, np.arange(t.size), t)
        parts.append((fine, CubicSpline(t, x)(fine)))
    if not parts:
        return time, theta
    fine, angle = (np.concatenate(part) for part in zip(*parts, strict=True))
    return fine, angle
