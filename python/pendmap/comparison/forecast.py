"""Errors of a baseline and of a better model: residuals, forecasts, periods and peaks.

Forecasts: a model is integrated from many starts on held-out data, with the initial state fitted to
the readings of the swing before. The error at a horizon is the root mean square of readings less
forecast over all starts; with the right model it begins at the noise and grows with the error of
the initial state.

Periods and peaks: as in the paper's figure 7 a model is integrated from the first measured peak, at
rest; nothing is fitted. Fitted damping may be negative there.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final, NamedTuple, TypeVar

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from pendmap.comparison.data import samples_of
from pendmap.identification.fit import Motion, fit_states, run_forward
from pendmap.identification.peaks import find_peaks
from pendmap.identification.runs import FitRun
from pendmap.identification.table1 import errors_of
from pendmap.signal.robust import rms

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pendmap.comparison.data import DataSplit
    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.peaks import Peaks
    from pendmap.identification.table1 import PeakErrors
    from pendmap.signal import Floats, Indices, Mask

Reasons = dict[str, str]  # Reason why a part was not computed, by its field in the JSON object
Part = TypeVar("Part")
LOST: Final = (ArithmeticError, np.linalg.LinAlgError)
"""Errors raised by a motion that diverges in another record or from another state."""
REACH: Final = 2 / 3
"""Length of forecasts over the median stretch; starts are spread over the rest of a stretch."""
STARTS: Final = 12  # Most starts in a stretch, at least half a swing apart
BINS: Final = 40  # Most bins of the horizon, each at least a tenth of a swing
FEWEST: Final = 8  # Fewest readings to which an initial state is fitted
BEGIN: Final = 0.15  # Fraction of a swing over which a parabola gives the first guess of a state
BEFORE: Final = "before"
AFTER: Final = "after"  # Names of the baseline and of the better model
PER_SWING: Final = 200
"""Samples of a swing between which cubics interpolate a peak, to 1e-7 of the swing."""
FEWEST_PEAKS: Final = 3  # Fewest peaks of a compared run: one full cycle


def compute_part(reasons: Reasons, field: str, compute: Callable[[], Part], default: Part) -> Part:
    """Return a part of a diagnosis, or the default if it fails, with the reason in ``reasons``."""
    try:
        return compute()
    except LOST as error:
        reasons[field] = str(error)
        return default


class Fits(NamedTuple):
    """Fit of a model to records, and the model with these parameters on the held-out records."""

    fitted: TrajectoryFit
    held: TrajectoryFit


@dataclasses.dataclass(frozen=True)
class Forecast:
    """Error of forecasts against their horizon."""

    kind: str  # Runs: ``free`` or ``forced``; errors of chaotic forced motion grow exponentially
    horizon: Floats  # Middle of each bin of the horizon, s, shape (n,)
    before: Floats  # Root mean square error of the baseline modulo a turn, rad, shape (n,)
    after: Floats  # Root mean square error of the selected model, rad, shape (n,)
    noise_floor: float  # Root mean square noise of the readings, rad
    starts: int  # Number of forecasts


class _Stretch(NamedTuple):
    """Stretch of consecutive held-out readings of a run."""

    run: FitRun
    place: int  # Index of the record among those held out
    held: Mask  # Held-out readings
    earliest: float  # First time with a swing of readings before it, s
    latest: float  # Last time, s


class _Launch(NamedTuple):
    """Start of a forecast in a stretch."""

    place: int  # As in the stretch
    before: FitRun  # Readings of the swing before, to which the state is fitted
    whole: FitRun  # These, and the held-out readings up to the horizon
    bins: Indices  # Bin of the horizon of each reading ahead


def compare_forecasts(data: DataSplit, base: Fits, best: Fits) -> tuple[Forecast, ...]:
    """Return the forecast errors of free and of forced runs."""
    swing = math.tau / base.fitted.model.w0
    every = [s for place in range(len(data.held)) for s in _stretches(data, place, swing)]
    kinds = {"free": [s for s in every if not s.run.forced]}
    kinds["forced"] = [s for s in every if s.run.forced]
    forecasts = (_forecast(kind, some, base, best, swing) for kind, some in kinds.items())
    return tuple(forecast for forecast in forecasts if forecast is not None)


def _stretches(data: DataSplit, place: int, swing: float) -> list[_Stretch]:
    """Return the held-out stretches of a record, as parts of their run."""
    held, of = data.held[place], data.held_of[place]
    run = data.fitted[data.fitted_of.index(of)] if of in data.fitted_of else held
    back = np.zeros(run.time.shape, bool)
    back[np.searchsorted(run.time, held.time)] = held.counted
    run = dataclasses.replace(run, trusted=back | run.counted)
    samples = np.flatnonzero(back)
    if samples.size < FEWEST:
        return []
    begin = float(run.time[np.argmax(run.counted)]) + swing
    parts = np.split(run.time[samples], np.flatnonzero(np.diff(run.time[samples]) > swing) + 1)
    return [_Stretch(run, place, back, max(float(t[0]), begin), float(t[-1])) for t in parts]


def _forecast(
    kind: str, stretches: list[_Stretch], base: Fits, best: Fits, swing: float
) -> Forecast | None:
    """Return the errors of both models over all starts; None if there is no start."""
    rooms = [s.latest - s.earliest for s in stretches if s.latest > s.earliest]
    if not rooms:
        return None
    reach = REACH * float(np.median(rooms))
    count = int(np.clip(10 * reach / swing, 4, BINS))
    launches = [one for s in stretches for one in _launches(s, reach, swing, count)]
    if not launches:
        return None
    floors = [one.whole.sigmas[-one.bins.size :] ** 2 for one in launches if one.bins.size]
    floor = math.sqrt(float(np.mean([np.mean(squares) for squares in floors])))
    before, after = (_errors(model, launches, swing, count) for model in (base, best))
    middles = (np.arange(count) + 0.5) * reach / count
    return Forecast(kind, middles, before, after, floor, len(launches))


def _launches(stretch: _Stretch, reach: float, swing: float, count: int) -> list[_Launch]:
    """Return the starts of forecasts in a stretch with enough readings before each."""
    run, room = stretch.run, stretch.latest - reach - stretch.earliest
    if room < 0:
        return []
    starts = min(STARTS, 1 + int(room / (swing / 2)))
    launches = []
    for at in np.linspace(stretch.earliest, stretch.earliest + room, starts):
        later = run.time - at
        behind = run.counted & (later > -swing) & (later <= 0)
        ahead = stretch.held & (later > 0) & (later <= reach)
        bins = np.minimum((later[ahead] / reach * count).astype(np.intp), count - 1)
        if np.count_nonzero(behind) >= FEWEST:
            before, whole = samples_of(run, behind), samples_of(run, behind | ahead)
            launches.append(_Launch(stretch.place, before, whole, bins))
    return launches


def _errors(model: Fits, launches: list[_Launch], swing: float, count: int) -> Floats:
    """Return the root mean square error in each bin, rad."""
    drives = [model.held.drive_of(one.whole, one.place) for one in launches]
    before, whole = (
        [dataclasses.replace(run, drive=drive) for run, drive in zip(runs, drives, strict=True)]
        for runs in ([one.before for one in launches], [one.whole for one in launches])
    )
    motion = Motion.of(model.fitted)
    sensors = model.held.sensors_of([one.place for one in launches])
    motion = dataclasses.replace(motion, own={**motion.own, **sensors})
    states = fit_states(motion, before, [_guess(run, swing) for run in before])
    squares, samples = np.zeros(count), np.zeros(count)
    for one, (readings, _) in zip(launches, run_forward(motion, whole, states), strict=True):
        first = readings.size - one.bins.size
        error = np.angle(np.exp(1j * (one.whole.theta - readings)[first:]))  # modulo a turn
        squares += np.bincount(one.bins, error**2, count)
        samples += np.bincount(one.bins, minlength=count)
    return np.asarray(np.sqrt(squares / np.where(samples > 0, samples, math.nan)))


def _guess(run: FitRun, swing: float) -> tuple[float, float]:
    """Return angle and velocity at a run's first sample, from a parabola."""
    time = run.time - run.time[0]
    near = max(int(np.searchsorted(time, BEGIN * swing)), 3)
    slope, angle = np.polyfit(time[:near], run.angle[:near], min(2, near - 1))[-2:]
    return float(angle), float(slope)


