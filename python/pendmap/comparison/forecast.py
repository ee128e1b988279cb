"""How the error of a forecast grows with its horizon, on data that were held back.

From many starts on held-out data a model is run forward without any further reading. All it is
given is its state at the start, adapted to the readings of the swing before. The error at a horizon
is the root mean square, over all starts, of readings less forecast; with the right model it is the
noise to begin with, and then grows with what the noise left unknown of the state.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.comparison.further import Reasons, attempted
from pendmap.comparison.replay import Motion, drives, replayed, settled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.comparison.data import Evidence
    from pendmap.comparison.replay import Fits
    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun

    Floats = NDArray[np.float64]

REACH: Final = 2 / 3
"""Part of a held-out stretch that a forecast covers; it may start anywhere in the rest."""

STARTS: Final = 12
"""Starts in one stretch at most, half a swing apart at least."""

BINS: Final = 40
"""Horizons that errors are shown at, a tenth of a swing apart at least."""

FEWEST: Final = 8
"""Readings that a state is adapted to, at least."""

BEGIN: Final = 0.15
"""Part of a swing over which a parabola gives a first guess of the state."""


@dataclasses.dataclass(frozen=True)
class Forecast:
    """The error of forecasts against their horizon.

    Parameters
    ----------
    kind : str
        ``free`` or ``forced``: of which runs. Forced motions may be chaotic; then every model's
        error grows exponentially.
    horizon : ndarray of float, shape (n,)
        Times ahead, s; the middle of a bin each.
    before, after : ndarray of float, shape (n,)
        Root mean square error of the baseline and of the model found, rad; turns do not count.
    noise_floor : float
        Of the readings, rad.
    starts : int
        How many forecasts this is the mean of.
    """

    kind: str
    horizon: Floats
    before: Floats
    after: Floats
    noise_floor: float
    starts: int


@dataclasses.dataclass(frozen=True)
class _Stretch:
    """Readings held back in a row, in the run that they are of: ``first`` to ``last`` of it."""

    run: FitRun
    place: int
    held: NDArray[np.bool_]
    good: NDArray[np.bool_]
    first: int
    last: int


def forecasts_of(
    evidence: Evidence, base: Fits, best: Fits, reasons: Reasons
) -> tuple[Forecast, ...]:
    """Return the error of forecasts, of free runs and of forced ones."""
    swing = math.tau / base.fitted.model.w0
    every = [s for place in range(len(evidence.held)) for s in _stretches(evidence, place, swing)]
    kinds = (("free", False), ("forced", True))
    found = []
    for kind, forced in kinds:
        own = [s for s in every if s.run.forced == forced]
        found.append(
            attempted(
                reasons,
                f"forecast.{kind}",
                functools.partial(_forecast, kind, own, base, best, swing),
                None,
            )
        )
    return tuple(forecast for forecast in found if forecast is not None)


def _stretches(evidence: Evidence, place: int, swing: float) -> list[_Stretch]:
    """Return the stretches of a record that was held back, in the run that they are of."""
    held, of = evidence.held[place], evidence.held_of[place]
    run = evidence.fitted[evidence.fitted_of.index(of)] if of in evidence.fitted_of else held
    back = np.zeros(run.time.shape, bool)
    at = np.searchsorted(run.time, held.time)
    back[at] = True if held.trusted is None else held.trusted
    good = back | (True if run.trusted is None else run.trusted)
    samples = np.flatnonzero(back)
    if samples.size < FEWEST:
        return []
    cuts = np.flatnonzero(np.diff(run.time[samples]) > swing) + 1
    return [
        _Stretch(run, place, back, good, int(part[0]), int(part[-1]))
        for part in np.split(samples, cuts)
    ]


def _earliest(stretch: _Stretch, swing: float) -> float:
    """Return the first time at which a stretch has a swing of readings behind it."""
    time = stretch.run.time
    return max(float(time[stretch.first]), float(time[np.argmax(stretch.good)]) + swing)


def _forecast(
    kind: str, stretches: list[_Stretch], base: Fits, best: Fits, swing: float
) -> Forecast | None:
    rooms = [float(s.run.time[s.last]) - _earliest(s, swing) for s in stretches]
    rooms = [room for room in rooms if room > 0]
    if not rooms:
        return None
    reach = REACH * float(np.median(rooms))
    starts = [(s, at) for s in stretches for at in _starts(s, reach, swing)]
    if not starts:
        return None
    count = int(np.clip(10 * reach / swing, 4, BINS))
    which, floors = [], []
    for stretch, at in starts:
        ahead = stretch.run.time - at
        counts = _ahead(stretch, at, reach)
        bins = np.minimum((ahead[counts] / reach * count).astype(int), count - 1)
        which.append((counts, bins))
        sigma = np.broadcast_to(np.asarray(stretch.run.sigma, float), ahead.shape)
        floors.append(float(np.mean(sigma[counts] ** 2)) if counts.any() else math.nan)
    before, after = (_errors(model, starts, which, reach, swing, count) for model in (base, best))
    return Forecast(
        kind,
        (np.arange(count) + 0.5) * reach / count,
        before,
        after,
        math.sqrt(float(np.nanmean(floors))),
        len(starts),
    )


def _starts(stretch: _Stretch, reach: float, swing: float) -> list[float]:
    """Return times from which a stretch is forecast, with enough readings behind each."""
    first = _earliest(stretch, swing)
    room = float(stretch.run.time[stretch.last]) - reach - first
    if room < 0:
        return []
    count = min(STARTS, 1 + int(room / (swing / 2)))
    times = np.linspace(first, first + room, count)
    return [float(at) for at in times if np.count_nonzero(_behind(stretch, at, swing)) >= FEWEST]


def _behind(stretch: _Stretch, at: float, swing: float) -> NDArray[np.bool_]:
    time = stretch.run.time
    return np.asarray(stretch.good & (time - at > -swing) & (time - at <= 0))


def _ahead(stretch: _Stretch, at: float, reach: float) -> NDArray[np.bool_]:
    ahead = stretch.run.time - at
    return np.asarray(stretch.held & (ahead > 0) & (ahead <= reach))


def _errors(  # noqa: PLR0913, PLR0917 (the model, the starts, how errors are sorted)
    model: Fits,
    starts: list[tuple[_Stretch, float]],
    which: list[tuple[NDArray[np.bool_], NDArray[np.int64]]],
    reach: float,
    swing: float,
    count: int,
) -> Floats:
    """Return the root mean square error in each bin."""
    before, whole = [], []
    for stretch, at in starts:
        run = dataclasses.replace(stretch.run, drive=drives(model.held, stretch.run, stretch.place))
        behind = _behind(stretch, at, swing)
        before.append(_of(run, behind))
        whole.append(_of(run, behind | _ahead(stretch, at, reach)))
    motion = Motion.of(model.fitted)
    states = settled(motion, before, [_guess(run, swing) for run in before])
    forecasts = replayed(motion, whole, states)
    squares, samples = np.zeros(count), np.zeros(count)
    for (stretch, _), (counts, bins), (readings, _) in zip(starts, which, forecasts, strict=True):
        error = stretch.run.theta[counts] - readings[readings.size - bins.size :]
        # Which turn a pendulum is in that went over the top says nothing more.
        error = np.angle(np.exp(1j * error))
        squares += np.bincount(bins, error**2, count)
        samples += np.bincount(bins, minlength=count)
    with np.errstate(invalid="ignore"):
        return np.sqrt(squares / np.where(samples > 0, samples, math.nan))


def _of(run: FitRun, kept: NDArray[np.bool_]) -> FitRun:
    """Return some of a run's samples."""
    sigma = np.broadcast_to(np.asarray(run.sigma, np.float64), run.time.shape)
    return dataclasses.replace(
        run, time=run.time[kept], theta=run.theta[kept], sigma=sigma[kept], trusted=None
    )


