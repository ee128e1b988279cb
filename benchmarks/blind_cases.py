"""One blind experiment: drawn, recorded by the virtual rig, diagnosed, compared with its truth.

Difficulty is measured, not assumed: the same motion without noise and counts is scored with the
noise that the record has. ``G`` is what the best possible model would gain there,
``s = 1 - G_impostor / G`` how far the nearest other name falls short. Names with ``s G < 25`` are
not told apart by these records, whoever looks: where an effect is withheld so are they.
"""

from __future__ import annotations

import dataclasses
import math
import tempfile
import time
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap import virtual_rig
from pendmap.discrepancy import diagnose
from pendmap.discrepancy.baseline import baseline
from pendmap.discrepancy.candidates import candidates
from pendmap.discrepancy.evidence import Evidence, evidence_of
from pendmap.discrepancy.scores import scores_of
from pendmap.discrepancy.trial import ASTRAY, fitted
from pendmap.errors import InputError
from pendmap.model.effects import library
from pendmap.records import read_experiment

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.discrepancy import Discrepancy
    from pendmap.discrepancy.trial import Trial
    from pendmap.records import Experiment

KINDS = {"mixed": (5, 4), "free": (5, 0), "single": (1, 0)}
SAMPLES = (100.0, 100.0, 100.0, 200.0, 500.0)
COUNTS = (1024, 2048, 4096, 8192)
BASE = ("viscous_damping", "coulomb_friction")
"""What the baseline has: not hidden."""

CLEAR = 25.0
"""Separation times score from which names are told apart nearly always."""

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
"""Of effects that only the rig has, by the rig's groups; those of the library it says itself."""


@dataclasses.dataclass(frozen=True)
class Case:
    """What is asked of the rig, and what is withheld from the search."""

    what: str
    kind: str
    seed: int
    effects: tuple[str, ...]
    size: float
    noise: float
    counts: int
    rate: float
    correlation: float = 0.0
    dropouts: float = 0.0
    outliers: float = 0.0
    jitter: float = 0.0


def draw(what: str, rng: np.random.Generator) -> Case:
    """Draw a case: ``none``, ``one``, ``two``, ``withheld``, ``form`` or ``nuisance``."""
    kind = str(rng.choice(list(KINDS), p=(0.6, 0.25, 0.15)))
    counts = int(rng.choice(COUNTS))
    noise = max(float(np.exp(rng.uniform(math.log(0.05), math.log(0.5)))), 0.3 * 360 / counts)
    known = {e["name"]: e for e in virtual_rig.describe()}
    usable = [n for n in library() if n in known and n not in BASE]
    if kind == "single":
        usable = [n for n in usable if "drift" not in n]
    if kind != "mixed":
        usable = [n for n in usable if library()[n]["group"] != "drive" and not known[n]["needs"]]
    effects: tuple[str, ...] = ("none",)
    if what in {"one", "nuisance"} and (what == "one" or rng.random() < 0.5):  # noqa: PLR2004
        effects = (str(rng.choice(usable)),)
    elif what == "two":
        effects = tuple(str(e) for e in rng.choice(usable, 2, replace=False))
    elif what == "withheld":
        foreign = [n for n in known if ":" not in n and n not in library()]
        foreign = [n for n in foreign if kind == "mixed" or not known[n]["needs"]]
        name = str(rng.choice(foreign if rng.random() < 0.5 else usable))  # noqa: PLR2004
        effects = (name,)
    elif what == "form":
        effects = (
            str(rng.choice([n for n in known if ":" in n and n.split(":")[0] in library()])),
        )
    size = (
        1.0 if effects == ("none",) else float(np.exp(rng.uniform(math.log(0.08), math.log(1.2))))
    )
    case = Case(
        what,
        kind,
        int(rng.integers(2**31)),
        effects,
        size,
        math.degrees(math.radians(noise)),
        counts,
        float(rng.choice(SAMPLES)),
    )
    if what != "nuisance":
        return case
    spoilt = ("correlation", 0.5), ("dropouts", 0.02), ("outliers", 0.003), ("jitter", 0.0005)
    name, value = spoilt[int(rng.integers(len(spoilt)))]
    return dataclasses.replace(case, **{name: value})


def record(case: Case, folder: Path, *, clean: bool = False) -> tuple[Experiment, float]:
    """Write and read a case's experiment; return it with the noise's standard deviation, rad."""
    free, forced = KINDS[case.kind]
    request = virtual_rig.Request(
        "hidden",
        seed=case.seed,
        effects=case.effects,
        size=case.size,
        free=free,
        forced=forced,
        noise=0.0 if clean else case.noise,
        counts=0 if clean else case.counts,
        rate=case.rate,
        correlation=0.0 if clean else case.correlation,
        dropouts=0.0 if clean else case.dropouts,
        outliers=0.0 if clean else case.outliers,
        jitter=0.0 if clean else case.jitter,
    )
    where = virtual_rig.places(folder / ("clean" if clean else "noisy"), replace=True)
    virtual_rig.write(virtual_rig.make(request), where)
    count = math.tau / case.counts / math.sqrt(12)
    return read_experiment(where.experiment), math.hypot(math.radians(case.noise), count)


