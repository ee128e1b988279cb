"""Records of several releases, between which a trembling hand carries and holds the pendulum."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from recorded import motion, noisy

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

RATE = 100.0


@dataclasses.dataclass(frozen=True)
class Released:
    """Readings, and the first and last time of each free swing."""

    time: Floats
    theta: Floats
    spans: list[tuple[float, float]]


def released(  # noqa: PLR0913 (the releases, and the motion of the hand)
    starts: Sequence[float],
    seconds: Sequence[float],
    *,
    carry: float = 1.0,
    hold: float = 0.8,
    tremor: float = 0.01,
    seed: int = 0,
) -> Released:
    """Return releases from rest at ``starts`` (rad), each stopped by a hand after ``seconds``."""
    rng = np.random.default_rng(seed)
    parts: list[Floats] = []
    spans = []
    count = 0
    for start, duration in zip(starts, seconds, strict=True):
        if parts:
            hand = _hand(float(parts[-1][-1]), start, carry, hold, tremor, rng)
            parts.append(hand)
            count += hand.size
        theta = motion(start=start, duration=duration, rate=RATE)[1]
        spans.append((count / RATE, (count + theta.size - 1) / RATE))
        parts.append(theta)
        count += theta.size
    theta = np.concatenate(parts)
    return Released(np.arange(theta.size) / RATE, noisy(theta, seed=seed), spans)


def _hand(  # noqa: PLR0913, PLR0917 (the ends of the motion and its parameters)
    begin: float, end: float, carry: float, hold: float, tremor: float, rng: np.random.Generator
) -> Floats:
    count = round(carry * RATE)
    way = (1 - np.cos(np.pi * np.arange(count) / count)) / 2
    place = np.concatenate([begin + (end - begin) * way, np.full(round(hold * RATE), end)])
    # White noise averaged over 0.2 s: a tremor of at most 5 Hz, zero at both ends of the hold.
    shaking = np.convolve(rng.standard_normal(place.size + 40), np.ones(20), "same") / math.sqrt(20)
    fading = np.minimum(1.0, np.arange(place.size) / 15)
    return np.asarray(place + tremor * shaking[: place.size] * fading * fading[::-1])
