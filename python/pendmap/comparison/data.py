"""Records divided into those that models are fitted to and those that are held back."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.identification.readings import Reading, as_fit_run, reading_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.identification.runs import FitRun
    from pendmap.records import Experiment, Run

    Floats = NDArray[np.float64]

HELD: Final = ((0.25, 0.35), (0.65, 0.75))
"""Parts of a run held back where no whole run is: a fifth, at large and at small swings."""

FEWEST_FORCED: Final = 2  # Forced runs of which one is held back whole

FEWEST_FREE: Final = 3  # Free runs of which one is held back whole

FEWEST: Final = 20  # Fewest samples of a stretch held back; two of them determine its initial state

LEAST: Final = round(FEWEST / (HELD[0][1] - HELD[0][0])) + 1
"""Fewest samples of a run of which stretches can be held back."""

KNOWN: Final = 0.1
"""Relative standard error of the noise above which a record is too short to show it."""

FINEST: Final = 1e-7
"""Least noise, rad, finer than any sensor; it covers the error of local polynomials."""

BLOCKS: Final = 50
"""Fewest blocks in a swing or turn, so that the spectrum separates noise and motion."""

FEWEST_BLOCKS: Final = 1000
"""Fewest blocks of a record; with fewer readings the integrator's own steps take the time."""

LEAST_OF_BLOCK: Final = 3  # Fewest readings of a block

NEIGHBOURS: Final = 2  # Blocks on either side through which a parabola is fitted


@dataclasses.dataclass(frozen=True)
class DataSplit:
    """Records to fit and records held back."""

    experiment: Experiment
    runs: tuple[Run, ...]  # All runs with samples for fitting
    readings: tuple[Reading, ...]  # Noise of the readings of each run
    fitted: tuple[FitRun, ...]  # Records to fit; dense readings are block means
    held: tuple[FitRun, ...]  # Records held back
    fitted_of: tuple[int, ...]  # Place in ``runs`` of each fitted record
    held_of: tuple[int, ...]  # Place in ``runs`` of each record held back
    # Whether stretches within fitted runs are held back, which the fitted motion passes through;
    # else the records held back have their own initial states.
    inside: bool

    @property
    def forced(self) -> bool:
        """Whether a fitted run has a harmonic drive."""
        return any(run.drive is not None for run in self.fitted)

    @property
    def floors(self) -> tuple[float, ...]:
        """Share of rounding, ``count^2 / 12``, which is white, in the noise of each fitted run."""
        readings = (self.readings[k] for k in self.fitted_of)
        pairs = zip(readings, self.fitted, strict=True)
        return tuple(
            r.count**2 / 12 / float(np.mean(np.square(run.sigma))) if r.sigma > 0 else 0.0
            for r, run in pairs
        )

    @property
    def doubt(self) -> float:
        """Relative standard error of the noise of all fitted runs, weighted by samples."""
        doubts = np.array([self.readings[k].doubt for k in self.fitted_of])
        sizes = np.array([float(run.time.size) for run in self.fitted])
        return float(np.sqrt(np.sum((sizes * doubts) ** 2)) / np.sum(sizes))


def split_records(experiment: Experiment) -> DataSplit:
    """Divide an experiment into records to fit and records held back; raises InputError.

    Held back are runs marked ``hold_out``; without any, the middle one of at least two forced runs
    and of at least three free runs. With fewer forced runs, two stretches of each free decay, which
    the fitted motion passes through; without a free run, stretches of the forced one with initial
    states of their own, since its windows are too short to pass through.
    """
    runs = tuple(run for run in experiment.runs if not run.peaks_only)
    if not runs:
        raise InputError(f"{experiment.path}: one run or more must have samples, none has")
    experiment.refuse_still(runs)
    runs = tuple(run for run in runs if run.moves)
    made = [run for run in runs if run.accelerometer is not None]
    if made:
        raise InputError(
            f"{made[0].name}: its angle is made of an acceleration, whose own errors are not among"
            " the effects: it must be a record with an angle"
        )
    rated = [run for run in runs if run.gyroscope is not None]
    if rated:
        raise InputError(
            f"{rated[0].name}: its angle is a velocity integrated, whose errors add up: it must be"
            " a record with an angle"
        )
    adrift = [run for run in runs if run.kind == "forced" and not (run.drive or run.pivot)]
    if adrift:
        raise InputError(
            f"{adrift[0].name}: a forced run must have drive or pivot, nothing says what drives it"
        )
    readings = _readings(runs)
    every = [
        average_blocks(as_fit_run(run, reading))
        for run, reading in zip(runs, readings, strict=True)
    ]
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
    """Return the noise of each run's readings; a run too short to show it has that of the others.

    All runs are read by one sensor.
    """

    def own(run: Run, sigma: float | None = None) -> Reading:
        return reading_of(run.time, run.theta, sigma, trusted=run.trusted, count=run.count_rad)

    every = [own(run) for run in runs]
    known = [reading for reading in every if reading.doubt <= KNOWN]
    if known:
        usual = float(np.median([reading.sigma for reading in known]))
        doubt = max(reading.doubt for reading in known)
        for k, run in enumerate(runs):
            if every[k].doubt > KNOWN:
                every[k] = dataclasses.replace(own(run, usual), doubt=doubt)
    return tuple(
        reading if reading.sigma >= FINEST else own(run, FINEST)
        for run, reading in zip(runs, every, strict=True)
    )


