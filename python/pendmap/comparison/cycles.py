"""The paper's figure 7, before and after: what simulated periods and peaks miss of measured ones.

As in the paper each model is run forward from the first measured peak, at rest; nothing is adapted.
Damping that was fitted negative is simulated as it was fitted.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.comparison.further import Reasons, attempted
from pendmap.comparison.replay import Motion, replayed
from pendmap.identification.peaks import find_peaks
from pendmap.identification.runs import FitRun
from pendmap.identification.table1 import errors_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.comparison.data import Evidence
    from pendmap.comparison.replay import Fits
    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.peaks import Peaks
    from pendmap.identification.table1 import PeakErrors

    Floats = NDArray[np.float64]

BEFORE: Final = "before"
AFTER: Final = "after"
"""What the two models are called."""

PER_SWING: Final = 200
"""Instants of a swing between which cubics interpolate a peak: right to 1e-7 of the swing."""

FEWEST: Final = 3
"""Peaks of one full cycle."""


@dataclasses.dataclass(frozen=True)
class Cycles:
    """Periods and peaks of one free run against those of two models.

    Parameters
    ----------
    name : str
        The run.
    held_out : bool
        Whether it was held back whole.
    peaks : Peaks
        As they were measured.
    errors : mapping of str to PeakErrors
        Of the models ``before`` and ``after``; without one that cannot be run from there.
    """

    name: str
    held_out: bool
    peaks: Peaks
    errors: dict[str, PeakErrors]


def cycles_of(evidence: Evidence, base: Fits, best: Fits, reasons: Reasons) -> tuple[Cycles, ...]:
    """Return figure 7 of every free run that has a full cycle, those held out first."""
    found = []
    for k, (run, reading) in enumerate(zip(evidence.runs, evidence.readings, strict=True)):
        if run.kind != "free" or run.accelerometer is not None:  # that angle is only roughly made
            continue
        peaks = find_peaks(run.time, run.theta, sigma=reading.sigma, trusted=run.trusted)
        if len(peaks.turned) < FEWEST:
            continue
        errors = {}
        for name, model in ((BEFORE, base), (AFTER, best)):
            simulated = attempted(
                reasons,
                f"cycles.{run.name}.{name}",
                functools.partial(_simulated, model.fitted, peaks, reading.sigma, run.lab_time_s),
                None,
            )
            if simulated is not None:
                errors[name] = errors_of(name, peaks, *simulated)
        if errors:
            found.append(Cycles(run.name, k not in evidence.fitted_of, peaks, errors))
    return tuple(sorted(found, key=lambda one: not one.held_out))


def _simulated(
    fit: TrajectoryFit, peaks: Peaks, sigma: float, lab_time_s: float
) -> tuple[Floats, Floats]:
    """Return times and angles of a model's peaks from the first measured one on."""
    turned = peaks.turned
    first, amplitude = float(turned.time[0]), float(turned.amplitude[0])
    until = 1.2 * (float(turned.time[-1]) - first) + 5.0
    swing = math.tau / fit.model.w0
    time = first + np.linspace(0.0, until, math.ceil(PER_SWING * until / swing) + 1)
    run = FitRun(time, np.zeros(time.shape), sigma, lab_time_s=lab_time_s)
    # The sensor's errors stand between the angle and its reading; they change slowly with it.
    start = amplitude
    for _ in range(2):
        ((readings, curve),) = replayed(Motion.of(fit), [run], [(start, 0.0)])
        start += amplitude - float(readings[0])
    return _peaks(time, readings, curve)


def _peaks(time: Floats, readings: Floats, curve: Floats) -> tuple[Floats, Floats]:
    """Return times and readings at the turns of a curve, the start and the stop among them."""
    theta, velocity = curve
    before, after = velocity[1:-1], velocity[2:]
    turns = np.flatnonzero((before * after < 0) | ((before != 0) & (after == 0))) + 1
    step, bottom = np.diff(time)[turns], theta[turns]
    # Where the derivative of Hermite's cubic through both ends is 0.
    rise = theta[turns + 1] - bottom
    v, w = step * velocity[turns], step * velocity[turns + 1]
    a, b = 3 * (v + w - 2 * rise), 2 * (3 * rise - 2 * v - w)
    half = -0.5 * (b + np.copysign(np.sqrt(np.maximum(b * b - 4 * a * v, 0.0)), b))
    with np.errstate(divide="ignore", invalid="ignore"):
        roots = np.stack([v / half, half / a])
    # The velocity changes its sign once between the two: one root lies there.
    inside = (roots >= 0) & (roots <= 1)
    x = np.where(inside[0], roots[0], np.where(inside[1], roots[1], 1.0))
    angle = bottom + x * (v + x * (b / 2 + x * a / 3))
    errors = readings - theta
    zero = errors[turns] + x * (errors[turns + 1] - errors[turns])
    return (
        np.concatenate([time[:1], time[turns] + x * step]),
        np.concatenate([readings[:1], angle + zero]),
    )
