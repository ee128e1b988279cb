"""The records of a diagnosis: those that are fitted, and those that are held back."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.identification.methods.joint import as_fit_run
from pendmap.identification.readings import Reading, reading_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.identification.runs import FitRun
    from pendmap.records import Experiment, Run

    Floats = NDArray[np.float64]

HELD: Final = ((0.25, 0.35), (0.65, 0.75))
"""Parts of a run that are held back where no whole run is: a fifth, at large and small swings."""

FEWEST_FORCED: Final = 2
FEWEST_FREE: Final = 3
"""Runs of a kind of which one is held back whole."""

FEWEST: Final = 20
"""Samples that a stretch held back has at least; two are needed for its initial state."""

LEAST: Final = round(FEWEST / (HELD[0][1] - HELD[0][0])) + 1
"""Samples of a run of which stretches can be held back."""

KNOWN: Final = 0.1
"""Relative standard error of the noise above which a record is too short to show it."""

FINEST: Final = 1e-7
"""The least noise, rad: a count of 2^26 in a turn, finer than any sensor. Of records without noise
the way that polynomials follow the motion would be taken for it."""


@dataclasses.dataclass(frozen=True)
class Evidence:
    """Records to fit and records held back.

    Parameters
    ----------
    experiment : Experiment
        Where they come from.
    runs : tuple of Run
        All that have samples for fitting.
    readings : tuple of Reading
        What the readings of each are worth.
    fitted, held : tuple of FitRun
        What models are fitted to, and what they are tried on; readings far denser than the motion
        are means over blocks, :func:`pendmap.comparison.data.in_blocks`.
    fitted_of, held_of : tuple of int
        Which of ``runs`` each belongs to.
    inside : bool
        Whether stretches within the fitted runs are held back, which the fitted motion passes
        through; else what is held back has initial states of its own.
    """

    experiment: Experiment
    runs: tuple[Run, ...]
    readings: tuple[Reading, ...]
    fitted: tuple[FitRun, ...]
    held: tuple[FitRun, ...]
    fitted_of: tuple[int, ...]
    held_of: tuple[int, ...]
    inside: bool

    @property
    def forced(self) -> bool:
        """Whether a run that is fitted has a harmonic drive."""
        return any(run.drive is not None for run in self.fitted)

    @property
    def floors(self) -> tuple[float, ...]:
        """Of each fitted run the share of rounding, ``count^2 / 12``, in the noise's variance.

        Rounding errs anew with each sample, whatever the colour of what is rounded.
        """
        readings = (self.readings[k] for k in self.fitted_of)
        pairs = zip(readings, self.fitted, strict=True)
        return tuple(
            r.count**2 / 12 / float(np.mean(np.square(run.sigma))) if r.sigma > 0 else 0.0
            for r, run in pairs
        )

    @property
    def doubt(self) -> float:
        """Relative standard error of the noise of all fitted runs together.

        Each run's own is independent of the others'; weights go by samples.
        """
        doubts = np.array([self.readings[k].doubt for k in self.fitted_of])
        sizes = np.array([float(run.time.size) for run in self.fitted])
        return float(np.sqrt(np.sum((sizes * doubts) ** 2)) / np.sum(sizes))


def evidence_of(experiment: Experiment) -> Evidence:
    """Divide an experiment into what is fitted and what is held back.

    Runs marked ``hold_out`` are held back; where there are none, the middle one of two forced runs
    or more, on which what the drive lacks is tried, and of three free ones or more. Of fewer, two
    stretches of each free decay, which the fitted motion passes through without being drawn to
    them; where no run is free, stretches of the forced one, with initial states of their own:
    windows there are too short to pass through.

    Raises
    ------
    InputError
        If no run has samples, nothing moves, a forced run has no drive, or all are held back.
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
        in_blocks(as_fit_run(run, reading)) for run, reading in zip(runs, readings, strict=True)
    ]
    marked = [k for k, run in enumerate(runs) if run.hold_out] or _middle_runs(every)
    if marked:
        others = [k for k in range(len(runs)) if k not in marked]
        if not others:
            raise InputError(
                f"{experiment.path}: at least one run must be fitted, all are held out"
            )
        fitted, held = [every[k] for k in others], [every[k] for k in marked]
        return Evidence(
            experiment,
            runs,
            readings,
            tuple(fitted),
            tuple(held),
            tuple(others),
            tuple(marked),
            inside=False,
        )
    return _stretched(experiment, runs, readings, every)


