"""Peaks and crossings of one record, each from a polynomial fitted around it."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ellipk

from pendmap.identification.turning import End, release, rough_damping
from pendmap.signal.local_polynomial import fit_around

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.identification.readings import Reading
    from pendmap.identification.turning import Outline
    from pendmap.signal import Floats
    from pendmap.signal.local_polynomial import WindowFit


_BIAS: Final = 0.25  # Greatest bias of a peak's amplitude, standard errors
_WIDEST: Final = 1.3
"""Greatest half-width of a peak's window, rad of phase w0 t: a quarter swing is 1.57."""
_SHOW: Final = 6  # Fewest peaks from which friction is estimated
_CROSSING: Final = 0.6  # Half-width of a crossing's window, rad of phase w0 t
_FEWEST: Final = 8  # Fewest samples of a peak's window


class Finder:
    """Peaks and crossings of one record, from its noise and its outline."""

    def __init__(self, time: Floats, theta: Floats, reading: Reading, course: Outline) -> None:
        # An unwrapped angle may come to rest some turns from its start.
        away = math.tau * round(float(np.mean(theta[course.turns[-2:]])) / math.tau)
        self.time, self.theta = time, theta - away
        self.course = dataclasses.replace(course, smooth=course.smooth - away)
        self.sigma, self.count = reading.sigma, reading.count
        late = float(np.median(np.abs(self.theta[course.turns[course.turns.size // 2 :]])))
        self.w0 = 4 * float(ellipk(math.sin(min(late, 3.0) / 2) ** 2)) / course.period
        self.step = float(np.median(np.diff(time)))
        self.bottom, self.top = float(theta.min()), float(theta.max())

    @functools.cached_property
    def ends(self) -> list[End]:
        """All peaks, in order of time."""
        turns = [int(k) for k in self.course.turns]
        scale = self.w0, self.window(float(self.theta[0]))
        begin = release(self.time, self.theta, self.sigma, scale, self.course)
        result = [] if begin is None else [begin]
        if begin is None:
            first = int(turns[0])
            inner = int(np.argmax(np.abs(self.course.smooth[: first // 2 + 1])))
            if inner > 2:  # noqa: PLR2004 (fewest samples before a turn)
                turns = [inner, *turns]
        for k in turns:
            end = self._clipped(k) or self._turn(k)
            if end is None or (result and not end.resolved_from(result[-1])):
                continue
            result.append(end)
        return self._in_time(result)

    @staticmethod
    def _in_time(ends: list[End]) -> list[End]:
        """Return ends without the delay by friction, which is estimated from their amplitudes."""
        sizes = np.array([e.angle for e in ends if math.isfinite(e.stderr_angle)])
        if sizes.size < _SHOW:
            return ends
        middle = np.median((sizes[:-2] + 2 * sizes[1:-1] + sizes[2:]) / 4)
        theta_r = rough_damping(np.minimum(np.abs(sizes - middle), 3.1))[1]
        return [e.late(theta_r) for e in ends]

    def window(self, amplitude: float) -> float:
        """Return the half-width of the window of a peak, s."""
        a = min(abs(amplitude), math.pi - 0.05)
        sixth = max(abs(math.sin(a) * (3 * math.sin(a) ** 2 - math.cos(a) ** 2)), 1e-3 * a, 1e-6)
        bias = 5 / 231 * sixth / 720
        error = self.sigma * 1.875 * math.sqrt(self.w0 * self.step / 2)
        phase = (_BIAS * error / bias) ** (1 / 6.5)
        least = (_FEWEST / 2 + 0.5) * self.step
        return float(min(max(min(phase, _WIDEST) / self.w0, least), 0.45 * self.course.period))

    def _turn(self, k: int) -> End | None:
        time, half = float(self.time[k]), self.window(float(self.course.smooth[k]))
        fit = None
        begin = float(self.time[max(self.course.left - 1, 0)])
        for _ in range(4):
            fit = fit_around(
                self.time, self.theta, time, half, (0, 1, 2, 3, 4), sigma=self.sigma, begin=begin
            )
            instant = None if fit is None else fit.root(1)
            if instant is None:
                return None
            near, time = time, instant
            if abs(time - near) < 0.1 * self.step:
                break
        if fit is None:
            return None
        (value, gain), (_, slope_gain), (bend, _) = (fit.at(time, j) for j in range(3))
        sigma, bend = self._effective(fit), bend or math.inf
        slope = slope_gain * sigma
        stderr = slope / abs(bend)
        # If the error of the instant exceeds the width of the window there is no turn.
        if not stderr <= 2 * fit.half:
            return None
        return End(time, value + slope**2 / (2 * bend), stderr, gain * sigma, "turn", fit.half)

    def _effective(self, fit: WindowFit) -> float:
        """Return the noise of a sample, increased if quantization correlates the errors."""
        if self.count <= 2 * self.sigma:
            return self.sigma
        inside = self._between(fit.centre - fit.half, fit.centre + fit.half)
        # Each level is worth three readings.
        levels = max(np.unique(np.round(self.theta[inside] / self.count)).size, 1)
        return self.sigma * math.sqrt(max((inside.stop - inside.start) / (3 * levels), 1.0))

    def _clipped(self, k: int) -> End | None:
        """Return a clipped peak, at the extreme for longer than a swing would be; or None."""
        extreme = self.top if self.course.smooth[k] > 0 else self.bottom
        half = self.course.period / 2
        around = self._between(float(self.time[k]) - half, float(self.time[k]) + half)
        near = around.start + np.flatnonzero(self.theta[around] == extreme)
        if near.size < 5 or near[-1] - near[0] + 1 != near.size:  # noqa: PLR2004 (in a row)
            return None
        bend = self.w0**2 * max(math.sin(min(abs(extreme), math.pi)), 0.05)
        lasts = float(self.time[near[-1]] - self.time[near[0]])
        if lasts < 3 * self.step + 3 * math.sqrt((self.count + 2 * self.sigma) / bend):
            return None
        middle = float(self.time[near[0]] + self.time[near[-1]]) / 2
        return End(middle, extreme, self.step, math.inf, "clipped")

    def _between(self, begin: float, end: float) -> slice:
        """Return the slice of samples between two times."""
        first, last = np.searchsorted(self.time, (begin, end))
        return slice(int(first), int(last))

    def crossings(self, index: NDArray[np.int64]) -> tuple[Floats, Floats, NDArray[np.int64]]:
        """Return times of zero crossings between two peaks, their errors and half cycles."""
        rows = []
        for (before, after), k in zip(itertools.pairwise(self.ends), index[:-1], strict=True):
            if before.angle * after.angle >= 0:
                continue
            inside = self._between(before.time, after.time)
            if inside.stop - inside.start < 3:  # noqa: PLR2004
                continue
            k0 = inside.start + int(np.argmin(np.abs(self.course.smooth[inside])))
            half = max(_CROSSING / self.w0, 3.5 * self.step)
            fit, time = None, float(self.time[k0])
            for _ in range(2):
                fit = fit_around(self.time, self.theta, time, half, (0, 1, 2, 3), sigma=self.sigma)
                root = None if fit is None else fit.root()
                time = time if root is None else root
            if fit is None or fit.root() is None:
                continue
            (_, gain), (speed, _) = fit.at(time), fit.at(time, 1)
            rows.append((time, gain * self._effective(fit) / abs(speed), k))
        columns = np.array(rows, float).reshape(-1, 3).T
        return columns[0], columns[1], columns[2].astype(np.int64)
