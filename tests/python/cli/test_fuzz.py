"""Randomly drawn bad input and faults: a few here, many in ``make fuzz``."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import fuzz_cases

FUZZ = Path(__file__).parents[1] / "fuzz.py"


def test_drawn_cases_end_well(tmp_path: Path) -> None:
    # A separate process: it forks, and computes nothing before that.
    words = [sys.executable, str(FUZZ), "--seed", "2", "--count", "56", "--keep", str(tmp_path)]
    run = subprocess.run(words, capture_output=True, text=True, check=False, timeout=300)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.startswith("56 cases of seed 2, 0 failed")


def test_the_same_seed_draws_the_same_case() -> None:
    fuzz_cases.SEEDS.setdefault("basins.nc", b"")
    for kind in ("options", "model", "formula", "experiment", "table", "fault"):
        one, again = (fuzz_cases.KINDS[kind](random.Random("7")) for _ in range(2))  # noqa: S311
        assert one == again


def test_a_case_that_ends_badly_is_reported(tmp_path: Path) -> None:
    broken = tmp_path / "broken.py"
    broken.write_text(
        "import sys; sys.path.insert(0, sys.argv.pop(1))\n"
        "import fuzz\n"
        "def badly():\n"
        "    if 'basins' in sys.argv: raise ValueError\n"
        "    print('\\x1b[31m')\n"
        "seeds = fuzz.make_seeds\n"
        "def made(folder):\n"
        "    seeds(folder)\n"
        "    fuzz.run_command = badly\n"
        "fuzz.make_seeds = made\n"
        "fuzz.main()\n"
    )
    words = [sys.executable, str(broken), str(FUZZ.parent), "--count=8", "--kinds=model"]
    words.append(f"--keep={tmp_path / 'kept'}")
    run = subprocess.run(words, capture_output=True, text=True, check=False, timeout=300)
    assert run.returncode == 1
    assert "8 cases of seed 1, 8 failed" in run.stdout
    assert len(list((tmp_path / "kept").iterdir())) == 8
