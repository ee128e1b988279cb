"""The result of a diagnosis, and its summary as text."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np
import pandas as pd

from pendmap.comparison.forecast import (
    Cycles,
    Forecast,
    Gap,
    compare_cycles,
    compare_forecasts,
    compute_part,
)
from pendmap.diagnosis.advice import Advice, advise
from pendmap.diagnosis.named import NamedEffect, effect_values
from pendmap.diagnosis.table import HEAD, NOTE, Standings
from pendmap.files.toml import packaged
from pendmap.formatting import Estimate
from pendmap.identification.report import in_line
from pendmap.identification.results import FitResult, Followed
from pendmap.model.effects import definition
from pendmap.model.labels import unit_of
from pendmap.model.rig import own_name
from pendmap.records.summary import doubt_lines, finding_lines
from pendmap.residuals.torque import OVER
from pendmap.signal.robust import Z95

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from pendmap.comparison.data import DataSplit
    from pendmap.comparison.forecast import Part, Reasons
    from pendmap.diagnosis.scores import Scores
    from pendmap.diagnosis.state import Attempt, ScoredModel
    from pendmap.diagnosis.verdict import Assessment
    from pendmap.identification.results import Covariance
    from pendmap.model import Formula, Rig
    from pendmap.model.effects import EffectDefinition
    from pendmap.residuals.by_run import RunByRun
    from pendmap.residuals.torque import Torque


SAID: Final[dict[str, str]] = packaged("report/json_keys.toml")["verdicts"]
"""Meaning of each verdict, in the summary and in the report."""

TORQUE: Final = unit_of("torque")  # Unit of a torque per moment of inertia
WHERE: Final = 3  # Number of bins of a residual torque in the summary
MOST_EFFECTS: Final = 3  # Default of the largest number of effects that are added


@dataclasses.dataclass(frozen=True, repr=False)
class Discrepancy(FitResult):
    """Result of a diagnosis: where a model and records disagree, and why."""

    KIND: ClassVar[str] = "diagnosis"

    data: DataSplit  # The records: fitted and held back
    base: ScoredModel  # The baseline
    best: ScoredModel  # The best model; with the verdicts ``none`` and ``unknown`` the baseline
    nearest: ScoredModel  # The best model with any effects, accepted by the verdict or not
    assessment: Assessment  # Verdict and the statistics it is based on
    effects: tuple[NamedEffect, ...]  # The named effects
    gap: Gap  # Residuals of the baseline and of the best model
    torque_before: Torque  # Torque missing in the baseline
    torque_after: Torque  # Torque missing in the best model
    where: list[dict[str, Any]]  # Bins in which the torque missing in the baseline is significant
    runs: RunByRun  # Parameters run by run
    scores: Scores  # Scores of all candidates at the baseline
    attempts: tuple[Attempt, ...]  # Candidates that were fitted
    beside: Scores  # Scores of the other candidates at the best model
    level: float  # Sum of squares of one independent reading
    without: tuple[str, ...] = ()  # Effects excluded from the candidates
    most: int = MOST_EFFECTS  # Most effects that could be added
    own: tuple[Formula, ...] = ()  # The user's own formulas among the candidates
    # Reasons for parts that were not computed, by field of the JSON; see ``not_computed``.
    reasons: Reasons = dataclasses.field(default_factory=dict)

    def further(self) -> dict[str, Any]:
        """Return further variables of the dataset, after what is computed when it is asked for."""
        for part in (self.not_computed, self.advice):
            del part
        return super().further()

    def definition(self, name: str) -> EffectDefinition:
        """Return the entry of a candidate in the library, or of the user's formula."""
        return next((f.definition for f in self.own if f.name == name), None) or definition(name)

    def __repr__(self) -> str:
        names = ", ".join(effect.name for effect in self.effects)
        gap = f"rms {self.gap.before:.3g} to {self.gap.after:.3g} rad"
        verdict = f"{self.verdict}: {names}" if names else self.verdict
        path = self.data.experiment.path.name
        return f"<Discrepancy {path}: {verdict}; {gap}, noise {self.gap.noise_floor:.3g}>"

    def text_parts(self) -> tuple[list[tuple[list[str], list[list[str]]]], list[str]]:
        """Return the table and the lines that ``pendmap diagnose`` prints."""
        return [self.table_cells()], list(as_text(self))

    @property
    def standings(self) -> Standings:
        """Effects of the best model and the other candidates, as in the table."""
        fitted = self.nearest.fitted, self.base.fitted, self.data.fitted
        identified = self.assessment.identified
        return Standings(
            identified, self.effects, *fitted, self.scores, self.attempts, self.definition
        )

    def table_cells(self) -> tuple[list[str], list[list[str]]]:
        """Return header and rows of the table of effects."""
        return HEAD, [row.cells for row in self.standings.rows]

    @property
    def parameters(self) -> Mapping[str, Estimate]:
        """Parameters of the best model; intervals include what differs between runs."""
        fit, wider = self.best.fitted.fit, math.sqrt(self.best.fitted.widening)
        estimates = {}
        for name, written in zip(fit.names, self.written_names, strict=True):
            value, stderr = self.in_turn(name), wider * (fit.estimates[name].stderr or math.nan)
            half = Z95 * math.hypot(stderr, self.runs.between(name))
            known = math.isfinite(half)
            ci95 = (value - half, value + half) if known else None
            estimates[written] = Estimate(value, stderr if known else None, ci95)
        for effect in self.effects:
            for parameter, value in effect.parameters.items():
                name = f"{effect.name}.{parameter}"
                known_error = estimates[name].stderr if name in estimates else None
                estimates[name] = Estimate(value, known_error, effect.ci95.get(parameter))
        return estimates

    def in_turn(self, name: str) -> float:
        """Return the value of a fitted parameter, of a phase from -pi to pi."""
        value, (effect, _, parameter) = self.best.fitted.fit[name], name.rpartition(".")
        phase = name.partition("[")[0] == "phi"
        if effect:
            phase = self.definition(effect)[parameter].role == "phase"
        return math.remainder(value, math.tau) if phase else value

    @property
    def written_names(self) -> list[str]:
        """Names of the fitted parameters in the model file, where named effects are effects."""
        renamed = {
            rig: f"{effect.name}.{next(iter(effect.parameters))}"
            for effect in self.effects
            if (rig := own_name(effect.name)) is not None
        }
        return [renamed.get(name, name) for name in self.best.fitted.fit.names]

    @property
    def joint_covariance(self) -> Covariance:
        """Covariance of the fitted parameters by their names in the model file, widened.

        An effect with a phase is named with a positive size: signs are those of its parameters.
        """
        fitted, names = self.best.fitted, self.written_names
        sizes = {
            f"{effect.name}.{parameter}": value
            for effect in self.effects
            for parameter, value in effect.parameters.items()
            if self.definition(effect.name)[parameter].role == "size"
        }
        pairs = zip(names, fitted.fit.names, strict=True)
        signs = [-1.0 if sizes.get(name, 0.0) * fitted.fit[key] < 0 else 1.0 for name, key in pairs]
        return names, fitted.widening * fitted.fit.covariance * np.outer(signs, signs)

    @property
    def model(self) -> Rig:
        """The best model, and in its notes the covariance of all fitted parameters, widened.

        Effects have ``ci95``, ``probability`` and ``approximate``. ``[covariance]`` has in
        ``between_runs`` the standard deviation of each parameter that differs between runs by more
        than its error.
        """
        fit, (names, covariance) = self.best.fitted.fit, self.joint_covariance
        named = {effect.name: effect.effect for effect in self.effects}
        # An effect that is a parameter of the rig is written as an effect.
        parameters = [rig for name in named if (rig := own_name(name)) is not None]
        effects = (*(e for e in fit.model.effects if e.name not in named), *named.values())
        still = fit.model.p == 0 and not any(e.drives for e in effects)
        between = {
            written: size
            for name, written in zip(fit.names, names, strict=True)
            if "[" not in name and (size := self.runs.between(name)) > 0
        }
        matrix = np.where(np.isfinite(covariance), covariance, 0.0).tolist()
        return dataclasses.replace(
            fit.model,
            **dict.fromkeys(parameters, 0.0),
            effects=effects,
            Omega=0.0 if still else (fit.model.Omega or 1.0),
            notes={"covariance": {"names": list(names), "matrix": matrix, "between_runs": between}},
        )

    @property
    def ranking(self) -> pd.DataFrame:
        """Candidates at the baseline, best first, by name: ``score``, ``size`` and ``shape``.

        ``score`` is the expected fall of the sum of squares in independent readings, ``size`` the
        expected size, SI.
        """
        rows = pd.DataFrame(ranking(self), columns=["name", "score", "size", "shape"])
        return rows.set_index("name")

    def followed(self) -> Followed:
        """Return the fit of the best model."""
        runs = [self.data.runs[k] for k in self.data.fitted_of]
        return Followed(self.best.fitted.fit, self.best.fitted.runs, runs)

    @property
    def verdict(self) -> str:
        """``none``, ``named``, ``partial``, ``ambiguous`` or ``unknown``."""
        return self.assessment.verdict

    @property
    def equivalent(self) -> list[list[str]]:
        """Classes of indistinguishable effects, one for each named effect that has one."""
        if not self.effects:
            return []
        classes = (effect.equivalent for effect in self.assessment.identified)
        return [names for names in classes if len(names) > 1]

    @property
    def clearest(self) -> list[dict[str, Any]]:
        """Most significant bin of each quantity; its neighbours are similar."""
        rows: dict[str, dict[str, Any]] = {}
        for row in self.where:
            rows.setdefault(row["over"], row)
        return list(rows.values())

    @property
    def adds(self) -> bool:
        """Whether the best model differs from the baseline."""
        return self.best is not self.base

    @functools.cached_property
    def not_computed(self) -> Reasons:
        """Reasons for parts that were not computed, by field of the JSON object."""
        for part in (self.forecasts, self.cycles):
            del part
        return self.reasons

    @functools.cached_property
    def forecasts(self) -> tuple[Forecast, ...]:
        """Forecast error of both models against the horizon, on the records held back."""
        return self._part("forecast", compare_forecasts)

    @functools.cached_property
    def advice(self) -> Advice:
        """Recommended next record, and detection limits of effects that were not found."""
        fitted = self.data, self.best, self.nearest
        return advise(*fitted, self.assessment, self.effects, self.beside)

    @functools.cached_property
    def cycles(self) -> tuple[Cycles, ...]:
        """Periods and peaks of each free run, and those of both models."""
        return self._part("cycles", compare_cycles)

    def _part(self, field: str, compared: Callable[..., tuple[Part, ...]]) -> tuple[Part, ...]:
        """Return a comparison of both models, empty where a motion diverges."""
        models = self.base.fits, self.best.fits
        return compute_part(self.reasons, field, lambda: compared(self.data, *models), ())