def _middle_runs(every: Sequence[FitRun]) -> list[int]:
    """Return the runs held back where none is marked; none of too few."""
    forced = [k for k, run in enumerate(every) if run.forced]
    free = [k for k, run in enumerate(every) if not run.forced]
    if len(forced) < FEWEST_FORCED:
        return []
    held = [forced[len(forced) // 2]]
    if len(free) >= FEWEST_FREE:
        held.append(free[len(free) // 2])
    return held


def _hold_stretches(
    experiment: Experiment,
    runs: tuple[Run, ...],
    readings: tuple[Reading, ...],
    every: Sequence[FitRun],
) -> DataSplit:
    """Hold back two stretches of each free run, or of each run where none is free."""
    inside = not all(run.forced for run in every)
    fitted, held, held_of = [], [], []
    for k, run in enumerate(every):
        if inside and run.forced:
            fitted.append(run)
            continue
        good = run.counted
        # Parts of the samples that count, not of the time at rest after them.
        samples = np.flatnonzero(good)
        back = np.zeros(good.shape, bool)
        for first, last in held_parts(samples.size):
            a, b = int(samples[first]), int(samples[last])
            if b - a < FEWEST:
                continue
            back[a:b] = good[a:b]
            if not inside:
                time, theta = run.time[a:b], run.theta[a:b]
                held.append(
                    dataclasses.replace(
                        run, time=time, theta=theta, sigma=run.sigmas[a:b], trusted=good[a:b]
                    )
                )
                held_of.append(k)
        fitted.append(dataclasses.replace(run, trusted=good & ~back))
        if inside and back.any():
            held.append(dataclasses.replace(run, trusted=back))
            held_of.append(k)
    if not held:
        raise InputError(
            f"{experiment.path}: one run must have {LEAST} samples or more: there are too few, "
            "none of them can be held back"
        )
    of = tuple(range(len(runs))), tuple(held_of)
    return DataSplit(experiment, runs, readings, tuple(fitted), tuple(held), *of, inside=inside)


def held_parts(samples: int) -> list[tuple[int, int]]:
    """Return first and one after the last of each stretch of samples that is held back."""
    return [(int(low * (samples - 1)), int(high * (samples - 1))) for low, high in HELD]


def average_blocks(run: FitRun) -> FitRun:
    """Return a run with dense readings averaged over blocks, else the run itself.

    With weights ``w``, one over the squared errors, ``sum(w x)/sum(w)`` at the mean time has the
    error ``sum(w)^(-1/2)``. The bias ``var(t) a/2``, with the acceleration ``a`` of the parabola
    through five blocks, is subtracted; the error of order ``T^4/60`` times the fourth derivative,
    in a block of length ``T``, is ``1e-6`` of a swing. Readings that are intervals have no mean.
    """
    if run.count is not None:
        return run
    weights = np.where(run.counted, run.sigmas**-2.0, 0.0)
    for size in range(run.time.size // FEWEST_BLOCKS, LEAST_OF_BLOCK - 1, -1):
        found = _block_means(run.time, run.theta, weights, size)
        if _dense(*found[:3]):
            break
    else:
        return run
    time, theta, weight, variance = found
    good = weight > 0
    # Blocks that do not count must not bend the parabolas of their neighbours.
    known = np.where(good, theta, np.interp(time, time[good], theta[good]))
    theta = theta - 0.5 * variance * _curvature(time, known)
    sigma = np.where(good, weight, np.median(weight[good])) ** -0.5
    return dataclasses.replace(run, time=time, theta=theta, sigma=sigma, trusted=good)


def _block_means(
    time: Floats, theta: Floats, weights: Floats, size: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return mean time, mean reading, weight and variance of the times of each full block.

    A block without a reading that counts has the unweighted means.
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
    """Whether blocks are short against the fastest swing or turn of what counts."""
    time, theta = time[weight > 0], theta[weight > 0]
    if time.size < FEWEST_BLOCKS:
        return False
    steps = np.diff(time)
    velocity = np.diff(theta) / steps
    # The frequency of a swing, or that of a rotation.
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
