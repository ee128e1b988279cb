"""The step that a sensor's readings come in, and what it does to the noise of a mean."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["levels_shared", "step_of"]

LATTICE: Final = 0.12
"""Root mean square distance from multiples of a step, in steps, that shows it; 0.29 is chance."""


def step_of(theta: Floats) -> float:
    """Return the step that readings come in, rad; 0 where there is none to be seen.

    The least distance between different readings is tried, then refined by all of them; a step is
    believed where the readings repeat and lie on its multiples.
    """
    values = np.unique(np.round(theta, 12))
    if values.size < 3 or values.size > 0.7 * theta.size:
        return 0.0
    apart = np.diff(values)
    # Written digits round multiples of a step: neighbours differ by it, give or take a digit.
    least = float(np.quantile(apart, 0.02))
    near = apart[(apart >= 0.5 * least) & (apart < 1.5 * least)]
    step = float(np.median(near)) if near.size else least
    multiples = np.round(apart / step)
    small = multiples < 50
    if step <= 0 or not np.any(multiples[small] > 0):
        return 0.0
    step = float(np.sum(apart[small]) / max(np.sum(multiples[small]), 1.0))
    away = (values - values[0]) / step
    away = away - np.round(away)
    phase = np.angle(np.mean(np.exp(2j * np.pi * away))) / (2 * np.pi)
    away = away - phase
    away -= np.round(away)
    return step if float(np.sqrt(np.mean(away**2))) < LATTICE else 0.0


def levels_shared(theta: Floats, step: float) -> float:
    """Return how much larger the noise of a mean is because readings share their step.

    Readings on one step have one error: three independent ones are counted for each step that is
    seen.
    """
    levels = np.unique(np.round(theta / step)).size
    return math.sqrt(max(theta.size / (3 * max(levels, 1)), 1.0))