@dataclasses.dataclass(frozen=True)
class RunGap:
    """Root mean square residuals of one run, rad."""

    name: str
    held_out: bool
    noise_floor: float
    before: float
    after: float


@dataclasses.dataclass(frozen=True)
class Gap:
    """Root mean square residuals, rad."""

    noise_floor: float  # Noise of the fitted records
    held_out_noise_floor: float  # Noise of the held-out records
    before: float  # Residual of the baseline in the fitted records
    after: float  # Residual of the selected model in the fitted records
    held_out_before: float  # Residual of the baseline in the held-out records
    held_out_after: float  # Residual of the selected model in the held-out records
    by_run: tuple[RunGap, ...]  # Residuals of each record


def share_closed(before: float, after: float, noise: float) -> float:
    """Return the share of a squared gap above the noise that a better model closes.

    ``(before^2 - after^2) / (before^2 - noise^2)`` of root mean squares. It is 1 where nothing is
    left above the noise, 0 where the gap was not above the noise before.
    """
    gap, left = (rms**2 - noise**2 for rms in (before, after))
    if left <= 0:
        return 1.0
    return 1.0 - left / gap if gap > 0 else 0.0


def noise_rms(runs: Sequence[FitRun]) -> float:
    """Return the root mean square noise of the included readings of runs, rad."""
    return math.sqrt(float(np.mean(np.concatenate([run.sigmas[run.counted] for run in runs]) ** 2)))


