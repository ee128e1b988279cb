"""The noise of a sensor that shows a few counts of one angle.

At rest a sensor whose noise is less than a count goes to and fro between two or three. How often it
shows each depends on where between two edges the angle is, ``x``, and on the noise ``s`` before the
rounding: ``P_k = Phi((k + 1/2 - x) / s) - Phi((k - 1/2 - x) / s)``, in counts. The root mean square
of such readings is anything from 0 to half a count. Three counts tell ``x`` and ``s``; two leave a
range of both, over which is averaged, all ``x`` and all ``log s`` being as likely before.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["still_noise"]

SPREADS: Final = np.geomspace(0.02, 1.0, 80)
"""Noise before the rounding that is tried, in counts; beyond, readings are as those of a value."""

PLACES: Final = (np.arange(200) + 0.5) / 200 - 0.5
"""Places of the angle between the edges of its count."""

MOST: Final = 9
"""Counts that are shown at most."""

PARTS: Final = 4
"""Parts of a record whose means agree where nothing moves."""

SURE: Final = 4.0
"""Standard errors by which they may differ."""


def still_noise(theta: NDArray[np.float64], count: float) -> tuple[float, float] | None:
    """Return the noise of readings of one angle, the rounding included, and its standard error.

    Parameters
    ----------
    theta : ndarray of float, shape (N,)
        Readings, rad.
    count : float
        The step of the readings, rad.

    Returns
    -------
    tuple of float, or None
        Both in rad: mean and standard deviation of ``sqrt(s^2 + count^2 / 12)``. None where one
        count alone is shown, or something moves.
    """
    from scipy.special import log_ndtr, logsumexp, ndtr

    steps = np.rint((theta - np.median(theta)) / count).astype(int)
    low, high = int(steps.min()), int(steps.max())
    if low == high or high - low >= MOST:
        return None
    error = float(np.std(steps)) * math.sqrt(PARTS / steps.size)
    means = [float(np.mean(part)) for part in np.array_split(steps, PARTS)]
    if max(means) - min(means) > 2 * SURE * error:
        return None
    shown = np.bincount(steps - low)
    centre = int(np.argmax(shown)) + low
    # Above the middle of a count the far tail is the smaller: digits are kept there.
    level = np.arange(low, high + 1)[:, None, None] - centre - PLACES[None, :, None]
    far, near = (np.abs(level) + side for side in (0.5, -0.5))
    spread = SPREADS[None, None, :]
    tail = log_ndtr(-near / spread) + np.log1p(
        -np.exp(np.minimum(log_ndtr(-far / spread) - log_ndtr(-near / spread), -1e-12))
    )
    inside = np.log(np.maximum(1 - ndtr(near / spread) - ndtr(-far / spread), 1e-300))
    likelihood = np.tensordot(shown, np.where(near > 0, tail, inside), axes=1)
    weight = np.exp(logsumexp(likelihood, axis=0) - logsumexp(likelihood))
    sigma = np.sqrt(SPREADS**2 + 1 / 12)
    mean = float(weight @ sigma)
    return count * mean, count * math.sqrt(float(weight @ (sigma - mean) ** 2))
