"""The blind benchmark of ``pendmap diagnose``: seeds drawn now and recorded, truth in files beside.

    python benchmarks/blind.py --count 100 --out blind.jsonl

Of the experiments two in five hide nothing; of the others half hide one effect, a quarter two, and
in a quarter the true effect is withheld from the search. ``--forms`` and ``--nuisances`` add
experiments whose form differs from the library's, and spoilt ones, which are scored apart.
Intervals are those of Wilson (1927), J. Am. Stat. Assoc. 22, 209, 95 %.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import secrets
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

# One thread a process, before numpy is imported: the processes share the processor.
os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"), "1")
)

import numpy as np

import blind_cases
from peers.report import machine, note, say, table

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    Row = dict[str, Any]

CLEAR = 25.0
"""Separation times score from which names are told apart nearly always."""


def wilson(hits: int, of: int) -> str:
    """Return a share with its interval."""
    if of == 0:
        return "no cases"
    z, share = 1.96, hits / of
    middle = (share + z * z / (2 * of)) / (1 + z * z / of)
    half = z * math.sqrt(share * (1 - share) / of + z * z / (4 * of * of)) / (1 + z * z / of)
    low, high = max(middle - half, 0.0), min(middle + half, 1.0)
    return f"{100 * share:.1f} % ({hits} of {of}; {100 * low:.1f} to {100 * high:.1f} %)"


def true_names(row: Row) -> list[str]:
    """Return the names of what is hidden, without their variants."""
    return [effect.split(":")[0] for effect in row["effects"] if effect != "none"]


def possible(row: Row) -> set[str]:
    """Return all names that the verdict holds possible."""
    return {*row["named"], *(name for names in row["classes"] for name in names)}


def right(row: Row) -> bool:
    """Whether every hidden effect is named, or in a class that is reported."""
    return set(true_names(row)) <= possible(row) and row["verdict"] != "unknown"


def strength(row: Row) -> float:
    """Return the least score of what is hidden."""
    return min(row["G"], default=0.0)


def figures(rows: list[Row]) -> list[list[str]]:
    """Return the lines of the table: what, target, measured."""

    def share(of: Iterable[Row], hit: Callable[[Row], bool]) -> str:
        chosen = list(of)
        return wilson(sum(map(hit, chosen)), len(chosen))

    none = [r for r in rows if r["what"] == "none"]
    one = [r for r in rows if r["what"] == "one"]
    two = [r for r in rows if r["what"] == "two"]
    withheld = [r for r in rows if r["what"] == "withheld"]
    clear = [r for r in one if strength(r) >= 100 and r["s"] * strength(r) >= CLEAR]  # noqa: PLR2004
    pairs = [r for r in two if strength(r) >= 100 and r["s"] * strength(r) >= CLEAR]  # noqa: PLR2004
    strong = [r for r in withheld if strength(r) >= 100]  # noqa: PLR2004
    forms = [r for r in rows if r["what"] == "form" and strength(r) >= 100]  # noqa: PLR2004
    spoilt = [r for r in rows if r["what"] == "nuisance"]
    sizes = [1 + sum(len(c) - 1 for c in r["classes"]) for r in clear if right(r)]
    hit = [r for r in clear if r["named"] == true_names(r)]
    inside, errors = _sizes(hit)
    seen = [r for r in one if strength(r) >= 60]  # noqa: PLR2004
    return [
        [
            "false alarms, nothing hidden",
            "at most 1 %",
            share(none, lambda r: r["verdict"] != "none"),
        ],
        ["right, G >= 100 and s G >= 25", "98 %", share(clear, right)],
        ["the name alone", "90 %", share(clear, lambda r: r["named"] == true_names(r))],
        ["detected, G >= 60", "95 %", share(seen, lambda r: r["verdict"] != "none")],
        [
            "detected, G >= 100",
            "99 %",
            share((r for r in seen if strength(r) >= 100), lambda r: r["verdict"] != "none"),  # noqa: PLR2004
        ],
        ["class size, s G >= 25, mean", "1.5", f"{np.mean(sizes):.2f}" if sizes else "no cases"],
        ["both of a pair", "95 %", share(pairs, right)],
        [
            "withheld, G >= 100: unknown or partial",
            "90 %",
            share(strong, lambda r: r["verdict"] in {"unknown", "partial"}),
        ],
        [
            "withheld, G >= 100: named",
            "at most 5 %",
            share(strong, lambda r: r["verdict"] == "named"),
        ],
        ["wrongly unknown", "at most 2 %", share(one + two, lambda r: r["verdict"] == "unknown")],
        ["95 % intervals that cover", "92 to 98 %", wilson(sum(inside), len(inside))],
        [
            "error times sqrt(G), median",
            "0.8",
            f"{np.median(errors):.2f} of {len(errors)}" if errors else "no cases",
        ],
        [
            "held-out chi^2/N afterwards, median",
            "1.03",
            f"{np.median([r['held'] for r in one + two]):.3f}" if one + two else "no cases",
        ],
        ["form differs: right family", "90 %", share(forms, right)],
        [
            "nuisances: false alarms",
            "at most 2 %",
            share(
                (r for r in spoilt if r["effects"] == ["none"] or r["effects"] == ("none",)),
                lambda r: r["verdict"] != "none",
            ),
        ],
        [
            "seconds for 2,500 samples in 9 runs, median",
            "3",
            f"{np.median([22500 * r['seconds'] / r['samples'] for r in rows]):.1f} on one thread",
        ],
    ]


def _sizes(rows: Iterable[Row]) -> tuple[list[bool], list[float]]:
    """Return whether intervals of first parameters cover the truth, and the relative errors."""
    inside, errors = [], []
    for row in rows:
        name = row["named"][0]
        values, bounds = row["parameters"][name]
        size = next(iter(values))
        true = row["truth"].get(name, {}).get(size)
        if true is None or size not in bounds:
            continue
        low, high = bounds[size]
        inside.append(low <= true <= high)
        errors.append(abs(values[size] / true - 1) * math.sqrt(strength(row)))
    return inside, errors


def drawn(count: int, forms: int, nuisances: int, seed: int) -> list[blind_cases.Case]:
    """Draw the cases."""
    rng = np.random.default_rng(seed)
    kinds = ["none", "one", "none", "one", "two", "none", "one", "withheld", "none", "two"]
    kinds += ["none", "one", "none", "one", "withheld", "none", "one", "none", "two", "withheld"]
    what = [kinds[k % len(kinds)] for k in range(count)]
    return [blind_cases.draw(w, rng) for w in [*what, *["form"] * forms, *["nuisance"] * nuisances]]


def main() -> None:
    """Draw, diagnose, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--forms", type=int, default=0)
    parser.add_argument("--nuisances", type=int, default=0)
    parser.add_argument("--seed", type=int, default=None, help="drawn and printed if none is given")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    parser.add_argument("--out", type=Path, default=Path("blind.jsonl"))
    given = parser.parse_args()
    seed = secrets.randbits(32) if given.seed is None else given.seed
    cases = drawn(given.count, given.forms, given.nuisances, seed)
    rows = []
    with ProcessPoolExecutor(given.processes) as pool, given.out.open("w", encoding="utf-8") as out:
        for done, row in enumerate(pool.map(blind_cases.run, cases), 1):
            out.write(json.dumps(row, default=float) + "\n")
            out.flush()
            rows.append(row)
            if done % 20 == 0:
                note(f"{done} of {len(cases)}")
    failed = [row for row in rows if "error" in row]
    say(machine(("numpy", "scipy")))
    say(f"seed      {seed}; {len(cases)} experiments, {len(failed)} refused; all in {given.out}\n")
    say(table(["figure", "target", "measured"], figures([r for r in rows if "error" not in r])))
    for row in failed:
        say(f"refused: {row['what']} {row['effects']} seed {row['seed']}: {row['error']}")


if __name__ == "__main__":
    main()
