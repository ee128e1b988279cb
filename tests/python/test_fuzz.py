"""Bad input and faults, drawn: a handful here, ``make fuzz`` for many."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import pytest

import fuzz_cases

FUZZ = Path(__file__).with_name("fuzz.py")


def test_what_is_drawn_ends_well(tmp_path: Path) -> None:
    # A process of its own: it forks, and computes nothing before.
    words = [sys.executable, str(FUZZ), "--seed", "2", "--count", "70", "--keep", str(tmp_path)]
    run = subprocess.run(words, capture_output=True, text=True, check=False, timeout=300)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.startswith("70 cases of seed 2, 0 failed")


def test_the_same_seed_draws_the_same_case() -> None:
    fuzz_cases.SEEDS.setdefault("basins.nc", b"")
    for kind in ("options", "model", "formula", "experiment", "table", "fault"):
        one, again = (fuzz_cases.KINDS[kind](random.Random("7")) for _ in range(2))  # noqa: S311
        assert one == again


@pytest.mark.parametrize("code", ["raise ValueError('x')", "import time; time.sleep(0)"])
def test_what_ends_badly_is_found(tmp_path: Path, code: str) -> None:
    broken = tmp_path / "broken.py"
    broken.write_text(
        "import sys; sys.path.insert(0, sys.argv.pop(1))\n"
        "import fuzz\n"
        f"def run_command():\n    {code}\n    print('\\x1b[31m')\n"
        "fuzz.run_command = run_command\n"
        "fuzz.main()\n"
    )
    words = [sys.executable, str(broken), str(FUZZ.parent), "--count=2", "--kinds=model"]
    words.append(f"--keep={tmp_path / 'kept'}")
    run = subprocess.run(words, capture_output=True, text=True, check=False, timeout=300)
    assert run.returncode == 1
    assert "2 cases of seed 1, 2 failed" in run.stdout
    assert len(list((tmp_path / "kept").iterdir())) == 2
