"""What the noise of a diagnosis' report is, and where root mean squares do not say all."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.report.document import Name, Paragraph
from pendmap.report.wording import mrad, number

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from pendmap.diagnosis import Discrepancy

    Floats = NDArray[np.float64]

__all__ = ["worth"]

UNEVEN: Final = 1.5
"""Ratio of the noise at high speed to that at low speed from which on it is told."""

LIKE: Final = 1.3
"""Times the noise up to which a root mean square looks like it."""

QUIET: Final = 20
"""Percent of the readings that have the least noise."""


def worth(found: Discrepancy) -> Iterator[Paragraph]:
    """Yield which noise is meant, and why chi-squared may say more than root mean squares."""
    residual, sigma = _weighed(found)
    low, high = (float(end) for end in np.percentile(sigma, (5, 95)))
    uneven = high > UNEVEN * low
    if uneven:
        yield Paragraph(
            (
                (
                    "The noise is that of the readings used, each at its own speed: about "
                    f"{mrad(low)} where they are slow and {mrad(high)} where they are fast. ("
                ),
                Name("pendmap look"),
                " gives one number for a whole record.)",
            )
        )
    yield from _means(found)
    judged, gap = found.judgement, found.gap
    alike = gap.after < LIKE * gap.noise_floor
    if uneven and alike and found.adds and judged.ratio > judged.ratio_allowed:
        still = sigma <= np.percentile(sigma, QUIET)
        yield Paragraph(
            "Root mean squares hang on the fast readings, which have the most noise; chi-squared "
            "takes each residual over the noise at its own speed. Thus chi-squared over degrees of "
            f"freedom is {number(judged.ratio)}, although the residual as a whole is as large as "
            f"the noise: in the fifth of the readings that have the least noise, the residual is "
            f"{mrad(_rms(residual[still]))} and the noise {mrad(_rms(sigma[still]))}."
        )


def _means(found: Discrepancy) -> Iterator[Paragraph]:
    """Yield that readings far denser than the motion were put together."""
    evidence = found.evidence
    for run, k in zip(evidence.fitted, evidence.fitted_of, strict=True):
        size = evidence.runs[k].time.size
        if run.time.size < size:
            yield Paragraph(
                (
                    f"The {size} readings of ",
                    Name(run.name),
                    (
                        f" are denser than the motion needs: {run.time.size} means of them were "
                        "fitted, and the noise above is that of the means. A reading by itself has "
                        f"{mrad(evidence.readings[k].sigma)}."
                    ),
                )
            )


def _weighed(found: Discrepancy) -> tuple[Floats, Floats]:
    """Return residuals of the model that is given out, and their standard errors, rad."""
    residuals, sigmas = [], []
    for run, residual in zip(found.evidence.fitted, found.best.trial.fit.residuals, strict=False):
        good = np.isfinite(residual)
        if run.trusted is not None:
            good &= run.trusted
        sigma = np.broadcast_to(np.asarray(run.sigma, np.float64), residual.shape)
        residuals.append(residual[good])
        sigmas.append(sigma[good])
    return np.concatenate(residuals), np.concatenate(sigmas)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
