"""What a reading is worth: its noise as seen without a model, and the sensor's counts."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.identification.coarse_finder import coarse_finder, is_coarse
from pendmap.records.noise import noise_of
from pendmap.records.resolution import step_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.records.jitter import SpeedLaw


DITHERED: Final = 0.45
"""Noise below this part of a count, the rounding included, no longer makes the errors of successive
readings different: a fit takes them for intervals."""


@dataclasses.dataclass(frozen=True)
class Reading:
    """Standard errors of readings.

    Parameters
    ----------
    sigma : float
        Of one reading, rad.
    count : float
        The step of the sensor, rad; 0 where none is seen.
    each : ndarray of float, shape (n,)
        For a fit, by the noise at their speed.
    doubt : float
        Relative standard error of ``sigma``.
    coarse : bool
        Whether the count is coarser than the noise.
    law : SpeedLaw or None
        How the noise grows with speed, where the record shows that it does; ``each`` follows it.
    alike : ndarray of float, shape (n,)
        ``each`` without the law: for a model that lacks more than the noise.
    shift : float or ndarray of float, shape (n,)
        By how much instants that miss their stamps move the readings on average, rad; a fit takes
        it off.
    gain, unit : float, str
        What was read over the angle that it counts for, and the unit of what was read; 1 and rad of
        an angle.
    """

    sigma: float
    count: float
    each: NDArray[np.float64]
    doubt: float
    coarse: bool
    alike: NDArray[np.float64]
    law: SpeedLaw | None = None
    shift: NDArray[np.float64] | float = 0.0
    gain: float = 1.0
    unit: str = "rad"

    @property
    def interval(self) -> float | None:
        """The count, rad, where a fit takes readings for intervals."""
        return self.count if self.coarse else None


def reading_of(
    time: NDArray[np.float64],
    theta: NDArray[np.float64],
    sigma: float | None = None,
    *,
    trusted: NDArray[np.bool_] | None = None,
    count: float | None = None,
) -> Reading:
    """Return the standard errors of readings.

    The noise is that of :func:`pendmap.noise_floor`, by its law where it grows with speed, with few
    samples a period what the swings of a pendulum leave, if that is less; it is at least that of
    the count, ``count / sqrt(12)``.

    Parameters
    ----------
    time, theta : ndarray of float, shape (n,)
        s, and the readings, rad.
    sigma : float, optional
        Their noise, where it is known, rad.
    trusted : ndarray of bool, shape (n,), optional
        Which of them count for the noise.
    count : float, optional
        The step of the sensor, rad, where it is known.
    """
    if count is None:
        count = step_of(theta)
    doubt, law = 0.0, None
    if sigma is None:
        floor = noise_of(time, theta, trusted=trusted, count=count)
        known = math.isfinite(floor.sigma) and floor.sigma > 0
        sigma = floor.sigma if known else 0.0
        law = floor.law
        doubt = min(floor.stderr / floor.sigma, 1.0) if known else 1.0
        use = np.ones(time.size, bool) if trusted is None else trusted
        if known and is_coarse(time[use], theta[use]):
            # No polynomial follows so few samples a period: what it leaves is motion.
            left = coarse_finder(time[use], theta[use], None).sigma
            if left < sigma:
                sigma, law = left, None
    least = max(count / math.sqrt(12), 1e-15)
    sigma = max(sigma, least)
    coarse = sigma < DITHERED * count
    each = alike = np.full(theta.shape, sigma)
    if law is None:
        return Reading(sigma, count, each, doubt, coarse, alike)
    each = np.maximum(law.sigma(time, theta), least)
    return Reading(sigma, count, each, doubt, coarse, alike, law, law.shift(time, theta))
