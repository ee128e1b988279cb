"""Diagnose a hidden example of every effect, and store what is said: effects_examples.json.

``python docs/effects_examples.py`` adds the effects that the file lacks; it takes most of an hour.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import pendmap

STORE = Path(__file__).resolve().parent / "effects_examples.json"
LIMIT = 150.0
"""Upper bound on the time of one diagnosis, s."""
BASELINE = ("viscous_damping", "coulomb_friction")
LARGER = " --size 5"
"""Added where an effect of the usual size is not found."""


def said(effect: str) -> list[str] | None:
    """Return the lines of verdict and names; ``None`` if a diagnosis takes too long.

    ``effect`` is its name, with further options of ``pendmap rig``.
    """
    words = [sys.executable, "-m", "pendmap"]
    with tempfile.TemporaryDirectory() as folder:
        rig = ["rig", "hidden", "--effect", *effect.split(), "--seed", "1", "--out", "hidden"]
        subprocess.run([*words, *rig], cwd=folder, check=True, capture_output=True)
        try:
            found = subprocess.run(
                [*words, "diagnose", "hidden"],
                cwd=folder,
                check=True,
                capture_output=True,
                text=True,
                timeout=LIMIT,
            )
        except subprocess.TimeoutExpired:
            return None
    return found.stdout.partition("\nResidual")[0].splitlines()


def main() -> None:
    """Add what the file lacks."""
    stored = json.loads(STORE.read_text(encoding="utf-8")) if STORE.exists() else {}
    for effect in pendmap.effects():
        for words in (effect.name, effect.name + LARGER):
            if words not in stored:
                stored[words] = said(words)
                STORE.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")
            missed = "Verdict: none" in "\n".join(stored[words] or [])
            if not missed or effect.name in BASELINE:
                break


if __name__ == "__main__":
    main()
