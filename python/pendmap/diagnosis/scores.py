"""Scores of all candidates at a fit, without fitting any: linear algebra on sensitivities.

With the residuals ``r`` and the derivatives ``x`` of the readings by a candidate's size and phase,
all over the standard errors and orthogonal to the fitted parameters and initial states, the sum of
squares falls by

``G = r' x (x' x)^-1 x' r``

when the candidate is fitted (Rao's score test). The same matrix gives the likeness of candidates,
the scores of pairs, and the detection limits.

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

from pendmap.diagnosis.candidates import add_candidates
from pendmap.identification.sensitivity import (
    STATE,
    WindowSlopes,
    freed_together,
    lengths,
    window_slopes,
)
from pendmap.residuals.times import calm_responses, frequencies, instants

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.comparison.data import DataSplit
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import FittedModel
    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun
    from pendmap.model import Rig
    from pendmap.signal import Floats

PASS: Final = 16  # Directions of derivatives in one pass of the integrator

CONTAINS: Final = 0.99
"""Cosine between the responses to two effects above which the one with more parameters has the
other as a special case."""

SAME: Final = 1e-6
"""Deficit of the cosine from 1 below which two candidates are one effect under two names."""

UNSEEN: Final = 1e-4
"""Norm of a response orthogonal to the fitted parameters, over its whole norm, below which a
candidate is undetectable; rounding and the integrator's error are not far below."""


@dataclasses.dataclass(frozen=True)
class Score:
    """A candidate's score."""

    candidate: Candidate  # Effect and shape
    gain: float  # ``G``, the expected fall of the sum of squares
    start: dict[str, float]  # Size and phase of the expected minimum, SI
    # ``x' x`` of the size: a size ``a`` gains ``a^2`` times this, at the least favourable phase; 0
    # if the effect is undetectable.
    information: float


@dataclasses.dataclass(frozen=True)
class Scores:
    """Scores of all candidates in all shapes at one fit."""

    scores: tuple[Score, ...]  # One for each candidate and shape
    columns: tuple[list[int], ...]  # Columns of each in ``gram`` and ``pull``
    gram: Floats  # Products of unit responses; rows of zeros for undetectable ones
    pull: Floats  # Products of unit responses with the residuals

    @classmethod
    def of_none(cls) -> Scores:
        """Return scores without any candidate."""
        return cls((), (), np.zeros((0, 0)), np.zeros(0))

    def name(self, place: int) -> str:
        """Return the name of the effect at a place."""
        return self.scores[place].candidate.name

    def best(self) -> list[int]:
        """Return the place of each effect's best shape, the greatest gain first."""
        chosen: dict[str, int] = {}
        for k, score in enumerate(self.scores):
            name = score.candidate.name
            if name not in chosen or score.gain > self.scores[chosen[name]].gain:
                chosen[name] = k
        return sorted(chosen.values(), key=lambda k: -self.scores[k].gain)

    def together(self, places: Sequence[int]) -> float:
        """Return the expected gain of several candidates together."""
        columns = [c for k in places for c in self.columns[k]]
        return _gain(self.gram[np.ix_(columns, columns)], self.pull[columns])

    def likeness(self, one: int, other: int) -> float:
        """Return the largest canonical correlation between the responses to two candidates."""
        a, b = self.columns[one], self.columns[other]
        left = _root_inverse(self.gram[np.ix_(a, a)])
        right = _root_inverse(self.gram[np.ix_(b, b)])
        return float(np.linalg.norm(left @ self.gram[np.ix_(a, b)] @ right, 2))

    def same(self, one: int, other: int) -> bool:
        """Return whether two candidates are one effect under two names."""
        shaped = self.scores[one].candidate.shape or self.scores[other].candidate.shape
        alike = len(self.columns[one]) == len(self.columns[other])
        return not shaped and alike and self.likeness(one, other) > 1 - SAME


def score_candidates(
    data: DataSplit, fitted: FittedModel, pool: Sequence[Sequence[Candidate]]
) -> Scores:
    """Return the scores of candidates at a fit; ``pool`` has the shapes of each effect."""
    room = max(PASS - len({name.partition("[")[0] for name in fitted.fit.names}) - STATE, 1)
    sought = [shapes for shapes in pool if shapes[0].sought]
    passes = _passes([shapes for shapes in pool if not shapes[0].sought], room) or [[]]
    names, windows = candidate_slopes(fitted.fit, data.fitted, passes)
    # Frequencies and instants come from the residuals.
    later = _passes(_located(data, sought, windows, fitted.fit.model), room)
    if later:
        _, windows = candidate_slopes(fitted.fit, data.fitted, later, windows)
    every = [candidate for present in (*passes, *later) for candidate in present]
    if not every:
        return Scores.of_none()
    together = freed_together((), windows)
    base, residual = _orthonormal(together.columns[:, : len(names)]), together.residual
    columns = together.columns[:, len(names) :]
    residual = residual - base @ (base.T @ residual)
    sizes = lengths(columns)
    columns /= np.where(sizes > 0, sizes, 1.0)
    # The second pass removes the rounding errors of the first.
    for _ in range(2):
        columns -= base @ (base.T @ columns)
    gram, pull = columns.T @ columns, columns.T @ residual
    unseen = np.sqrt(np.diag(gram)) < UNSEEN
    gram[unseen], gram[:, unseen], pull[unseen] = 0.0, 0.0, 0.0
    units = np.where(unseen, 1.0, np.sqrt(np.diag(gram)))
    gram, pull, sizes = gram / np.outer(units, units), pull / units, sizes * units
    scores, where, left = [], [], iter(range(pull.size))
    for candidate in every:
        indices = list(itertools.islice(left, len(candidate.free)))
        where.append(indices)
        faint = candidate.effect(fitted.fit.model.units).parameters.get(candidate.size, 0.0)
        block = gram[np.ix_(indices, indices)]
        scores.append(_scored(candidate, block, pull[indices], sizes[indices], faint))
    return Scores(tuple(scores), tuple(where), gram, pull)


