"""The table of a diagnosis: what each effect closes, what it costs, and its value."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import Estimate, interval
from pendmap.model.labels import unit_of
from pendmap.signal.robust import Z95

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.fitted_model import FittedModel
    from pendmap.diagnosis.named import NamedEffect
    from pendmap.diagnosis.scores import Scores
    from pendmap.diagnosis.state import Attempt
    from pendmap.diagnosis.verdict import Identifiability
    from pendmap.identification.runs import FitRun
    from pendmap.model.effects import EffectDefinition

ROWS: Final = 8  # Number of rows of the table
HEAD: Final = ["effect", "alone", "last", "BIC", "95 % interval", "p"]
NOTE: Final = (
    "alone, last: share of the squared gap that an effect promises to close by itself, and closes "
    "beside the others; BIC: its fall by the effect, or by another one in its place; p: "
    "probability of the name if the library has the effect, * with reserve; no: not claimed; "
    "alike: indistinguishable; wider: does the same with more parameters; less: explains less"
)
MARKS: Final = ("alike", "wider", "less")  # How a rival stands to an effect of the best model


@dataclasses.dataclass(frozen=True)
class Row:
    """An effect in the table."""

    candidate: Candidate
    alone: float | None  # Share of the squared gap that its score at the baseline promises
    last: float | None = None  # Share that it closes beside the others
    bic: float | None = None  # Fall of the BIC, beside the others
    size: str = ""  # 95 % interval; of an effect that is not fitted the shape
    mark: str = ""  # Probability, or how it stands to an effect of the best model

    @property
    def cells(self) -> list[str]:
        """Texts of the row, under HEAD."""
        shares = [f"{100 * s:.0f} %" if s is not None else "" for s in (self.alone, self.last)]
        bic = "" if self.bic is None else f"{self.bic:.0f}"
        return [self.candidate.name, *shares, bic, self.size, self.mark]


@dataclasses.dataclass(frozen=True)
class Standings:
    """Effects of the best model, and the other candidates beside them."""

    identified: Sequence[Identifiability]  # Effects of the best model with their alternatives
    named: Sequence[NamedEffect]
    nearest: FittedModel  # The best model
    base: FittedModel
    runs: Sequence[FitRun]  # Fitted records with the noise of their readings
    scores: Scores  # Of all candidates at the baseline
    attempts: Sequence[Attempt]
    definition: Callable[[str], EffectDefinition]

    @property
    def rows(self) -> list[Row]:
        """Effects of the best model, what could replace them, then the best of the others.

        A candidate whose size has a sign that its effect cannot have is left out.
        """
        listed = {one.candidate.name: self._identified(one) for one in self.identified}
        others = [other for one in self.identified for other in one.alternatives]
        for mark in MARKS:
            for other in others:
                if mark == ("wider" if other.contains else "alike" if other.alike else "less"):
                    row = self._other(other.candidate, self._bic(other.candidate, other.gain), mark)
                    listed.setdefault(other.candidate.name, row)
        tried = {a.effects: a.bic_gain for a in self.attempts if a.stage == 0 and not listed}
        for k in self.scores.best():
            candidate, start = self.scores.scores[k].candidate, self.scores.scores[k].start
            opposes = candidate.definition.opposing == candidate.size
            if not opposes or next(iter(start.values()), 0.0) >= 0:
                bic = tried.get((candidate.name,))
                listed.setdefault(candidate.name, self._other(candidate, bic))
        return [*listed.values()][:ROWS]

    def shape_text(self, candidate: Candidate) -> str:
        """Return the shape of a candidate in SI, with units."""
        return ", ".join(
            f"{name} = {value:.3g} {self._unit(candidate, name)}".rstrip()
            for name, value in candidate.shape_in(self.base.fit.model.units).items()
        )

    def _unit(self, candidate: Candidate, parameter: str) -> str:
        return unit_of(f"{candidate.name}.{parameter}", self.definition)

    def _other(self, candidate: Candidate, bic: float | None, mark: str = "") -> Row:
        shape = self.shape_text(candidate)
        return Row(candidate, self._alone(candidate), None, bic, shape, mark)

    def _alone(self, candidate: Candidate) -> float | None:
        """Return the share of the baseline's gap that the best score of an effect promises."""
        gains = [s.gain for s in self.scores.scores if s.candidate.name == candidate.name]
        noise = sum(
            float(np.sum((given.sigmas / weighted.sigmas)[weighted.counted] ** 2))
            for given, weighted in zip(self.runs, self.base.runs, strict=True)
        )
        gap = self.base.chi2 - noise
        return min(max(gains) / gap, 1.0) if gains and gap > 0 else None

    def _bic(self, candidate: Candidate, gain: float) -> float:
        """Return the fall of the BIC by an effect of a gain, beside the others."""
        fit, level = self.nearest.fit, self.nearest.level
        readings = min(max(fit.samples / level, self.nearest.chi2 / level, 3.0), fit.samples)
        return gain - candidate.count * math.log(readings) - candidate.choice_gain

    def _identified(self, one: Identifiability) -> Row:
        candidate, estimate = one.candidate, self.nearest.fit.estimates[one.candidate.free[0]]
        named = next((effect for effect in self.named if effect.name == candidate.name), None)
        value, mark = estimate.value, "no"
        half = Z95 * math.sqrt(self.nearest.widening) * (estimate.stderr or math.nan)
        ends = value - half, value + half
        if named is not None:
            ends = named.ci95.get(candidate.size, (math.nan, math.nan))
            mark = f"{named.probability:.2f}{'*' if named.approximate else ''}"
        bic = self._bic(candidate, one.gain)
        unit = self._unit(candidate, candidate.size)
        size = f"{interval(Estimate(value, None, ends))} {unit}".rstrip()
        return Row(candidate, self._alone(candidate), one.closed, bic, size, mark)
