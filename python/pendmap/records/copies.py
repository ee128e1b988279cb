"""Runs that hold readings of another run: a copy tells nothing new, and one held out tests nothing.

Readings in a row are copied where they are those of another run, up to a factor and a zero, to
within the digits that were written. The noise of a record is its own: two recordings of one motion
differ by it, and by how they are rounded.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted
from pendmap.records.experiment import Finding

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.records.experiment import Run

    Floats = NDArray[np.float64]

COPIED: Final = "same-record"

FEWEST: Final = 50
"""Readings in a row that two runs share at least; what is left of fewer is no run."""

PART: Final = 0.1
"""The same as a part of the shorter run."""

LEVELS: Final = 20
"""Steps of the sensor that shared readings span at least: fewer agree by chance."""

ALIKE: Final = 0.99
"""Share of the readings that agree to within half a step: one in a hundred may be edited."""

EXACT: Final = 1e-6
"""Relative error of a factor between units, as people write it."""

WHOLE: Final = 1e-2
"""How far from whole multiples of a step the distances of readings are, in steps."""


THINNED: Final = 10
"""A copy that keeps one reading in so many is found, also where as many are lost in gaps."""


@dataclasses.dataclass(frozen=True)
class _Motion:
    """The readings of a run from its first to its last that counts."""

    first: int
    theta: Floats
    step: float
    tick: NDArray[np.int64]
    """When each was taken, in whole intervals: lost readings leave ticks empty."""
    interval: float

    @classmethod
    def of(cls, run: Run) -> _Motion:
        at = np.flatnonzero(run.trusted)
        part = slice(at[0], at[-1] + 1) if at.size else slice(0, 0)
        theta, apart = run.theta[part], np.diff(run.time[part])
        interval = float(np.median(apart)) if apart.size else 1.0
        ticks = np.cumsum(np.maximum(np.round(apart / interval), 1.0))
        tick = np.concatenate([[0.0], ticks])[: theta.size].astype(np.int64)
        return cls(part.start, theta, _digit(theta), tick, interval)


def once_each(runs: Sequence[Run]) -> list[Run]:
    """Return runs in which each reading counts once, and where it is copied is found.

    Of two runs that share readings the one that is held out gives way, else the shorter one, else
    the later one.

    Parameters
    ----------
    runs : sequence of Run
        The runs of one experiment.
    """
    made = list(runs)
    motions = [_Motion.of(run) for run in runs]
    order = sorted(range(len(runs)), key=lambda k: (runs[k].hold_out, -motions[k].theta.size, k))
    for place, k in enumerate(order):
        for other in order[:place]:
            shared = _shared(motions[other], motions[k])
            if shared is not None and made[k].moves:
                first = motions[k].first + shared[0]
                made[k] = _without(made[k], runs[other], first, shared[1])
    return made


def _digit(theta: Floats) -> float:
    """Return the step that readings are written or counted in; 0 where it is not seen."""
    apart = np.diff(np.unique(np.round(theta, 12)))
    if not apart.size:
        return 0.0
    step = float(apart.min())
    # Digits round the multiples of a count; a step found from many is exact enough for all.
    near = apart[apart < 1.5 * step]
    step = float(near.mean())
    multiples = apart / step
    away = np.abs(multiples - np.round(multiples))
    return step if float(np.quantile(away, 0.9)) < WHOLE * max(multiples.mean(), 1.0) else 0.0


def _shared(one: _Motion, other: _Motion) -> tuple[int, int] | None:
    """Return from which reading of the other on two motions share how many of its readings."""
    for mine, its in _ticks(one, other):
        found = _along(one, other, mine, its)
        if found is not None:
            return found
    return None


def _ticks(one: _Motion, other: _Motion) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Return how readings may lie on one clock: one after another, and by their times."""
    in_a_row = np.arange(one.theta.size), np.arange(other.theta.size)
    ratio = other.interval / one.interval
    times = round(max(ratio, 1 / ratio))
    whole = abs(max(ratio, 1 / ratio) / times - 1) < WHOLE
    by_time = (
        one.tick * (times if whole and ratio < 1 else 1),
        other.tick * (times if whole and ratio > 1 else 1),
    )
    wide = any(t.size and t[-1] >= THINNED * t.size for t in by_time)
    if wide or all(np.array_equal(a, b) for a, b in zip(in_a_row, by_time, strict=True)):
        return [in_a_row]
    return [in_a_row, by_time]


