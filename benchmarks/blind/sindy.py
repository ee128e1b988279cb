"""``pendmap diagnose`` and SINDy on the same experiments, by bins of G.

    python -m benchmarks.blind.run --experiments 1000 --out blind.jsonl
    python -m benchmarks.blind.sindy blind.jsonl --workers 2 --out sindy.jsonl

Each experiment that ``run.py`` wrote down with one effect hidden, two or none is recorded again
from its seed. SINDy regresses ``th''`` sparsely on the candidates of ``diagnose`` in the
same shapes (``sindy_features``); torques have the very form that the rig hides. Angle and
velocity come from a filter of Savitzky and Golay whose width depends on the noise.

- Strong form (Brunton, Proctor & Kutz 2016): the second derivative of the smoothed angle, its
  features through the same smoothing.
- Weak form (Messenger & Bortz 2021): integrals against test functions, derivatives by parts, rows
  whitened by the noise that overlapping test functions share (Bortz, Messenger & Dukic 2023).

Sparse models come from pysindy (Kaptanoglu et al. 2022). Optimizer, widths and penalty on a
coefficient are those that were right most often on experiments of another seed (901): 50 for the
weak form (FROLS, STLSQ, SSR), 38 of them for the strong one (FROLS, STLSQ). SR3 is there to be
tried: with thresholds up to the length of the target it kept nine features and more. A second
column for each form has the least penalty with which it claims no more than pendmap where nothing
is hidden, on these very experiments.

As in ``diagnose`` gravity, viscous damping and Coulomb friction are in every model, and at most
three further effects, also in SINDy. "Right" is defined by ``report.right`` for both. SINDy
is given the classes of equals that its own features cannot distinguish, and those found by
pendmap.

References
----------
Brunton, Proctor & Kutz (2016), PNAS 113, 3932. Messenger & Bortz (2021), J. Comput. Phys. 443,
110525. Bortz, Messenger & Dukic (2023), Bull. Math. Biol. 85, 110. Kaptanoglu et al. (2022), J.
Open Source Softw. 7, 3994.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import json
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

# One thread per process, set before numpy is imported: the processes share the processors.
os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"), "1")
)

import numpy as np

from benchmarks.blind.cases import Case, record
from benchmarks.blind.report import right, strength, true_names, wilson
from benchmarks.blind.sindy_choice import choose
from benchmarks.blind.sindy_forms import Setting, prepared, regression
from benchmarks.peers.report import machine, note, say, table
from pendmap.comparison.data import split_records
from pendmap.identification.readings import as_fit_run

WIDTH = 2.0
SETTINGS = {
    "strong": Setting("strong", "frols", support=7.0, penalty=2.0),
    "weak": Setting("weak", "frols", support=2.0, penalty=3.0),
}
"""Settings with the largest share right on seed 901."""

PENALTIES = (*np.arange(1.0, 12.01, 0.5).tolist(), *np.geomspace(14.0, 200.0, 16).tolist())
"""Factors of BIC's penalty at which answers are computed: up to no claims from either form, so that
a column with at most pendmap's false alarms exists."""

EDGES = (0.0, 12.0, 30.0, 100.0, 300.0, 1000.0, np.inf)
"""Edges of the bins of G; a pair is in the bin of the lesser one."""

KINDS = ("one", "two", "none")


def case_of(row: dict[str, Any]) -> Case:
    """Return the case of a row, from which the same experiment is made."""
    names = [field.name for field in dataclasses.fields(Case)]
    return Case(**{n: row[n] for n in names} | {"effects": tuple(row["effects"])})


def run(row: dict[str, Any]) -> dict[str, Any]:
    """Make the experiment of a row again and run SINDy on it."""
    result: dict[str, Any] = {"what": row["what"], "seed": row["seed"]}
    records = split_records(record(case_of(row)).experiment)
    runs = [as_fit_run(*pair) for pair in zip(records.runs, records.readings, strict=True)]
    begin = time.process_time()
    data = prepared(runs, WIDTH)
    shared = time.process_time() - begin
    for form, setting in SETTINGS.items():
        begin = time.process_time()
        models = choose(regression(data, setting), setting, PENALTIES)
        seconds = time.process_time() - begin + shared
        by_penalty = [dataclasses.asdict(model) for model in models]
        result[form] = {"by_penalty": by_penalty, "seconds": seconds}
    return result