def _guess(run: FitRun, swing: float) -> tuple[float, float]:
    """Return angle and velocity at a run's first sample, from a parabola."""
    time = run.time - run.time[0]
    near = max(int(np.searchsorted(time, BEGIN * swing)), 3)
    slope, angle = np.polyfit(time[:near], run.theta[:near], min(2, near - 1))[-2:]
    return float(angle), float(slope)


@dataclasses.dataclass(frozen=True)
class RunGap:
    """Residuals of one run, rms in rad."""

    name: str
    held_out: bool
    noise_floor: float
    before: float
    after: float


@dataclasses.dataclass(frozen=True)
class Gap:
    """Root mean squares of the residuals, rad.

    Parameters
    ----------
    noise_floor, held_out_noise_floor : float
        Of the noise alone, as it is seen without a model: of the runs that were fitted, and of what
        was held back.
    before, after : float
        Of the baseline and of the model found, on the runs that both were fitted to.
    held_out_before, held_out_after : float
        On what was held back from both, with fresh initial states.
    by_run : tuple of RunGap
        Each run, or part of one, by itself.
    """

    noise_floor: float
    held_out_noise_floor: float
    before: float
    after: float
    held_out_before: float
    held_out_after: float
    by_run: tuple[RunGap, ...]


def gap_of(evidence: Evidence, base: Fits, best: Fits) -> Gap:
    """Return the gap that a baseline leaves and that a model leaves."""
    before, held_before = base
    after, held_after = best
    rows = _rows(evidence.fitted, before, after, held_out=False)
    held = _rows(evidence.held, held_before, held_after, held_out=True)
    return Gap(
        _together(evidence.fitted, rows),
        _together(evidence.held, held),
        _rms(evidence.fitted, before),
        _rms(evidence.fitted, after),
        _rms(evidence.held, held_before),
        _rms(evidence.held, held_after),
        (*rows, *held),
    )


def _rows(
    runs: Sequence[FitRun], before: TrajectoryFit, after: TrajectoryFit, *, held_out: bool
) -> list[RunGap]:
    return [
        RunGap(
            run.name,
            held_out,
            _floor(run),
            _rms([run], before, k),
            _rms([run], after, k),
        )
        for k, run in enumerate(runs)
    ]


def _floor(run: FitRun) -> float:
    sigma = np.broadcast_to(np.asarray(run.sigma, np.float64), run.time.shape)
    return float(np.sqrt(np.mean(np.square(sigma if run.trusted is None else sigma[run.trusted]))))


def _together(runs: Sequence[FitRun], rows: Sequence[RunGap]) -> float:
    sizes = [run.time.size if run.trusted is None else int(run.trusted.sum()) for run in runs]
    squares = [size * row.noise_floor**2 for size, row in zip(sizes, rows, strict=True)]
    return math.sqrt(sum(squares) / sum(sizes))


def _rms(runs: Sequence[FitRun], fit: TrajectoryFit, first: int = 0) -> float:
    squares, count = 0.0, 0
    for k, run in enumerate(runs, start=first):
        residual = fit.residuals[k]
        good = np.isfinite(residual)
        if run.trusted is not None:
            good &= run.trusted
        squares += float(np.sum(residual[good] ** 2))
        count += int(np.count_nonzero(good))
    return math.sqrt(squares / count) if count else math.nan
