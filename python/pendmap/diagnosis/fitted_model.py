"""A model fitted to the evidence."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.diagnosis.candidates import placed
from pendmap.identification.fit import TrajectoryFit, fit_runs
from pendmap.identification.valley import nearer
from pendmap.residuals.noise import Remainder, remainder_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pendmap.comparison.data import Evidence
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.identification.runs import FitRun
    from pendmap.model import Rig

Windows = tuple[tuple[int, int, int, float, float], ...]

MOST_STEPS: Final = 40
"""Steps of a fit at most."""

QUICK: Final = 4.0
"""By so much windows grow from stage to stage ..."""

GENTLE: Final = 1.5
"""... and by so much where what comes out decides, or was lost as they grew by more."""

LITTLE: Final = 0.05
"""Of a sum of squares: far below what decides between candidates."""

LEAST_LEVEL: Final = 0.5
"""Noise counts for at least this part of the variance that its readings are stated to have."""

EXACT: Final = 1e-3
"""Part of an independent reading that the last step of a converged fit promises."""

FEW_STEPS: Final = 12
"""Steps of a candidate's fit at most: what is right arrives in five, what is wrong creeps."""

SIZED_STEPS: Final = 5
"""The same of a size alone, before its shape is fitted with it."""

NEAR_STEPS: Final = 6
"""The same where an exponent has been moved, and all else is nearly where it belongs."""


@dataclasses.dataclass(frozen=True)
class Trial:
    """A model fitted to the evidence."""

    fit: TrajectoryFit  # To the runs that are not held back
    free: tuple[str, ...]  # What was fitted, as in fit_runs
    chosen: tuple[Candidate, ...]  # The effects that were added to the baseline
    runs: tuple[FitRun, ...]  # What it was fitted to
    floors: tuple[float, ...]  # Share of rounding in the variance of each run's noise
    # Coefficients that were negative and are held at 0; a larger model frees them again.
    zeroed: tuple[str, ...] = ()

    @functools.cached_property
    def remainder(self) -> Remainder:
        """What it leaves."""
        return remainder_of(self.fit, self.runs, len(self.fit.names), self.floors)

    @property
    def widening(self) -> float:
        """By how much variances exceed the fit's: coloured or strong noise, or what is left."""
        return max(self.remainder.level, self.chi2 / max(self.fit.degrees, 1), 1.0)

    @functools.cached_property
    def level(self) -> float:
        """By what sums of squares are divided to count independent readings.

        The greater one of the noise's spectral density where the motion is, and of the sum of
        squares over the number of independent readings among the residuals.
        """
        rest = self.remainder
        return max(rest.level, self.chi2 / max(rest.independent, 1.0), LEAST_LEVEL)

    @property
    def chi2(self) -> float:
        """The sum of squared residuals over standard errors, or of deviances of counts."""
        return self.fit.chi2

    @property
    def names(self) -> tuple[str, ...]:
        """The effects that were added."""
        return tuple(candidate.name for candidate in self.chosen)

    @property
    def start(self) -> dict[str, float]:
        """Where another fit may begin: damping may be negative there, as in no model."""
        return _values(self.fit)

    def start_without(self, names: Sequence[str]) -> dict[str, float]:
        """Return where a fit starts in which some parameters are 0.

        The others move by what the covariance says, so that the motion stays as near as it can.
        """
        start = self.start
        places = [self.fit.names.index(name) for name in names if name in self.fit.names]
        own = self.fit.covariance[np.ix_(places, places)]
        column = self.fit.covariance[:, places]
        if places and np.isfinite(self.fit.covariance).all() and np.linalg.matrix_rank(own):
            values = np.array([start[self.fit.names[k]] for k in places])
            moved = column @ (np.linalg.pinv(own, hermitian=True) @ values)
            start |= {n: start[n] - m for n, m in zip(self.fit.names, moved, strict=True)}
        return {name: value for name, value in start.items() if name not in names}

    def shape_of(self, candidate: Candidate) -> dict[str, float]:
        """Return an effect's shape as it was fitted, without dimensions."""
        model = self.fit.model
        bare = {e.name: e.bare(model.units).parameters for e in model.effects}
        return {name: bare[candidate.name][name] for name in candidate.shape}

    @property
    def adapted(self) -> int:
        """How many numbers were adapted to the records.

        Shapes that were scanned are among them, and what is held at 0.
        """
        free = set(self.free)
        scanned = sum(c.count - len(free & {*c.free, *c.adapted}) for c in self.chosen)
        return len(self.fit.names) + len(self.zeroed) + scanned


