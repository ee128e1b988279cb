"""Residuals of a fit: spectrum of their noise, residual torque, and its frequencies and times."""

from pendmap.residuals.noise import ResidualNoise, estimate_noise

__all__ = ["ResidualNoise", "estimate_noise"]
