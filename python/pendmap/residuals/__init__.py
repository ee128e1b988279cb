"""Residuals of a fit: their noise with its colour, the torque that they lack, and its times."""

from pendmap.residuals.noise import ResidualNoise, estimate_noise

__all__ = ["ResidualNoise", "estimate_noise"]
