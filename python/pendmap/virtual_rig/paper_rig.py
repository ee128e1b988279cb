"""A rig like that of Horton, Wiercigroch & Xu (2008): the record behind figures 4 to 7, table 1."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.virtual_rig.drive import Drive
from pendmap.virtual_rig.equation import Equation, Parameters
from pendmap.virtual_rig.integrator import Starts, integrate
from pendmap.virtual_rig.sensor import Sensor

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["OFFSET", "PARAMETERS", "RELEASE", "SENSOR", "paper_decay"]

PARAMETERS: Final = Parameters(w0=6.2, c_over_m=2 * 0.004 * 6.2, friction=0.08)
"""The paper gives no numbers; these have periods and a length of the decay like its figures."""
RELEASE: Final = 3.0
"""Where it is released at rest, rad."""
SECONDS: Final = 86.0
"""Length of the record: it comes to rest before."""
SENSOR: Final = Sensor(rate=100.0, counts=4096, noise=math.radians(0.1))
OFFSET: Final = math.radians(0.05)
"""What the encoder reads at rest, rad."""


def paper_decay(seed: int = 0) -> tuple[Floats, Floats]:
    """Return a free decay as the encoder reads it, from its release until it rests.

    Parameters
    ----------
    seed : int
        Of the noise; 0 or more.

    Returns
    -------
    time, theta : ndarray, shape (N,)
        s and rad.
    """
    none = np.zeros(1)
    starts = Starts(np.zeros(1, int), none, np.array([SECONDS]), np.array([RELEASE]), none)
    equation = Equation(PARAMETERS, Drive.harmonic(none, np.ones(1), none), none, [])
    times = SENSOR.times(SECONDS)
    reading = integrate(equation, starts)[0].angle(times) + OFFSET
    angle, kept = SENSOR.write_down(reading, np.random.default_rng(seed))
    return times[kept], angle[kept]
