"""Checks across the runs of an experiment: duplicated readings and different rigs.

Consecutive readings are duplicates if they equal those of another run up to a factor and an offset,
within their resolution. Two recordings of one motion, in contrast, differ by their noise.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted
from pendmap.records.findings import finding_of
from pendmap.records.periods import small_period

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.records.experiment import Finding, Run
    from pendmap.signal import Floats


ONE_RIG: Final = 0.05  # Relative difference of small-swing periods above which rigs differ
FEWEST_SHARED: Final = 50  # Fewest readings of a duplicate, and of a run without its duplicates
LEAST_SHARE: Final = 0.1  # Least share of the shorter run in a duplicate
LEAST_LEVELS: Final = 20  # Least span of a duplicate, sensor steps: smaller ones agree by chance
AGREEING: Final = 0.99  # Least share of readings that agree within half a step; 1 % may be edited
FACTOR_ERROR: Final = 1e-6  # Relative rounding error of a written factor between units
OFF_STEP: Final = 1e-2  # Tolerance, in steps, for differences that are multiples of a step
MOST_THINNED: Final = 10  # Greatest decimation factor of a duplicate that is searched for


def checked_together(runs: Sequence[Run]) -> tuple[tuple[Run, ...], tuple[Finding, ...]]:
    """Return runs without duplicated readings, and the findings across runs."""
    made = without_duplicates(runs)
    findings: list[Finding] = []
    swings = {
        run.name: small_period(run.time[run.trusted], run.theta[run.trusted], run.count_rad)
        for run in made
        if run.kind == "free" and not run.peaks_only and run.moves
    }
    known = sorted((period, name) for name, period in swings.items() if math.isfinite(period))
    if known and known[-1][0] > (1 + ONE_RIG) * known[0][0]:
        short, long = (f"{period:.4g} s in {name}" for period, name in (known[0], known[-1]))
        findings.append(finding_of("rigs-differ", short=short, long=long))
    if runs and all(run.hold_out for run in runs):
        findings.append(finding_of("all-held-out"))
    return tuple(made), tuple(findings)


@dataclasses.dataclass(frozen=True)
class _Motion:
    """Readings from the first to the last trusted one, with their clock ticks."""

    first: int
    theta: Floats
    step: float
    tick: NDArray[np.int64]  # time in sampling intervals; lost readings leave ticks empty
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


def without_duplicates(runs: Sequence[Run]) -> list[Run]:
    """Return runs without duplicates: held-out runs lose them, else shorter, else later ones."""
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
    """Return the resolution of written or counted readings; 0 if none is found."""
    apart = np.diff(np.unique(np.round(theta, 12)))
    if not apart.size:
        return 0.0
    step = float(apart.min())
    # Written digits round the multiples of a count; averaging many steps reduces this error.
    near = apart[apart < 1.5 * step]
    step = float(near.mean())
    multiples = apart / step
    away = np.abs(multiples - np.round(multiples))
    return step if float(np.quantile(away, 0.9)) < OFF_STEP * max(multiples.mean(), 1.0) else 0.0


def _shared(one: _Motion, other: _Motion) -> tuple[int, int] | None:
    """Return the first duplicated reading of ``other`` and their number; None without any."""
    size = min(one.theta.size, other.theta.size)
    least = max(FEWEST_SHARED, round(LEAST_SHARE * size))
    for mine, its in _ticks(one, other) if size >= least else ():
        lags = _lags(_spread(one.theta, mine), _spread(other.theta, its), least)
        for lag in lags | ({0} if one.theta.size == other.theta.size else set()):
            _, a, b = np.intersect1d(mine, its + lag, assume_unique=True, return_indices=True)
            if a.size >= least and _alike(one.theta[a], other.theta[b], one.step, other.step):
                return int(b[0]), int(b[-1] - b[0]) + 1
    return None


def _ticks(one: _Motion, other: _Motion) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Return indices of the readings of both runs on a common clock: by order, and by time."""
    in_a_row = np.arange(one.theta.size), np.arange(other.theta.size)
    ratio = other.interval / one.interval
    times = round(max(ratio, 1 / ratio))
    if abs(max(ratio, 1 / ratio) / times - 1) >= OFF_STEP:
        times = 1
    by_time = one.tick * (times if ratio < 1 else 1), other.tick * (times if ratio > 1 else 1)
    wide = any(t.size and t[-1] >= MOST_THINNED * t.size for t in by_time)
    same = all(np.array_equal(a, b) for a, b in zip(in_a_row, by_time, strict=True))
    return [in_a_row] if wide or same else [in_a_row, by_time]


