"""Experiments with something hidden, diagnosed; the truth stands in a file that nothing here opens
before the diagnosis is there.
"""  # noqa: D205 (one sentence)

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING, Any

from pendmap import virtual_rig
from pendmap.discrepancy import Discrepancy, diagnose
from pendmap.records import read_experiment

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


def diagnosed(
    folder: Path,
    *effects: str,
    seed: int = 3,
    without: Sequence[str] = (),
    **given: Any,  # noqa: ANN401 (what the rig is asked for)
) -> tuple[Discrepancy, dict[str, dict[str, float]]]:
    """Hide effects, diagnose the experiment, then read the truth: parameters by effect."""
    request = virtual_rig.Request("hidden", seed=seed, effects=effects or ("none",), **given)
    where = virtual_rig.places(folder / "hidden", replace=True)
    virtual_rig.write(virtual_rig.make(request), where)
    found = diagnose(read_experiment(where.experiment), without=without)
    truth = tomllib.loads(where.truth.read_text(encoding="utf-8"))
    return found, {e["name"]: e["parameters"] for e in truth.get("effect", [])}
