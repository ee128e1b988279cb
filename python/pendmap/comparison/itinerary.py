"""Statistics of measured and simulated trajectories among the potential wells.

A well is the range of angles around one hanging position, from one top to the next. Chaotic
trajectories cannot be compared point by point; the statistics are the number of wells, escapes
between them, the range of the angle, the greatest speed, and the time to settle.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.signal import savgol_filter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.signal import Floats, Mask

    Whole = NDArray[np.int64]


LONGEST: Final = 8  # Longest cycle that is searched for, forcing periods

_MARGIN: Final = 0.1
"""Distance from either top at which a new well is entered, rad: noise at a top is no escape."""
_REPEATED: Final = 0.05
"""Least tolerance within which readings repeat themselves, rad."""
_NOISES: Final = 6.0  # Tolerance within which readings repeat, over the noise of a difference
_HELD: Final = 5  # Forcing periods for which a motion must repeat itself to be settled
_SWING: Final = 0.06
"""Half-width of the local polynomials that give velocities, over the period of small swings."""
_DEGREE: Final = 3  # Degree of the local polynomials


@dataclasses.dataclass(frozen=True)
class Ruler:
    """Time scales and noise with which trajectories are analysed."""

    tick: float  # sampling interval, s
    swing: float  # period of small swings, s
    period: float | None  # of the drive, s; None: only rest is a steady state
    sigma: float  # noise of the readings, rad

    @property
    def near(self) -> float:
        """Tolerance within which a reading repeats itself, rad."""
        return max(_REPEATED, _NOISES * math.sqrt(2) * self.sigma)

    def velocity(self, reading: Floats) -> Floats:
        """Return velocities from local cubics, rad/s, of the shape (..., N) of the readings."""
        half = max(round(_SWING * self.swing / self.tick), 2)
        width = min(2 * half + 1, (reading.shape[-1] - 1) // 2 * 2 + 1)
        if width <= _DEGREE:
            return np.gradient(reading, self.tick, axis=-1)
        return np.asarray(savgol_filter(reading, width, _DEGREE, deriv=1, delta=self.tick, axis=-1))


@dataclasses.dataclass(frozen=True)
class Itineraries:
    """Statistics of M trajectories; arrays have the shape (M,)."""

    wells: Whole  # number of distinct wells visited
    escapes: Whole  # number of passages into another well
    covered: Floats  # greatest less least angle, rad
    fastest: Floats  # greatest speed, rad/s
    settled: Floats  # time after which the motion repeats itself, s; infinite: never
    n: Whole  # forcing periods of the cycle; 0 if not settled
    w: Whole  # net turns over the cycle

    @classmethod
    def of(cls, reading: Floats, ruler: Ruler) -> Itineraries:
        """Return the statistics of unwrapped readings, rad, shape (M, N)."""
        well = wells(reading)
        n, w, settled = repeats(reading, ruler)
        passed = np.abs(np.diff(well, axis=-1)).sum(axis=-1)
        return cls(
            wells=np.array([np.unique(row).size for row in well], dtype=np.int64),
            escapes=passed.astype(np.int64),
            covered=np.ptp(reading, axis=-1),
            fastest=np.abs(ruler.velocity(reading)).max(axis=-1),
            settled=settled,
            n=n,
            w=w,
        )

    @classmethod
    def joined(cls, parts: list[Itineraries]) -> Itineraries:
        """Return the concatenation of several sets of trajectories."""
        names = [field.name for field in dataclasses.fields(cls)]
        return cls(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in names})


def wells(reading: Floats) -> Whole:
    """Return the index of the well at each sample, 0 at ``theta = 0``, shape (M, N).

    Within 0.1 rad of a top the well is still the previous one.
    """
    nearest = np.round(reading / math.tau).astype(np.int64)
    inside = np.abs(reading - math.tau * nearest) < math.pi - _MARGIN
    inside[..., 0] = True
    place = np.where(inside, np.arange(reading.shape[-1]), 0)
    last = np.maximum.accumulate(place, axis=-1)
    return np.asarray(np.take_along_axis(nearest, last, axis=-1))


def repeats(reading: Floats, ruler: Ruler) -> tuple[Whole, Whole, Floats]:
    """Return ``n``, ``w`` and the time after which ``theta(t + n T) = theta(t) + 2 pi w``, (M,).

    ``n`` is the least for which this holds over the last five periods; 0, with infinite time, if
    there is none. Without a drive, ``n = 1`` and ``w = 0`` from the time when the motion rests.
    """
    count, size = reading.shape
    n, w = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    settled = np.full(count, math.inf)
    if ruler.period is None:
        away = np.abs(reading - reading[:, -1:]) > ruler.near
        since = _last(away) + 1
        held = (size - since) * ruler.tick >= ruler.swing
        n[held], settled[held] = 1, since[held] * ruler.tick
        return n, w, settled
    for cycle in range(1, LONGEST + 1):
        shift = cycle * ruler.period / ruler.tick
        whole, part = int(shift), shift - int(shift)
        pairs = size - whole - 1
        least = math.ceil(_HELD * ruler.period / ruler.tick)
        free = n == 0
        if pairs < least or not free.any():
            break
        readings = reading[free]
        later = (1 - part) * readings[:, whole : whole + pairs] + part * readings[:, whole + 1 :][
            :, :pairs
        ]
        apart = later - readings[:, :pairs]
        turns = np.round(apart[:, -least:].mean(axis=-1) / math.tau)
        since = _last(np.abs(apart - math.tau * turns[:, None]) > ruler.near) + 1
        held = pairs - since >= least
        which = np.flatnonzero(free)[held]
        n[which], w[which] = cycle, turns[held].astype(np.int64)
        settled[which] = since[held] * ruler.tick
    return n, w, settled


def _last(true: Mask) -> Whole:
    """Return the last true index of each row, -1 if there is none."""
    size = true.shape[-1]
    last = size - 1 - np.argmax(true[:, ::-1], axis=-1)
    return np.where(true.any(axis=-1), last, -1).astype(np.int64)
