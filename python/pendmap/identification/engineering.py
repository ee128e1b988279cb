"""Numbers of the trade from identified parameters: frequency, damping, Q, dead band, torques."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import Estimate, estimate_text, interval
from pendmap.identification.parameters import PLACES
from pendmap.identification.uncertainty import jacobian
from pendmap.signal.robust import Z95

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pendmap.identification.results import Parameters
    from pendmap.signal import Floats

DRAG: Final = "quadratic_drag.q"
QUANTITIES: Final[dict[str, tuple[str, str, str]]] = {
    "frequency_hz": ("Hz", "f = {} Hz", "frequency of small swings"),
    "period_s": ("s", "period {} s", "period of small swings"),
    "zeta": ("1", "viscous: zeta = {}", "damping ratio of the viscous damping alone"),
    "log_decrement": ("1", "log decrement {}", "logarithmic decrement by viscous damping alone"),
    "time_constant_s": ("s", "time constant {} s", "1/e time by viscous damping alone"),
    "Q": ("1", "Q = {} at {:.3g} rad, of all losses", "quality factor at q_amplitude_rad"),
    "dead_band_rad": ("rad", "dead band {} rad", "angle to which friction holds the pendulum"),
    "dead_band_deg": ("degrees", "{} degrees", "the same angle"),
    "friction_n_m": ("N m", "friction {} N m", "torque of the Coulomb friction"),
    "viscous_n_m_s": ("N m s", "viscous {} N m s", "torque of the viscous damping per velocity"),
}
"""Unit, text and meaning of each quantity."""
LINES: Final = ((0, 2), (2, 5), (5, 8), (8, 10))  # Quantities of each line of text
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)


def swing_amplitude(curve: Floats, w0: float) -> Floats:
    """Return the amplitude of swings with the energy of angle and velocity, shape (2, n), rad.

    Of a rotation it is above pi.
    """
    theta, velocity = curve
    energy = 1 - np.cos(theta) + 0.5 * (velocity / w0) ** 2
    swing = np.arccos(np.clip(1 - energy, -1, 1))
    above = energy > 2  # noqa: PLR2004 (of the inverted pendulum at rest)
    return np.asarray(np.where(above, math.pi * np.sqrt(energy / 2), swing), np.float64)


def quantities(
    result: Parameters, amplitude: float, known: Mapping[str, float], gravity: float
) -> dict[str, Estimate]:
    """Return the finite QUANTITIES of a result with errors; Q at an amplitude, rad.

    Errors are by the delta method. A parameter that is held at the end of its interval moves one
    end of the interval of what depends on it, which then has no standard error.
    """
    given = {n: e for n, e in result.parameters.items() if n in (*PLACES, DRAG)}
    names = [name for name in ("w0", "c_over_m", "Tr", DRAG) if name in given]
    values = np.array([given[name].value for name in names])
    errors = np.array([given[name].stderr or 0.0 for name in names])
    effects = {name.partition(".")[0] for name in result.parameters if "." in name}
    others = effects - {DRAG.partition(".")[0]}
    if any(result.definition(name).group == "damping" for name in others):
        amplitude = math.nan

    def computed(row: Floats) -> Floats:
        p = dict(zip(names, row.tolist(), strict=True))
        # Of a mass whose centre is at a length from the pivot, or of a bob on a light rod.
        length = known.get("length", known.get("length_m", math.nan))
        pendulum = known.get("mass", math.nan) * gravity * length / p["w0"] ** 2
        return _computed(p, amplitude, known.get("inertia", pendulum))

    covariance = np.diag(errors**2)
    if result.joint_covariance is not None and {*names} <= {*result.joint_covariance[0]}:
        every, matrix = result.joint_covariance
        places = [[*every].index(name) for name in names]
        covariance = np.where(np.outer(errors, errors) > 0, matrix[np.ix_(places, places)], 0.0)
    with np.errstate(all="ignore"):
        best, slopes = computed(values), jacobian(computed, values, errors / 10)
        error = np.sqrt(np.diag(slopes @ covariance @ slopes.T))
        down, up = -Z95 * error, Z95 * error
        for k, name in enumerate(names):
            if given[name].stderr is None and (ends := given[name].ci95) is not None:
                moved = computed(np.where(np.arange(len(names)) == k, ends[1], values)) - best
                down, up = down + np.minimum(moved, 0), up + np.maximum(moved, 0)
    made = {}
    for name, *row in zip(QUANTITIES, *np.stack([best, error, down, up]).tolist(), strict=True):
        value, stderr, low, high = row
        known_error = low < high and math.isfinite(high - low)
        if math.isfinite(value):
            made[name] = Estimate(
                value,
                stderr if known_error and low == -high else None,
                (value + low, value + high) if known_error else None,
            )
    return made


def _computed(p: Mapping[str, float], amplitude: float, inertia: float) -> Floats:
    """Return the QUANTITIES of parameters in SI, nan where one is missing.

    A swing of amplitude ``A`` has the energy ``E = w0^2 (1 - cos A)`` per moment of inertia and the
    velocity ``v^2 = 2 w0^2 (cos theta - cos A)``. A cycle loses four times the integral of ``c/m v
    + Tr + q v^2`` from 0 to A. ``Q = 2 pi E / loss`` is ``w0 m / c`` of viscous damping alone at
    small swings.
    """
    w0, c = p["w0"], p.get("c_over_m", math.nan)
    friction, drag = p.get("Tr", 0.0), p.get(DRAG, 0.0)
    zeta = c / (2 * w0)
    # theta = A sin s, which the velocity is smooth in
    phase = math.pi / 4 * (NODES + 1)
    angle, width = amplitude * np.sin(phase), amplitude * np.cos(phase) * math.pi / 4
    speed = w0 * np.sqrt(2 * np.maximum(np.cos(angle) - math.cos(amplitude), 0.0))
    loss = 4 * float(np.sum(WEIGHTS * width * (c * speed + friction + drag * speed**2)))
    dead = float(np.arcsin(p.get("Tr", math.nan) / w0**2))
    return np.array(
        [
            w0 / math.tau,
            math.tau / w0,
            zeta,
            math.tau * float(zeta / np.sqrt(1 - zeta**2)),
            float(np.divide(2.0, c)),
            float(np.divide(math.tau * w0**2 * (1 - math.cos(amplitude)), loss)),
            dead,
            math.degrees(dead),
            inertia * p.get("Tr", math.nan),
            inertia * c,
        ]
    )


def lines_of(known: Mapping[str, Estimate], amplitude: float) -> Iterator[str]:
    """Yield lines of text with quantities; Q is at an amplitude, rad."""
    texts = {}
    for name in QUANTITIES.keys() & known.keys():
        one, text = known[name], estimate_text(known[name])
        if one.stderr is None and one.ci95 is not None and one.ci95[0] < one.value:
            text = f"{text} {interval(one)}"
        texts[name] = QUANTITIES[name][1].format(text, amplitude)
    for first, end in LINES:
        if line := ", ".join(texts[name] for name in [*QUANTITIES][first:end] if name in texts):
            yield line
