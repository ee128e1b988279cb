"""Residuals of a fit: spectrum of their noise, residual torque, and its frequencies and times."""
