"""Synthetic residuals: noise of a known spectrum, with a fitted swing subtracted."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np

import pendmap
from pendmap.diagnosis.fitted_model import FittedModel
from pendmap.identification.runs import FitRun

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pendmap.residuals.noise import ResidualNoise

    Floats = NDArray[np.float64]

INTERVAL, W0 = 0.02, 6.0
RUNS, SAMPLES = 4, 800
COUNT = 1.0  # Size of a count: all quantities here are in counts


def swing(samples: int = SAMPLES) -> Floats:
    """Return an orthonormal basis of swings of one frequency, shape (2, samples)."""
    waves = np.exp(1j * W0 * INTERVAL * np.arange(samples))
    return np.asarray(np.linalg.qr(np.column_stack([waves.real, waves.imag]))[0].T, np.float64)


def coloured(
    rng: np.random.Generator, correlation: float, runs: int = RUNS, samples: int = SAMPLES
) -> Floats:
    """Return noise of unit variance, ``x[k] = rho x[k-1] + ...``, shape (runs, samples)."""
    values = rng.standard_normal((runs, samples))
    values[:, 1:] *= np.sqrt(1 - correlation**2)
    for k in range(1, samples):
        values[:, k] += correlation * values[:, k - 1]
    return values


def counted(rng: np.random.Generator, noise: Floats) -> Floats:
    """Return rounded noise in counts about swings of 300 counts, the exact swing subtracted."""
    runs, samples = noise.shape
    phases = W0 * INTERVAL * np.arange(samples) + rng.uniform(0, math.tau, (runs, 1))
    motion = 300 * COUNT * np.sin(phases)
    return np.asarray(COUNT * np.round((motion + noise) / COUNT) - motion, np.float64)


def noise_of(residuals: Floats, floor: float = 0.0, *, fitted: bool = True) -> ResidualNoise:
    """Return the noise beside the swing fitted here; ``floor`` is the variance of rounding."""
    if fitted:
        basis = swing(residuals.shape[1])
        residuals = residuals - residuals @ basis.T @ basis
    return fitted_to(residuals, floor).noise


def fitted_to(residuals: Floats, floor: float = 0.0) -> FittedModel:
    """Return a fit with the given residuals, one run a row."""
    count, samples = residuals.shape
    runs = [FitRun(INTERVAL * np.arange(samples), np.zeros(samples), 1.0) for _ in residuals]
    curve = np.vstack([np.zeros(samples), W0 * swing(samples)[0]])
    fit = SimpleNamespace(
        white=residuals,
        chi2=float(np.sum(residuals**2)),
        names=(),
        curves=[curve] * count,
        windows=[(k, 0, samples, 0.0, 0.0) for k in range(count)],
        estimates={},
        model=pendmap.Rig(w0=W0),
    )
    return FittedModel(fit, (), (), tuple(runs), (floor,) * count)  # type: ignore[arg-type]
