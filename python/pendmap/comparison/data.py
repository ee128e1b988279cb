"""Division of an experiment's records into those fitted and those held out."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.identification.readings import Reading, as_fit_run, reading_of_run

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.identification.runs import FitRun
    from pendmap.records import Experiment, Run
    from pendmap.signal import Floats, Mask

HELD: Final = ((0.25, 0.35), (0.65, 0.75))
"""Fractions of a run held out if no whole run is: a fifth in all, at large and small swings."""
FEWEST_FORCED: Final = 2  # Fewest forced runs for which one whole run is held out
FEWEST_FREE: Final = 3  # Fewest free runs for which one whole run is held out
FEWEST: Final = 20  # Fewest samples of a held-out stretch
LEAST: Final = round(FEWEST / (HELD[0][1] - HELD[0][0])) + 1
"""Fewest samples of a run from which stretches can be held out."""
KNOWN: Final = 0.1
"""Relative standard error of the noise above which a record is too short to estimate it."""
FINEST: Final = 1e-7
"""Lower bound on the noise, rad, below that of any sensor; covers errors of local polynomials."""
BLOCKS: Final = 50
"""Fewest blocks in a swing or turn, so that noise and motion are separate in the spectrum."""
MOST: Final = 30_000  # Most readings that are fitted; of more, every second or further one is
FEWEST_BLOCKS: Final = 1000
"""Fewest blocks of a record; with fewer readings the integrator's own steps dominate the cost."""
LEAST_OF_BLOCK: Final = 3  # Fewest readings of a block


