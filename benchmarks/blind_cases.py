"""One blind experiment: drawn, recorded by the virtual rig, diagnosed, compared with its truth.

Difficulty is measured, not assumed: the same motion without noise and counts is scored with the
noise that the record has. ``G`` is what the best possible model would gain there,
``s = 1 - G_impostor / G`` how far the nearest other name falls short.
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
from pendmap.discrepancy.candidates import candidates
from pendmap.discrepancy.evidence import Evidence, evidence_of
from pendmap.discrepancy.scores import scores_of
from pendmap.discrepancy.trial import fitted
from pendmap.errors import InputError
from pendmap.model.effects import library
from pendmap.records import read_experiment

if TYPE_CHECKING:
    from pendmap.discrepancy.trial import Trial
    from pendmap.records import Experiment

KINDS = {"mixed": (5, 4), "free": (5, 0), "single": (1, 0)}
SAMPLES = (100.0, 100.0, 100.0, 200.0, 500.0)
COUNTS = (1024, 2048, 4096, 8192)
BASE = ("viscous_damping", "coulomb_friction")
"""What the baseline has: not hidden."""

EQUALS = {
    "bias_torque": ("bias_torque", "encoder_offset"),
    "quadratic_drag": ("quadratic_drag", "power_law_drag"),
    "cubic_damping": ("cubic_damping", "power_law_drag"),
}
"""What is left out with an effect that is withheld: what does the same."""


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
    without: tuple[str, ...] = ()
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
        usable = [n for n in usable if library()[n]["group"] != "drive"]
    effects: tuple[str, ...] = ("none",)
    without: tuple[str, ...] = ()
    if what in {"one", "nuisance"} and (what == "one" or rng.random() < 0.5):  # noqa: PLR2004
        effects = (str(rng.choice(usable)),)
    elif what == "two":
        effects = tuple(str(e) for e in rng.choice(usable, 2, replace=False))
    elif what == "withheld":
        foreign = [n for n in known if ":" not in n and n not in library()]
        foreign = [n for n in foreign if kind == "mixed" or "drive" not in n]
        name = str(rng.choice(foreign if rng.random() < 0.5 else usable))  # noqa: PLR2004
        effects, without = (name,), EQUALS.get(name, (name,))
        without = tuple(n for n in without if n in library())
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
        without,
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


def difficulty(case: Case, folder: Path, base: Trial) -> dict[str, Any]:
    """Return ``G`` and ``s`` of a case on noise-free records; of a pair ``G`` of each alone."""
    gains = []
    separation = 1.0
    for effect in case.effects:
        alone = dataclasses.replace(case, effects=(effect,), dropouts=0.0, outliers=0.0)
        experiment, sigma = record(alone, folder, clean=True)
        evidence = _with_noise(evidence_of(experiment), sigma)
        # From the noisy fit: what is measured is the effect, not how well a start is found.
        begin = fitted(
            evidence, base.fit.model, base.free, start=base.start, windows=base.fit.windows
        )
        gains.append(begin.chi2)
        own = {effect.split(":")[0], *case.without}
        pool = candidates({"Tr", *own}, driven=evidence.forced)
        scores = scores_of(evidence, begin, pool)
        nearest = max(score.gain for score in scores.scores)
        separation = min(separation, 1 - nearest / begin.chi2)
    return {"G": gains, "s": separation}


def _with_noise(evidence: Evidence, sigma: float) -> Evidence:
    fitted = tuple(dataclasses.replace(run, sigma=sigma) for run in evidence.fitted)
    held = tuple(dataclasses.replace(run, sigma=sigma) for run in evidence.held)
    return dataclasses.replace(evidence, fitted=fitted, held=held)


def run(case: Case) -> dict[str, Any]:
    """Make, diagnose and judge one case."""
    result: dict[str, Any] = dataclasses.asdict(case)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            experiment, _ = record(case, folder)
            begin = time.perf_counter()
            found = diagnose(experiment, without=case.without)
            seconds = time.perf_counter() - begin
            truth = _parameters(folder / "noisy.truth.toml")
            hard = {"G": [], "s": 1.0}
            if case.effects != ("none",) and case.dropouts == 0:
                hard = difficulty(case, folder, found.base.trial)
        except InputError as error:
            return result | {"error": str(error)}
    named = {effect.name: effect for effect in found.effects}
    held = found.best.held
    return (
        result
        | hard
        | {
            "verdict": found.verdict,
            "named": list(named),
            "classes": found.equivalent,
            "nearest": list(found.nearest.trial.names),
            "probability": [effect.probability for effect in found.effects],
            "parameters": {n: [dict(e.parameters), dict(e.ci95)] for n, e in named.items()},
            "truth": truth,
            "held": held.chi2 / held.degrees,
            "left": found.judgement.left,
            "uneven": found.judgement.uneven,
            "closed": found.judgement.closed,
            "chance": found.judgement.chance,
            "ratio": [found.judgement.ratio, found.judgement.ratio_allowed],
            "attempts": [
                [a.names, a.score, a.gain, a.held_gain, a.accepted] for a in found.attempts
            ],
            "seconds": seconds,
            "samples": sum(r.time.size for r in experiment.runs),
        }
    )


def _parameters(path: Path) -> dict[str, Any]:
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    return {e["name"]: e["parameters"] for e in table.get("effect", [])}
