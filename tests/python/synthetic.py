"""Synthetic maps in the project's schema, for tests of layout and bookkeeping."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

import pendmap
from pendmap.files import facts

if TYPE_CHECKING:
    from collections.abc import Sequence

Floats = npt.NDArray[np.float64]
TWO_PI = 2.0 * math.pi
UNRELIABLE: dict[str, Any] = {"labels_reliable": 0, "unreliable": 0.207}
"""Attributes of a map whose labels are not reliable."""


class Painted(NamedTuple):
    """One attractor of a synthetic map: its row of the attractor table."""

    name: str
    kind: str
    n: int = 1
    w: int = 0
    points: Sequence[Sequence[float]] = ()
    twin: int = 0
    lean: int = 0


def wrap(theta: Floats) -> Floats:
    """Wrap angles in rad to (-pi, pi]."""
    return -((math.pi - theta) % TWO_PI - math.pi) * 1.0


def centres(low: float, high: float, count: int) -> Floats:
    """Return the centres of ``count`` cells between ``low`` and ``high``."""
    return low + (np.arange(count) + 0.5) * (high - low) / count


@functools.cache
def _facts() -> dict[str, Any]:
    """Return the facts of a real map, with numbers that do not depend on the machine."""
    real = facts(pendmap.basins(pendmap.Pendulum(), 4))
    reliable = {"labels_reliable": 1, "unreliable": 0.002, "basin_entropy": 0.21}
    fixed = {"seconds": 1.5, "simd": "avx2", "threads": 2, "reached_error": 4.2e-7}
    text = {
        "title": "Basins of attraction",
        "summary": "A synthetic map.\nIts second line tells a little more.",
    }
    return real | reliable | fixed | text


USUAL = (
    Painted("rest", "rest", 1, 0, [[0.0, 0.0]], twin=1),
    Painted("rotation 1:+1", "rotation", 1, 1, [[-0.56, 2.63]], twin=3),
    Painted("rotation 1:-1", "rotation", 1, -1, [[0.56, -2.63]], twin=2),
    Painted("oscillation 2:0", "oscillation", 2, 0, [[-1.65, 0.21], [1.65, -0.21]], twin=4),
    Painted("oscillation 1:0 (+)", "oscillation", 1, 0, [[1.0, 1.2]], twin=6, lean=1),
    Painted("oscillation 1:0 (-)", "oscillation", 1, 0, [[-1.0, -1.2]], twin=5, lean=-1),
    Painted("rotation 2:+2", "rotation", 2, 2, [[-0.3, 2.8], [-0.7, 2.4]], twin=8),
    Painted("rotation 2:-2", "rotation", 2, -2, [[0.3, -2.8], [0.7, -2.4]], twin=7),
    Painted("oscillation 3:0", "oscillation", 3, 0, [[0.4, 0.2], [-0.8, 0.1], [0.5, -0.6]], twin=9),
    Painted("inverted rest", "inverted_rest", 1, 0, [[math.pi, 0.0]], twin=10),
    Painted("libration chaos", "libration_chaos", 0, 0, [[0.1, 1.5], [0.2, 1.6]]),
    Painted("rotating chaos +", "rotating_chaos", 0, 1, [[2.0, 2.1], [2.1, 2.2]]),
)


def painted(  # noqa: PLR0913 (what tests vary)
    attractors: Sequence[Painted] = USUAL[:4],
    shape: tuple[int, int] = (30, 40),
    *,
    undecided: int = 0,
    failed: int = 0,
    theta: tuple[float, float] = (-math.pi, math.pi),
    velocity: tuple[float, float] = (-3.0, 3.0),
    **attrs: Any,  # noqa: ANN401 (attributes of any type)
) -> xr.Dataset:
    """Return a map of wavy bands, one per attractor; first cells undecided, last ones failed."""
    rows, columns = shape
    y = np.arange(rows)[:, None] / rows
    x = np.arange(columns)[None, :] / columns
    wave = (y + 0.15 * np.sin(TWO_PI * x)) % 1.0
    label = np.floor(wave * len(attractors)).astype(np.int16) + (len(attractors) > 0)
    settle = (3 + 60 * wave**4 * (1 + x)).astype(np.int32)
    turns = np.round(12 * np.sin(TWO_PI * y) * np.cos(TWO_PI * x)).astype(np.int32)
    label.reshape(-1)[:undecided] = 0
    if failed:
        label.reshape(-1)[-failed:] = -1
    chaotic = ["chaos" in a.kind for a in attractors]
    settle[(label <= 0) | np.isin(label, np.flatnonzero(chaotic) + 1)] = -1
    cells, count = label.size, len(attractors)
    shares = np.array([np.count_nonzero(label == k + 1) / cells for k in range(count)])
    first = [
        (math.nan,) * 2 if c else a.points[0] for a, c in zip(attractors, chaotic, strict=True)
    ]
    points = [(k, *point) for k, a in enumerate(attractors, 1) for point in a.points]
    first, points = np.reshape(first, (-1, 2)), np.reshape(points, (-1, 3))
    table = {
        **{name: [getattr(a, name) for a in attractors] for name in ("n", "w", "lean", "twin")},
        "id": range(1, count + 1),
        "turn": [0] * count,
    }
    plane = {"label": label, "settle_periods": settle, "net_turns": turns}
    variables: dict[str, Any] = {
        **{name: (("velocity", "theta"), values) for name, values in plane.items()},
        **{name: ("attractor", np.array(values, int)) for name, values in table.items()},
        "kind": ("attractor", np.array([a.kind for a in attractors], object)),
        "theta_point": ("attractor", first[:, 0]),
        "velocity_point": ("attractor", first[:, 1]),
        "period": ("attractor", np.array([a.n * math.pi for a in attractors], float)),
        "exponent": ("attractor", np.where(chaotic, 0.17, -0.05)),
        "fraction": ("attractor", shares),
        "stderr": ("attractor", np.sqrt(shares * (1 - shares) / cells)),
        "multipliers": (("attractor", "eigenvalue", "part"), np.full((count, 2, 2), 0.5)),
        "point_attractor": ("point", points[:, 0].astype(int)),
        "point_theta": ("point", points[:, 1]),
        "point_velocity": ("point", points[:, 2]),
    }
    settled = settle[settle >= 0]
    mean, longest = (settled.mean(), settled.max()) if settled.size else (0.0, 0)
    coords = {
        "theta": centres(*theta, columns),
        "velocity": centres(*velocity, rows),
        "attractor": np.array([a.name for a in attractors], object),
    }
    numbers = {
        "cells": cells,
        "undecided": float(np.mean(label == 0)),
        "failed": float(np.mean(label == -1)),
        "mean_periods": float(mean),
        "mean_settle": float(mean),
        "longest_settle": int(longest),
    }
    return xr.Dataset(variables, coords, _facts() | numbers | attrs)