def candidate_slopes(
    fit: TrajectoryFit,
    runs: Sequence[FitRun],
    passes: Sequence[Sequence[Candidate]],
    known: Sequence[WindowSlopes] = (),
) -> tuple[list[str], list[WindowSlopes]]:
    """Return the names of a fit's parameters, and the derivatives by them and by candidates.

    Each pass has at most one shape of an effect. With ``known`` windows the candidates' columns
    are appended to theirs, without the parameters.
    """
    names: list[str] = []
    windows = list(known)
    columns = [[window.columns] for window in known]
    for present in passes:
        free = [name for candidate in present for name in candidate.free]
        all_names, slopes = window_slopes(fit, runs, free, add_candidates(fit.model, present))
        wanted = [all_names.index(name) for name in free]
        if not windows:
            names = [name for name in all_names if name not in free]
            wanted = [*map(all_names.index, names), *wanted]
            windows, columns = slopes, [[] for _ in slopes]
        for blocks, window, one in zip(columns, slopes, windows, strict=True):
            blocks.append(window.columns_as_in(one)[:, wanted])
    return names, [
        dataclasses.replace(window, columns=np.hstack(blocks))
        for window, blocks in zip(windows, columns, strict=True)
    ]


def _located(
    data: DataSplit,
    pool: Sequence[Sequence[Candidate]],
    windows: Sequence[WindowSlopes],
    model: Rig,
) -> list[list[Candidate]]:
    """Return candidates with the frequencies or instants that residuals show most clearly."""
    candidates: list[list[Candidate]] = []
    responses = calm_responses(data.fitted, windows, model.c_over_m) if pool else []
    for one, *_ in pool if responses else ():
        if (scanned := one.sought) is None:
            continue
        unit = model.w0**scanned.power_of_w0
        if scanned.role == "frequency":
            values = frequencies(responses, scanned.typical[1] * unit)
        else:
            values = instants(responses)
        shapes = [{**one.shape, scanned.name: value / unit} for value in values]
        candidates.append([dataclasses.replace(one, shape=shape) for shape in shapes])
    return candidates


def _passes(pool: Sequence[Sequence[Candidate]], room: int) -> list[list[Candidate]]:
    """Divide candidates among passes, each with at most one shape of an effect."""
    passes: list[list[Candidate]] = []
    for batch in itertools.zip_longest(*pool):
        left = 0
        for candidate in batch:
            if candidate is None:
                continue
            if left < len(candidate.free):
                passes.append([])
                left = room
            passes[-1].append(candidate)
            left -= len(candidate.free)
    return passes


def _scored(candidate: Candidate, gram: Floats, pull: Floats, sizes: Floats, faint: float) -> Score:
    """Return the score of a candidate; ``faint`` is its size if it has a phase."""
    if not gram.any():
        return Score(candidate, 0.0, {}, 0.0)
    step = np.where(sizes > 0, _inverse(gram) @ pull / np.where(sizes > 0, sizes, 1.0), 0.0)
    start = {candidate.free[0]: float(step[0])}
    scale = sizes.copy()
    if candidate.phase is not None:
        # The derivative by the phase is the size times the response a quarter of a turn later.
        quadrature = float(step[1]) * faint
        start = {
            candidate.free[0]: math.hypot(step[0], quadrature),
            candidate.free[1]: math.atan2(quadrature, step[0]),
        }
        scale[1] /= faint
    information = float(np.linalg.eigvalsh(gram * np.outer(scale, scale))[0])
    # What opposes the motion gains nothing with a size below 0.
    drives = candidate.definition.opposing is not None and start[candidate.free[0]] < 0
    gain = 0.0 if drives else _gain(gram, pull)
    return Score(candidate, gain, start, max(information, 0.0))


def _gain(gram: Floats, pull: Floats) -> float:
    return float(pull @ _inverse(gram) @ pull)


def _inverse(gram: Floats) -> Floats:
    return np.asarray(np.linalg.pinv(gram, rcond=UNSEEN**2, hermitian=True), np.float64)


def _root_inverse(gram: Floats) -> Floats:
    values, vectors = np.linalg.eigh(gram)
    sound = values > UNSEEN**2 * max(float(values[-1]), 1e-300)
    return np.asarray(vectors[:, sound] / np.sqrt(values[sound]) @ vectors[:, sound].T, np.float64)


def _orthonormal(columns: Floats) -> Floats:
    sizes = np.linalg.norm(columns, axis=0)
    nonzero = columns[:, sizes > 0]
    if not nonzero.size:
        return np.zeros((len(columns), 0))
    u, s, _ = np.linalg.svd(nonzero / sizes[sizes > 0], full_matrices=False)
    return np.asarray(u[:, s > 1e-7 * s[0]], np.float64)
