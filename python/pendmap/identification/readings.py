"""Standard errors of readings: the noise as estimated without a model, and the sensor's counts."""

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
"""Noise (rounding included) over the count below which a fit takes readings for intervals. Below,
the errors of successive readings are no longer independent."""


@dataclasses.dataclass(frozen=True)
class Reading:
    """Standard errors of readings; arrays have the shape (n,)."""

    sigma: float  # of one reading, rad
    count: float  # step of the sensor, rad; 0 where none is seen
    each: NDArray[np.float64]  # rad, for a fit: by the law where there is one
    doubt: float  # relative standard error of sigma
    coarse: bool  # whether the count is coarser than the noise
    alike: NDArray[np.float64]  # each without the law: for a model that lacks an effect
    law: SpeedLaw | None = None  # growth of the noise with speed, where it is seen
    shift: NDArray[np.float64] | float = 0.0  # mean error of stamps off time, rad; subtracted
    gain: float = 1.0  # reading over the angle that it counts for
    unit: str = "rad"  # of what was read

    @property
    def interval(self) -> float | None:
        """Count, rad, where a fit takes readings for intervals."""
        return self.count if self.coarse else None


def reading_of(
    time: NDArray[np.float64],
    theta: NDArray[np.float64],
    sigma: float | None = None,
    *,
    trusted: NDArray[np.bool_] | None = None,
    count: float | None = None,
) -> Reading:
    """Return the standard errors of readings (rad, at times in s), from the trusted ones.

    The noise is that of :func:`pendmap.noise_floor`, by its law where it grows with speed. With few
    samples a period it is the residual of a pendulum's swings, if that is less. It is at least that
    of the count, ``count / sqrt(12)``. ``sigma`` and ``count`` (rad) are estimated unless they are
    given.
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
            # A polynomial cannot follow a swing with few samples: its residual is motion.
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
