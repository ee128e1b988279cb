"""The virtual rig: processor seconds of one thread for each experiment of nine runs.

Experiments of `pendmap rig hidden` with seeds 0, 1, ... are made and written, once without a hidden
effect and once with the one that the seed draws. The target is 400 experiments in 10 minutes.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from pathlib import Path

# One thread, set before numpy is imported.
os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))

from benchmarks.peers.report import machine, note, say, table
from pendmap.virtual_rig import Request, make, places, write

HEADERS = ("effects", "experiments", "median s", "most s", "400 in min", "wanted min")


def seconds(seed: int, effect: str, folder: Path) -> float:
    """Make and write one experiment; return its processor time, s."""
    start = time.process_time()
    write(
        make(Request("hidden", seed, (effect,))), places(folder / f"{effect}{seed}", replace=True)
    )
    return time.process_time() - start


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20, help="experiments of each kind")
    count = parser.parse_args().count
    say("Experiments of the virtual rig, one thread")
    say(machine(("pendmap", "numpy", "scipy")))
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        seconds(0, "none", Path(folder))  # first run, with its imports and compilation
        for effect in ("none", "any"):
            note(effect)
            taken = [seconds(seed, effect, Path(folder)) for seed in range(count)]
            median, most = statistics.median(taken), max(taken)
            minutes = 400 / 60 * statistics.mean(taken)
            rows.append(
                (effect, f"{count}", f"{median:.2f}", f"{most:.2f}", f"{minutes:.1f}", "< 10")
            )
    say(table(HEADERS, rows))


if __name__ == "__main__":
    main()