def _along(
    one: _Motion, other: _Motion, mine: NDArray[np.int64], its: NDArray[np.int64]
) -> tuple[int, int] | None:
    """Return what :func:`_shared` does, for readings that lie so on one clock."""
    size = min(one.theta.size, other.theta.size)
    least = max(FEWEST, round(PART * size))
    if size < least:
        return None
    lags = _lags(_spread(one.theta, mine), _spread(other.theta, its), least)
    for lag in lags | ({0} if one.theta.size == other.theta.size else set()):
        _, a, b = np.intersect1d(mine, its + lag, assume_unique=True, return_indices=True)
        if a.size >= least and _alike(one.theta[a], other.theta[b], one.step, other.step):
            return int(b[0]), int(b[-1] - b[0]) + 1
    return None


def _spread(theta: Floats, tick: NDArray[np.int64]) -> Floats:
    """Return readings at their ticks; no number at the others."""
    spread = np.full(int(tick[-1]) + 1, np.nan)
    spread[tick] = theta
    return spread


def _lags(a: Floats, b: Floats, least: int) -> set[int]:
    """Return by how many ticks ``b``, or its mirror image, begins after ``a`` where it is alike."""
    wide = 1 << (a.size + b.size - 1).bit_length()
    middle = float(np.nanmean(a))
    lags = np.arange(1 - b.size, a.size)

    def spectra(values: Floats) -> list[NDArray[np.complex128]]:
        there = np.isfinite(values)
        moved = np.where(there, values - middle, 0.0)
        return [np.fft.rfft(part, wide) for part in (there.astype(float), moved, moved * moved)]

    def product(x: NDArray[np.complex128], y: NDArray[np.complex128]) -> Floats:
        return np.asarray(np.fft.irfft(x * np.conj(y), wide)[lags % wide])

    (there_a, one_a, two_a), (there_b, one_b, two_b) = spectra(a), spectra(b)
    count = np.round(product(there_a, there_b))
    enough = count >= least
    if not enough.any():
        return set()
    count = np.maximum(count, 1.0)
    mean_a, mean_b = product(one_a, there_b) / count, product(there_a, one_b) / count
    own = (product(two_a, there_b) + product(there_a, two_b)) / count - mean_a**2 - mean_b**2
    both = 2 * (product(one_a, one_b) / count - mean_a * mean_b)
    # The variance of the difference, and that of the sum.
    found = (np.argmin(np.where(enough, own + sign * both, np.inf)) for sign in (-1, 1))
    return {int(lags[k]) for k in found}


def _alike(a: Floats, b: Floats, step: float, other: float) -> bool:
    """Whether ``b`` is ``a`` up to a factor and a zero, to within half a step of either."""
    columns = np.column_stack([a, np.ones(a.size)])
    away = np.zeros(a.size)
    # Readings that were edited move the first line.
    for _ in range(2):
        near = away <= np.quantile(away, ALIKE)
        (factor, zero), *_ = np.linalg.lstsq(columns[near], b[near], rcond=None)
        away = np.abs(b - factor * a - zero)
    steps = max(abs(factor) * step, other)
    if float(np.ptp(b)) <= LEVELS * steps:
        return False
    # The line is known to a part of a step that falls with the root of the readings.
    allowed = (0.5 + a.size**-0.5) * steps + EXACT * float(np.ptp(b))
    return bool(np.mean(away <= allowed) >= ALIKE)


def _without(run: Run, other: Run, first: int, count: int) -> Run:
    """Return a run in which readings of another do not count."""
    trusted = run.trusted.copy()
    before = int(trusted.sum())
    trusted[first : first + count] = False
    if int(trusted.sum()) < max(FEWEST, PART * before):
        trusted[:] = False
    copied = before - int(trusted.sum())
    text = (
        f"{run.name} is a copy of {other.name}: {copied} of its {counted(before, 'reading')} are "
        "readings of that run, and count once"
    )
    if run.hold_out and not trusted.any():
        text += ": held out, it would test nothing"
    low, high = float(run.time[first]), float(run.time[first + count - 1])
    found = Finding(COPIED, text, mended=True, where=run.name, from_s=low, to_s=high)
    segments = run.segments
    if not trusted.any():
        segments = tuple(dataclasses.replace(part, used=False) for part in segments)
    return dataclasses.replace(
        run,
        trusted=trusted,
        segments=segments,
        findings=(*run.findings, found),
    )
