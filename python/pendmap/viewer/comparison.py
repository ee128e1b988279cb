"""A record with its model: readings, residual, velocities, at the drawn instants."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicHermiteSpline

from pendmap.analysis.trajectory import simulate
from pendmap.identification.peaks import Peaks, find_peaks
from pendmap.identification.table1 import first_state

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pendmap.charts.marks import Floats
    from pendmap.identification import IdentificationReport
    from pendmap.records import Run

INSTANTS = 20000
"""Greatest number of drawn instants of a run; of a longer one every k-th is drawn, unless too few
per swing would remain."""

PER_SWING = 24  # Least number of drawn instants per swing

GAP = 8.0  # Interval, over the median, above which a gap is not bridged

SLOPE = 0.05
"""Part of a swing over which the record's velocity is a difference: a longer one reduces its peaks
(by 0.4 % here), a shorter one amplifies the noise."""


@dataclass(frozen=True)
class Comparison:
    """A record and its model, all in s, rad and rad/s; unknown values are NaN.

    ``speed`` is measured or a difference, ``left_out`` marks samples that are not for fitting.
    ``model`` includes the sensor's errors and is empty without a model; ``model_time`` is ``time``
    except for a record of peaks alone, which is ``sparse``. ``residual`` is record minus model,
    ``peaks`` are in the turn in which they are drawn, ``sigma`` is the noise of a reading, 0 if
    unknown. A row of NaN marks a gap.
    """

    name: str
    time: Floats
    record: Floats
    speed: Floats
    left_out: npt.NDArray[np.bool_]
    model_time: Floats
    model: Floats
    model_speed: Floats
    residual: Floats
    peaks: Peaks
    sigma: float
    sparse: bool = False


def comparisons(report: IdentificationReport) -> list[Comparison]:
    """Return every fitted run, or else the decay with the best model's simulation."""
    joint = report.joint
    if joint is None:
        return [_simulated(report)]
    made = []
    for k, (run, reading) in enumerate(zip(joint.runs, joint.readings, strict=True)):
        (theta, speed), residual = joint.fit.curves[k], joint.fit.residuals[k]
        counted = run.trusted & np.isfinite(theta)
        # The fit gives the angle itself. The sensor's errors are added, interpolated over samples
        # that are not used; errors of a sensor on the rod do not apply to the angle.
        off = run.theta - residual - theta if run.rod_sensor is None else 0 * theta
        offset = off[counted]
        error = np.interp(run.time, run.time[counted], offset) if offset.size else 0.0
        known = np.where(counted, residual, math.nan)
        own = run is report.run
        peaks = (
            report.peaks
            if own
            else find_peaks(run.time, run.theta, sigma=reading.sigma, trusted=run.trusted)
        )
        columns = (theta + error, speed, known)
        made.append(_drawn(run, columns, peaks, report.model.w0, reading.sigma))
    return made


def _simulated(report: IdentificationReport) -> Comparison:
    """Return the decay with a simulation from its first peak, if a method found a model."""
    run, best, curve = report.run, report.sound, None
    peaks = report.peaks if run.peaks_only else _in_turn(report.peaks, run)
    w0 = 0.0
    if best is not None and len(peaks.turned) and best.method not in report.table.lost:
        w0, start = best.rig.w0, first_state(peaks)
        until = max(float(run.time[-1]) - start.time, 1e-3)
        made = simulate(best.rig, start.theta - best.zero, 0.0, until)
        times, angles = made["time"].values + start.time, made["theta"].values + best.zero
        curve = CubicHermiteSpline(times, angles, made["velocity"].values)
    elif len(peaks) > 1:
        w0 = math.pi / float(np.median(np.diff(peaks.time)))
    if run.peaks_only:
        return _of_peaks(run, peaks, curve, w0)
    model = speed = np.full(run.time.size, math.nan)
    if curve is not None:
        model, speed = (curve(run.time, order, extrapolate=False) for order in (0, 1))
    residual = np.where(run.trusted, run.theta - model, math.nan)
    return _drawn(run, (model, speed, residual), peaks, w0, peaks.sigma)


