"""Readings far denser than the motion, put together: a fit then has fewer to go through.

The mean of readings over a block is a reading at the mean of their times, with weights ``w`` one
over their squared errors: ``sum(w x)/sum(w)`` has the error ``sum(w)^(-1/2)``, and nothing that the
readings say about a slow motion is lost. It exceeds the angle there by the curvature,
``var(t) th''/2``, which is taken off with ``th''`` of the parabola through five blocks; what
is left, of the order of ``T^4 th''''/60`` of a block of length ``T``, is ``1e-6`` of a swing.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.identification.runs import FitRun

    Floats = NDArray[np.float64]

__all__ = ["in_blocks"]

BLOCKS: Final = 50
"""So many blocks at least a swing, or a turn, is divided into: noise still stands apart from the
motion in their spectrum, and a window has enough of them."""

FEWEST: Final = 1000
"""Blocks that a record has at least: below, the integrator's own steps are what takes time."""

LEAST: Final = 3
"""Readings of a block at least: pairs save little."""

NEIGHBOURS: Final = 2
"""Blocks on either side through which a parabola is laid."""


def in_blocks(run: FitRun) -> FitRun:
    """Return a run with its readings put together, or as it is where they are not dense.

    Parameters
    ----------
    run : FitRun
        A record of angles; one whose readings are intervals stays as it is: their mean is none.
    """
    if run.count is not None:
        return run
    weights = np.broadcast_to(np.asarray(run.sigma, np.float64), run.time.shape) ** -2.0
    if run.trusted is not None:
        weights = np.where(run.trusted, weights, 0.0)
    for size in range(run.time.size // FEWEST, LEAST - 1, -1):
        found = _divided(run.time, run.theta, weights, size)
        if _dense(*found[:3]):
            break
    else:
        return run
    time, theta, weight, variance = found
    counted = weight > 0
    # What does not count may be anything, and bends no parabola of its neighbours.
    known = np.where(counted, theta, np.interp(time, time[counted], theta[counted]))
    theta = theta - 0.5 * variance * _curvature(time, known)
    # One that does not count has any error.
    sigma = np.where(counted, weight, np.median(weight[counted])) ** -0.5
    return dataclasses.replace(run, time=time, theta=theta, sigma=sigma, trusted=counted)


def _divided(
    time: Floats, theta: Floats, weights: Floats, size: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return mean time, mean reading, weight and variance of the times of each block.

    A block without a reading that counts has the plain means. What is left at the end joins none.
    """
    count = time.size // size
    t, x, w = (values[: count * size].reshape(count, size) for values in (time, theta, weights))
    total = w.sum(axis=1)
    share = np.where(total[:, None] > 0, w, 1.0)
    share /= share.sum(axis=1, keepdims=True)
    middle = (share * t).sum(axis=1)
    variance = (share * (t - middle[:, None]) ** 2).sum(axis=1)
    return middle, (share * x).sum(axis=1), total, variance


def _dense(time: Floats, theta: Floats, weight: Floats) -> bool:
    """Whether blocks are short against the quickest swing, or turn, of what counts."""
    counted = weight > 0
    time, theta = time[counted], theta[counted]
    if time.size < FEWEST:
        return False
    steps = np.diff(time)
    velocity = np.diff(theta) / steps
    # Of a swing the one is its frequency, of a rotation the other.
    rate = max(float(np.std(velocity) / np.std(theta)), float(np.quantile(np.abs(velocity), 0.99)))
    return float(np.median(steps)) * rate < math.tau / BLOCKS


def _curvature(time: Floats, theta: Floats) -> Floats:
    """Return the second derivative of the parabola through each block and its neighbours."""
    span = 2 * NEIGHBOURS + 1
    first = np.clip(np.arange(time.size) - NEIGHBOURS, 0, time.size - span)
    places = first[:, None] + np.arange(span)
    t = time[places] - time[:, None]
    scale = np.abs(t).max(axis=1)
    basis = (t / scale[:, None])[..., None] ** np.arange(3)
    fitted = np.linalg.pinv(basis) @ theta[places][..., None]
    return np.asarray(2 * fitted[:, 2, 0] / scale**2, np.float64)
