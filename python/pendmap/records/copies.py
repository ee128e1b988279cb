"""Runs that hold readings of another run: a copy tells nothing new, and one held out tests nothing.

Readings in a row are copied where they are those of another run, up to a factor and a zero, to
within the digits that were written. The noise of a record is its own: two recordings of one motion
differ by it, and by how they are rounded.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.experiment import Finding
from pendmap.words import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.records.experiment import Run

    Floats = NDArray[np.float64]

__all__ = ["COPIED", "once_each"]

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


@dataclasses.dataclass(frozen=True)
class _Motion:
    """The readings of a run from its first to its last that counts."""

    first: int
    theta: Floats
    step: float

    @classmethod
    def of(cls, run: Run) -> _Motion:
        at = np.flatnonzero(run.trusted)
        theta = run.theta[at[0] : at[-1] + 1] if at.size else np.empty(0)
        return cls(int(at[0]) if at.size else 0, theta, _digit(theta))


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
                first = motions[k].first + shared[1]
                made[k] = _without(made[k], runs[other], first, shared[2])
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


def _shared(one: _Motion, other: _Motion) -> tuple[int, int, int] | None:
    """Return where the readings begin that two motions share, in each, and how many they are."""
    a, b = one.theta, other.theta
    least = max(FEWEST, round(PART * min(a.size, b.size)))
    if min(a.size, b.size) < least:
        return None
    lags = {_lag(a, b, least)} | ({0} if a.size == b.size else set())
    for lag in lags:
        first, begin = max(lag, 0), max(-lag, 0)
        count = min(a.size - first, b.size - begin)
        if _alike(a[first : first + count], b[begin : begin + count], one.step, other.step):
            return first, begin, count
    return None


def _lag(a: Floats, b: Floats, least: int) -> int:
    """Return by how many readings ``b`` begins after ``a`` where the two differ least."""
    size = a.size + b.size
    wide = 1 << (size - 1).bit_length()
    middle = float(a.mean())
    a, b = a - middle, b - middle
    product = np.fft.irfft(np.fft.rfft(a, wide) * np.conj(np.fft.rfft(b, wide)), wide)
    lags = np.arange(least - b.size, a.size - least + 1)
    first, begin = np.maximum(lags, 0), np.maximum(-lags, 0)
    count = np.minimum(a.size - first, b.size - begin)

    def total(values: Floats, start: NDArray[np.int64]) -> Floats:
        summed = np.concatenate(([0.0], np.cumsum(values)))
        return np.asarray(summed[start + count] - summed[start])

    square = total(a * a, first) + total(b * b, begin) - 2 * product[lags % wide]
    mean = (total(a, first) - total(b, begin)) / count
    # The variance of the difference: where it is least over what moves there.
    return int(lags[np.argmin(square / count - mean**2)])


def _alike(a: Floats, b: Floats, step: float, other: float) -> bool:
    """Whether ``b`` is ``a`` up to a factor and a zero, to within half a step of either."""
    columns = np.column_stack([a, np.ones(a.size)])
    (factor, zero), *_ = np.linalg.lstsq(columns, b, rcond=None)
    steps = max(abs(factor) * step, other)
    if float(np.ptp(b)) <= LEVELS * steps:
        return False
    allowed = 0.5 * (1 + WHOLE) * steps + EXACT * float(np.ptp(b))
    away = np.abs(b - factor * a - zero)
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
