"""Noise that grows with speed: ``sigma^2 = still^2 + (tau v)^2``.

A clock whose instants miss their stamps by ``tau`` puts ``tau v`` on top of the sensor's own noise
``still``. Both are adapted to the squared residuals of local polynomials by the likelihood of
normal noise, and told only where ``tau`` stands out of its own error and matters.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.signal.local_polynomial import even_weights
from pendmap.signal.robust import broad_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


REACH: Final = 0.7
"""Radians of phase to either side from which a speed is taken: it is right to a few thousandths,
where the difference of two neighbours would err by the share of the interval that a clock misses.
"""

FALSE: Final = 8.0
"""Standard deviations from the median of five beyond which a reading is put there."""

CERTAIN: Final = 4.0
"""Standard errors by which ``tau^2`` is above 0 before it is told: one clean record in 30 000."""

MATTERS: Final = 0.1
"""Part of ``still^2`` that ``(tau v)^2`` comes to at the quickest before it is told: less changes
standard errors by a few per cent."""

DITHERED: Final = 0.55
"""Noise over count below which slow readings say nothing about noise."""

FEWEST_READINGS: Final = 200
"""Residuals from which two numbers are taken."""

ROUNDS: Final = 30

BEND: Final = 0.5
"""Radians of phase to either side over which the bend of a motion is taken: it is short by 2 %."""


@dataclasses.dataclass(frozen=True)
class SpeedLaw:
    """Noise as a function of speed, ``sigma^2 = still^2 + (tau v)^2``.

    Parameters
    ----------
    still : float
        Standard deviation of readings at rest, rad.
    tau, stderr : float
        Standard deviation of the instants of sampling that makes the rest, s.
    fastest : float
        Phase that the motion passes in a second at most, rad/s.
    grows_with : str
        What ``v`` is of the motion: the speed where angles are read.
    """

    still: float
    tau: float
    stderr: float
    fastest: float
    grows_with: str = "speed"

    def __str__(self) -> str:
        """What it says, in words."""
        return (
            f"the noise grows with {self.grows_with}, as if the instants of sampling missed their "
            f"stamps by {1e3 * self.tau:.3g} +- {1e3 * self.stderr:.1g} ms"
        )

    def sigma(self, time: Floats, theta: Floats) -> Floats:
        """Return the standard deviation of each reading of a motion, rad, shape (N,).

        Parameters
        ----------
        time, theta : ndarray, shape (N,)
            s, increasing; rad.
        """
        return np.hypot(self.still, self.tau * speed_of(time, theta, self.fastest))

    def shift(self, time: Floats, theta: Floats) -> Floats:
        """Return by how much readings differ on average from the motion, rad, shape (N,).

        ``E theta(t + d) - theta(t) = tau^2 theta'' / 2``: a swing read at instants that miss their
        stamps looks smaller than it is. Against what a whole decay says of ``w0`` that is not
        little.

        Parameters
        ----------
        time, theta : ndarray, shape (N,)
            s, increasing; rad.
        """
        calm = _calm(theta)
        lag = _lag(time, BEND / self.fastest)
        if time.size <= 2 * lag:
            return np.zeros(time.size)
        steps = (time[lag:] - time[:-lag], calm[lag:] - calm[:-lag])
        slope = steps[1] / steps[0]
        bend = 2 * (slope[lag:] - slope[:-lag]) / (time[2 * lag :] - time[: -2 * lag])
        return 0.5 * self.tau**2 * np.pad(bend, lag, mode="edge")


def speed_of(time: Floats, theta: Floats, fastest: float) -> Floats:
    """Return the size of the velocity at every stamp, rad/s.

    Slopes of quartics, which are odd about their middle: noise in them is independent of what the
    middle is away from its neighbours. Single false samples are put on the median of these before.

    Parameters
    ----------
    time, theta : ndarray, shape (N,)
        s, increasing; rad.
    fastest : float
        Phase that the motion passes in a second at most, rad/s: quartics reach 0.7 rad each way.
    """
    reach = max(_lag(time, REACH / fastest), 3)
    if time.size <= 2 * reach:
        return np.zeros(time.size)
    middle, weights = even_weights(4, 2 * reach + 1)

    def adapted(values: Floats, by: Floats) -> Floats:
        """Quartics by the number of the sample, as ``by`` weighs their values."""
        padded = np.pad(values, reach, mode="reflect", reflect_type="odd")
        return np.correlate(padded, by, "valid")

    slope = adapted(time, weights)
    speed = adapted(_calm(theta), weights) / slope
    # By number it is the speed where a stamp should be. A stamp that is off names another instant,
    # whose speed a weight must follow: else it depends on how far the stamp is off, and a fit with
    # such weights is biased. What its neighbours say of a stamp leaves out the stamp itself; next
    # to a gap they say nothing.
    off = np.clip(adapted(time, middle) / middle[reach] / slope, -1.0, 1.0)
    return np.asarray(np.abs(speed + off * np.gradient(speed)))


def _calm(theta: Floats) -> Floats:
    """Return readings, single false ones put on the median of their neighbours."""
    padded = np.concatenate((theta[:1], theta[:1], theta, theta[-1:], theta[-1:]))
    middle = np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1)
    off = np.abs(theta - middle)
    return np.where(off > FALSE * broad_scale(off), middle, theta)


def _lag(time: Floats, seconds: float) -> int:
    return max(int(seconds / float(np.median(np.diff(time)))), 1)


def law_of(  # noqa: PLR0913 (residuals, and what is known of them)
    residual: Floats,
    square: Floats,
    *,
    worth: float,
    fastest: float,
    count: float = 0.0,
    interval: float = 0.0,
) -> SpeedLaw | None:
    """Return how noise grows with speed, or none where that does not show.

    Parameters
    ----------
    residual, square : ndarray, shape (M,)
        Residuals, rad, each an estimate of the noise; squared speeds, (rad/s)^2.
    worth : float
        So many residuals are worth an independent one.
    fastest : float
        As of :class:`SpeedLaw`.
    count, interval : float
        Step of the readings, rad, 0 if there is none; s between samples.
    """
    found = _adapted(residual, square, worth, count)
    if found is not None and count and found[0] < DITHERED * count:
        # Slow readings that share a count err alike, which no residual shows.
        quick = square >= (count / interval) ** 2
        found = _adapted(residual[quick], square[quick], worth, count)
    return None if found is None else SpeedLaw(*found, fastest)


def _adapted(
    residual: Floats, square: Floats, worth: float, count: float
) -> tuple[float, float, float] | None:
    """Return what is at rest, tau and its error, or none where tau does not show.

    Adapts ``E r^2 = a + b v^2`` by iterated weights ``1 / (a + b v^2)^2``.
    """
    if residual.size < FEWEST_READINGS:
        return None
    power = residual**2
    unit = float(np.mean(square))
    if unit <= 0:
        return None
    rows = np.column_stack((np.ones(power.size), square / unit))
    least = max(count**2 / 12, 1e-6 * float(np.mean(power)))
    variance = np.full(power.size, max(float(np.mean(power)), 1e-300))
    coefficients = np.zeros(2)
    inverse = np.zeros((2, 2))
    for _ in range(ROUNDS):
        weighted = rows / variance[:, None] ** 2
        inverse = np.asarray(np.linalg.pinv(rows.T @ weighted), np.float64)
        last, coefficients = coefficients, inverse @ (weighted.T @ power)
        if coefficients[0] < least:
            # At the least that the count leaves the slope alone is adapted.
            slope = float(weighted[:, 1] @ (power - least)) / float(weighted[:, 1] @ rows[:, 1])
            coefficients = np.array([least, slope])
        coefficients[1] = max(coefficients[1], 0.0)
        variance = rows @ coefficients
        if np.allclose(coefficients, last, rtol=1e-4, atol=0.0):
            break
    still, growth = math.sqrt(coefficients[0]), float(coefficients[1])
    # Errors from the scatter itself: noise need not be normal.
    weighted = rows / variance[:, None] ** 2
    pull = weighted * (power - variance)[:, None]
    error = math.sqrt(max(float((inverse @ (pull.T @ pull) @ inverse)[1, 1]) * worth, 0.0))
    quickest = float(np.quantile(square, 0.98)) / unit
    if growth <= CERTAIN * error or growth * quickest < MATTERS * coefficients[0]:
        return None
    tau = math.sqrt(growth / unit)
    return still, tau, error / unit / (2 * tau)