def _of_peaks(run: Run, peaks: Peaks, curve: CubicHermiteSpline | None, w0: float) -> Comparison:
    """Return peaks alone with the model's curve; their velocity is 0."""
    time, none = peaks.time, np.empty(0)
    model_time, model, speed, residual = none, none, none, np.full(time.size, math.nan)
    if curve is not None:
        per_swing = min(max(PER_SWING, INSTANTS * math.tau / (w0 * np.ptp(time))), 200.0)
        count = math.ceil(float(np.ptp(time)) * w0 / math.tau * per_swing) + 1
        model_time = np.linspace(float(time[0]), float(time[-1]), count)
        model, speed = curve(model_time), curve(model_time, 1)
        residual = peaks.amplitude - curve(time)
    return Comparison(
        name=run.name,
        time=time,
        record=peaks.amplitude,
        speed=np.zeros(time.size),
        left_out=np.zeros(time.size, bool),
        model_time=model_time,
        model=model,
        model_speed=speed,
        residual=residual,
        peaks=peaks,
        sigma=peaks.sigma,
        sparse=True,
    )


def _drawn(
    run: Run, columns: tuple[Floats, Floats, Floats], peaks: Peaks, w0: float, sigma: float
) -> Comparison:
    """Return model, its velocity and the residual for a run, thinned and cut at gaps."""
    out = np.where(run.trusted, 0.0, 1.0)
    instants, record, speed, out, *model, residual = thinned(
        run.time, w0, run.theta, _speed(run, w0), out, *columns
    )
    if not np.isfinite(model[0]).any():
        model = [np.empty(0), np.empty(0)]
    return Comparison(
        name=run.name,
        time=instants,
        record=record,
        speed=speed,
        left_out=out == 1,
        model_time=instants[: model[0].size],
        model=model[0],
        model_speed=model[1],
        residual=residual,
        peaks=_in_turn(peaks, run),
        sigma=sigma,
    )


def thinned(time: Floats, w0: float, *columns: Floats) -> Iterator[Floats]:
    """Yield the drawn instants of a run (s), and columns at these, with NaN in gaps.

    ``w0`` is the natural frequency in rad/s, 0 if unknown.
    """
    step = float(np.median(np.diff(time)))
    swing = math.tau / w0 / step if w0 else math.inf
    every = max(1, min(-(-time.size // INSTANTS), int(min(swing, time.size) / PER_SWING)))
    chosen = time[::every]
    cuts = np.flatnonzero(np.diff(chosen) > GAP * every * step) + 1
    ends = (chosen[cuts - 1] + chosen[cuts]) / 2
    yield np.insert(chosen, cuts, ends)
    yield from (np.insert(column[::every], cuts, math.nan) for column in columns)


def _speed(run: Run, w0: float) -> Floats:
    """Return the measured velocity, or else differences between trusted samples."""
    if run.velocity is not None:
        return np.where(run.trusted, run.velocity, math.nan)
    speed, step = np.full(run.time.size, math.nan), float(np.median(np.diff(run.time)))
    reach = max(1, round(SLOPE * math.tau / w0 / step / 2)) if w0 else 1
    if run.time.size > 2 * reach:
        time, theta = run.time, run.theta
        wide = time[2 * reach :] - time[: -2 * reach]
        good = run.trusted[2 * reach :] & run.trusted[: -2 * reach] & run.trusted[reach:-reach]
        good &= wide < 2 * reach * step * 1.5
        speed[reach:-reach] = np.where(
            good, (theta[2 * reach :] - theta[: -2 * reach]) / wide, math.nan
        )
    return speed


def _in_turn(peaks: Peaks, run: Run) -> Peaks:
    """Return peaks shifted by whole turns to the record; theirs end in the turn of rest."""
    if not len(peaks):
        return peaks
    near = np.interp(peaks.time, run.time, run.theta)
    away = math.tau * np.round(np.median(near - peaks.amplitude) / math.tau)
    return replace(peaks, amplitude=peaks.amplitude + away) if away else peaks
