"""What a diagnosis found, as JSON and as text."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

from pendmap.comparison.cycles import AFTER, BEFORE
from pendmap.diagnosis.named import values_of
from pendmap.model.labels import unit_of
from pendmap.records.summary import doubts, doubts_said, findings_said

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pendmap.diagnosis.diagnose import Discrepancy
    from pendmap.diagnosis.state import Found

SAID: Final = {
    "none": "none: the baseline describes the records to within their noise",
    "named": "named: the effects below explain what the baseline lacks",
    "partial": "partial: the effects below close a part of the gap, and something is left",
    "ambiguous": "ambiguous: these records do not tell the effects of a class apart",
    "unknown": "unknown: something is missing that no candidate explains",
}

PLACES: Final[dict[str, str]] = {
    "angle": "at an angle of",
    "velocity": "at a velocity of",
    "amplitude": "at an amplitude of",
    "drive_phase": "at a phase of the drive of",
    "lab_time": "at a time in the laboratory of",
}
"""Where a torque is missing, in words."""

TORQUE: Final = unit_of("torque")
"""A torque is one per moment of inertia."""

WHERE: Final = 3
"""Places of a residual torque that are told."""

RANKED: Final = 8
"""Candidates that the table of scores shows."""


def as_json(found: Discrepancy) -> dict[str, Any]:
    """Return the JSON object of ``pendmap diagnose``, without the paths of files.

    What could not be computed beside the verdict is null, and ``not_computed`` has the reason.
    """
    unknown = found.not_computed
    gap, judgement = found.gap, found.judgement
    fit, base = found.best.trial.fit, found.base.trial.fit
    wider = math.sqrt(found.best.trial.widening)
    return {
        "experiment": str(found.evidence.experiment.path),
        "doubts": doubts(found.evidence.experiment, *found.evidence.runs),
        "verdict": found.verdict,
        "effects": [
            {
                "name": effect.name,
                "parameters": effect.parameters,
                "ci95": {name: list(bounds) for name, bounds in effect.ci95.items()},
                "probability": effect.probability,
                "approximate": effect.approximate,
                "closes": next(
                    s.closed for s in judgement.standings if s.candidate.name == effect.name
                ),
                "elsewhere": effect.elsewhere,
            }
            for effect in found.effects
        ],
        "equivalent": found.equivalent,
        "gap": {
            "noise_floor": gap.noise_floor,
            "held_out_noise_floor": gap.held_out_noise_floor,
            "before": gap.before,
            "after": gap.after,
            "held_out_before": gap.held_out_before,
            "held_out_after": gap.held_out_after,
            "closed": judgement.closed if found.effects else None,
            "closed_by_nearest": judgement.closed if judgement.standings else None,
            "runs": [
                {
                    "name": run.name,
                    "held_out": run.held_out,
                    "noise_floor": run.noise_floor,
                    "before": run.before,
                    "after": run.after,
                }
                for run in gap.by_run
            ],
        },
        "forecast": [
            {
                "runs": forecast.kind,
                "starts": forecast.starts,
                "noise_floor": forecast.noise_floor,
                "horizon_s": forecast.horizon.tolist(),
                "before": forecast.before.tolist(),
                "after": forecast.after.tolist(),
            }
            for forecast in found.forecasts
        ],
        "cycles": [
            {
                "name": one.name,
                "held_out": one.held_out,
                **{
                    f"{what}_percent": {
                        model: getattr(one.errors.get(model), what, None)
                        for model in (BEFORE, AFTER)
                    }
                    for what in ("period_rms", "peak_rms")
                },
            }
            for one in found.cycles
        ],
        "where": None if "where" in unknown else found.where,
        "next_experiment": found.advice.next_experiment,
        "proposals": _proposals(found),
        "detection_limits": None
        if "detection_limits" in unknown
        else {name: limit.size for name, limit in found.advice.limits.items()},
        "nearest": list(found.nearest.trial.names),
        "left": {
            "z": judgement.left,
            "uneven": judgement.uneven,
            "torque_by_chance": judgement.chance,
            "chance": judgement.form.chance,
            "chances": dict(judgement.form.chances),
            "further": judgement.form.further,
            "chi2_per_degree": judgement.ratio,
            "chi2_per_degree_held_out": judgement.ratio_held,
            "allowed": judgement.ratio_allowed,
        },
        "baseline": {name: e.value for name, e in base.estimates.items()},
        "set_to_zero": list(found.best.trial.zeroed),
        "model_file": {"rms": fit.rms, "parameters": given_out(found.best)},
        "parameters": {
            name: {"value": e.value, "stderr": e.stderr and wider * e.stderr}
            for name, e in fit.estimates.items()
        },
        "runs": {
            name: [{"value": value, "stderr": error} for value, error in pairs]
            for name, pairs in found.runs.coefficients.items()
        },
        "ranking": _ranking(found),
        "functions": None
        if "functions" in unknown
        else [dataclasses.asdict(score) for score in found.functions],
        "not_computed": unknown,
        "attempts": [
            {
                "effects": list(a.names),
                "shape": a.shape,
                "score": a.score,
                "bic_gain": a.gain,
                "held_out_gain": a.held_gain,
                "accepted": a.accepted,
                "stage": a.stage,
            }
            for a in found.attempts
        ],
        "findings": [
            finding.text
            for finding in (
                *found.evidence.experiment.findings,
                *(finding for run in found.evidence.runs for finding in run.findings),
            )
        ],
    }


def _proposals(found: Discrepancy) -> dict[str, Any] | None:
    """Return what is wanted, and of each kind of run that could be recorded the best."""
    outlook = found.advice.outlook
    if outlook is None:
        return None
    return {
        "aim": outlook.aim,
        "about": list(outlook.about),
        "now": outlook.now,
        "wanted": outlook.wanted,
        "not_told_apart": [list(pair) for pair in outlook.equals],
        "experiments": [
            {
                "what": prospect.proposal.what,
                "seconds": prospect.proposal.seconds,
                "wait_s": prospect.proposal.wait_s,
                "predicted": prospect.value,
                "chance_of_wrong_name": prospect.wrong,
                "chance_of_one_name": prospect.resolved,
                "recommended": prospect is outlook.best,
                "runs": [
                    {
                        "kind": "free" if run.start.drive is None else "forced",
                        "theta_rad": run.start.theta,
                        "velocity_rad_s": run.start.velocity,
                        "seconds": run.seconds,
                        "lab_time_s": run.start.lab_time_s,
                        "drive": None if run.start.drive is None else dict(run.start.drive),
                    }
                    for run in prospect.proposal.runs
                ],
            }
            for prospect in outlook.by_start
        ],
    }


def _ranking(found: Discrepancy) -> list[dict[str, Any]]:
    level = found.base.trial.remainder.level
    rows = []
    for k in found.scores.best():
        score = found.scores.scores[k]
        rows.append(
            {
                "name": score.candidate.name,
                "shape": dict(score.candidate.shape),
                "score": score.gain / level,
                "size": next(iter(score.start.values()), None),
            }
        )
    return rows


def ranking_table(found: Discrepancy) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of the table of candidates at the baseline."""
    refitted = {a.names[0]: a for a in reversed(found.attempts) if a.stage == 0}
    rows = []
    for row in _ranking(found)[:RANKED]:
        tried = refitted.get(row["name"])
        shape = ", ".join(
            f"{name} = {value:.3g} {_unit(found, row['name'], name)}".rstrip()
            for name, value in row["shape"].items()
        )
        rows.append(
            [
                row["name"],
                shape,
                f"{row['score']:.1f}",
                "" if tried is None else f"{tried.gain:.1f}",
                "" if tried is None or tried.held_gain is None else f"{tried.held_gain:.1f}",
            ]
        )
    return ["candidate", "shape", "score G", "fall of BIC", "gain held out"], rows


