"""Residual torque of a model against angle, velocity, amplitude, drive phase and time.

A small torque ``u(s)`` per moment of inertia that the model lacks changes the readings, to first
order (variation of constants), by

``e(t) = int_0^t (b(t) a(s) - a(t) b(s)) / W(s) u(s) ds``,   ``W = a b' - a' b``,

with the derivatives ``a`` and ``b`` of the angle by the initial angle and velocity. A constant
torque in one bin of the angle thus has a column of the Jacobian like a parameter, computed with two
cumulative integrals. Bins of all quantities are fitted jointly, orthogonal to the model's
parameters and initial states. Records hardly determine combinations of bins that are like the
model's own terms, so the least-squares part of these is taken out of the bins of each quantity: the
result is the torque that the model's own terms cannot represent.
Its effect accumulates over a record, so torques far below the noise of second differences are seen.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from scipy.fft import dct

from pendmap.identification.engineering import swing_amplitude
from pendmap.identification.methods.trajectory import DRAG
from pendmap.identification.sensitivity import window_slopes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun
    from pendmap.identification.sensitivity import WindowSlopes
    from pendmap.residuals.noise import ResidualNoise
    from pendmap.signal import Floats


OVER: Final = {
    "angle": ("an", "angle", "rad"),
    "velocity": ("a", "velocity", "rad/s"),
    "amplitude": ("an", "amplitude", "rad"),
    "drive_phase": ("a", "phase of the drive", "rad"),
    "lab_time": ("a", "time in the laboratory", "s"),
}
"""Quantities against which the torque is computed: article and name in texts, and unit."""
ALONG: Final = ("amplitude", "lab_time")
"""Quantities with the torque along the motion, positive if it adds energy."""
ROW: Final = ("from", "to", "torque", "stderr")  # Keys of the numbers of a bin
BINS: Final = 10  # Number of bins of a quantity, with equally many samples each
STANDS_OUT: Final = 4.0  # Standard errors above which a bin is significant; 0.3 % for fifty bins
BLIND: Final = 1e-5
"""Information of a combination of bins, over the greatest, below which it is undetermined."""
LOST: Final = 1e-6  # ``W`` over its greatest below which the integrand is set to 0
ROUNDING: Final = 1e-9  # Entry of a projector that is 0 but for rounding


@dataclasses.dataclass(frozen=True)
class Torque:
    """Residual torque of a model, in bins of each quantity."""

    noise: ResidualNoise  # Noise of the model's residuals
    # Rows of bins by quantity: ``from`` and ``to``, ``torque`` and ``stderr`` in rad/s^2, their
    # ratio ``z``, and whether it is along the motion. Empty if the quantity is not in the records.
    rows: dict[str, list[dict[str, Any]]] = dataclasses.field(
        default_factory=lambda: {name: [] for name in OVER}
    )
    # Decrease of the sum of squares with a quantity's torques, and number of combinations of bins.
    gains: dict[str, tuple[float, int]] = dataclasses.field(default_factory=dict)

    @property
    def chance(self) -> float:
        """Probability that noise alone gives such a gain for any quantity (Bonferroni)."""
        gains = [(gain, count) for gain, count in self.gains.values() if count]
        tails = [self.noise.chance_of(gain, count) for gain, count in gains]
        return min(min(tails, default=1.0) * max(len(tails), 1), 1.0)


def residual_torque(runs: Sequence[FitRun], fit: TrajectoryFit, noise: ResidualNoise) -> Torque:
    """Return the residual torque of a model in the runs to which it is fitted."""
    # Derivatives also at samples without weight.
    whole = [dataclasses.replace(run, trusted=None) for run in runs]
    windows = window_slopes(fit, whole, (), fit.model)[1]
    places = [_places(runs[w.run], fit, w) for w in windows]
    edges: dict[str, Floats] = {}
    for name in OVER:
        values = np.concatenate([place[name] for place in places])
        if np.isfinite(values).any():
            edge = np.unique(np.nanquantile(values, np.linspace(0, 1, BINS + 1)))
            if edge.size > 2:  # noqa: PLR2004 (two bins at least)
                edges[name] = edge
    binned = [_binned(place, edges) for place in places]
    columns = [responses(runs[w.run], w, bins) for w, bins in zip(windows, binned, strict=True)]
    drag = any(effect.name == DRAG for effect in fit.model.effects)
    further, residual = project_out(runs, windows, columns)
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in OVER}
    gains: dict[str, tuple[float, int]] = {}
    torques, covariance, _ = _solved(further, residual)
    # The noise level is at least the sum of squares over the effective number of readings.
    power = dct(residual - further @ torques, norm="ortho") ** 2
    level = float(np.sum(power**2)) / (3 * float(power.sum())) if power.any() else 0.0
    covariance *= max(noise.level, level)
    every, first = np.concatenate(binned), 0
    for name, edge in edges.items():
        lows, highs = edge[:-1], edge[1:]
        part = slice(first, first + lows.size)
        gains[name] = _solved(further[:, part], residual)[2]
        rest = _without_own(name, every[:, part], places, drag=drag)
        errors = np.sqrt(np.maximum(np.diag(rest @ covariance[part, part] @ rest), 0.0))
        values = np.stack((lows, highs, rest @ torques[part], errors), axis=1).tolist()
        about: dict[str, Any] = {"over": name, "unit": OVER[name][2], "along_motion": name in ALONG}
        for ends_and_torque in values:
            row = about | dict(zip(ROW, ends_and_torque, strict=True))
            rows[name].append(row | {"z": row["torque"] / row["stderr"] if row["stderr"] else 0.0})
        first = part.stop
    return Torque(noise, rows, gains)


def project_out(
    runs: Sequence[FitRun], windows: Sequence[WindowSlopes], columns: Sequence[Floats]
) -> tuple[Floats, Floats]:
    """Return columns and residuals orthogonal to parameters and states; excluded samples are 0."""
    parts = []
    for window, part in zip(windows, columns, strict=True):
        lost = ~runs[window.run].counted[window.first : window.first + len(window.residual)]
        for values in (part, window.columns, window.states, window.residual):
            values[lost] = 0.0
        parts.append(window.freed(part))
    base, further, residual = (np.concatenate([p[k] for p in parts]) for k in range(3))
    sizes = np.linalg.norm(base, axis=0)
    u, s, _ = np.linalg.svd(base[:, sizes > 0] / sizes[sizes > 0], full_matrices=False)
    u = u[:, s > BLIND * s[0]] if s.size else u
    return further - u @ (u.T @ further), residual - u @ (u.T @ residual)


def outstanding_bins(torque: Torque) -> list[dict[str, Any]]:
    """Return the bins with a significant torque, the most significant first."""
    rows = [row for rows in torque.rows.values() for row in rows if abs(row["z"]) > STANDS_OUT]
    return sorted(rows, key=lambda row: -abs(row["z"]))


def _places(run: FitRun, fit: TrajectoryFit, window: WindowSlopes) -> dict[str, Floats]:
    """Return the quantities of OVER at each sample of a window."""
    part = slice(window.first, window.first + len(window.residual))
    theta, velocity = curve = fit.curves[window.run][:, part]
    phase = np.full(theta.shape, math.nan)
    drive = fit.drive_of(run, window.run)
    if drive:
        turned = (drive.get("Omega") or 0.0) * run.time[part] + (drive["phi"] or 0.0)
        phase = np.angle(np.exp(1j * turned))
    return {
        "angle": np.angle(np.exp(1j * theta)),
        "velocity": velocity,
        "amplitude": swing_amplitude(curve, fit.model.w0),
        "drive_phase": phase,
        "lab_time": run.lab_time_s + run.time[part],
    }


def _without_own(
    name: str, bins: Floats, places: Sequence[dict[str, Floats]], *, drag: bool
) -> Floats:
    """Return the projector of a quantity's bins that takes out the model's own terms.

    They are means in the bins: of ``sin`` and ``cos`` over the angle (``w0``, the sensor's zero), a
    constant over the drive's phase, and else ``v``, ``sign v``, with ``drag`` also ``v |v|``.
    """
    speed, angle = (np.concatenate([one[key] for one in places]) for key in ("velocity", "angle"))
    terms = [speed, np.sign(speed), *([speed * np.abs(speed)] if drag else [])]
    if name == "angle":
        terms = [np.sin(angle), np.cos(angle)]
    elif name == "drive_phase":
        terms = [np.ones(speed.size)]
    means = bins.T @ np.stack(terms, axis=1) / np.maximum(np.sum(bins**2, axis=0), 1.0)[:, None]
    means /= np.maximum(np.linalg.norm(means, axis=0), 1e-300)
    rest = np.eye(len(means)) - means @ np.linalg.pinv(means)
    return np.where(np.abs(rest) < ROUNDING, 0.0, rest)


def _binned(place: dict[str, Floats], edges: dict[str, Floats]) -> Floats:
    """Return a column for each bin with a torque of 1 rad/s^2 in it."""
    torques = []
    for name, edge in edges.items():
        which = np.clip(np.searchsorted(edge, place[name], side="right") - 1, 0, edge.size - 2)
        weight = np.sign(place["velocity"]) if name in ALONG else np.ones(which.size)
        weight = np.where(np.isfinite(place[name]), weight, 0.0)
        torques += [np.where(which == k, weight, 0.0) for k in range(edge.size - 1)]
    return np.stack(torques, axis=1)


def responses(run: FitRun, window: WindowSlopes, torques: Floats) -> Floats:
    """Return the response of a window's readings to torques, over standard errors, shape (n, k).

    ``torques`` are per moment of inertia at the window's samples, rad/s^2, shape (n, k). The
    readings of a gyroscope are the derivative of ``e``.
    """
    part = slice(window.first, window.first + len(window.residual))
    time = run.time[part]
    if time.size < 3:  # noqa: PLR2004 (no slope)
        return np.zeros(torques.shape)
    weight = window.weight
    read = (window.states / np.where(weight > 0, weight, 1.0)[:, None]).T
    a, b = read
    if run.rod_sensor is not None:
        rises = 0.5 * (read[:, 1:] + read[:, :-1]) * np.diff(time) / run.rod_sensor.rate
        a, b = np.cumsum(np.column_stack([[1.0, 0.0], rises]), axis=1)
    wronskian = a * np.gradient(b, time) - np.gradient(a, time) * b
    sound = np.abs(wronskian) > LOST * float(np.max(np.abs(wronskian)))
    inverse = np.where(sound, 1.0 / np.where(sound, wronskian, 1.0), 0.0)
    steps = np.diff(time, append=time[-1:])[:, None]

    def integral(kernel: Floats) -> Floats:
        rate = (kernel * inverse)[:, None] * torques
        summed = np.cumsum(steps * rate, axis=0)
        return np.asarray(summed - 0.5 * steps * rate, np.float64)

    response = read[1][:, None] * integral(a) - read[0][:, None] * integral(b)
    return np.asarray(response * weight[:, None], np.float64)


def _solved(columns: Floats, residual: Floats) -> tuple[Floats, Floats, tuple[float, int]]:
    """Return torques of least norm, covariance for noise 1, fall of the squares, and rank."""
    gram = columns.T @ columns
    scale = np.sqrt(np.diag(gram))
    scale[scale == 0] = 1.0
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    known = values > BLIND * max(float(values[-1]), 1e-300)
    spread = vectors[:, known] / np.sqrt(values[known])
    inverse = (spread @ spread.T) / np.outer(scale, scale)
    pull = columns.T @ residual
    torque = inverse @ pull
    return torque, inverse, (float(pull @ torque), int(np.count_nonzero(known)))
