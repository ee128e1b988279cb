"""Checks across the runs of an experiment: duplicated readings, zeros, and different rigs.

Consecutive readings are duplicates if they equal those of another run up to an offset, within their
resolution. Two recordings of one motion, in contrast, differ by their noise.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted, moment
from pendmap.records.scale import FAR_ZERO, middle_of, swings_of
from pendmap.signal.robust import normal_scale
from pendmap.tables.findings import finding_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.records.experiment import Experiment, Run
    from pendmap.signal import Floats
    from pendmap.tables.findings import Finding

SPREADS: Final = 10.0  # Gap of two groups of periods, in their spreads, above which rigs differ
ONE_RIG: Final = 0.05  # Relative difference of periods above which rigs differ at any spread
CONTACT: Final = 0.25  # Time for which a hand acts beside its instant, in swings
SURE_PERIOD: Final = 1e-3  # Least relative error of a run's periods
FEWEST_SHARED: Final = 50  # Fewest readings of a duplicate, and of a run without its duplicates
LEAST_SHARE: Final = 0.1  # Least share of the shorter run in a duplicate
LEAST_LEVELS: Final = 20  # Least span of a duplicate, sensor steps: smaller ones agree by chance
AGREEING: Final = 0.99  # Least share of readings that agree within half a step; 1 % may be edited
ROUNDING: Final = 1e-6  # Rounding error of a conversion between units, over the range
OFF_STEP: Final = 1e-2  # Tolerance, in steps, for differences that are multiples of a step


def checked_together(runs: Sequence[Run]) -> tuple[tuple[Run, ...], tuple[Finding, ...]]:
    """Return runs without duplicated readings, and the findings across runs."""
    made, findings = one_zero(without_duplicates(runs))
    if (differ := two_groups(made)) is not None:
        short, long = (f"{period:.4g} s in {name}" for name, period in differ)
        findings.append(finding_of("rigs-differ", short=short, long=long))
    if runs and all(run.hold_out for run in runs):
        findings.append(finding_of("all-held-out"))
    return tuple(made), tuple(findings)


def _free(runs: Sequence[Run]) -> list[Run]:
    """Return the free decays whose samples are read."""
    return [run for run in runs if run.kind == "free" and run.moves and not run.peaks_only]


def two_groups(runs: Sequence[Run]) -> list[tuple[str, float]] | None:
    """Return the runs of shortest and longest period, s, if they are in two groups or far apart.

    Those of equal amplitudes are compared, since magnets and friction change them, too.
    """
    swings = {run.name: of_run for run in _free(runs) if (of_run := swings_of(run)) is not None}
    if not swings:
        return None
    longest = max(swings.values(), key=lambda swing: swing.period.size)
    places, spread = {}, SURE_PERIOD
    for name, swing in swings.items():
        size, order = longest.amplitude, np.argsort(longest.amplitude)
        level = np.interp(swing.amplitude, size[order], longest.corrected[order])
        common = (swing.amplitude >= size.min()) & (swing.amplitude <= size.max())
        apart = (swing.corrected / level)[common]
        if apart.size > 2:
            places[name] = float(np.median(apart))
            spread = max(spread, normal_scale(apart - places[name]) / math.sqrt(apart.size))
    names = sorted(places, key=lambda name: places[name])
    values = np.array([places[name] for name in names])
    if len(names) < 2:
        return None
    cut = int(np.argmax(np.diff(values))) + 1
    spread = max(spread, float(np.std(values[:cut])), float(np.std(values[cut:])))
    apart = values[-1] - values[0] > ONE_RIG
    if values[cut] - values[cut - 1] <= SPREADS * spread and not apart:
        return None
    return [(name, swings[name].smallest) for name in (names[0], names[-1])]


def one_zero(runs: Sequence[Run]) -> tuple[list[Run], list[Finding]]:
    """Return runs with one zero, or each with its own, if the reading shifted some of them."""
    middles = {
        run.name: run.zero_rad + middle
        for run in _free(runs)
        if (middle := middle_of(run.time[run.trusted], run.theta[run.trusted])) is not None
    }
    if len({run.zero_rad for run in runs if run.name in middles}) < 2:
        return list(runs), []
    low, high = min(middles.values()), max(middles.values())
    zero, how = (low + high) / 2, "the middle of each subtracted from it"
    if high - zero < FAR_ZERO:
        how = f"{zero:.4g} subtracted from all, the rest left to the fit"
        middles = dict.fromkeys((run.name for run in runs), zero)
    made = []
    for run in runs:
        zero = middles.get(run.name, run.zero_rad)
        findings = tuple(f for f in run.findings if f.what not in {"zero-offset", "gauge-turned"})
        theta = run.theta + run.zero_rad - zero
        made.append(dataclasses.replace(run, theta=theta, zero_rad=zero, findings=findings))
    return made, [finding_of("zero-offset.runs", low=low, high=high, how=how)]


def without_hands(
    experiment: Experiment, instants: Sequence[float], swing: float
) -> Experiment | None:
    """Return an experiment without the ends of runs that a hand moved; None without a hand.

    An instant, s in the laboratory, within a swing (s) of a run's start or end is that of a hand.
    """
    cut = {}
    for t, run in itertools.product(instants, [run for run in experiment.runs if run.moves]):
        since = run.lab_time_s + run.time - t
        first, last = np.abs(since[run.trusted][[0, -1]]) < swing
        hand = first & (since < CONTACT * swing) | last & (since > -CONTACT * swing)
        hand &= run.trusted
        if hand.any():
            at, number = moment(t - run.lab_time_s), counted(int(hand.sum()), "reading")
            findings = (*run.findings, finding_of("hand-at-end", at=at, number=number))
            cut[run.name] = dataclasses.replace(run, trusted=run.trusted & ~hand, findings=findings)
    runs = tuple(cut.get(run.name, run) for run in experiment.runs)
    return dataclasses.replace(experiment, runs=runs) if cut else None


def with_lab_times(experiment: Experiment) -> Experiment:
    """Return an experiment with a finding if its files do not say when they were recorded."""
    runs = experiment.runs
    if len({run.file for run in runs}) < 2 or any(run.lab_time_s for run in runs):
        return experiment
    findings = dict.fromkeys((*experiment.findings, finding_of("lab-time-missing")))
    return dataclasses.replace(experiment, findings=tuple(findings))


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