def as_text(found: Discrepancy) -> Iterator[str]:
    """Yield the lines of a summary, the verdict first, but for doubts about a unit."""
    runs = found.evidence.runs
    yield from doubts_said(found.evidence.experiment, *runs)
    gap, judgement = found.gap, found.judgement
    yield f"Verdict: {SAID[found.verdict]}"
    for effect in found.effects:
        units = {name: _unit(found, effect.name, name) for name in effect.parameters}
        values = ", ".join(
            f"{name} = {value:.4g} {units[name]}".rstrip()
            + (" [{:.4g}, {:.4g}]".format(*effect.ci95[name]) if name in effect.ci95 else "")
            for name, value in effect.parameters.items()
        )
        nearly = (
            ", with reserve: what is missing may only resemble it" if effect.approximate else ""
        )
        share = next(100 * s.closed for s in judgement.standings if s.candidate.name == effect.name)
        yield (
            f"  {effect.name}: {values}; closes {share:.0f} % of the squared gap that the others "
            f"leave; probability {effect.probability:.3f}, given that the effect is in the "
            f"library{nearly}"
        )
        for name, value in effect.elsewhere.items():
            said = f"{name} = {value:.4g} {units[name]}".rstrip()
            yield f"    or {said}, which does as well: the records do not tell which"
    for names in found.equivalent:
        yield f"  not told apart here: {', '.join(names)}"
    if found.without:
        yield f"  left out of the candidates: {', '.join(found.without)}"
    if found.most == 0 and found.verdict != "none":
        yield "  no candidate was fitted: at most 0 effects were allowed"
    if found.verdict == "unknown" and found.nearest.trial.names:
        yield f"  nearest, and not claimed: {', '.join(found.nearest.trial.names)}"
    yield (
        f"Residual, rms: {gap.before:.4g} rad before, {gap.after:.4g} after, noise "
        f"{gap.noise_floor:.4g}; held out {gap.held_out_before:.4g} before, "
        f"{gap.held_out_after:.4g} after, noise {gap.held_out_noise_floor:.4g}"
    )
    if judgement.standings:
        by = "" if found.effects else " by what is nearest"
        yield f"Share of the squared gap closed{by}: {100 * max(judgement.closed, 0.0):.0f} %"
    yield from zeroed(found)
    yield from _between(found)
    yield from confined(found)
    # Of each thing that it may go by the clearest place: neighbours say the same.
    clearest = {row["over"]: row for row in reversed(found.where)}
    for row in sorted(clearest.values(), key=lambda row: -abs(row["z"]))[:WHERE]:
        what = "torque along the motion" if row["along_motion"] else "torque"
        yield (
            f"Where: a {what} of {row['torque']:.3g} {TORQUE} is missing {PLACES[row['over']]} "
            f"{row['from']:.3g} to {row['to']:.3g} {row['unit']} ({row['z']:.1f} standard errors)"
        )
    for score in found.functions:
        yield (
            f"Function {score.name}, to first order: {score.size:.3g} +- {score.stderr:.2g} times "
            f"it, G = {score.gain:.1f}; {score.left:.1f} beside the effects found"
        )
    yield from _further(found)
    yield from findings_said(found.evidence.experiment, *runs)


