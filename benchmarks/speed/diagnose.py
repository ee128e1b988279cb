"""Speed of a diagnosis: its CPU and wall time against the recorded time and the samples.

Nine runs, five free and four forced, are made by the virtual rig with nothing hidden, one effect, a
pair, and one withheld, at a rate of 2,500 samples each on average. Each is diagnosed in its own
process, once on one thread, whose CPU time measures the work, and once on all.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.peers.report import machine, note, say, table

CASES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "nothing hidden": (("none",), ()),
    "one": (("quadratic_drag",), ()),
    "pair": (("quadratic_drag", "bearing_harmonic"), ()),
    "withheld": (("quadratic_drag",), ("quadratic_drag", "power_law_drag")),
}
RUNS, RATE = (5, 4), 124.0
"""Free and forced runs, and samples a second: runs last 15 to 30 s."""


@dataclasses.dataclass(frozen=True)
class Timed:
    """A diagnosis: seconds, size of the record, and verdict."""

    cpu: float
    wall: float
    samples: int
    recorded: float
    verdict: str


def one(case: str, seed: int) -> Timed:
    """Make, read and diagnose an experiment of a case."""
    from pendmap import read_experiment, virtual_rig  # noqa: PLC0415 (after the threads are set)
    from pendmap.diagnosis import diagnose  # noqa: PLC0415

    effects, without = CASES[case]
    request = virtual_rig.Request(
        "hidden",
        seed=seed,
        effects=effects,
        free=RUNS[0],
        forced=RUNS[1],
        noise=0.1,
        counts=4096,
        rate=RATE,
    )
    with tempfile.TemporaryDirectory() as name:
        where = virtual_rig.places(Path(name) / "experiment", replace=True)
        virtual_rig.write(virtual_rig.make(request), where)
        experiment = read_experiment(where.experiment)
        cpu, wall = time.process_time(), time.perf_counter()
        found = diagnose(experiment, without=without)
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    return Timed(
        cpu,
        wall,
        sum(run.time.size for run in experiment.runs),
        sum(float(run.time[-1] - run.time[0]) for run in experiment.runs),
        " ".join([found.verdict, *(effect.name for effect in found.effects)]),
    )


def apart(case: str, seed: int, threads: int) -> Timed:
    """Run the diagnosis in a process with this number of threads."""
    own = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "RAYON_NUM_THREADS": str(threads)}
    command = [
        sys.executable,
        "-m",
        "benchmarks.speed.diagnose",
        "--one",
        case,
        "--seed",
        str(seed),
    ]
    done = subprocess.run(  # noqa: S603 (this script itself)
        command, env=os.environ | own, capture_output=True, text=True, check=True
    )
    return Timed(**json.loads(done.stdout))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=3, help="of the first experiment of each case")
    parser.add_argument("--count", type=int, default=3, help="experiments of each case")
    parser.add_argument("--threads", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--one", choices=CASES, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        say(json.dumps(dataclasses.asdict(one(given.one, given.seed))))
        return
    rows = []
    for case in CASES:
        for seed in range(given.seed, given.seed + given.count):
            note(f"{case}, seed {seed}")
            single = apart(case, seed, 1)
            every = apart(case, seed, given.threads)
            rows.append(
                [
                    case,
                    str(seed),
                    str(single.samples),
                    f"{single.cpu:.2f}",
                    f"{every.wall:.2f}",
                    f"{single.recorded / single.cpu:.0f}",
                    f"{1e6 * single.cpu / single.samples:.0f}",
                    single.verdict,
                ]
            )
    say(machine(["numpy", "scipy"]))
    say(
        table(
            [
                "hidden",
                "seed",
                "samples",
                "CPU s, 1 thread",
                f"wall s, {given.threads} threads",
                "recorded/CPU",
                "us CPU a sample",
                "verdict",
            ],
            rows,
        )
    )


if __name__ == "__main__":
    main()
