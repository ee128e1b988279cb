"""The blind benchmark of ``pendmap diagnose``: the truth is in files that no diagnosis opens.

    python -m benchmarks.blind.run --experiments 1000 --workers 2 --out blind.jsonl

Two in five of the experiments hide nothing; of the others half hide one effect, a quarter two, and
in a quarter the true effect is withheld from the search, with all that these records cannot
distinguish from it. ``--forms`` and ``--nuisances`` add experiments whose form differs from the
library's, and damaged ones, which are scored separately. ``--mess`` adds experiments with
disturbances that no effect describes, half to ten times as strong as the noise; three in four of
them have one main effect that changes the readings at least as much. ``--layouts`` adds experiments
of laboratories that record less: one forced run, a single decay, 10 to 500 readings a second, 10 to
140 s. The seed is drawn and recorded; results are appended, and an interrupted run is resumed.
``--report`` only prints the tables of a file, and ``--plot`` draws the reliability of
probabilities.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import secrets
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

# One thread per process, set before numpy is imported: the processes share the processors.
os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"), "1")
)

import numpy as np

from benchmarks.blind import answer, report
from benchmarks.blind.cases import Case, draw
from benchmarks.peers.report import machine, note, say, table

KINDS = ["none", "one", "none", "one", "two", "none", "one", "withheld", "none", "two"]
KINDS += ["none", "one", "none", "one", "withheld", "none", "one", "none", "two", "withheld"]
"""Kinds in turn, so that any part of a run contains all of them."""


FURTHER = ("form", "nuisance", "mess", "layout")
"""Experiments that are scored separately, in the order of their random streams."""


def drawn(count: int, seed: int, **further: int) -> list[Case]:
    """Draw the cases, with the given number of each kind in ``FURTHER``.

    Each has its own seed: an additional case changes no other.
    """
    kinds = [KINDS[k % len(KINDS)] for k in range(count)]
    cases = []
    for stream, what in enumerate(("", *FURTHER)):
        number = further.get(what, 0) if what else count
        for k in range(number):
            rng = np.random.default_rng((seed, stream, k))
            cases.append(draw(what or kinds[k], rng))
    return cases


def rows_of(path: Path) -> list[dict[str, Any]]:
    """Return the results in a file."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def _key(row: dict[str, Any]) -> tuple[str, int]:
    return row["what"], row["seed"]


def main() -> None:
    """Draw cases, diagnose them, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--experiments", type=int, default=1000)
    parser.add_argument("--forms", type=int, default=0)
    parser.add_argument("--nuisances", type=int, default=0)
    parser.add_argument("--mess", type=int, default=0)
    parser.add_argument("--layouts", type=int, default=0)
    parser.add_argument("--seed", type=int, default=None, help="drawn if none is given")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--out", type=Path, default=Path("blind.jsonl"))
    parser.add_argument("--report", action="store_true", help="only print what --out holds")
    parser.add_argument("--plot", type=Path, default=None, help="figure of the probabilities")
    given = parser.parse_args()
    rows = rows_of(given.out)
    drawn_before = rows[-1]["run"] if rows else secrets.randbits(32)
    seed = drawn_before if given.seed is None else given.seed
    if not given.report:
        known = {_key(row) for row in rows}
        further = {
            "form": given.forms,
            "nuisance": given.nuisances,
            "mess": given.mess,
            "layout": given.layouts,
        }
        cases = drawn(given.experiments, seed, **further)
        left = [case for case in cases if _key(dataclasses.asdict(case)) not in known]
        with (
            ProcessPoolExecutor(given.workers) as pool,
            given.out.open("a", encoding="utf-8") as out,
        ):
            for done, row in enumerate(pool.map(answer.run, left), 1):
                out.write(json.dumps({"run": seed} | row, default=float) + "\n")
                out.flush()
                rows.append(row)
                if done % 20 == 0:
                    note(f"{done} of {len(left)}")
    failed = [row for row in rows if "error" in row]
    good = [row for row in rows if "error" not in row]
    say(machine(("numpy", "scipy")))
    say(f"seed      {seed}; {len(rows)} experiments, {len(failed)} refused; all in {given.out}\n")
    say(table(["figure", "target", "measured"], report.figures(good)))
    say("")
    if layouts := report.layouts(good):
        say(table(["layout", "false alarms", "right", "wrong without reserve"], layouts))
        say("")
    say(table(["probability", "names", "mean", "right"], report.reliability(good)))
    say("")
    say(table(["hidden, G >= 60", "said", "times"], report.confusion(good)))
    for row in failed:
        say(f"refused: {row['what']} {row['effects']} seed {row['seed']}: {row['error']}")
    if given.plot:
        report.draw_reliability(good, given.plot)


if __name__ == "__main__":
    main()