def _spread(theta: Floats, tick: NDArray[np.int64]) -> Floats:
    """Return readings at their ticks, NaN at empty ticks."""
    spread = np.full(int(tick[-1]) + 1, np.nan)
    spread[tick] = theta
    return spread


def _lags(a: Floats, b: Floats, least: int) -> set[int]:
    """Return the lags, in ticks, at which ``b`` is closest to ``a`` and to its mirror image."""
    from scipy.signal import correlate, correlation_lags

    product = functools.partial(correlate, method="fft")
    there_a, there_b = np.isfinite(a).astype(float), np.isfinite(b).astype(float)
    middle = float(np.nanmean(a))
    one_a, one_b = np.nan_to_num(a - middle), np.nan_to_num(b - middle)
    count = np.round(product(there_a, there_b))
    enough = count >= least
    if not enough.any():
        return set()
    count = np.maximum(count, 1.0)
    mean_a, mean_b = product(one_a, there_b) / count, product(there_a, one_b) / count
    squares = product(one_a**2, there_b) + product(there_a, one_b**2)
    apart = squares / count - mean_a**2 - mean_b**2
    both = 2 * (product(one_a, one_b) / count - mean_a * mean_b)
    # The variance of the difference, and of the sum.
    closest = (np.argmin(np.where(enough, apart + sign * both, np.inf)) for sign in (-1, 1))
    return {int(correlation_lags(a.size, b.size)[k]) for k in closest}


def _alike(a: Floats, b: Floats, step: float, other: float) -> bool:
    """Return whether ``b`` equals ``a`` up to a factor and an offset, within half a step."""
    columns = np.column_stack([a, np.ones(a.size)])
    away = np.zeros(a.size)
    # Edited readings distort the first line: a second one is fitted without them.
    for _ in range(2):
        near = away <= np.quantile(away, AGREEING)
        (factor, zero), *_ = np.linalg.lstsq(columns[near], b[near], rcond=None)
        away = np.abs(b - factor * a - zero)
    steps = max(abs(factor) * step, other)
    if float(np.ptp(b)) <= LEAST_LEVELS * steps:
        return False
    # The error of the line is a step over the square root of the number of readings.
    allowed = (0.5 + a.size**-0.5) * steps + FACTOR_ERROR * float(np.ptp(b))
    return bool(np.mean(away <= allowed) >= AGREEING)


def _without(run: Run, other: Run, first: int, count: int) -> Run:
    """Return a run in which ``count`` duplicated readings from ``first`` on are excluded."""
    trusted = run.trusted.copy()
    before = int(trusted.sum())
    trusted[first : first + count] = False
    if int(trusted.sum()) < max(FEWEST_SHARED, LEAST_SHARE * before):
        trusted[:] = False
    segments, held_out = run.segments, ""
    if not trusted.any():
        segments = tuple(dataclasses.replace(part, used=False) for part in segments)
        held_out = ": a held-out duplicate is no independent test" if run.hold_out else ""
    copy = finding_of(
        "same-record",
        where=run.name,
        span=(float(run.time[first]), float(run.time[first + count - 1])),
        name=run.name,
        other=other.name,
        copied=before - int(trusted.sum()),
        readings=counted(before, "reading"),
        held_out=held_out,
    )
    findings = (*run.findings, copy)
    return dataclasses.replace(run, trusted=trusted, segments=segments, findings=findings)