def difficulty(
    case: Case, folder: Path, base: Trial, without: Sequence[str] = ()
) -> tuple[dict[str, Any], list[str]]:
    """Return ``G`` and ``s`` of a case on noise-free records, and who is not told apart from it.

    Of a pair ``G`` of each alone. Names in ``without`` are no impostors, nor, where an effect is
    withheld, those that are not told apart from it.
    """
    gains, separation, alike = [], 1.0, set()
    for effect in case.effects:
        alone = dataclasses.replace(case, effects=(effect,), dropouts=0.0, outliers=0.0)
        experiment, sigma = record(alone, folder, clean=True)
        evidence = _with_noise(evidence_of(experiment), sigma)
        # From the noisy fit: what is measured is the effect, not how well a start is found.
        begin = fitted(
            evidence, base.fit.model, base.free, start=base.start, windows=base.fit.windows
        )
        if begin.chi2 > ASTRAY * begin.fit.degrees and len(case.effects) > 1:
            # What the other effect of a pair did to the windows may lead astray.
            again = fitted(evidence, base.fit.model, base.free, start=base.start)
            begin = min((begin, again), key=lambda trial: trial.chi2)
        gains.append(begin.chi2)
        own = effect.split(":")[0]
        pool = candidates({"Tr", own, *without}, driven=evidence.forced)
        scores = scores_of(evidence, begin, pool)
        best = [scores.scores[k] for k in scores.best()]
        near = {s.candidate.name for s in best if begin.chi2 - s.gain < CLEAR}
        alike |= near
        if case.what == "withheld":
            best = [score for score in best if score.candidate.name not in near]
        nearest = max((score.gain for score in best), default=0.0)
        separation = min(separation, 1 - nearest / begin.chi2)
    return {"G": gains, "s": separation}, sorted(alike)


def _with_noise(evidence: Evidence, sigma: float) -> Evidence:
    fitted = tuple(dataclasses.replace(run, sigma=sigma) for run in evidence.fitted)
    held = tuple(dataclasses.replace(run, sigma=sigma) for run in evidence.held)
    return dataclasses.replace(evidence, fitted=fitted, held=held)


def family(effect: str) -> str:
    """Return the family of an effect, with or without a variant."""
    name = effect.partition(":")[0]
    if name in library():
        return str(library()[name]["family"])
    groups = {e["name"].split(":")[0]: e["group"] for e in virtual_rig.describe()}
    return FAMILIES[groups[name]]


def run(case: Case) -> dict[str, Any]:
    """Make, diagnose and judge one case."""
    result: dict[str, Any] = dataclasses.asdict(case)
    result["families"] = [family(effect) for effect in case.effects if effect != "none"]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            experiment, _ = record(case, folder)
            hard: dict[str, Any] = {"G": [], "s": 1.0}
            without: list[str] = []
            if case.effects != ("none",) and case.dropouts == 0:
                base = baseline(evidence_of(experiment))
                hard, alike = difficulty(case, folder, base)
                if case.what == "withheld":
                    own = [effect.split(":")[0] for effect in case.effects]
                    without = [n for n in (*own, *alike) if n in library()]
            begin = time.process_time()
            found = diagnose(experiment, without=without)
            seconds = time.process_time() - begin
            truth = _parameters(folder / "noisy.truth.toml")
        except InputError as error:
            return result | {"error": str(error)}
    samples = sum(r.time.size for r in experiment.runs)
    said = {"without": without, "truth": truth, "seconds": seconds, "samples": samples}
    return result | hard | said | answer(found)


def answer(found: Discrepancy) -> dict[str, Any]:
    """Return what a diagnosis says, and what it rests on."""
    judgement, held = found.judgement, found.best.held
    return {
        "verdict": found.verdict,
        "named": [effect.name for effect in found.effects],
        "approximate": [effect.approximate for effect in found.effects],
        "probability": [effect.probability for effect in found.effects],
        "named_families": [family(effect.name) for effect in found.effects],
        "classes": found.equivalent,
        "nearest": list(found.nearest.trial.names),
        "parameters": {e.name: [dict(e.parameters), dict(e.ci95)] for e in found.effects},
        "held": held.chi2 / held.degrees,
        "closed": judgement.closed,
        "spread": judgement.spread,
        "ratio": [judgement.ratio, judgement.ratio_allowed],
        "left": [judgement.left, judgement.uneven, judgement.chance],
        "form": [judgement.form.chance, dict(judgement.form.chances), judgement.form.further],
        "standings": [
            {
                "name": s.candidate.name,
                "gain": s.gain,
                "share": s.share,
                "equivalent": s.equivalent,
                "rivals": [[r.candidate.name, r.behind, r.contains] for r in s.rivals[:4]],
            }
            for s in judgement.standings
        ],
        "attempts": [[a.names, a.score, a.gain, a.held_gain, a.accepted] for a in found.attempts],
    }


def _parameters(path: Path) -> dict[str, Any]:
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    return {e["name"]: e["parameters"] for e in table.get("effect", [])}
