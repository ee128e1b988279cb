"""How much verdicts depend on the thresholds: each is halved and doubled.

    python benchmarks/thresholds.py --experiments 200 --seed 1 --workers 2

The experiments are those of blind.py. Each is diagnosed with the thresholds as they are, and with
one of them halved, then doubled. A verdict has changed where its word or its names have. Most
searches take the same way: a fit that was made before is remembered.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import hashlib
import os
import pickle
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

# One thread a process, before numpy is imported: the processes share the processor.
os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"), "1")
)

import blind
import blind_cases
from peers.report import machine, note, say, table
from pendmap import _core
from pendmap.diagnosis import diagnose
from pendmap.diagnosis.thresholds import Thresholds
from pendmap.errors import InputError
from pendmap.model.effects import library

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

FIELDS = [field.name for field in dataclasses.fields(Thresholds)]
FACTORS = (0.5, 2.0)


def changed(name: str, factor: float) -> Thresholds:
    """Return the thresholds with one of them multiplied; whole numbers stay whole."""
    value = getattr(Thresholds(), name)
    new = max(round(factor * value), 1) if isinstance(value, int) else factor * value
    return dataclasses.replace(Thresholds(), **{name: new})


def remembered(compute: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that computes what it is asked for once."""
    known: dict[bytes, Any] = {}

    def asked(*given: Any) -> Any:  # noqa: ANN401 (what the core takes and returns)
        key = hashlib.sha256(pickle.dumps(given)).digest()
        if key not in known:
            try:
                known[key] = compute(*given)
            except ValueError as error:
                known[key] = error
        if isinstance(known[key], ValueError):
            raise known[key]
        return known[key]

    return asked


@contextlib.contextmanager
def memory() -> Iterator[None]:
    """Remember the fits and derivatives of the core."""
    whole = {name: getattr(_core, name) for name in ("fit_runs", "fit_rows")}
    for name, compute in whole.items():
        setattr(_core, name, remembered(compute))
    try:
        yield
    finally:
        for name, compute in whole.items():
            setattr(_core, name, compute)


def run(case: blind_cases.Case) -> dict[tuple[str, float], bool]:
    """Return for each threshold and factor whether the verdict on an experiment changes."""
    own = [effect.split(":")[0] for effect in case.effects] if case.what == "withheld" else []
    without = [name for name in own if name in library()]
    with tempfile.TemporaryDirectory() as folder:
        experiment, _ = blind_cases.record(case, Path(folder))

        def said(thresholds: Thresholds) -> tuple[str, ...]:
            try:
                found = diagnose(experiment, without=without, thresholds=thresholds)
            except InputError as error:
                return ("refused", str(error))
            return (found.verdict, *(effect.name for effect in found.effects))

        with memory():
            usual = said(Thresholds())
            return {(n, f): said(changed(n, f)) != usual for n in FIELDS for f in FACTORS}


def main() -> None:
    """Draw, diagnose, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--experiments", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    given = parser.parse_args()
    cases = blind.drawn(given.experiments, given.seed)
    counts = dict.fromkeys(((name, factor) for name in FIELDS for factor in FACTORS), 0)
    with ProcessPoolExecutor(given.workers) as pool:
        for done, row in enumerate(pool.map(run, cases), 1):
            for key, other in row.items():
                counts[key] += other
            note(f"{done} of {len(cases)}")
    say(machine(("numpy", "scipy")))
    say(f"seed      {given.seed}; verdicts that change, of {len(cases)}\n")
    rows = [
        [name, f"{getattr(Thresholds(), name):g}", *(str(counts[name, f]) for f in FACTORS)]
        for name in FIELDS
    ]
    say(table(["threshold", "value", "halved", "doubled"], rows))


if __name__ == "__main__":
    main()
