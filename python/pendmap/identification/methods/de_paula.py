"""De Paula's method: viscous damping from fast swings, friction from slow ones.

De Paula, Savi & Pereira-Pinto (2006), "Chaos and transient chaos in an experimental nonlinear
pendulum", J. Sound Vib.; the windows of amplitudes are chosen here.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.identification.methods.base import MISFIT, Identification, identified, too_few
from pendmap.identification.methods.combined import CUT
from pendmap.identification.period import frequency
from pendmap.identification.uncertainty import least_squares_line, propagated

if TYPE_CHECKING:
    from pendmap.identification.peaks import Peaks
    from pendmap.signal import Floats


FAST: Final = (CUT, math.radians(90.0))
"""Range of amplitudes in which the decay is assumed to be exponential, rad."""
SLOW: Final = (0.0, CUT)  # Range of amplitudes in which the decay is assumed to be linear, rad
_FEWEST: Final = 3  # Fewest peaks of each window


def from_peaks(
    peaks: Peaks, *, fast: tuple[float, float] = FAST, slow: tuple[float, float] = SLOW
) -> Identification:
    """Identify viscous damping and Coulomb friction separately, each in its own window.

    ``abs(th) ~ exp(-c_over_m t / 2)`` is fitted to fast swings, ``abs(th) ~ -(2 Tr / (pi w0)) t``
    to slow ones, since friction reduces the amplitude by ``2 theta_r`` per half cycle. Each fit
    attributes all damping to its own law, so the result depends on the windows (rad).
    """
    turned = peaks.turned
    size = np.abs(turned.amplitude)
    windows = {"fast": fast, "slow": slow}
    chosen = {n: turned.select((size >= low) & (size < high)) for n, (low, high) in windows.items()}
    lacking = [
        too_few(len(some), _FEWEST, len(turned), _between(windows[name]))
        for name, some in chosen.items()
        if len(some) < _FEWEST
    ]
    if lacking:
        texts = tuple(text for result in lacking for text in result.warnings)
        return Identification(warnings=texts, applicable=False)
    quick, slack = chosen["fast"], chosen["slow"]
    warnings = []
    speed = frequency(
        turned.select((size < max(fast[1], slow[1])) & (size >= min(fast[0], slow[0])))
    )
    relative = np.maximum(quick.stderr_amplitude, 1e-12) / np.abs(quick.amplitude)
    rate, rate_cov, rate_misfit = least_squares_line(
        quick.time, np.log(np.abs(quick.amplitude)), relative
    )
    error = np.maximum(slack.stderr_amplitude, 1e-12)
    fall, fall_cov, fall_misfit = least_squares_line(slack.time, np.abs(slack.amplitude), error)
    for name, misfit in (("exponential", rate_misfit), ("linear", fall_misfit)):
        if misfit > MISFIT and turned.known:
            warnings.append(
                f"the decay is not {name} in the assumed range: chi^2 per degree of freedom "
                f"is {misfit:.3g}; the errors are widened accordingly, but still too small"
            )

    def compute(values: Floats) -> Floats:
        w0, slope, drop = values
        return np.array([w0, -2 * slope, -drop * math.pi * w0 / 2])

    inner = np.array([speed.w0, rate[1], fall[1]])
    errors = np.array([speed.stderr, rate_cov[1, 1] ** 0.5, fall_cov[1, 1] ** 0.5])
    covariance = propagated(compute, inner, errors)
    estimates = compute(inner)
    names = ("w0", "c_over_m", "Tr")
    return identified(
        names,
        estimates,
        covariance,
        used=(
            f"exponential through the {len(quick)} peaks {_between(fast)}, straight line through "
            f"the {len(slack)} {_between(slow)}; times of all of these"
        ),
        warnings=warnings,
    )


def _between(window: tuple[float, float]) -> str:
    low, high = (math.degrees(edge) for edge in window)
    return f"between {low:.3g} and {high:.3g} degrees"