def as_text(result: Discrepancy) -> Iterator[str]:
    """Yield the lines of a summary: doubts about a unit, then the verdict and its details."""
    runs = result.data.runs
    yield from doubt_lines(result.data.experiment, *runs)
    gap, assessment = result.gap, result.assessment
    yield f"Verdict: {result.verdict}: {SAID[result.verdict]}"
    yield f"Model: {in_line(result.parameters)}"
    for effect in result.effects:
        units = {n: unit_of(f"{effect.name}.{n}", result.definition) for n in effect.parameters}
        ci95 = sure_intervals(effect)
        values = ", ".join(
            f"{name} = {value:.4g} {units[name]}".rstrip()
            + (" [{:.4g}, {:.4g}]".format(*ends) if (ends := ci95.get(name)) else "")
            for name, value in effect.parameters.items()
        )
        yield f"  {effect.name}: {values}{effect.reserve}"
        for name, value in effect.elsewhere.items():
            text = f"{name} = {value:.4g} {units[name]}".rstrip()
            yield f"    or {text}, which fits equally well"
    for names in result.equivalent:
        yield f"  indistinguishable in these records: {', '.join(names)}"
    if result.without:
        yield f"  excluded from the candidates: {', '.join(result.without)}"
    if result.most == 0 and result.verdict != "none":
        yield "  no candidate was fitted: at most 0 effects were allowed"
    if result.verdict == "unknown" and result.nearest.fitted.names:
        yield f"  nearest effects, not claimed: {', '.join(result.nearest.fitted.names)}"
    yield (
        f"Residual, rms: {gap.before:.4g} rad before, {gap.after:.4g} after, noise "
        f"{gap.noise_floor:.4g}; held out {gap.held_out_before:.4g} before, "
        f"{gap.held_out_after:.4g} after, noise {gap.held_out_noise_floor:.4g}"
    )
    if assessment.identified:
        by = "" if result.effects else " by the nearest effects"
        yield f"Share of the squared gap closed{by}: {100 * max(assessment.closed, 0.0):.0f} %"
    yield from _remarks(result)
    for row in result.clearest[:WHERE]:
        what = "torque along the motion" if row["along_motion"] else "torque"
        at = " ".join(OVER[row["over"]][:2])
        yield (
            f"Where: a {what} of {row['torque']:.3g} {TORQUE} is missing at {at} of "
            f"{row['from']:.3g} to {row['to']:.3g} {row['unit']} ({row['z']:.1f} standard errors)"
        )
    if result.advice.next_experiment is not None:
        yield f"Next: {result.advice.next_experiment}"
    yield from (f"Not computed: {name}: {why}" for name, why in result.not_computed.items())
    yield from finding_lines(result.data.experiment, *runs)
    yield NOTE


