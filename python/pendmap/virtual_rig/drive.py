"""The pivot's motion that is meant, and that acts."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["Drive"]


@dataclasses.dataclass(frozen=True)
class Drive:
    """Acceleration of the pivot over g in each of R runs.

    Upward: ``a(t) = p cos(psi) + p_second cos(2 psi + phi_second)`` with the phase
    ``psi = Omega t + chirp t**2 / 2 + phi``; toward positive angles
    ``p_lateral cos(psi + phi_lateral)``.

    Parameters
    ----------
    p, frequency, phase, chirp, p_second, phi_second, p_lateral, phi_lateral : array, shape (R,)
        ``p`` and its like without unit and 0 in a free run, ``frequency`` (Omega) in rad/s,
        phases in rad, ``chirp`` in rad/s^2.
    """

    p: Floats
    frequency: Floats
    phase: Floats
    chirp: Floats
    p_second: Floats
    phi_second: Floats
    p_lateral: Floats
    phi_lateral: Floats

    @classmethod
    def harmonic(cls, p: Floats, frequency: Floats, phase: Floats) -> Drive:
        """Return the drive that is meant: ``p cos(Omega t + phi)`` upward."""
        none = np.zeros_like(p)
        return cls(p, frequency, phase, none, none, none, none, none)

    def at(self, run: NDArray[np.intp], time: Floats) -> tuple[Floats | float, Floats | float]:
        """Return upward and lateral acceleration over g, each of shape (L, K).

        Parameters
        ----------
        run : array of int, shape (L, 1)
            Which run each lane belongs to.
        time : array, shape (L, K)
            Time since that run began, s.
        """
        if not self.p.any():
            return 0.0, 0.0
        psi = (self.frequency[run] + self.chirp[run] * time / 2) * time + self.phase[run]
        upward = self.p[run] * np.cos(psi)
        if self.p_second.any():
            upward = upward + self.p_second[run] * np.cos(2 * psi + self.phi_second[run])
        if not self.p_lateral.any():
            return upward, 0.0
        return upward, self.p_lateral[run] * np.cos(psi + self.phi_lateral[run])
