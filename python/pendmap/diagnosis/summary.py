"""JSON object of a diagnosis."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

from pendmap.comparison.forecast import AFTER, BEFORE
from pendmap.diagnosis.result import given_out, ranking, sure_intervals
from pendmap.records.summary import doubts

if TYPE_CHECKING:
    from pendmap.diagnosis.result import Discrepancy


def as_json(result: Discrepancy) -> dict[str, Any]:
    """Return the JSON object of ``pendmap diagnose``, without the paths of written files.

    Parts that were not computed are null, with the reason in ``not_computed``.
    """
    unknown = result.not_computed
    gap, assessment = dataclasses.asdict(result.gap), result.assessment
    gap_by_run = gap.pop("by_run")
    fit, base = result.best.fitted.fit, result.base.fitted.fit
    wider = math.sqrt(result.best.fitted.widening)
    return {
        "experiment": str(result.data.experiment.path),
        "doubts": doubts(result.data.experiment, *result.data.runs),
        "verdict": result.verdict,
        "effects": [
            {
                "name": effect.name,
                "parameters": effect.parameters,
                "ci95": sure_intervals(effect),
                "probability": effect.probability,
                "approximate": effect.approximate,
                "closes": effect.closes,
                "elsewhere": effect.elsewhere,
            }
            for effect in result.effects
        ],
        "equivalent": result.equivalent,
        "gap": {
            **gap,
            "closed": assessment.closed if result.effects else None,
            "closed_by_nearest": assessment.closed if assessment.identified else None,
            "runs": gap_by_run,
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
            for forecast in result.forecasts
        ],
        "cycles": [
            {
                "name": one.name,
                "held_out": one.held_out,
                **{
                    f"{what}_percent": {
                        model: getattr(one.errors[model], what) for model in (BEFORE, AFTER)
                    }
                    for what in ("period_rms", "peak_rms")
                },
            }
            for one in result.cycles
        ],
        "where": None if "where" in unknown else result.where,
        "next_experiment": result.advice.next_experiment,
        "detection_limits": None
        if "detection_limits" in unknown
        else {name: limit.size for name, limit in result.advice.limits.items()},
        "nearest": list(result.nearest.fitted.names),
        "left": {
            "z": assessment.left,
            "uneven": assessment.uneven,
            "torque_by_chance": assessment.form.chances["torque"],
            "chance": assessment.form.chance,
            "chances": dict(assessment.form.chances),
            "further": assessment.form.further,
            "chi2_per_degree": assessment.ratio,
            "chi2_per_degree_held_out": assessment.ratio_held,
            "allowed": assessment.ratio_allowed,
        },
        "baseline": {name: e.value for name, e in base.estimates.items()},
        "set_to_zero": list(result.best.fitted.zeroed),
        "model_file": {"rms": fit.rms, "parameters": given_out(result.best)},
        "parameters": {
            name: {"value": result.in_turn(name), "stderr": e.stderr and wider * e.stderr}
            for name, e in fit.estimates.items()
        },
        "runs": {
            name: [{"value": value, "stderr": error} for value, error in pairs]
            for name, pairs in result.runs.coefficients.items()
        },
        "ranking": ranking(result),
        "not_computed": unknown,
        "attempts": [dataclasses.asdict(attempt) for attempt in result.attempts],
        "findings": [one.text for _, one in result.data.experiment.findings_of(result.data.runs)],
    }
