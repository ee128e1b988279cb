"""Public functions in a forked child of a process that has called all of them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.thorough
@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_every_public_function_works_in_a_forked_child() -> None:
    script = Path(__file__).parents[1] / "forked.py"
    words = [sys.executable, "-W", "ignore::DeprecationWarning", str(script)]
    ended = subprocess.run(words, capture_output=True, text=True, check=False, timeout=600)
    assert ended.returncode == 0, ended.stdout + ended.stderr
