"""Thresholds of all decisions of the diagnosis."""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True)
class Thresholds:
    """Decision thresholds of a diagnosis.

    ``benchmarks/blind/thresholds.py`` halves and doubles each of them and counts how many verdicts
    change; the table is in ``docs/records/diagnose.md``.

    Examples
    --------
    >>> from pendmap.diagnosis import Thresholds
    >>> Thresholds(chance=1e-4).chance
    0.0001
    """

    # Probability that noise alone gains as much, times the numbers of candidates and of the
    # effect's shapes, below which an effect is accepted.
    chance: float = 1e-3
    rest: float = 1e-3  # Probability of residuals by noise alone below which a model is incomplete
    # Twice the difference of log-likelihoods, in independent readings, up to which two models are
    # indistinguishable.
    alike: float = 10.0
    # Share of the squared gap above the noise that effects must close if they leave a part of it:
    # each to be accepted, all together for the verdict ``partial``.
    closes: float = 1 / 3
    # Rise of the sum of squares on a held-out set, in independent readings, up to which an effect
    # is accepted.
    loss: float = 4.0
    singles: int = 4  # Candidates that are fitted at each step of the search
    pairs: int = 2  # Pairs of candidates that are fitted at each step of the search
    rivals: int = 4  # Candidates that are fitted in the place of an accepted effect
    worth: float = 0.5  # Share of an effect's gain that the score of a replacement must promise
    shapes: int = 3  # Shapes of a candidate from which its fit starts
    short: float = 0.8  # Share of the promised gain below which a fit restarts at the full step
    # Sum of squares per reading held out, over that per reading fitted or over that of the model
    # without an effect, above which a model fails to predict.
    forecast: float = 1.3
    sure: float = 0.9  # Probability of a name below which it is reported with reserve
