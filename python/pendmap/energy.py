"""The mechanical energy of the pendulum."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap.model.units import VELOCITY, Units

if TYPE_CHECKING:
    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]

__all__ = ["FORMULA", "energy"]

FORMULA = "(dtheta/dtau)^2 / 2 + 1 - cos(theta), over m g l"
"""As attributes of datasets say it."""


def energy(theta: Floats, velocity: Floats, attributes: Any) -> Floats:  # noqa: ANN401 (a mapping)
    """Return ``E / (m g l) = v^2 / 2 + 1 - cos theta``, ``v = d theta / d tau``.

    Kinetic energy about the pivot, seen from it, and potential energy at rest gravity: 0 hanging at
    rest, 2 at rest upside down. Without drive, damping and torque it stays what it is; drive and
    effects change it. ``m g l = m l^2 w0^2`` is its unit in all units.

    Parameters
    ----------
    theta, velocity : ndarray, shape (N,)
        Angle in rad, velocity in the units of the dataset.
    attributes : mapping
        The attributes of the dataset, which tell its units.
    """
    speed = Units.of(attributes).bare(velocity, VELOCITY)
    found: Floats = 0.5 * speed**2 + 1.0 - np.cos(theta)
    return found