def _readings(runs: Sequence[Run]) -> tuple[Reading, ...]:
    """Return what the readings of each run are worth.

    A run too short to show its noise has that of the others: they are of one sensor.
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
    """Return the runs to hold back where none is marked; none of too few."""
    forced = [k for k, run in enumerate(every) if run.forced]
    free = [k for k, run in enumerate(every) if not run.forced]
    if len(forced) < FEWEST_FORCED:
        return []
    held = [forced[len(forced) // 2]]
    if len(free) >= FEWEST_FREE:
        held.append(free[len(free) // 2])
    return held


def _stretched(
    experiment: Experiment,
    runs: tuple[Run, ...],
    readings: tuple[Reading, ...],
    every: Sequence[FitRun],
) -> Evidence:
    inside = not all(run.forced for run in every)
    fitted, held, held_of = [], [], []
    for k, run in enumerate(every):
        if inside and run.forced:
            fitted.append(run)
            continue
        good = np.ones(run.time.shape, bool) if run.trusted is None else run.trusted.copy()
        # Parts of the samples that count, not of the time at rest after them.
        counted = np.flatnonzero(good)
        back = np.zeros(good.shape, bool)
        for first, last in held_parts(counted.size):
            a, b = int(counted[first]), int(counted[last])
            if b - a < FEWEST:
                continue
            back[a:b] = good[a:b]
            if not inside:
                held.append(_part(run, good, a, b))
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
    return Evidence(
        experiment,
        runs,
        readings,
        tuple(fitted),
        tuple(held),
        tuple(range(len(runs))),
        tuple(held_of),
        inside=inside,
    )


def held_parts(samples: int) -> list[tuple[int, int]]:
    """Return first and one after the last of each stretch of samples that is held back."""
    return [(int(low * (samples - 1)), int(high * (samples - 1))) for low, high in HELD]


def _part(run: FitRun, good: NDArray[np.bool_], a: int, b: int) -> FitRun:
    sigma = np.broadcast_to(np.asarray(run.sigma, np.float64), run.time.shape)
    return dataclasses.replace(
        run, time=run.time[a:b], theta=run.theta[a:b], sigma=sigma[a:b], trusted=good[a:b]
    )


BLOCKS: Final = 50
"""Least number of blocks in a swing or a turn: noise stands apart from the motion in their
spectrum, and a window has enough of them."""

FEWEST_BLOCKS: Final = 1000
"""Blocks that a record has at least: below, the integrator's own steps are what takes time."""

LEAST_OF_BLOCK: Final = 3
"""Readings of a block at least: pairs save little."""

NEIGHBOURS: Final = 2
"""Blocks on either side through which a parabola is laid."""


def in_blocks(run: FitRun) -> FitRun:
    """Return a run with its readings put together, or as it is where they are not dense.

    The mean of readings over a block is a reading at the mean of their times, with weights ``w``
    one over their squared errors: ``sum(w x)/sum(w)`` has the error ``sum(w)^(-1/2)``. It exceeds
    the angle there by the curvature, ``var(t) a/2`` with the acceleration ``a`` of the parabola
    through five blocks, which is taken off; the rest, of the order of ``T^4/60`` times the fourth
    derivative in a block of length ``T``, is ``1e-6`` of a swing. A run whose readings are
    intervals stays as it is: their mean is none.
    """
    if run.count is not None:
        return run
    weights = np.broadcast_to(np.asarray(run.sigma, np.float64), run.time.shape) ** -2.0
    if run.trusted is not None:
        weights = np.where(run.trusted, weights, 0.0)
    for size in range(run.time.size // FEWEST_BLOCKS, LEAST_OF_BLOCK - 1, -1):
        found = _divided(run.time, run.theta, weights, size)
        if _dense(*found[:3]):
            break
    else:
        return run
    time, theta, weight, variance = found
    counted = weight > 0
    # What does not count may be anything, and bends no parabola of its neighbours.
    known = np.where(counted, theta, np.interp(time, time[counted], theta[counted]))
    theta = theta - 0.5 * variance * _curvature(time, known)
    # One that does not count has any error.
    sigma = np.where(counted, weight, np.median(weight[counted])) ** -0.5
    return dataclasses.replace(run, time=time, theta=theta, sigma=sigma, trusted=counted)


def _divided(
    time: Floats, theta: Floats, weights: Floats, size: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return mean time, mean reading, weight and variance of the times of each block.

    A block without a reading that counts has the plain means. What is left at the end joins none.
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
    """Whether blocks are short against the quickest swing, or turn, of what counts."""
    counted = weight > 0
    time, theta = time[counted], theta[counted]
    if time.size < FEWEST_BLOCKS:
        return False
    steps = np.diff(time)
    velocity = np.diff(theta) / steps
    # Of a swing the one is its frequency, of a rotation the other.
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
