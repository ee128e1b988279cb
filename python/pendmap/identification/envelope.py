"""The peaks of a damped pendulum by its energy, without integrating its motion."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ellipe, ellipkm1

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["envelope", "viscous_work"]

_ROUNDS = 4


def viscous_work(amplitude: Floats) -> Floats:
    """Return ``int th'^2 dt / w0`` over a half cycle of a pendulum of this amplitude, rad^2.

    ``8 (E(m) - (1 - m) K(m))``, ``m = sin^2(A/2)``; ``pi A^2 / 2`` for small swings.

    Parameters
    ----------
    amplitude : array
        Either sign, below pi, rad.
    """
    half = np.minimum(np.abs(amplitude), math.pi - 1e-9) / 2
    m, rest = np.sin(half) ** 2, np.cos(half) ** 2
    return np.asarray(8 * (ellipe(m) - rest * ellipkm1(rest)))


def envelope(first: Floats, gamma: Floats, theta_r: Floats, count: int) -> Floats:
    """Return the absolute values of successive peaks, shape (count, ...).

    Each half cycle loses ``cos B - cos A = gamma W((A + B)/2) + theta_r (A + B)`` with the work
    ``W`` of :func:`viscous_work`: first order in the damping, any amplitude. Where friction would
    end a half cycle before zero, the peaks are 0 from there on.

    Parameters
    ----------
    first, gamma, theta_r : array, shapes that broadcast
        First peak (rad), ``c_over_m / w0`` and ``Tr / w0^2``.
    count : int
        How many peaks.
    """
    a, damping, friction = np.broadcast_arrays(
        np.abs(np.asarray(first, float)), np.asarray(gamma, float), np.asarray(theta_r, float)
    )
    result = np.empty((count, *a.shape))
    result[0] = a
    for k in range(1, count):
        before = result[k - 1]
        after = before
        for _ in range(_ROUNDS):
            both = before + after
            energy = np.cos(before) + damping * viscous_work(both / 2) + friction * both
            after = np.arccos(np.clip(energy, -1.0, 1.0))
        result[k] = np.where(after > 0, after, 0.0)
    return result
