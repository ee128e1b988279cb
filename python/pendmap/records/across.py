"""Checks across the runs of an experiment: duplicated readings and different rigs.

Consecutive readings are duplicates if they equal those of another run up to an offset, within their
resolution. Two recordings of one motion, in contrast, differ by their noise.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted
from pendmap.records.experiment import finding_of
from pendmap.records.scale import small_period

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.records.experiment import Finding, Run
    from pendmap.signal import Floats

ONE_RIG: Final = 0.05  # Relative difference of small-swing periods above which rigs differ
FEWEST_SHARED: Final = 50  # Fewest readings of a duplicate, and of a run without its duplicates
LEAST_SHARE: Final = 0.1  # Least share of the shorter run in a duplicate
LEAST_LEVELS: Final = 20  # Least span of a duplicate, sensor steps: smaller ones agree by chance
AGREEING: Final = 0.99  # Least share of readings that agree within half a step; 1 % may be edited
ROUNDING: Final = 1e-6  # Rounding error of a conversion between units, over the range
OFF_STEP: Final = 1e-2  # Tolerance, in steps, for differences that are multiples of a step


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


def without_duplicates(runs: Sequence[Run]) -> list[Run]:
    """Return runs without duplicates: held-out runs lose them, else shorter, else later ones."""
    made = list(runs)
    used = [np.flatnonzero(run.trusted) for run in runs]
    parts = [slice(at[0], at[-1] + 1) if at.size else slice(0, 0) for at in used]
    motions = [run.theta[part] for run, part in zip(runs, parts, strict=True)]
    order = sorted(range(len(runs)), key=lambda k: (runs[k].hold_out, -motions[k].size, k))
    for place, k in enumerate(order):
        for other in order[:place]:
            shared = _shared(motions[other], motions[k])
            if shared is not None and made[k].moves:
                first, last = shared
                made[k] = _without(made[k], runs[other], parts[k].start + first, last - first)
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


def _shared(one: Floats, other: Floats) -> tuple[int, int] | None:
    """Return first and last (exclusive) duplicated reading of ``other``; None without any."""
    from scipy.signal import correlate, correlation_lags

    size = min(one.size, other.size)
    least = max(FEWEST_SHARED, round(LEAST_SHARE * size))
    if size < least:
        return None
    # The lag at which the difference has the least variance.
    product = functools.partial(correlate, method="fft")
    middle, all_one, all_other = float(np.mean(one)), np.ones(one.size), np.ones(other.size)
    a, b = one - middle, other - middle
    count = np.round(product(all_one, all_other))
    square = product(a**2, all_other) + product(all_one, b**2) - 2 * product(a, b)
    mean = (product(a, all_other) - product(all_one, b)) / count
    apart = np.where(count >= least, square / count - mean**2, np.inf)
    lag = int(correlation_lags(a.size, b.size)[np.argmin(apart)])
    first, last = max(-lag, 0), min(other.size, one.size - lag)
    a, b = a[first + lag : last + lag], b[first:last]
    away = np.abs(b - a - np.median(b - a))
    step = max(_digit(one), _digit(other))
    allowed = (0.5 + a.size**-0.5) * step + ROUNDING * float(np.ptp(b))
    alike = np.ptp(b) > LEAST_LEVELS * step and np.mean(away <= allowed) >= AGREEING
    return (first, last) if alike else None


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
