"""Distinguishing power of the next experiment, against the predictions of ``pendmap diagnose``.

    python -m benchmarks.blind.next_experiment --cases 60 --seed 1 --out next.jsonl

Small effects are hidden in free decays of the virtual rig until a diagnosis cannot distinguish
names. Then the rig records the recommendation of ``next_experiment`` (``recommended``) and also, as
a recommendation is meant to leave no doubt, a random proposal of the same table that leaves some
(``weaker``); old and new records are diagnosed together. The table compares the frequencies of a
single remaining name, and of a wrong one, with the prediction, and twice the difference of
log-likelihoods with the predicted ``s G``. Results are appended; ``--report`` only prints.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import os
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

# One thread per process, set before numpy is imported: the processes share the processors.
os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"), "1")
)

import numpy as np

from benchmarks.blind.report import wilson
from benchmarks.peers.report import machine, say, table
from pendmap import virtual_rig
from pendmap.diagnosis import diagnose
from pendmap.records import read_experiment
from pendmap.virtual_rig import RunPlan

if TYPE_CHECKING:
    from pendmap.diagnosis import Discrepancy
    from pendmap.diagnosis.next_experiment.proposals import Proposal
    from pendmap.records import Experiment

EFFECTS = {
    "quadratic_drag": (0.01, 0.2),
    "cubic_damping": (0.01, 0.2),
    "coulomb_drift": (0.02, 0.3),
    "viscous_drift": (0.02, 0.3),
    "elastic_restoring": (0.1, 1.0),
    "encoder_gain": (0.1, 1.0),
    "asymmetric_viscous": (0.1, 1.0),
    "load_dependent_friction": (0.05, 0.5),
}
"""Hidden effects, and ranges of their sizes over the usual ones: weak enough to be confused."""

DOUBTFUL = (6.0, 40.0)
"""Predicted s G of a proposal that leaves some doubt."""


def record(request: virtual_rig.Request) -> Experiment:
    """Let the rig record and read its files; the truth is not read."""
    with tempfile.TemporaryDirectory() as folder:
        where = virtual_rig.places(Path(folder) / "records", replace=True)
        virtual_rig.write(virtual_rig.make(request), where)
        return read_experiment(where.experiment)


def add_effects(
    request: virtual_rig.Request, old: Experiment, proposal: Proposal, *, pause: float = 20.0
) -> Experiment:
    """Return old records with those of a proposal by the same rig; no new one is held out."""
    begun = [run.plan for run in virtual_rig.make(request).runs]
    plans, late = [], 0.0
    for start in proposal.runs:
        lab = start.lab_time_s + late
        plans.append(
            RunPlan("free", start.theta, start.velocity, proposal.length_s, lab_time=round(lab, 1))
        )
        late += proposal.length_s + pause
    asked = {"free": None, "forced": None, "duration": None, "plans": (*begun, *plans)}
    every = record(dataclasses.replace(request, **asked))
    new = tuple(dataclasses.replace(run, hold_out=False) for run in every.runs[len(begun) :])
    return dataclasses.replace(old, runs=(*old.runs, *new))


def outcome(found: Discrepancy, truth: str, others: set[str]) -> dict[str, Any]:
    """Return the remaining name, and the deficit of the nearest other one relative to the truth."""
    for each in found.assessment.identified:
        name = each.candidate.name
        behind = {r.candidate.name: r.behind for r in each.alternatives}
        alike = {r.candidate.name for r in each.alternatives if r.alike}
        if name == truth:
            near = [behind[other] for other in others if other in behind]
            left = "right" if not alike & others else "both"
            return {"left": left, "power": min(near) if near else None}
        if name in others:
            left = "both" if truth in alike else "wrong"
            return {"left": left, "power": -behind[truth] if truth in behind else None}
    return {"left": "neither", "power": None}


def case(seed: int) -> list[dict[str, Any]]:
    """Hide an effect; if the diagnosis is ambiguous, record more and diagnose again."""
    rng = np.random.default_rng(seed)
    truth = str(rng.choice(list(EFFECTS)))
    low, high = EFFECTS[truth]
    request = virtual_rig.Request(
        "hidden",
        seed=seed,
        effects=(truth,),
        size=float(np.exp(rng.uniform(math.log(low), math.log(high)))),
        free=int(rng.integers(2, 5)),
        forced=0,
        noise=float(np.exp(rng.uniform(math.log(0.1), math.log(0.4)))),
    )
    old = record(request)
    found = diagnose(old)
    if found.verdict != "ambiguous" or found.advice.outlook is None:
        return []
    outlook = found.advice.outlook
    best = outlook.best
    if best is None or truth not in outlook.about:
        return []
    choices = {"recommended": best}
    weaker = [p for p in outlook.prospects if DOUBTFUL[0] < p.value < DOUBTFUL[1]]
    if weaker:
        choices["weaker"] = weaker[int(rng.integers(len(weaker)))]
    rows = []
    for choice, prospect in choices.items():
        again = diagnose(add_effects(request, old, prospect.proposal))
        others = set(outlook.about) - {truth}
        rows.append(
            {
                "seed": seed,
                "effect": truth,
                "about": list(outlook.about),
                "choice": choice,
                "what": prospect.proposal.what,
                "now": outlook.now,
                "predicted": prospect.value,
                "resolved": prospect.resolved,
                "wrong": prospect.wrong,
                "verdict": again.verdict,
            }
            | outcome(again, truth, others)
        )
    return rows


def report(rows: list[dict[str, Any]]) -> str:
    """Return the table of predictions and outcomes."""
    lines = []
    for choice in ("recommended", "weaker"):
        own = [row for row in rows if row["choice"] == choice]
        told = [row for row in own if row["left"] != "neither"]
        measured = [row for row in told if row["power"] is not None]
        ratio = [row["power"] / row["predicted"] for row in measured]
        # Twice the difference of log-likelihoods has the standard deviation 2 sqrt(s G).
        z = [(r["power"] - r["predicted"]) / (2 * math.sqrt(r["predicted"])) for r in measured]
        lines.append(
            [
                choice,
                str(len(own)),
                f"{np.median([row['predicted'] for row in own]):.3g}" if own else "",
                f"{100 * np.mean([row['resolved'] for row in own]):.1f} %" if own else "",
                wilson(sum(row["left"] == "right" for row in told), len(told)),
                f"{100 * np.mean([row['wrong'] for row in own]):.2f} %" if own else "",
                wilson(sum(row["left"] == "wrong" for row in told), len(told)),
                str(len(own) - len(told)),
                f"{np.median(ratio):.2f}" if ratio else "",
                f"{np.mean(z):.2f} +- {np.std(z):.2f}" if choice == "weaker" and z else "",
            ]
        )
    head = [
        "new record",
        "cases",
        "s G predicted",
        "one name, predicted",
        "came true",
        "wrong, predicted",
        "came true",
        "other names",
        "s G measured over predicted",
        "z",
    ]
    return table(head, lines)


def main() -> None:
    """Run cases until there are enough ambiguous ones, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("next.jsonl"))
    parser.add_argument("--report", action="store_true")
    asked = parser.parse_args()
    rows: list[dict[str, Any]] = []
    if asked.out.exists():
        rows = [json.loads(line) for line in asked.out.read_text(encoding="utf-8").splitlines()]
    begun, drawn = time.perf_counter(), 0
    done = {row["seed"] for row in rows}
    if not asked.report:
        with ProcessPoolExecutor(asked.workers) as pool, asked.out.open("a") as out:
            first = 1_000_000 * asked.seed + 1 + max((s % 1_000_000 for s in done), default=-1)
            while len(done) < asked.cases:
                batch = range(first, first + 4 * asked.workers)
                first, drawn = batch.stop, drawn + len(batch)
                for found in pool.map(case, batch):
                    for row in found:
                        done.add(row["seed"])
                        rows.append(row)
                        out.write(json.dumps(row) + "\n")
                out.flush()
        say(f"{drawn} experiments drawn in {time.perf_counter() - begun:.0f} s")
    say(machine(["pendmap", "numpy", "scipy"]))
    say(report(rows))


if __name__ == "__main__":
    main()