def _between(found: Discrepancy) -> Iterator[str]:
    """Yield which parameters differ from run to run by more than their errors."""
    for name in found.best.trial.fit.names:
        between = found.runs.between(name)
        if between > 0:
            yield (
                f"{name} differs from run to run by {between:.3g} "
                f"{unit_of(name, found.definition)}".rstrip()
                + ", more than its error: intervals are wider by it"
            )


def _further(found: Discrepancy) -> Iterator[str]:
    """Yield what to record next, and what could not be computed beside the verdict."""
    if found.advice.next_experiment is not None:
        yield f"Next: {found.advice.next_experiment}"
    for field, reason in found.not_computed.items():
        yield f"Not computed: {field}: {reason}"


def _unit(found: Discrepancy, effect: str, parameter: str) -> str:
    """Return the unit of an effect's parameter; empty where it has none."""
    return unit_of(f"{effect}.{parameter}", found.definition)


def given_out(found: Found) -> dict[str, float]:
    """Return the parameters of the model file, SI; initial states and phases of runs left out."""
    trial = found.trial
    values = {name: value for name, value in trial.start.items() if "[" not in name}
    for effect in trial.fit.model.effects:
        values |= {f"{effect.name}.{name}": value for name, value in effect.parameters.items()}
    for candidate in trial.chosen:
        parameters, _ = values_of(found, candidate)
        values |= {f"{candidate.name}.{name}": value for name, value in parameters.items()}
    return values


def confined(found: Discrepancy) -> Iterator[str]:
    """Yield which effects of the model no map over initial conditions can have."""
    for effect in found.best.trial.fit.model.effects:
        if effect.definition["mappable"] == "no":
            yield f"{effect.name}: simulate, compare and diagnose can have it; no map has it"


def zeroed(found: Discrepancy) -> Iterator[str]:
    """Yield which coefficients are held at 0."""
    for name in found.best.trial.zeroed:
        yield f"{name} is held at 0: the fit would make it negative, and no pendulum drives itself"
