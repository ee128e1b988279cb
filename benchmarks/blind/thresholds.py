"""Sensitivity of verdicts to the thresholds: each is halved and doubled.

    python -m benchmarks.blind.thresholds --experiments 200 --seed 1 --workers 2

The experiments are those of run.py. Each is diagnosed with the default thresholds, and with one of
them halved, then doubled. A verdict has changed if its word, its names or their reserve have. Most
searches share their fits, which are cached. A quarter of the experiments have disturbances that no
effect describes. Results are appended to ``--out``, and an interrupted run is resumed.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

# One thread per process, set before numpy is imported: the processes share the processors.
os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"), "1")
)

from benchmarks.blind.cases import Case, record
from benchmarks.blind.run import drawn, rows_of
from benchmarks.peers.report import machine, note, say, table
from pendmap import comparison
from pendmap.comparison.data import DataSplit
from pendmap.diagnosis import diagnose, fitted_model, hold_out, refit, scores
from pendmap.diagnosis.fitted_model import FittedModel
from pendmap.diagnosis.hold_out import HoldOut
from pendmap.diagnosis.thresholds import Thresholds
from pendmap.errors import InputError
from pendmap.identification.fit import TrajectoryFit
from pendmap.identification.runs import FitRun
from pendmap.model.effects import library
from pendmap.records import Experiment
from pendmap.residuals import by_run, torque
from pendmap.residuals.noise import ResidualNoise

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

FIELDS = [field.name for field in dataclasses.fields(Thresholds)]
FACTORS = (0.5, 2.0)
RATE = 100.0
"""Sampling rate, 1/s."""


def changed(name: str, factor: float) -> Thresholds:
    """Return the thresholds with one of them multiplied; integers remain integers."""
    value = getattr(Thresholds(), name)
    new = max(round(factor * value), 1) if isinstance(value, int) else factor * value
    return dataclasses.replace(Thresholds(), **{name: new})


KNOWN_BY_ITSELF = (Experiment, FitRun, HoldOut, ResidualNoise, TrajectoryFit, FittedModel)
"""Arguments that are identical between searches if all before them are."""

REMEMBERED = {
    "split_records": comparison.data,
    "weight_records": fitted_model,
    "fit_model": fitted_model,
    "impose_physics": fitted_model,
    "score_candidates": scores,
    "evaluate_hold_out": hold_out,
    "hold_out_losses": hold_out,
    "profile_intervals": refit,
    "residual_torque": torque,
    "parameters_by_run": by_run,
}
"""Functions whose results are cached, and their modules."""


def remembered(compute: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that computes each result once."""
    known: dict[str, Any] = {}
    kept: list[object] = []

    def key_of(value: object) -> object:
        if isinstance(value, KNOWN_BY_ITSELF):
            kept.append(value)
            return id(value)
        if isinstance(value, DataSplit):
            parts = (value.fitted, value.held, value.fitted_of, value.held_of, value.inside)
            return [key_of(part) for part in parts]
        if isinstance(value, tuple | list):
            return [key_of(part) for part in value]
        return value

    def asked(*given: Any, **named: Any) -> Any:  # noqa: ANN401 (what is remembered)
        parts = [key_of(value) for value in given]
        key = repr((parts, {name: key_of(value) for name, value in named.items()}))
        if key not in known:
            try:
                known[key] = compute(*given, **named)
            except InputError as error:
                known[key] = error
        if isinstance(known[key], InputError):
            raise known[key]
        return known[key]

    return asked


@contextlib.contextmanager
def memory() -> Iterator[None]:
    """Cache the fits, scores and other results of a search."""
    modules = [m for name, m in sys.modules.items() if name.startswith("pendmap.")]
    places = []
    for name, home in REMEMBERED.items():
        whole = getattr(home, name)
        asked = remembered(whole)
        for module in modules:
            if getattr(module, name, None) is whole:
                places.append((module, name, whole))
                setattr(module, name, asked)
    try:
        yield
    finally:
        for module, name, whole in places:
            setattr(module, name, whole)


def run(case: Case) -> dict[str, Any]:
    """Return the verdicts on an experiment with the default thresholds and each changed one."""
    own = [effect.split(":")[0] for effect in case.effects] if case.what == "withheld" else []
    without = [name for name in own if name in library()]
    experiment = record(case).experiment

    def said(thresholds: Thresholds) -> list[str]:
        try:
            found = diagnose(experiment, without=without, thresholds=thresholds)
        except InputError as error:
            return ["refused", str(error)]
        names = [effect.name + "?" * effect.approximate for effect in found.effects]
        return [found.verdict, *names]

    with memory():
        usual = said(Thresholds())
        others = {f"{n} {f:g}": said(changed(n, f)) for n in FIELDS for f in FACTORS}
    return {"what": case.what, "seed": case.seed, "effects": case.effects, "": usual} | others


def main() -> None:
    """Draw cases, diagnose them, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--experiments", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--out", type=Path, default=Path("thresholds.jsonl"))
    given = parser.parse_args()
    mess = given.experiments // 4
    cases = drawn(given.experiments - mess, given.seed, mess=mess)
    cases = [dataclasses.replace(case, rate=RATE) for case in cases]
    rows = rows_of(given.out)
    known = {(row["what"], row["seed"]) for row in rows}
    left = [case for case in cases if (case.what, case.seed) not in known]
    with (
        ProcessPoolExecutor(given.workers) as pool,
        given.out.open("a", encoding="utf-8") as out,
    ):
        for done, row in enumerate(pool.map(run, left), 1):
            out.write(json.dumps(row) + "\n")
            out.flush()
            rows.append(row)
            note(f"{done} of {len(left)}")
    say(machine(("numpy", "scipy")))
    say(f"seed      {given.seed}; verdicts that change, of {len(rows)}\n")
    lines = [
        [
            name,
            f"{getattr(Thresholds(), name):g}",
            *(str(sum(row[f"{name} {f:g}"] != row[""] for row in rows)) for f in FACTORS),
        ]
        for name in FIELDS
    ]
    say(table(["threshold", "value", "halved", "doubled"], lines))


if __name__ == "__main__":
    main()
