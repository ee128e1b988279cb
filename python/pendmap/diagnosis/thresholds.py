"""Thresholds of the diagnosis: every number that decides, in one place."""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True)
class Thresholds:
    """Numbers that decide a diagnosis.

    ``benchmarks/blind/thresholds.py`` halves and doubles each of them and counts how many verdicts
    change; the table is in ``docs/diagnose.md``.

    Parameters
    ----------
    chance : float
        Probability that noise alone gains as much as an effect, times the number of candidates and
        that of the effect's shapes, below which the effect is accepted.
    rest : float
        Probability that noise alone leaves as much as a model leaves, below which the model lacks
        something.
    alike : float
        Twice the difference of log-likelihoods, in independent readings, up to which two models are
        not told apart.
    closes : float
        Share of the squared gap above the noise that effects close at least where the model with
        them still lacks something: each to be accepted, all together to be named ``partial``.
    loss : float
        Rise of the sum of squares on a held-out set, in independent readings, up to which an effect
        is accepted.
    singles, pairs : int
        Candidates, and pairs of candidates, that are fitted at each step of the search.
    rivals : int
        Candidates that are fitted in the place of an accepted effect.
    worth : float
        Share of an effect's gain that the score of a rival promises at least to be fitted.
    shapes : int
        Shapes of a candidate from which its fit starts.
    short : float
        Share of the gain that the score promises below which a fit starts again from the score's
        full step.
    forecast : float
        Sum of squares per reading held out, over that per reading fitted or over that of the model
        without an effect, above which a model does not foretell what it was not fitted to.
    sure : float
        Probability of a name below which it is given with reserve.
    """

    chance: float = 1e-3
    rest: float = 1e-3
    alike: float = 10.0
    closes: float = 1 / 3
    loss: float = 4.0
    singles: int = 4
    pairs: int = 2
    rivals: int = 4
    worth: float = 0.5
    shapes: int = 3
    short: float = 0.8
    forecast: float = 1.3
    sure: float = 0.9