def compute_gap(data: DataSplit, base: Fits, best: Fits) -> Gap:
    """Return the root mean square residuals of a baseline and of a model."""
    rows = []
    for held_out, runs in enumerate((data.fitted, data.held)):
        residuals = (fits[held_out].residuals for fits in (base, best))
        for run, *both in zip(runs, *residuals, strict=True):
            rms_of = (rms(residual[run.counted]) for residual in both)
            rows.append(RunGap(run.name, bool(held_out), noise_rms([run]), *rms_of))
    floors = noise_rms(data.fitted), noise_rms(data.held)
    left = base.fitted.rms, best.fitted.rms, base.held.rms, best.held.rms
    return Gap(*floors, *left, tuple(rows))


@dataclasses.dataclass(frozen=True)
class Cycles:
    """Errors of two models in the periods and peaks of one free run."""

    name: str  # Name of the run
    held_out: bool  # True if the whole run is held out
    peaks: Peaks  # Measured peaks
    errors: dict[str, PeakErrors]  # By model, ``before`` and ``after``


def compare_cycles(data: DataSplit, base: Fits, best: Fits) -> tuple[Cycles, ...]:
    """Return the errors in each free run with a full cycle, held-out runs first."""
    cycles = []
    for k, (run, reading) in enumerate(zip(data.runs, data.readings, strict=True)):
        if run.kind != "free":
            continue
        peaks = find_peaks(run.time, run.theta, sigma=reading.sigma, trusted=run.trusted)
        if len(peaks.turned) < FEWEST_PEAKS:
            continue
        errors = {}
        for name, model in ((BEFORE, base), (AFTER, best)):
            simulated = _simulated_peaks(model.fitted, peaks, reading.sigma, run.lab_time_s)
            errors[name] = errors_of(name, peaks, *simulated)
        cycles.append(Cycles(run.name, k not in data.fitted_of, peaks, errors))
    return tuple(sorted(cycles, key=lambda one: not one.held_out))


def _simulated_peaks(
    fit: TrajectoryFit, peaks: Peaks, sigma: float, lab_time_s: float
) -> tuple[Floats, Floats]:
    """Return times and readings of a model's peaks from the first measured one on."""
    turned = peaks.turned
    first, amplitude = float(turned.time[0]), float(turned.amplitude[0])
    until = 1.2 * (float(turned.time[-1]) - first) + 5.0
    swing = math.tau / fit.model.w0
    time = first + np.linspace(0.0, until, math.ceil(PER_SWING * until / swing) + 1)
    run = FitRun(time, np.zeros(time.shape), sigma, lab_time_s=lab_time_s)
    # Find the angle with the measured reading: they differ by the sensor's errors.
    start = amplitude
    for _ in range(2):
        ((readings, curve),) = run_forward(Motion.of(fit), [run], [(start, 0.0)])
        start += amplitude - float(readings[0])
    return _turning_points(time, readings, curve)


def _turning_points(time: Floats, readings: Floats, curve: Floats) -> tuple[Floats, Floats]:
    """Return times and readings of a curve's first sample, turning points and stop."""
    theta, velocity = curve
    before, after = velocity[1:-1], velocity[2:]
    turns = np.flatnonzero((before * after < 0) | ((before != 0) & (after == 0))) + 1
    spline = CubicHermiteSpline(time, theta, velocity)
    roots = spline.derivative().roots(extrapolate=False)
    roots = np.append(roots[np.isfinite(roots)], time[-1])
    at = roots[np.searchsorted(roots, time[turns])].clip(time[turns], time[turns + 1])
    angle = spline(at) + np.interp(at, time, readings - theta)
    return np.append(time[:1], at), np.append(readings[:1], angle)
