"""Scores of all candidates at a fit, without fitting any: linear algebra on sensitivities.

With the residuals ``r`` and the derivatives ``x`` of the readings by a candidate's size and phase,
all over the standard errors and with what the fitted parameters and initial states can follow taken
off, the sum of squares falls by

``G = r' x (x' x)^-1 x' r``

when the candidate is fitted (Rao's score test). The same matrix says how alike candidates are, which
pairs belong together, and how weak an effect the records could show.

References
----------
Rao (1948), Proceedings of the Cambridge Philosophical Society 44, 50.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.discrepancy.candidates import place
from pendmap.identification.sensitivity import sensitivities

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pendmap.discrepancy.candidates import Candidate
    from pendmap.discrepancy.evidence import Evidence
    from pendmap.discrepancy.trial import Trial

    Floats = NDArray[np.float64]

__all__ = ["Score", "Scores", "scores_of"]

UNSEEN: Final = 1e-4
"""A candidate of which the fitted parameters follow all but this part (of the root of its
information) does nothing of its own: rounding and the integrator's error are not far below."""


@dataclasses.dataclass(frozen=True)
class Score:
    """A candidate's score.

    Parameters
    ----------
    candidate : Candidate
        Effect and shape.
    gain : float
        ``G``: by which the sum of squares is expected to fall.
    start : mapping of str to float
        Size and phase where it is expected to be least, SI.
    information : float
        ``x' x`` of the size: a size ``a`` gains ``a^2`` times this; of an effect with a phase at the
        phase where it is least. 0 where the records do not show the effect at all.
    """

    candidate: Candidate
    gain: float
    start: dict[str, float]
    information: float


@dataclasses.dataclass(frozen=True)
class Scores:
    """Scores of all candidates in all shapes at one fit.

    Parameters
    ----------
    scores : tuple of Score
        One for each candidate and shape.
    columns : tuple of ndarray of float, shape (n, 1 or 2)
        For each the orthonormal directions in which it moves the readings.
    residual : ndarray of float, shape (n,)
        What is left to explain.
    run : ndarray of int, shape (n,)
        Which run each reading is of.
    """

    scores: tuple[Score, ...]
    columns: tuple[Floats, ...]
    residual: Floats
    run: NDArray[np.int64]

    def best(self) -> list[int]:
        """Return the places of each effect's best shape, the greatest gain first."""
        chosen: dict[str, int] = {}
        for k, score in enumerate(self.scores):
            name = score.candidate.name
            if name not in chosen or score.gain > self.scores[chosen[name]].gain:
                chosen[name] = k
        return sorted(chosen.values(), key=lambda k: -self.scores[k].gain)

    def together(self, places: Sequence[int]) -> float:
        """Return the gain expected of several candidates at once."""
        joint = np.hstack([self.columns[k] for k in places])
        q, r = np.linalg.qr(joint)
        sound = np.abs(np.diag(r)) > UNSEEN
        return float(np.sum((q[:, sound].T @ self.residual) ** 2))

    def likeness(self, one: int, other: int) -> float:
        """Return the cosine of the angle between what two candidates do to the readings.

        The largest canonical correlation: 1 where the one can do all that the other does.
        """
        a, b = self.columns[one], self.columns[other]
        if not (a.size and b.size):
            return 0.0
        return float(np.linalg.norm(a.T @ b, 2))

    def pairs(self, places: Sequence[int]) -> list[tuple[float, int, int]]:
        """Return the joint gains of all pairs among some candidates, the greatest first."""
        found = [(self.together([a, b]), a, b) for a, b in itertools.combinations(places, 2)]
        return sorted(found, reverse=True)


def scores_of(
    evidence: Evidence, trial: Trial, pool: Sequence[Sequence[Candidate]]
) -> Scores:
    """Return the scores of candidates at a fit.

    Parameters
    ----------
    evidence : Evidence
        The records.
    trial : Trial
        The fit.
    pool : sequence of sequence of Candidate
        By effect, each in its shapes; shapes of different effects are scored together.
    """
    scores: list[Score] = []
    columns: list[Floats] = []
    residual, run = np.zeros(0), np.zeros(0, np.int64)
    for batch in itertools.zip_longest(*pool):
        present = [candidate for candidate in batch if candidate is not None]
        model = trial.fit.model
        for candidate in present:
            model = place(model, candidate)
        names = [name for candidate in present for name in candidate.free]
        found = sensitivities(trial.fit, evidence.fitted, names, model)
        old = [k for k, name in enumerate(found.names) if name in trial.fit.estimates]
        base = _orthonormal(found.columns[:, old])
        residual = found.residual - base @ (base.T @ found.residual)
        run = found.run
        for candidate in present:
            where = [found.names.index(name) for name in candidate.free]
            raw = found.columns[:, where]
            score, basis = _scored(candidate, raw, base, residual, trial)
            scores.append(score)
            columns.append(basis)
    return Scores(tuple(scores), tuple(columns), residual, run)


def _scored(
    candidate: Candidate, raw: Floats, base: Floats, residual: Floats, trial: Trial
) -> tuple[Score, Floats]:
    sizes = np.linalg.norm(raw, axis=0)
    seen = raw - base @ (base.T @ raw)
    # Twice is enough: what rounding left of the base the first time is gone.
    seen -= base @ (base.T @ seen)
    kept = np.linalg.norm(seen, axis=0)
    if not np.all(sizes > 0) or np.all(kept < UNSEEN * sizes):
        return Score(candidate, 0.0, {}, 0.0), np.zeros((len(raw), 0))
    q, r = np.linalg.qr(seen / sizes)
    sound = np.abs(np.diag(r)) > UNSEEN
    basis = q[:, sound]
    gain = float(np.sum((basis.T @ residual) ** 2))
    solved = np.linalg.lstsq(seen / sizes, residual, rcond=UNSEEN)[0] / sizes
    start = {candidate.free[0]: float(solved[0])}
    if candidate.phase is not None:
        effect = candidate.effect(trial.fit.model.units)
        faint = effect.parameters[candidate.size]
        quadrature = float(solved[1]) * faint
        start = {
            candidate.free[0]: math.hypot(solved[0], quadrature),
            candidate.free[1]: math.atan2(quadrature, solved[0]),
        }
        seen[:, 1] /= faint
    information = float(np.linalg.eigvalsh(seen.T @ seen)[0])
    return Score(candidate, gain, start, max(information, 0.0)), np.asarray(basis, np.float64)


def _orthonormal(columns: Floats) -> Floats:
    sizes = np.linalg.norm(columns, axis=0)
    kept = columns[:, sizes > 0]
    if not kept.size:
        return np.zeros((len(columns), 0))
    u, s, _ = np.linalg.svd(kept / sizes[sizes > 0], full_matrices=False)
    return np.asarray(u[:, s > 1e-7 * s[0]], np.float64)  # noqa: PLR2004 (a direction that is none)
