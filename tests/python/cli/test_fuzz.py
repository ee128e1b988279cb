"""Randomly drawn bad input and faults: a few here, many in ``make fuzz``."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

FUZZ = Path(__file__).parents[1] / "fuzz.py"


def test_drawn_cases_end_well(tmp_path: Path) -> None:
    # A separate process: it forks, and computes nothing before that.
    words = [sys.executable, str(FUZZ), "--seed", "2", "--count", "56", "--keep", str(tmp_path)]
    run = subprocess.run(words, capture_output=True, text=True, check=False, timeout=300)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.startswith("56 cases of seed 2, 0 failed")
