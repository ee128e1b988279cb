"""Diagnoses of experiments with hidden effects; the truth is read after the diagnosis."""

from __future__ import annotations

import functools
import hashlib
import pickle
import tempfile
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

try:
    import fcntl
except ImportError:  # Windows: processes repeat one another's work
    fcntl = None  # type: ignore[assignment]

from pendmap import virtual_rig
from pendmap.diagnosis import Discrepancy, diagnose
from pendmap.records import read_experiment

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.records import Experiment


KNOWN: list[Path] = []
"""Folder of the diagnoses made in this test run; set by conftest.py."""


def recorded(
    *effects: str,
    seed: int = 3,
    **given: Any,  # noqa: ANN401 (parameters of the request)
) -> tuple[Experiment, dict[str, dict[str, float]]]:
    """Hide effects; return the experiment, and the truth: parameters by effect."""
    request = virtual_rig.Request("hidden", seed=seed, effects=effects or ("none",), **given)
    with tempfile.TemporaryDirectory() as folder:
        where = virtual_rig.places(Path(folder) / "hidden", replace=True)
        virtual_rig.write(virtual_rig.make(request), where)
        content = tomllib.loads(where.truth.read_text(encoding="utf-8"))
        truth = {e["name"]: e["parameters"] for e in content.get("effect", [])}
        return read_experiment(where.experiment), truth


def diagnosed(
    *effects: str,
    without: Sequence[str] = (),
    max_effects: int = 3,
    **given: Any,  # noqa: ANN401 (parameters of the request)
) -> tuple[Discrepancy, dict[str, dict[str, float]]]:
    """Hide effects; return the diagnosis, made once in a test run of all processes, and truth."""
    choices = sorted(({"seed": 3} | given).items())
    asked = repr((effects, tuple(without), max_effects, choices)).encode()
    known = KNOWN[0] / f"{hashlib.sha256(asked).hexdigest()}.pickle"
    with known.with_suffix(".lock").open("w") as lock:
        # Other processes wait here until the diagnosis is complete.
        if fcntl is not None:
            fcntl.flock(lock, fcntl.LOCK_EX)
        if known.exists():
            return pickle.loads(known.read_bytes())  # type: ignore[no-any-return]  # noqa: S301 (our own)
        experiment, truth = recorded(*effects, **given)
        result = diagnose(experiment, max_effects=max_effects, without=without)
        known.write_bytes(pickle.dumps((result, truth)))
    return result, truth


@functools.cache
def once(*effects: str, **given: Any) -> Discrepancy:  # noqa: ANN401 (parameters of the request)
    """Return the diagnosis of hidden effects, the same object for all tests of a process."""
    return diagnosed(*effects, **given)[0]
