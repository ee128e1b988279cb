"""Experiments with something hidden, diagnosed; the truth stands in a file that nothing here opens
before the diagnosis is there.
"""  # noqa: D205 (one sentence)

from __future__ import annotations

import functools
import tempfile
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pendmap import virtual_rig
from pendmap.discrepancy import Discrepancy, diagnose
from pendmap.records import read_experiment

if TYPE_CHECKING:
    from collections.abc import Sequence


def diagnosed(
    folder: Path,
    *effects: str,
    seed: int = 3,
    without: Sequence[str] = (),
    max_effects: int = 3,
    **given: Any,  # noqa: ANN401 (what the rig is asked for)
) -> tuple[Discrepancy, dict[str, dict[str, float]]]:
    """Hide effects, diagnose the experiment, then read the truth: parameters by effect."""
    request = virtual_rig.Request("hidden", seed=seed, effects=effects or ("none",), **given)
    where = virtual_rig.places(folder / "hidden", replace=True)
    virtual_rig.write(virtual_rig.make(request), where)
    found = diagnose(read_experiment(where.experiment), max_effects=max_effects, without=without)
    truth = tomllib.loads(where.truth.read_text(encoding="utf-8"))
    return found, {e["name"]: e["parameters"] for e in truth.get("effect", [])}


@functools.cache
def once(*effects: str, **given: Any) -> Discrepancy:  # noqa: ANN401 (what the rig is asked for)
    """Hide effects and diagnose the experiment, once for all tests that look at the result."""
    with tempfile.TemporaryDirectory() as folder:
        return diagnosed(Path(folder), *effects, **given)[0]