def judged(row: dict[str, Any], answer: dict[str, Any] | None) -> bool:
    """Return whether an answer of pendmap or SINDy is right, by one rule for both.

    Each effect that SINDy chose represents all that its features, or pendmap, cannot distinguish
    from it.
    """
    if answer is None:
        names, said = row["named"], row
        claimed = row["verdict"] != "none"
    else:
        names = answer["names"]
        own = [
            sorted({*same, *(n for c in row["classes"] if name in c for n in c)})
            for name, same in zip(names, answer["classes"], strict=True)
        ]
        said = row | {"named": names, "classes": own}
        claimed = bool(names)
    return right(said) if true_names(row) else not claimed


def columns(
    rows: list[dict[str, Any]], answers: dict[int, dict[str, Any]]
) -> dict[str, tuple[str, int] | None]:
    """Return the columns of the table: pendmap, and each form with two penalties."""
    sound = [row for row in rows if row["what"] == "none"]
    claimed = sum(not judged(row, None) for row in sound)
    found: dict[str, tuple[str, int] | None] = {"pendmap": None}
    for form, setting in SETTINGS.items():
        found[f"SINDy {form}"] = form, PENALTIES.index(setting.penalty)
        for k, penalty in enumerate(PENALTIES):
            alarms = sum(not judged(r, answers[r["seed"]][form]["by_penalty"][k]) for r in sound)
            if alarms <= claimed:
                found[f"{form}, no more false alarms (penalty {penalty:g})"] = form, k
                break
    return found


def lines(
    rows: list[dict[str, Any]],
    answers: dict[int, dict[str, Any]],
    which: dict[str, tuple[str, int] | None],
) -> list[list[str]]:
    """Return the share of right answers in each column, by kind and bin of G."""
    found = []
    for what in KINDS:
        edges = list(itertools.pairwise(EDGES)) if what != "none" else [(0.0, np.inf)]
        for low, high in edges:
            own = [r for r in rows if r["what"] == what and low <= strength(r) < high]
            if not own:
                continue
            cells = []
            for column in which.values():
                hits = 0
                for row in own:
                    said = None
                    if column is not None:
                        said = answers[row["seed"]][column[0]]["by_penalty"][column[1]]
                    hits += judged(row, said)
                cells.append(wilson(hits, len(own)))
            label = "nothing hidden: silent" if what == "none" else f"{what}, G {low:g} to {high:g}"
            found.append([label, *cells])
    return found


def main() -> None:
    """Run SINDy on the rows without an answer, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("blind", type=Path, help="what benchmarks.blind.run wrote")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument(
        "--limit", type=int, default=None, help="number of experiments, from the first"
    )
    parser.add_argument("--out", type=Path, default=Path("sindy.jsonl"), help="SINDy's answers")
    given = parser.parse_args()
    if not given.blind.exists():
        parser.error(f"{given.blind}: there must be such a file, written by benchmarks.blind.run")
    rows = [row for row in _read(given.blind) if row["what"] in KINDS and "error" not in row]
    rows = rows[: given.limit]
    answers = {row["seed"]: row for row in _read(given.out)}
    left = [row for row in rows if row["seed"] not in answers]
    with (
        ProcessPoolExecutor(given.workers) as pool,
        given.out.open("a", encoding="utf-8") as out,
    ):
        for done, answer in enumerate(pool.map(run, left), 1):
            out.write(json.dumps(answer, default=float) + "\n")
            out.flush()
            answers[answer["seed"]] = answer
            if done % 20 == 0:
                note(f"{done} of {len(left)}")
    say(machine(("numpy", "scipy", "pysindy")))
    say(f"{len(rows)} experiments of {given.blind}; SINDy's answers in {given.out}\n")
    which = columns(rows, answers)
    say(table(["hidden", *which], lines(rows, answers, which)))
    say("")
    for form in SETTINGS:
        spent = [answers[row["seed"]][form]["seconds"] for row in rows]
        if spent:
            say(
                f"SINDy {form}: {np.median(spent):.2f} s of one thread, median; pendmap "
                f"{np.median([row['seconds'] for row in rows]):.2f} s"
            )


def _read(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a file, except a last one that is incomplete."""
    if not path.exists():
        return []
    whole = path.read_text(encoding="utf-8").splitlines(keepends=True)
    try:
        found = [json.loads(line) for line in whole if line.endswith("\n")]
        _ = [(row["what"], row["seed"]) for row in found]
    except (ValueError, TypeError, KeyError):
        sys.exit(
            f"{path}: must be a file that benchmarks.blind.run wrote, got no list of experiments"
        )
    return found


if __name__ == "__main__":
    main()
