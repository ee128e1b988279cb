"""Numbers of the trade from identified parameters: frequency, damping, Q, dead band, torques."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import estimate_text, interval
from pendmap.identification.parameters import OPPOSING
from pendmap.identification.peaks import viscous_work
from pendmap.identification.uncertainty import computed_from
from pendmap.model.labels import QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pendmap.formatting import Estimate
    from pendmap.identification.results import Parameters
    from pendmap.signal import Floats

DRAG: Final = "quadratic_drag.q"
LINES: Final = ((0, 2), (2, 5), (5, 8), (8, 10))  # Quantities of each line of text


def swing_amplitude(curve: Floats, w0: float) -> Floats:
    """Return amplitudes, rad, at the energy of angle and velocity, (2, n); rotations: above pi."""
    theta, velocity = curve
    energy = 1 - np.cos(theta) + 0.5 * (velocity / w0) ** 2
    swing = np.arccos(np.clip(1 - energy, -1, 1))
    above = energy > 2  # noqa: PLR2004 (of the inverted pendulum at rest)
    return np.asarray(np.where(above, math.pi * np.sqrt(energy / 2), swing), np.float64)


def quantities(
    result: Parameters, amplitude: float, known: Mapping[str, float], gravity: float
) -> dict[str, Estimate]:
    """Return the finite QUANTITIES of a result with errors; Q at an amplitude, rad.

    A swing of amplitude ``A`` has the energy ``E = w0^2 (1 - cos A)`` per moment of inertia and the
    velocity ``v^2 = 2 w0^2 (cos theta - cos A)``. A cycle loses four times the integral of ``c/m v
    + Tr + q v^2`` from 0 to A. ``Q = 2 pi E / loss`` is ``w0 m / c`` of viscous damping alone at
    small swings.
    """
    given = {n: e for n, e in result.parameters.items() if n in ("w0", *OPPOSING, DRAG)}
    effects = {name.partition(".")[0] for name in result.parameters if "." in name}
    others = effects - {DRAG.partition(".")[0]}
    if any(result.definition(name).group == "damping" for name in others):
        amplitude = math.nan
    # Of a mass whose centre is at a length from the pivot, or of a bob on a light rod.
    length = known.get("length", known.get("length_m", math.nan))
    moment = known.get("mass", math.nan) * gravity * length
    fall, sine = 1 - math.cos(amplitude), math.sin(amplitude)
    work = float(viscous_work(np.array(amplitude)))

    def computed(p: dict[str, float]) -> dict[str, float]:
        w0, c, friction = p["w0"], p.get("c_over_m", math.nan), p.get("Tr", math.nan)
        zeta, dead = c / (2 * w0), float(np.arcsin(friction / w0**2))
        loss = 2 * c * w0 * work + 4 * amplitude * p.get("Tr", 0.0)
        loss += 8 * p.get(DRAG, 0.0) * w0**2 * (sine - amplitude * (1 - fall))
        inertia = known.get("inertia", moment / w0**2)
        values = (
            w0 / math.tau,
            math.tau / w0,
            zeta,
            math.tau * float(zeta / np.sqrt(1 - zeta**2)),
            float(np.divide(2.0, c)),
            float(np.divide(math.tau * w0**2 * fall, loss)),
            dead,
            math.degrees(dead),
            inertia * friction,
            inertia * c,
        )
        return dict(zip(QUANTITIES, values, strict=True))

    return computed_from(given, result.joint_covariance, computed)


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