def sure_intervals(effect: NamedEffect) -> dict[str, tuple[float, float] | None]:
    """Return the 95 % intervals of an effect; None of a phase that may have any value."""
    phases = {one.name for one in effect.definition.parameters if one.role == "phase"}
    return {
        name: None if name in phases and ends[1] - ends[0] >= math.tau else ends
        for name, ends in effect.ci95.items()
    }


def _remarks(result: Discrepancy) -> Iterator[str]:
    """Yield what is special about parameters and effects of the best model."""
    for name in result.best.fitted.zeroed:
        yield f"{name} is fixed at 0: the fit would make it negative, which is unphysical"
    for name in result.best.fitted.fit.names:
        between = result.runs.between(name)
        if between > 0:
            yield (
                f"{name} differs from run to run by {between:.3g} "
                f"{unit_of(name, result.definition)}".rstrip()
                + ", more than its error: intervals include this"
            )
    for effect in result.best.fitted.fit.model.effects:
        if effect.definition.mappable == "no":
            yield f"{effect.name}: supported by simulate, compare and diagnose, but not by maps"


def given_out(scored: ScoredModel) -> dict[str, float]:
    """Return the parameters of the model file, SI, without those of single runs."""
    fitted = scored.fitted
    values = {name: value for name, value in fitted.start.items() if "[" not in name}
    for effect in fitted.fit.model.effects:
        values |= {f"{effect.name}.{name}": value for name, value in effect.parameters.items()}
    for candidate in fitted.chosen:
        parameters, _ = effect_values(scored, candidate)
        values |= {f"{candidate.name}.{name}": value for name, value in parameters.items()}
    return values


def ranking(result: Discrepancy) -> list[dict[str, Any]]:
    """Return name, shape, score and size of each effect at the baseline, the best first."""
    base = result.base.fitted
    scores = [result.scores.scores[k] for k in result.scores.best()]
    return [
        {
            "name": score.candidate.name,
            "shape": score.candidate.shape_in(base.fit.model.units),
            "score": score.gain / base.noise.level,
            "size": next(iter(score.start.values()), None),
        }
        for score in scores
    ]
