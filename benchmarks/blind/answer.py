"""Diagnosis of one blind experiment, and its comparison with the truth."""

from __future__ import annotations

import dataclasses
import math
import time
from typing import TYPE_CHECKING, Any

from benchmarks.blind.cases import SOUND, Case, record
from benchmarks.blind.difficulty import difficulty, disturbance
from pendmap import virtual_rig
from pendmap.comparison.data import split_records
from pendmap.diagnosis import diagnose
from pendmap.diagnosis.baseline import fit_baseline
from pendmap.errors import InputError
from pendmap.model.effects import library

if TYPE_CHECKING:
    from pendmap.diagnosis import Discrepancy

FAMILIES = {
    "damping": "damping",
    "friction": "dry friction",
    "load": "dry friction",
    "torque": "position torque",
    "inertia": "position torque",
    "stand": "position torque",
    "drive": "drive",
    "reading": "reading",
}
"""Families of effects that only the rig has, by the rig's groups; the library states its own."""


STRONG = 100.0
"""Least score of a main effect in an experiment with disturbances; it also exceeds theirs."""

TRIES, GREATEST = 4, 20.0
"""Number of increases of its size to reach that score, and the greatest size; else excluded."""


def family(effect: str) -> str:
    """Return the family of an effect."""
    return library()[effect].family


def families(effect: str) -> set[str]:
    """Return the families accepted for a hidden effect, with or without a variant.

    A variant may belong to another family than the library's effect of its name: a constant added
    mass shows against the drive only, one added between two runs also as another frequency.
    """
    name = effect.partition(":")[0]
    groups = {e["name"]: e["group"] for e in virtual_rig.describe()}
    own = {FAMILIES[groups[effect]]} if name not in library() or name != effect else set()
    return own | ({family(name)} if name in library() else set())


def run(case: Case) -> dict[str, Any]:
    """Make, diagnose and judge one case."""
    hidden = [effect for effect in case.effects if effect != "none"]
    kin = {"families": sorted({f for effect in hidden for f in families(effect)})}
    try:
        hard: dict[str, Any] = {
            "G": [],
            "s": 1.0,
            "equals": [],
            "beyond": 0.0,
            "disturbance": 0.0,
        }
        without: list[str] = []
        if hidden:
            hard, alike = _difficulty(case)
            main = case.what == "mess"
            hard["disturbance"] = disturbance(case) if main else 0.0
            least = max(STRONG, hard["disturbance"])
            for _ in range(TRIES if main else 0):
                if min(hard["G"]) >= least:
                    break
                more = 1.2 * math.sqrt(least / max(min(hard["G"]), 1.0))
                case = dataclasses.replace(case, size=min(more * case.size, GREATEST))
                easier, alike = _difficulty(case)
                hard |= easier
            if case.what == "withheld":
                own = [effect.split(":")[0] for effect in case.effects]
                without = [n for n in (*own, *alike) if n in library()]
        recorded = record(case)
        begin = time.process_time()
        found = diagnose(recorded.experiment, without=without)
        seconds = time.process_time() - begin
    except InputError as error:
        return dataclasses.asdict(case) | kin | {"error": str(error)}
    samples = sum(r.time.size for r in recorded.experiment.runs)
    said = {"without": without, "truth": recorded.truth, "seconds": seconds, "samples": samples}
    return dataclasses.asdict(case) | kin | hard | said | answer(found)


def _difficulty(case: Case) -> tuple[dict[str, Any], list[str]]:
    """Return the difficulty of a case, without the faults of its records."""
    plain = dataclasses.replace(case, **SOUND)
    base, _ = fit_baseline(split_records(record(plain).experiment))
    return difficulty(plain, base)


def answer(found: Discrepancy) -> dict[str, Any]:
    """Return the verdict of a diagnosis and the statistics it is based on."""
    assessment, held = found.assessment, found.best.hold_out
    return {
        "verdict": found.verdict,
        "named": [effect.name for effect in found.effects],
        "approximate": [effect.approximate for effect in found.effects],
        "probability": [effect.probability for effect in found.effects],
        "named_families": [family(effect.name) for effect in found.effects],
        "classes": found.equivalent,
        "nearest": list(found.nearest.fitted.names),
        "parameters": {e.name: [dict(e.parameters), dict(e.ci95)] for e in found.effects},
        "held": held.chi2 / held.degrees,
        "closed": assessment.closed,
        "ratio": [assessment.ratio, assessment.ratio_allowed],
        "left": [assessment.left, assessment.uneven, assessment.form.chances["torque"]],
        "form": [assessment.form.chance, dict(assessment.form.chances), assessment.form.further],
        "standings": [
            {
                "name": s.candidate.name,
                "gain": s.gain,
                "share": s.share,
                "equivalent": s.equivalent,
                "rivals": [[r.candidate.name, r.behind, r.contains] for r in s.alternatives[:4]],
            }
            for s in assessment.identified
        ],
        "attempts": [
            [a.effects, a.score, a.bic_gain, a.held_out_gain, a.accepted] for a in found.attempts
        ],
    }
