"""Spectra of residuals, window by window, put together run by run.

By the cosine transform, which asks of a window no period; where its frequencies are many they are
put into bins, narrow against any noise's colour.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun

    Floats = NDArray[np.float64]

BINS: Final = 256
"""Bins of frequency, from 0 to half the rate of sampling."""

PHASES: Final = np.pi * (np.arange(BINS) + 0.5) / BINS
"""Phase, rad, that an oscillation at the middle of each bin passes from sample to sample."""

HARMONICS: Final = 4.0
"""What a model lacks shows up to so many times the frequency of swing or rotation."""

GAP: Final = 1.5
"""Noise is read from so many times that frequency on."""

WIDEST: Final = 0.4
"""Part of all frequencies that counts as slow at most."""

STATES: Final = 2
"""Numbers that each window has adapted for itself: angle and velocity where it begins."""

LEAST: Final = 8
"""Samples of a window that a spectrum is taken of."""


@dataclasses.dataclass(frozen=True)
class Spectra:
    """Residuals of all runs by frequency.

    Parameters
    ----------
    slow, quick : ndarray of float, shape (runs, BINS)
        Squared amplitudes added up in each bin, in units of the readings' standard errors: where a
        model's error would show, and where noise is alone. White noise of the stated size has 1
        for each amplitude.
    slow_sizes, quick_sizes : ndarray of float, shape (runs, BINS)
        How many amplitudes those are.
    motion : ndarray of float, shape (runs, BINS)
        Share of each bin in the velocity's slow part, times the samples, window by window: what
        parameters do to the readings is where the motion is.
    states : ndarray of float, shape (runs,)
        How many initial states were adapted.
    independent : float
        Independent readings, see :class:`pendmap.residuals.noise.Remainder`.
    """

    slow: Floats
    quick: Floats
    slow_sizes: Floats
    quick_sizes: Floats
    motion: Floats
    states: Floats
    independent: float

    @property
    def mean(self) -> float:
        """Mean squared amplitude of all."""
        sizes = self.slow_sizes.sum() + self.quick_sizes.sum()
        return float((self.slow.sum() + self.quick.sum()) / sizes)


def spectra_of(fit: TrajectoryFit, runs: Sequence[FitRun]) -> Spectra:
    """Return the spectra of what a fit leaves."""
    from scipy.fft import dct  # noqa: PLC0415 (where it is needed)

    slow, quick, slow_sizes, quick_sizes, motion = np.zeros((5, len(runs), BINS))
    states = np.zeros(len(runs))
    total, fourth = 0.0, 0.0
    for run, first, last, *_ in fit.windows:
        record = runs[run]
        residual = fit.white[run][first:last]
        good = np.isfinite(residual)
        if record.trusted is not None:
            good &= record.trusted[first:last]
        if np.count_nonzero(good) < LEAST:
            continue
        time = record.time[first:last][good]
        velocity = fit.curves[run][1][first:last][good]
        # A rotation's angle is a ramp, its velocity is not.
        rows = np.stack([residual[good], velocity - velocity.mean()])
        power, moved = np.asarray(dct(rows, type=2, norm="ortho"), np.float64) ** 2
        total, fourth = total + float(power.sum()), fourth + float(power @ power)
        swing = max(
            fit["w0"] if "w0" in fit.estimates else fit.model.w0,
            float(np.quantile(np.abs(velocity), 0.9)),
        )
        edge = min(HARMONICS * swing * float(np.median(np.diff(time))), WIDEST * np.pi)
        phase = np.pi * np.arange(time.size) / time.size
        place = np.minimum((phase / np.pi * BINS).astype(int), BINS - 1)
        below, above = phase <= edge, phase >= GAP * edge
        for chosen, sums, sizes in ((below, slow, slow_sizes), (above, quick, quick_sizes)):
            sums[run] += np.bincount(place[chosen], power[chosen], BINS)
            sizes[run] += np.bincount(place[chosen], minlength=BINS)
        moved = moved[below] if moved[below].any() else np.ones(np.count_nonzero(below))
        motion[run] += np.bincount(place[below], time.size * moved / moved.sum(), BINS)
        states[run] += STATES
    independent = 3 * total**2 / fourth if fourth > 0 else 1.0
    return Spectra(slow, quick, slow_sizes, quick_sizes, motion, states, independent)