def fitted(  # noqa: PLR0913 (the evidence, the model, where to begin)
    evidence: Evidence,
    model: Rig,
    free: Sequence[str],
    chosen: Sequence[Candidate] = (),
    *,
    start: Mapping[str, float] | None = None,
    windows: Windows | None = None,
    steps: int = MOST_STEPS,
    least_gain: float = 1e-3,
    growth: float = QUICK,
    zeroed: Sequence[str] = (),
    target: float = math.inf,
) -> Trial:
    """Fit a model to the evidence.

    ``zeroed`` are coefficients held at 0; the last arguments are those of
    :func:`pendmap.identification.fit.fit_runs`.
    """
    fit = fit_runs(
        evidence.fitted,
        model,
        free,
        start=start,
        windows=windows,
        profiled=(),
        steps=steps,
        least_gain=least_gain,
        growth=growth,
        target=target,
    )
    return Trial(fit, tuple(free), tuple(chosen), evidence.fitted, evidence.floors, tuple(zeroed))


def settled(evidence: Evidence, trial: Trial, level: float) -> Trial:
    """Return a fit that has converged; that of a candidate ends after a few steps."""
    if trial.fit.converged:
        return trial
    return fitted(
        evidence,
        trial.fit.model,
        trial.free,
        trial.chosen,
        start=trial.start,
        windows=trial.fit.windows,
        least_gain=EXACT * level,
        zeroed=trial.zeroed,
    )


def with_candidates(  # noqa: PLR0913 (what to fit, and from where)
    evidence: Evidence,
    trial: Trial,
    added: Sequence[Candidate],
    start: Mapping[str, float],
    *,
    level: float,
    short: bool = False,
) -> Trial:
    """Fit a trial's model with further effects, from the trial's parameters and windows on.

    Coefficients that the trial holds at 0 are free again. Steps that promise a small part of
    ``level``, one independent reading, are not taken. ``short`` starts from short windows, where
    the trial's lead astray.
    """
    model = placed(trial.fit.model, added)
    free = [*trial.free, *trial.zeroed, *(name for c in added for name in c.free)]
    shapes = [name for c in added for name in c.adapted]
    begin = dict.fromkeys(trial.zeroed, 0.0) | trial.start | dict(start)
    windows = None if short else trial.fit.windows
    least = LITTLE * level
    if shapes and not short:
        # A shape means nothing before its effect has a size.
        steps = FEW_STEPS if any(c.exponents for c in added) else SIZED_STEPS
        sized = fitted(
            evidence, model, free, start=begin, windows=windows, steps=steps, least_gain=least
        )
        near = _near_exponents(evidence, sized, added, least)
        # An exponent's start is the model's; it sets the unit of its size.
        model, begin, windows = near.model, _values(near), near.windows
    return fitted(
        evidence,
        model,
        [*free, *shapes],
        (*trial.chosen, *added),
        start=begin,
        windows=windows,
        steps=FEW_STEPS,
        least_gain=least,
    )


def _near_exponents(
    evidence: Evidence, sized: Trial, added: Sequence[Candidate], least: float
) -> TrajectoryFit:
    """Return a fit with candidates' sizes, whose exponents are brought near their best."""

    def again(model: Rig, start: Mapping[str, float], before: TrajectoryFit) -> TrajectoryFit:
        return fitted(
            evidence,
            model,
            sized.free,
            start=start,
            windows=before.windows,
            steps=NEAR_STEPS,
            least_gain=least,
        ).fit

    fit = sized.fit
    for candidate in added:
        for size, exponent in candidate.exponents.items():
            fit = nearer(fit, evidence.fitted, size, exponent, again)
    return fit


def _values(fit: TrajectoryFit) -> dict[str, float]:
    return {name: estimate.value for name, estimate in fit.estimates.items()}
