"""Small experiments of the virtual rig, and readers of their files."""

from __future__ import annotations

import csv
import tomllib
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap.virtual_rig import Experiment, Request, make

if TYPE_CHECKING:
    from pathlib import Path


def read_toml(path: Path) -> dict[str, Any]:
    """Parse a TOML file."""
    return tomllib.loads(path.read_text(encoding="utf-8"))


def record(path: Path) -> np.ndarray:
    """Read a run: columns of time and angle."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["t_s", "theta_rad"]
    return np.array(rows[1:], float)


def short(**given: Any) -> Experiment:  # noqa: ANN401 (parameters of a request)
    """Return a small experiment, by default without hidden effects."""
    settings = {"effects": ("none",), "free": 2, "forced": 1, "duration": 5.0, "noise": 0.0}
    return make(Request("hidden", **(settings | given)))  # type: ignore[arg-type]
