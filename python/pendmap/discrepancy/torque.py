"""Where a model fails: the torque that it lacks, over angle, velocity, amplitude, phase and time.

What a model reads too little, ``e(t)``, obeys for a small lack of torque ``u`` (rad/s^2)

``e'' + c_over_m e' + w0^2 (1 + a) cos(theta) e = u``.

Multiplied by a bump ``phi(t) = (1 - s^2)^6``, ``s`` from -1 to 1 over ``WIDTH`` of a small swing,
and integrated by parts, no derivative of the readings is left:

``int phi u dt = int (phi'' - c_over_m phi' + w0^2 (1 + a) cos(theta) phi) e dt``.

References
----------
Messenger & Bortz (2021), Multiscale Modeling and Simulation 19, 1474, for the weak form.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.discrepancy.evidence import Evidence
    from pendmap.discrepancy.trial import Trial

    Floats = NDArray[np.float64]

__all__ = ["OVER", "Torque", "binned", "residual_torque", "standing_out"]

WIDTH: Final = 0.6
"""Width of a bump in periods of small swings."""

POWER: Final = 6
"""Of the bump: so smooth at its ends that sampling adds no error."""

OVER: Final = {
    "angle": "rad",
    "velocity": "rad/s",
    "amplitude": "rad",
    "drive_phase": "rad",
    "lab_time": "s",
}
"""What the torque is shown over, and the units."""

BINS: Final = 12
"""Bins with equally many values."""

STANDS_OUT: Final = 4.0
"""Standard errors from which a bin stands out: of sixty, none does by chance."""

FEWEST: Final = 3
"""Values in a bin."""


@dataclasses.dataclass(frozen=True)
class Torque:
    """What a model lacks, per moment of inertia.

    Parameters
    ----------
    torque, stderr : ndarray of float, shape (n,)
        rad/s^2, each over a bump.
    over : mapping of str to ndarray of float, shape (n,)
        Angle (rad, within half a turn), velocity (rad/s), amplitude (rad: of the swing with that
        energy, pi and more in rotation), phase of the drive (rad; no numbers in free runs) and time
        in the laboratory (s) in the middle of the bumps.
    run : ndarray of int, shape (n,)
        Which run.
    """

    torque: Floats
    stderr: Floats
    over: dict[str, Floats]
    run: NDArray[np.int64]


def residual_torque(evidence: Evidence, trial: Trial) -> Torque:
    """Return the torque that a fitted model lacks in the runs that it was fitted to.

    Parameters
    ----------
    evidence : Evidence
        The records.
    trial : Trial
        The model.
    """
    parts = [p for w in trial.fit.windows if (p := _of_window(evidence, trial, w)) is not None]
    if not parts:
        empty = np.zeros(0)
        return Torque(empty, empty, dict.fromkeys(OVER, empty), np.zeros(0, np.int64))
    return Torque(
        np.concatenate([p.torque for p in parts]),
        np.concatenate([p.stderr for p in parts]),
        {name: np.concatenate([p.over[name] for p in parts]) for name in OVER},
        np.concatenate([p.run for p in parts]),
    )


def _of_window(
    evidence: Evidence, trial: Trial, window: tuple[int, int, int, float, float]
) -> Torque | None:
    run, first, last = window[:3]
    record, model = evidence.fitted[run], trial.fit.model
    time = record.time[first:last]
    interval = float(np.median(np.diff(time))) if time.size > 1 else math.inf
    half = round(WIDTH * math.pi / (model.w0 * interval)) if math.isfinite(interval) else 0
    if half < POWER or time.size < 2 * half + 1:
        return None
    theta, velocity = (row[first:last] for row in trial.fit.curves[run])
    residual = trial.fit.residuals[run][first:last]
    good = np.isfinite(residual)
    if record.trusted is not None:
        good &= record.trusted[first:last]
    sigma = np.broadcast_to(np.asarray(record.sigma, np.float64), record.time.shape)[first:last]
    drive = record.drive or {}
    omega = float(drive.get("Omega") or 0.0)
    phase = drive.get("phi")
    own = f"phi[{run}]" if f"phi[{run}]" in trial.fit.estimates else "phi"
    offset = trial.fit[own] if phase is None and own in trial.fit.estimates else float(phase or 0.0)
    turned = omega * time + offset
    pull = model.w0**2 * (1 + float(drive.get("p") or 0.0) * np.cos(turned)) * np.cos(theta)
    s = np.arange(-half, half + 1) / (half + 1)
    span = (half + 1) * interval
    bump = (1 - s**2) ** POWER
    slope = -2 * POWER * s * (1 - s**2) ** (POWER - 1) / span
    bend = (
        -2 * POWER * (1 - s**2) ** (POWER - 1)
        + 4 * POWER * (POWER - 1) * s**2 * (1 - s**2) ** (POWER - 2)
    ) / span**2
    fixed = bend - (trial.fit["c_over_m"] if "c_over_m" in trial.fit.estimates else 0.0) * slope
    middle = np.arange(half, time.size - half, half)
    around = middle[:, None] + np.arange(-half, half + 1)
    kernel = (fixed + pull[around] * bump) / float(np.sum(bump))
    whole = good[around].all(axis=1) & (time[around[:, -1]] - time[around[:, 0]] < 1.5 * 2 * span)
    middle, around, kernel = middle[whole], around[whole], kernel[whole]
    energy = 1 - np.cos(theta[middle]) + 0.5 * (velocity[middle] / model.w0) ** 2
    turning = energy > 2  # noqa: PLR2004 (that of the upright rest)
    amplitude = np.where(
        turning, math.pi * np.sqrt(energy / 2), np.arccos(np.clip(1 - energy, -1, 1))
    )
    return Torque(
        np.sum(kernel * residual[around], axis=1),
        np.sqrt(np.sum((kernel * sigma[around]) ** 2, axis=1)),
        {
            "angle": np.angle(np.exp(1j * theta[middle])),
            "velocity": velocity[middle],
            "amplitude": amplitude,
            "drive_phase": np.angle(np.exp(1j * turned[middle]))
            if record.drive
            else np.full(middle.size, math.nan),
            "lab_time": record.lab_time_s + time[middle],
        },
        np.full(middle.size, run),
    )


def binned(torque: Torque, over: str, *, signed: bool = False) -> list[dict[str, Any]]:
    """Return the mean torque in bins with equally many values.

    Parameters
    ----------
    torque : Torque
        As of :func:`residual_torque`.
    over : str
        One of :data:`OVER`.
    signed : bool
        Whether torque along the motion is meant: positive where it drives.
    """
    place, values = torque.over[over], torque.torque
    if signed:
        values = values * np.sign(torque.over["velocity"])
    known = np.isfinite(place)
    place, values, weight = place[known], values[known], 1 / torque.stderr[known] ** 2
    if place.size < BINS * FEWEST:
        return []
    edges = np.quantile(place, np.linspace(0, 1, BINS + 1))
    which = np.clip(np.searchsorted(edges, place, side="right") - 1, 0, BINS - 1)
    rows = []
    for k in range(BINS):
        own = which == k
        if np.count_nonzero(own) < FEWEST:
            continue
        total = float(np.sum(weight[own]))
        mean = float(np.sum(weight[own] * values[own])) / total
        # Neighbouring bumps overlap by half: each says about two thirds of its own.
        error = 1.5**0.5 / math.sqrt(total)
        rows.append(
            {
                "over": over,
                "unit": OVER[over],
                "along_motion": signed,
                "from": float(edges[k]),
                "to": float(edges[k + 1]),
                "torque": mean,
                "stderr": error,
                "z": mean / error,
            }
        )
    return rows


def standing_out(torque: Torque) -> list[dict[str, Any]]:
    """Return the bins in which the torque stands out of the noise, the clearest first.

    Over amplitude and laboratory time it is the torque along the motion, over angle, velocity and
    drive phase the torque itself.
    """
    rows = []
    for over in OVER:
        rows += binned(torque, over, signed=over in {"amplitude", "lab_time"})
    return sorted((r for r in rows if abs(r["z"]) > STANDS_OUT), key=lambda r: -abs(r["z"]))
