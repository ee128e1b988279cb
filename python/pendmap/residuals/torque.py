"""Where a model fails: the torque that it lacks, over angle, velocity, amplitude, phase and time.

A small torque ``u(s)`` per inertia that the model lacks moves its readings, to first order, by

``e(t) = int_0^t (b(t) a(s) - a(t) b(s)) / W(s) u(s) ds``,   ``W = a b' - a' b``,

where ``a`` and ``b`` are the derivatives of the angle by the initial angle and velocity, which a
fit has anyhow (variation of constants). A torque that is constant while the pendulum is in one bin
of the angle, say, so has a column like any parameter, at the price of two running integrals; the
torques of all bins are fitted together, with what the parameters and the initial states can follow
taken off. Since an error adds up over a record, this sees torques far below what second differences
of the readings show. The bins of angle, velocity, amplitude, phase and time are fitted together
too: what one of them explains is no artefact of another.

What is shown is therefore the torque beyond what the model's own terms could take up.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.identification.sensitivity import window_slopes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun
    from pendmap.identification.sensitivity import WindowSlopes
    from pendmap.residuals.noise import Remainder

    Floats = NDArray[np.float64]

OVER: Final = {
    "angle": "rad",
    "velocity": "rad/s",
    "amplitude": "rad",
    "drive_phase": "rad",
    "lab_time": "s",
}
"""What the torque is shown over, and the units."""

ALONG: Final = ("amplitude", "lab_time")
"""Over these it is the torque along the motion, positive where it drives: of the torque itself as
much goes one way as the other."""

BINS: Final = 10
"""Bins with equally many samples."""

STANDS_OUT: Final = 4.0
"""Standard errors from which a bin stands out: of fifty, none does by chance."""

BLIND: Final = 1e-5
"""A combination of bins with this part of the greatest information is taken for unseen."""

LOST: Final = 1e-6
"""Where ``W`` has fallen to this part of its start the motion has forgotten how it began."""


@dataclasses.dataclass(frozen=True)
class Torque:
    """The torque that a model lacks."""

    # For each of OVER a row a bin: ``from`` and ``to``, ``torque`` and ``stderr`` in rad/s^2, ``z``
    # their ratio, whether it is the torque along the motion. Empty where the records do not show
    # it.
    rows: dict[str, list[dict[str, Any]]]
    # For each what the sum of squares falls by if the torques of all its bins are added to the
    # model, and how many numbers that is.
    gains: dict[str, tuple[float, int]]
    remainder: Remainder  # What the model leaves, and with it the noise

    @classmethod
    def unknown(cls, remainder: Remainder) -> Torque:
        """Return that of a model of which it cannot be computed."""
        return cls({name: [] for name in OVER}, {}, remainder)

    @property
    def chance(self) -> float:
        """The chance that noise alone gains so much: the least of all, times how many there are."""
        gains = [(gain, count) for gain, count in self.gains.values() if count]
        tails = [self.remainder.chance_of(gain, count) for gain, count in gains]
        return min(min(tails, default=1.0) * max(len(tails), 1), 1.0)


def residual_torque(runs: Sequence[FitRun], fit: TrajectoryFit, remainder: Remainder) -> Torque:
    """Return the torque that a fitted model lacks in the runs that it was fitted to."""
    windows, places = windows_of(runs, fit)
    names = [name for name in OVER if any(np.isfinite(p[name]).any() for p in places)]
    edges = {
        name: np.unique(
            np.nanquantile(np.concatenate([p[name] for p in places]), np.linspace(0, 1, BINS + 1))
        )
        for name in names
    }
    names = [name for name in names if edges[name].size > 2]  # noqa: PLR2004 (two bins at least)
    columns = [
        responses(runs[window.run], window, _binned(place, {n: edges[n] for n in names}))
        for window, place in zip(windows, places, strict=True)
    ]
    further, residual = freed(runs, windows, columns)
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in OVER}
    gains: dict[str, tuple[float, int]] = {}
    joint = _solved(further, residual)
    # Errors are those of what the bins together leave.
    wide = math.sqrt(max(remainder.level, _level(residual - further @ joint.torque)))
    first = 0
    for name in names:
        last = first + edges[name].size - 1
        own = _solved(further[:, first:last], residual)
        gains[name] = (own.gain, own.rank)
        torque, errors = joint.torque[first:last], wide * joint.errors[first:last]
        found[name] = [
            {
                "over": name,
                "unit": OVER[name],
                "along_motion": name in ALONG,
                "from": float(edges[name][k]),
                "to": float(edges[name][k + 1]),
                "torque": float(torque[k]),
                "stderr": float(errors[k]),
                "z": float(torque[k] / errors[k]) if errors[k] > 0 else 0.0,
            }
            for k in range(torque.size)
        ]
        first = last
    return Torque(found, gains, remainder)


def _level(residual: Floats) -> float:
    """Return the sum of squares over the number of independent readings among residuals."""
    from scipy.fft import dct  # noqa: PLC0415 (where it is needed)

    power = dct(residual, norm="ortho") ** 2
    total = float(power.sum())
    return float(np.sum(power**2)) / (3 * total) if total > 0 else 0.0


def windows_of(
    runs: Sequence[FitRun], fit: TrajectoryFit
) -> tuple[list[WindowSlopes], list[dict[str, Floats]]]:
    """Return the derivatives of a fit window by window, and where the motion is at each sample.

    All samples have them: integrals run through those that do not count.
    """
    whole = [dataclasses.replace(run, trusted=None) for run in runs]
    _, windows = window_slopes(fit, whole, (), fit.model)
    return windows, [_places(runs[w.run], fit, w) for w in windows]


def freed(
    runs: Sequence[FitRun], windows: Sequence[WindowSlopes], columns: Sequence[Floats]
) -> tuple[Floats, Floats]:
    """Return columns and residuals, what parameters and initial states can follow taken off.

    Samples that do not count are left out, also of ``windows``.
    """
    parts = []
    for window, own in zip(windows, columns, strict=True):
        run = runs[window.run]
        if run.trusted is not None:
            lost = ~run.trusted[window.first : window.first + len(window.residual)]
            for values in (own, window.columns, window.states, window.residual):
                values[lost] = 0.0
        parts.append(window.freed(own))
    base, further, residual = (np.concatenate([p[k] for p in parts]) for k in range(3))
    sizes = np.linalg.norm(base, axis=0)
    u, s, _ = np.linalg.svd(base[:, sizes > 0] / sizes[sizes > 0], full_matrices=False)
    u = u[:, s > BLIND * s[0]] if s.size else u
    return further - u @ (u.T @ further), residual - u @ (u.T @ residual)


def standing_out(torque: Torque) -> list[dict[str, Any]]:
    """Return the bins in which a torque stands out of the noise, the clearest first."""
    rows = [row for rows in torque.rows.values() for row in rows if abs(row["z"]) > STANDS_OUT]
    return sorted(rows, key=lambda row: -abs(row["z"]))


def _places(run: FitRun, fit: TrajectoryFit, window: WindowSlopes) -> dict[str, Floats]:
    """Return where the motion is at each sample of a window."""
    own = slice(window.first, window.first + len(window.residual))
    theta, velocity = (row[own] for row in fit.curves[window.run])
    energy = 1 - np.cos(theta) + 0.5 * (velocity / fit.model.w0) ** 2
    amplitude = np.where(
        energy > 2,  # noqa: PLR2004 (that of the upright rest)
        math.pi * np.sqrt(energy / 2),
        np.arccos(np.clip(1 - energy, -1, 1)),
    )
    phase = np.full(theta.shape, math.nan)
    if run.drive:
        names = (f"phi[{window.run}]", "phi")
        fitted = next((fit[n] for n in names if n in fit.estimates), 0.0)
        known = run.drive.get("phi")
        turned = float(run.drive.get("Omega") or 0.0) * run.time[own]
        phase = np.angle(np.exp(1j * (turned + (fitted if known is None else known))))
    return {
        "angle": np.angle(np.exp(1j * theta)),
        "velocity": velocity,
        "amplitude": amplitude,
        "drive_phase": phase,
        "lab_time": run.lab_time_s + run.time[own],
    }


def _binned(place: dict[str, Floats], edges: dict[str, Floats]) -> Floats:
    """Return a torque of 1 rad/s^2 in each bin, by columns."""
    torques = []
    for name, edge in edges.items():
        which = np.clip(np.searchsorted(edge, place[name], side="right") - 1, 0, edge.size - 2)
        weight = np.sign(place["velocity"]) if name in ALONG else np.ones(which.size)
        weight = np.where(np.isfinite(place[name]), weight, 0.0)
        torques += [np.where(which == k, weight, 0.0) for k in range(edge.size - 1)]
    return np.stack(torques, axis=1)


def responses(run: FitRun, window: WindowSlopes, torques: Floats) -> Floats:
    """Return what torques do to the readings of a window, over their standard errors.

    Torques per moment of inertia at the window's samples, rad/s^2; both have the shape (n, k).
    """
    own = slice(window.first, window.first + len(window.residual))
    time = run.time[own]
    if time.size < 3:  # noqa: PLR2004 (no slope)
        return np.zeros(torques.shape)
    weight = window.weight
    a, b = (window.states / np.where(weight > 0, weight, 1.0)[:, None]).T
    wronskian = a * np.gradient(b, time) - np.gradient(a, time) * b
    sound = np.abs(wronskian) > LOST * float(np.max(np.abs(wronskian)))
    inverse = np.where(sound, 1.0 / np.where(sound, wronskian, 1.0), 0.0)
    steps = np.diff(time, append=time[-1:])[:, None]

    def integral(kernel: Floats) -> Floats:
        rate = (kernel * inverse)[:, None] * torques
        summed = np.cumsum(steps * rate, axis=0)
        return np.asarray(summed - 0.5 * steps * rate, np.float64)

    response = b[:, None] * integral(a) - a[:, None] * integral(b)
    return np.asarray(response * weight[:, None], np.float64)


@dataclasses.dataclass(frozen=True)
class _Solution:
    """Torques of bins that are fitted together, their errors for noise of 1, and what they gain."""

    torque: Floats
    errors: Floats
    gain: float
    rank: int


def _solved(columns: Floats, residual: Floats) -> _Solution:
    """Return the torques of bins that explain residuals best, those of least size where many do."""
    gram = columns.T @ columns
    scale = np.sqrt(np.diag(gram))
    scale[scale == 0] = 1.0
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    seen = values > BLIND * max(float(values[-1]), 1e-300)
    spread = vectors[:, seen] / np.sqrt(values[seen])
    inverse = (spread @ spread.T) / np.outer(scale, scale)
    pull = columns.T @ residual
    torque = inverse @ pull
    errors = np.sqrt(np.maximum(np.diag(inverse), 0.0))
    return _Solution(torque, errors, float(pull @ torque), int(np.count_nonzero(seen)))