@dataclasses.dataclass(frozen=True)
class DataSplit:
    """Records to fit and records held out."""

    experiment: Experiment
    runs: tuple[Run, ...]  # All runs with samples for fitting
    readings: tuple[Reading, ...]  # Noise of the readings of each run
    fitted: tuple[FitRun, ...]  # Records to fit; dense readings are block means
    held: tuple[FitRun, ...]  # Records held out
    fitted_of: tuple[int, ...]  # Index in ``runs`` of each fitted record
    held_of: tuple[int, ...]  # Index in ``runs`` of each held-out record
    # True if held-out stretches are parts of fitted runs, predicted by the fitted trajectory; False
    # if held-out records have their own initial states.
    inside: bool

    @property
    def forced(self) -> bool:
        """Whether a fitted run has a harmonic drive."""
        return any(run.drive is not None for run in self.fitted)

    @property
    def whole(self) -> tuple[FitRun, ...]:
        """Fitted records with the stretches held back."""
        back = dict(zip(self.held_of, self.held, strict=True)) if self.inside else {}
        return tuple(
            dataclasses.replace(run, trusted=run.counted | back[of].counted) if of in back else run
            for run, of in zip(self.fitted, self.fitted_of, strict=True)
        )

    @property
    def floors(self) -> tuple[float, ...]:
        """Share of rounding (white, variance ``count^2 / 12``) in each fitted run's noise."""
        floors = []
        for k, run in zip(self.fitted_of, self.fitted, strict=True):
            # The rounding of a block's mean is that of one reading over the number of readings.
            several = max(self.runs[k].time.size // run.time.size, 1)
            variance = self.readings[k].count ** 2 / 12 / several
            floors.append(variance / float(np.mean(np.square(run.sigma))))
        return tuple(floors)

    @property
    def doubt(self) -> float:
        """Relative standard error of the noise level of all fitted runs, weighted by samples."""
        doubts = np.array([self.readings[k].doubt for k in self.fitted_of])
        sizes = np.array([float(run.time.size) for run in self.fitted])
        return float(np.sqrt(np.sum((sizes * doubts) ** 2)) / np.sum(sizes))


def split_records(experiment: Experiment) -> DataSplit:
    """Divide an experiment into records to fit and records held out; raises InputError.

    Runs marked ``hold_out`` are held out; without any, the middle one of at least two forced runs
    and of at least three free runs. With fewer forced runs, two stretches of each free decay are
    held out, which the fitted trajectory spans; without a free run, stretches of the forced one
    with their own initial states, since its windows are too short to span them.
    """
    runs = tuple(run for run in experiment.runs if not run.peaks_only)
    if not runs:
        raise InputError(f"{experiment.path}: one run or more must have samples, none has")
    experiment.refuse_still(runs)
    runs = tuple(run for run in runs if run.moves)
    for run in runs:
        if run.kind == "forced" and not (run.drive or run.pivot):
            raise InputError(f"{run.name}: a forced run must have drive or pivot, neither is given")
    readings = _readings(runs)
    every = [
        average_blocks(as_fit_run(run, reading))
        for run, reading in zip(runs, readings, strict=True)
    ]
    step = math.ceil(sum(run.time.size for run in every) / MOST)
    every = [samples_of(run, slice(None, None, step)) if step > 1 else run for run in every]
    marked = [k for k, run in enumerate(runs) if run.hold_out] or _middle_runs(every)
    if not marked:
        return _hold_stretches(experiment, runs, readings, every)
    others = [k for k in range(len(runs)) if k not in marked]
    if not others:
        raise InputError(f"{experiment.path}: at least one run must be fitted, all are held out")
    fitted, held = (tuple(every[k] for k in places) for places in (others, marked))
    of = tuple(others), tuple(marked)
    return DataSplit(experiment, runs, readings, fitted, held, *of, inside=False)


def _readings(runs: Sequence[Run]) -> tuple[Reading, ...]:
    """Return the noise of each run's readings; a run too short has the median of the others."""
    every = [reading_of_run(run) for run in runs]
    known = [reading for reading in every if reading.doubt <= KNOWN]
    if known:
        usual = float(np.median([reading.sigma for reading in known]))
        doubt = max(reading.doubt for reading in known)
        for k, run in enumerate(runs):
            if every[k].doubt > KNOWN:
                every[k] = dataclasses.replace(reading_of_run(run, usual), doubt=doubt)
    return tuple(
        reading if reading.sigma >= FINEST else reading_of_run(run, FINEST)
        for run, reading in zip(runs, every, strict=True)
    )


def _middle_runs(every: Sequence[FitRun]) -> list[int]:
    """Return the indices of the runs held out if none is marked; empty with too few runs."""
    forced = [k for k, run in enumerate(every) if run.forced]
    free = [k for k, run in enumerate(every) if not run.forced]
    if len(forced) < FEWEST_FORCED:
        return []
    enough = (forced, free) if len(free) >= FEWEST_FREE else (forced,)
    return [kind[len(kind) // 2] for kind in enough]


def _hold_stretches(
    experiment: Experiment,
    runs: tuple[Run, ...],
    readings: tuple[Reading, ...],
    every: Sequence[FitRun],
) -> DataSplit:
    """Hold out two stretches of each free run, or of each run if none is free."""
    inside = not all(run.forced for run in every)
    fitted, held, held_of = [], [], []
    for k, run in enumerate(every):
        stretches = [] if inside and run.forced else _stretches(run)
        back = np.zeros(run.time.shape, bool)
        for part in stretches:
            back[part] = run.counted[part]
        parts = [samples_of(run, part) for part in stretches]
        if inside and back.any():
            parts = [dataclasses.replace(run, trusted=back)]
        fitted.append(dataclasses.replace(run, trusted=run.counted & ~back))
        held += parts
        held_of += [k] * len(parts)
    if not held:
        raise InputError(
            f"{experiment.path}: at least one run must have {LEAST} samples, "
            "so that part of it can be held out"
        )
    of = tuple(range(len(runs))), tuple(held_of)
    return DataSplit(experiment, runs, readings, tuple(fitted), tuple(held), *of, inside=inside)


def _stretches(run: FitRun) -> list[slice]:
    """Return the stretches held out of a run: fractions of its included samples."""
    samples = np.flatnonzero(run.counted)
    ends = [samples[[int(f * (samples.size - 1)) for f in part]].tolist() for part in HELD]
    return [slice(a, b) for a, b in ends if b - a >= FEWEST]


def samples_of(run: FitRun, which: Mask | slice) -> FitRun:
    """Return a run with only some of its samples."""
    time, theta, sigma = run.time[which], run.theta[which], run.sigmas[which]
    good, angle = run.counted[which], run.angle[which]
    part = dataclasses.replace(run, time=time, theta=theta, sigma=sigma, trusted=good)
    return _with_angle(part, angle)


def _with_angle(run: FitRun, angle: Floats) -> FitRun:
    """Return a run with another angle computed from its readings, if it is a sensor's."""
    sensor = run.rod_sensor and dataclasses.replace(run.rod_sensor, angle=angle)
    return dataclasses.replace(run, rod_sensor=sensor)


def average_blocks(run: FitRun) -> FitRun:
    """Return a run with dense readings averaged over blocks, or else the run itself.

    With weights ``w``, one over the squared errors, ``sum(w x)/sum(w)`` at the mean time has the
    error ``sum(w)^(-1/2)``. The bias ``var(t) a/2``, with the second difference ``a`` of the
    blocks, is subtracted; the remaining error, of order ``T^4/60`` times the fourth derivative in
    a block of length ``T``, is ``1e-6`` of a swing. Rounding to counts of ``q`` has
    the error ``q / sqrt(12)``, that of the mean of a ramp over ``m`` counts ``q / (m sqrt(120))``.
    """
    weights = np.where(run.counted, run.sigmas**-2.0, 0.0)
    for size in range(run.time.size // FEWEST_BLOCKS, LEAST_OF_BLOCK - 1, -1):
        angles = _block_means(run.time, run.angle, weights, size)
        if _dense(*angles[:3]):
            break
    else:
        return run
    time, theta, weight, variance = _block_means(run.time, run.theta, weights, size)
    good = weight > 0
    # Excluded blocks must not bend the curve at their neighbours.
    known = np.where(good, theta, np.interp(time, time[good], theta[good]))
    bent = np.gradient(np.gradient(known, time), time)
    bent[:2], bent[-2:] = bent[2], bent[-3]  # at the ends that of the third block
    theta = theta - 0.5 * variance * bent
    sigma = np.where(good, weight, np.median(weight[good])) ** -0.5
    if run.count is not None:
        parts = run.theta[: time.size * size].reshape(-1, size)
        passed = math.sqrt(10) * (np.ptp(parts, axis=1) / run.count - 1)
        sigma = np.hypot(sigma, run.count / math.sqrt(12) / np.clip(passed, 1, math.sqrt(size)))
    means = dataclasses.replace(run, time=time, theta=theta, sigma=sigma, trusted=good, count=None)
    return _with_angle(means, angles[1])


def _block_means(
    time: Floats, theta: Floats, weights: Floats, size: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return mean time, mean reading, weight and variance of the times of each full block.

    A block without included readings has the unweighted means.
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
    """Return whether blocks are short relative to the fastest swing or turn."""
    time, theta = time[weight > 0], theta[weight > 0]
    if time.size < FEWEST_BLOCKS:
        return False
    steps = np.diff(time)
    velocity = np.diff(theta) / steps
    # Angular frequency of swings, or of rotations.
    rate = max(float(np.std(velocity) / np.std(theta)), float(np.quantile(np.abs(velocity), 0.99)))
    return float(np.median(steps)) * rate < math.tau / BLOCKS
