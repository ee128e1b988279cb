"""Noise of a record, estimated without a model of the pendulum.

The noise is the residual of local polynomials over the filter's gain. With slow sampling the degree
is raised until the residual no longer decreases. Readings that share a coarse count have equal
errors: samples at least a count apart are fitted; for slower motion the noise is count/sqrt(12).
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError, short_repr
from pendmap.records.experiment import Experiment, Run
from pendmap.records.jitter import DITHERED, SpeedLaw, law_of, speed_of
from pendmap.records.resolution import step_of
from pendmap.signal.local_polynomial import local_fit
from pendmap.signal.robust import broad_scale, widened

if TYPE_CHECKING:
    from collections.abc import Callable

    from pendmap.records.work import Work
    from pendmap.signal import Floats, Mask
    from pendmap.signal.local_polynomial import LocalFit
    from pendmap.tables.findings import Finding

SLOW_SAMPLING: Final = 0.06  # Phase between samples, rad, above which quartics leave motion
WAY_PHASE: Final = 0.25  # Phase over which displacements are measured, rad, unless one interval
CLEAR_WAY: Final = 4  # Least displacement from which a speed is computed, counts
TOO_FEW: Final = 0.3  # Phase between samples, rad, above which polynomials fail: upper bound only
OUTLIER: Final = 8.0  # Standard deviations above which a residual is an outlier
FEWEST_RESIDUALS: Final = 40  # Fewest residuals from which a standard deviation is estimated
OUTLIER_RANGES: Final = 16  # Most ranges of speed with separate outlier limits
CLEARLY_LESS: Final = 1.02  # Least ratio of two noise estimates that differ
DEGREES: Final = ((4, 9), (6, 11), (8, 13), (10, 15))  # Degrees and samples, in the order tried
FARTHEST: Final = 0.25  # Greatest phase between samples a count apart, rad
MORE_STRIDES: Final = 4  # Number of strides beyond the shortest that are pooled
STIFF_STRIDE: Final = 2.0  # Factor on FARTHEST for the highest degree


@dataclasses.dataclass(frozen=True)
class NoiseFloor:
    """Standard deviation of readings about a smooth motion.

    Parameters
    ----------
    sigma, stderr : float
        Noise and its standard error, rad, including rounding to counts; ``nan`` with too few
        samples.
    limited_by_count : bool
        Whether ``sigma`` is count/sqrt(12), the lower bound set by the resolution.
    samples : int
        Number of residuals.
    law : SpeedLaw or None
        Growth of the noise with speed, if it is significant.
    bound : bool
        Whether ``sigma`` is an upper bound: few samples per period leave some motion in it.
    """

    sigma: float
    stderr: float
    limited_by_count: bool = False
    samples: int = 0
    law: SpeedLaw | None = None
    bound: bool = False


def noise_floor(run: Run | Experiment) -> NoiseFloor:
    """Return the noise of a run, estimated without a model of the pendulum.

    Polynomials are fitted to neighbouring trusted samples; the noise is the root mean square of
    their residuals over the filter's gain. If no sample is trusted, all are used.

    Parameters
    ----------
    run : Run or Experiment
        A run of :func:`read_experiment`, or an experiment of one run.

    Returns
    -------
    NoiseFloor
        Noise in rad; of a gyroscope alone in rad/s. ``nan`` if only turning points are known or
        there are too few samples.

    Examples
    --------
    >>> import numpy as np
    >>> import pendmap
    >>> time = np.arange(0, 20, 0.01)
    >>> theta = 0.5 * np.exp(-0.02 * time) * np.cos(6.2 * time)
    >>> theta += np.random.default_rng(0).normal(0, 1e-3, time.size)
    >>> rows = np.column_stack((time, theta))
    >>> np.savetxt("run.csv", rows, delimiter=",", header="t_s,theta_rad", comments="")
    >>> run = pendmap.read_experiment("run.csv").runs[0]
    >>> round(pendmap.noise_floor(run).sigma, 4)
    0.001
    """
    if isinstance(run, Experiment) and len(run.runs) == 1:
        (run,) = run.runs
    if not isinstance(run, Run):
        what = f"{len(run.runs)} runs" if isinstance(run, Experiment) else short_repr(run)
        raise InputError(f"run must be one run, like experiment.runs[0], got {what}")
    if run.peaks_only:
        return NoiseFloor(math.nan, math.nan)
    trusted = run.trusted if run.trusted.any() else None
    if run.gyroscope is not None:
        noise = noise_of(run.time, run.read, trusted=trusted, count=step_of(run.read))
        law = noise.law and dataclasses.replace(noise.law, grows_with="acceleration")
        return dataclasses.replace(noise, law=law)
    return noise_of(run.time, run.theta, trusted=trusted, count=run.count_rad)


def noise_of(
    time: Floats, theta: Floats, *, trusted: Mask | None = None, count: float = 0.0
) -> NoiseFloor:
    """Return the noise of readings of a smooth motion, of resolution ``count``, rad."""
    bad = np.zeros(time.size, bool) if trusted is None else ~trusted
    noise = _noise(time, theta, bad, count)
    if noise is None and bad.any():
        noise = _noise(time, theta, np.zeros(time.size, bool), count)
    return noise or NoiseFloor(math.nan, math.nan)


def _noise(time: Floats, theta: Floats, bad: Mask, count: float) -> NoiseFloor | None:
    """Return the noise from the windows without bad samples; None if there are too few."""
    if time.size < FEWEST_RESIDUALS:
        return None
    interval = float(np.median(np.diff(time)))
    swing, phase = fastest(time, theta, count)
    slow = swing * interval > SLOW_SAMPLING
    speed = speed_of(time, theta, phase)

    def fitted(degree: int = 4, points: int = 9, stride: int = 1) -> LocalFit:
        fit = local_fit(time, theta, degree=degree, points=points, stride=stride)
        return clean(fit, bad, speed)

    first = fitted()
    if first.middle.size < FEWEST_RESIDUALS:
        return None
    fit = raise_degree(fitted, first) if slow else first
    least, law = count / math.sqrt(12), None
    if count and fit.rms < DITHERED * count:
        far = fit_with_stride(fitted, count, interval, swing, fit if slow else None)
        if far is None:
            sigma = max(least, fit.rms)
            return NoiseFloor(sigma, least / 10, limited_by_count=True)
        fit = far
    else:
        # A residual has the noise of all samples of its window, each with its own speed.
        square = np.convolve(speed**2, fit.shares, "same")[fit.middle]
        law = law_of(fit, square, fastest=phase, count=count, interval=interval)
    few = phase * interval > TOO_FEW
    return NoiseFloor(
        sigma=max(fit.rms, least),
        stderr=fit.stderr,
        limited_by_count=fit.rms < least,
        samples=fit.middle.size,
        law=None if few else law,
        bound=few,
    )


def fastest(time: Floats, theta: Floats, count: float) -> tuple[float, float]:
    """Return the largest phase velocities, rad/s: with large swings as rotations, and as swings."""
    interval = float(np.median(np.diff(time)))
    lag = 1
    while True:
        way = float(np.quantile(np.abs(theta[lag:] - theta[:-lag]), 0.98))
        if way >= CLEAR_WAY * count or 8 * lag > theta.size:
            break
        lag *= 2
    reach = max(float(np.quantile(np.abs(theta - np.median(theta)), 0.99)), 1e-300)
    # A rotation's phase is its angle.
    length = min(reach, 1.0) if float(np.ptp(theta)) > math.pi else reach
    slowest = 1.0 / float(time[-1] - time[0])
    phase = max(way / (lag * interval * length), slowest)
    # Noise adds to the displacement between neighbours: longer lags reduce its effect.
    while lag < (longer := min(int(WAY_PHASE / (phase * interval)), theta.size // 8)):
        lag = longer
        way = float(np.quantile(np.abs(theta[lag:] - theta[:-lag]), 0.98))
        phase = max(way / (lag * interval * length), slowest)
    swing = phase if float(np.ptp(theta)) > math.tau else phase * length / reach
    return min(phase, math.pi / interval), min(max(swing, slowest), math.pi / interval)


def grows(work: Work) -> Finding | None:
    """Report noise that grows with speed."""
    if work.integrated:
        return None  # the noise by jitter of a rate grows with the acceleration
    count = 0.0 if work.edges else work.count
    law = noise_of(work.time, work.theta, trusted=work.trusted, count=count).law
    if law is None:
        return None
    percent = 100 * law.tau / float(np.median(np.diff(work.time)))
    return work.finding("noise-grows-with-speed", law=law, percent=percent)


def clean(fit: LocalFit, bad: Mask, speed: Floats) -> LocalFit:
    """Return a fit without windows that have bad samples or outliers among similar speeds."""
    fit = fit.only(~widened(bad, fit.neighbours)[fit.middle])
    false = np.zeros(speed.size, bool)
    sizes = np.abs(fit.residual)
    whole = broad_scale(sizes)
    order = np.argsort(speed[fit.middle], kind="stable")
    ranges = max(min(OUTLIER_RANGES, order.size // (5 * FEWEST_RESIDUALS)), 1)
    for part in np.array_split(order, ranges):
        # Noise that grows with speed is largest for the fastest samples.
        scale = max(whole, broad_scale(sizes[part]))
        false[fit.middle[part[sizes[part] > OUTLIER * scale]]] = scale > 0
    return fit.only(~widened(false, fit.neighbours)[fit.middle])


def less(fit: LocalFit, other: LocalFit) -> bool:
    """Return whether a fit's residual is significantly less than another's."""
    if fit.middle.size < FEWEST_RESIDUALS:
        return False
    return other.rms > (CLEARLY_LESS + 2 * fit.stderr / max(fit.rms, 1e-300)) * fit.rms


def raise_degree(fitted: Callable[..., LocalFit], first: LocalFit) -> LocalFit:
    """Return the fit of the lowest degree whose residual the next degree does not reduce."""
    chosen = first
    for degree, points in DEGREES[1:]:
        higher = fitted(degree=degree, points=points)
        if not less(higher, chosen):
            break
        chosen = higher
    return chosen


def fit_with_stride(
    fitted: Callable[..., LocalFit],
    count: float,
    interval: float,
    swing: float,
    nearest: LocalFit | None,
) -> LocalFit | None:
    """Return a fit of samples a count apart; ``nearest`` is that of neighbours if slow."""
    most = max(int(FARTHEST / (swing * interval)), 1)
    stride = 1
    while True:
        # At lower speeds neighbours are within a count and have equal errors.
        slowest = count / (stride * interval)
        fit = fitted(degree=6, points=11, stride=stride)
        if stride == 1 and nearest is not None and less(nearest, fit):
            fit = nearest
        quick = np.abs(fit.slope) >= slowest
        if np.count_nonzero(quick) >= max(FEWEST_RESIDUALS, quick.size // 3) or stride >= most:
            break
        stride = min(2 * stride, most)
    if np.count_nonzero(quick) < FEWEST_RESIDUALS:
        return None
    fits = [fit.only(quick)]
    farthest = max(int(STIFF_STRIDE * FARTHEST / (swing * interval)), 1)
    for longer in range(stride + 1, min(stride + MORE_STRIDES, farthest) + 1):
        degree, points = DEGREES[1] if fit is not nearest and longer <= most else DEGREES[-1]
        more = fitted(degree=degree, points=points, stride=longer)
        fits.append(more.only(np.abs(more.slope) >= slowest))
    middle, residual, slope = (
        np.concatenate([getattr(one, name) for one in fits])
        for name in ("middle", "residual", "slope")
    )
    # Overlapping residuals: the pooled fit has the effective number of the first one.
    worth = fits[0].sum_of_squares * middle.size / fits[0].middle.size
    return dataclasses.replace(
        fits[0], middle=middle, residual=residual, slope=slope, sum_of_squares=worth
    )
