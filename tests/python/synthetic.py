"""Synthetic maps in the project's schema, for tests of layout and bookkeeping."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

if TYPE_CHECKING:
    from collections.abc import Sequence

Floats = npt.NDArray[np.float64]
TWO_PI = 2.0 * math.pi
UNRELIABLE: dict[str, Any] = {"labels_reliable": 0, "unreliable": 0.207}
"""Attributes of a map whose labels are not reliable."""


@dataclass(frozen=True)
class Painted:
    """One attractor of a synthetic map: its row of the attractor table."""

    name: str
    kind: str
    n: int = 1
    w: int = 0
    points: Floats = field(default_factory=lambda: np.empty((0, 2)))
    twin: int = 0
    lean: int = 0


def wrap(theta: Floats) -> Floats:
    """Wrap angles in rad to (-pi, pi]."""
    return -((math.pi - theta) % TWO_PI - math.pi) * 1.0


def centres(low: float, high: float, count: int) -> Floats:
    """Return the centres of ``count`` cells between ``low`` and ``high``."""
    return low + (np.arange(count) + 0.5) * (high - low) / count


def assemble(  # noqa: PLR0913 (the schema has many parts)
    attractors: Sequence[Painted],
    label: npt.NDArray[np.int16],
    settle: npt.NDArray[np.int32],
    turns: npt.NDArray[np.int32],
    *,
    exponent: npt.NDArray[np.float32] | None = None,
    theta: tuple[float, float] = (-math.pi, math.pi),
    velocity: tuple[float, float] = (-3.0, 3.0),
    **attrs: Any,  # noqa: ANN401 (attributes of any type)
) -> xr.Dataset:
    """Assemble arrays and attractors into a Dataset as ``pendmap.basins`` returns it."""
    rows, columns = label.shape
    cells = label.size
    shares = np.array([np.count_nonzero(label == k + 1) / cells for k in range(len(attractors))])
    first = np.array(
        [
            a.points[0] if len(a.points) and "chaos" not in a.kind else (np.nan, np.nan)
            for a in attractors
        ]
    ).reshape(-1, 2)
    points = np.concatenate([a.points for a in attractors] + [np.empty((0, 2))])
    owners = np.concatenate(
        [np.full(len(a.points), k + 1) for k, a in enumerate(attractors)] + [np.empty(0)]
    )
    variables: dict[str, Any] = {
        "label": (("velocity", "theta"), label),
        "settle_periods": (("velocity", "theta"), settle),
        "net_turns": (("velocity", "theta"), turns),
        "id": ("attractor", np.arange(1, len(attractors) + 1)),
        "kind": ("attractor", np.array([a.kind for a in attractors], dtype=object)),
        "n": ("attractor", np.array([a.n for a in attractors], dtype=int)),
        "w": ("attractor", np.array([a.w for a in attractors], dtype=int)),
        "lean": ("attractor", np.array([a.lean for a in attractors], dtype=int)),
        "turn": ("attractor", np.zeros(len(attractors), dtype=int)),
        "theta_point": ("attractor", first[:, 0]),
        "velocity_point": ("attractor", first[:, 1]),
        "period": ("attractor", np.array([a.n * math.pi for a in attractors], dtype=float)),
        "exponent": (
            "attractor",
            np.array([0.17 if "chaos" in a.kind else -0.05 for a in attractors], dtype=float),
        ),
        "fraction": ("attractor", shares),
        "stderr": ("attractor", np.sqrt(shares * (1 - shares) / cells)),
        "twin": ("attractor", np.array([a.twin for a in attractors], dtype=int)),
        "multipliers": (
            ("attractor", "eigenvalue", "part"),
            np.full((len(attractors), 2, 2), 0.5),
        ),
        "point_attractor": ("point", owners.astype(int)),
        "point_theta": ("point", points[:, 0]),
        "point_velocity": ("point", points[:, 1]),
    }
    if exponent is not None:
        variables["finite_time_exponent"] = (("velocity", "theta"), exponent)
    settled = settle[settle >= 0]
    values = {
        "kind": "basins",
        "title": "Basins of attraction",
        "gamma": 0.1,
        "p": 1.0,
        "omega": 2.0,
        "phase": 0.0,
        "torque": 0.0,
        "tol": 1e-6,
        "reached_error": 4.2e-7,
        "steps_per_period": 14,
        "max_periods": 2000,
        "layer_periods": 20,
        "layers": "labels",
        "cells": cells,
        "undecided": float(np.count_nonzero(label == 0) / cells),
        "failed": float(np.count_nonzero(label == -1) / cells),
        "mean_periods": float(settled.mean()) if settled.size else 0.0,
        "mean_settle": float(settled.mean()) if settled.size else 0.0,
        "longest_settle": int(settled.max()) if settled.size else 0,
        "basin_entropy": 0.21,
        "unreliable": 0.002,
        "unreliable_half_step": 0.001,
        "unreliable_mirror": 0.002,
        "labels_reliable": 1,
        "seconds": 1.5,
        "simd": "avx2",
        "threads": 2,
        "pendmap_version": "0.1.0",
        "format_version": 1,
        "section": "tau = 0 mod T, where the drive's argument is the phase",
        "summary": "A synthetic map.\nIts second line tells a little more.",
    }
    return xr.Dataset(
        variables,
        coords={
            "theta": centres(*theta, columns),
            "velocity": centres(*velocity, rows),
            "attractor": np.array([a.name for a in attractors], dtype=object),
        },
        attrs=values | attrs,
    )


USUAL = (
    Painted("rest", "rest", 1, 0, np.array([[0.0, 0.0]]), twin=1),
    Painted("rotation 1:+1", "rotation", 1, 1, np.array([[-0.56, 2.63]]), twin=3),
    Painted("rotation 1:-1", "rotation", 1, -1, np.array([[0.56, -2.63]]), twin=2),
    Painted(
        "oscillation 2:0", "oscillation", 2, 0, np.array([[-1.65, 0.21], [1.65, -0.21]]), twin=4
    ),
    Painted("oscillation 1:0 (+)", "oscillation", 1, 0, np.array([[1.0, 1.2]]), twin=6, lean=1),
    Painted("oscillation 1:0 (-)", "oscillation", 1, 0, np.array([[-1.0, -1.2]]), twin=5, lean=-1),
    Painted("rotation 2:+2", "rotation", 2, 2, np.array([[-0.3, 2.8], [-0.7, 2.4]]), twin=8),
    Painted("rotation 2:-2", "rotation", 2, -2, np.array([[0.3, -2.8], [0.7, -2.4]]), twin=7),
    Painted(
        "oscillation 3:0",
        "oscillation",
        3,
        0,
        np.array([[0.4, 0.2], [-0.8, 0.1], [0.5, -0.6]]),
        twin=9,
    ),
    Painted("inverted rest", "inverted_rest", 1, 0, np.array([[math.pi, 0.0]]), twin=10),
    Painted("libration chaos", "libration_chaos", 0, 0, np.array([[0.1, 1.5], [0.2, 1.6]])),
    Painted("rotating chaos +", "rotating_chaos", 0, 1, np.array([[2.0, 2.1], [2.1, 2.2]])),
)


def painted(
    attractors: Sequence[Painted] = USUAL[:4],
    shape: tuple[int, int] = (30, 40),
    *,
    undecided: int = 0,
    failed: int = 0,
    **options: Any,  # noqa: ANN401 (options of assemble)
) -> xr.Dataset:
    """Return a map of wavy bands, one per attractor; first cells undecided, last ones failed."""
    rows, columns = shape
    y = np.arange(rows)[:, None] / rows
    x = np.arange(columns)[None, :] / columns
    wave = (y + 0.15 * np.sin(TWO_PI * x)) % 1.0
    label = (
        np.floor(wave * len(attractors)).astype(np.int16) + 1
        if attractors
        else np.zeros(shape, np.int16)
    )
    settle = (3 + 60 * wave**4 * (1 + x)).astype(np.int32)
    turns = np.round(12 * np.sin(TWO_PI * y) * np.cos(TWO_PI * x)).astype(np.int32)
    label.reshape(-1)[:undecided] = 0
    if failed:
        label.reshape(-1)[-failed:] = -1
    chaotic = [k + 1 for k, a in enumerate(attractors) if "chaos" in a.kind]
    settle[(label <= 0) | np.isin(label, chaotic)] = -1
    return assemble(attractors, label, settle, turns, **options)
