"""The residuals of a fit: their spectra, and the noise in them with its colour."""

from pendmap.residuals.noise import Remainder, remainder_of

__all__ = ["Remainder", "remainder_of"]
