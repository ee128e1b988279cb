"""Closed orbits and attractors: columns and JSON objects."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap import _core
from pendmap.analysis.result import point, records, rows
from pendmap.files.variables import variable
from pendmap.units import RATE, TIME, VELOCITY, Units

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from pendmap.signal import Floats, Mask


DESCRIBED: Final = {
    "n": ("periods", "period n", "0: no meaning"),
    "w": ("turns", "net turns w over a period", "without a period the sense of the turns"),
    "lean": ("1", "side to which one of two twins leans", "0: not one of such twins"),
    "turn": ("1", "multiple of a turn around which it moves"),
}
"""What tells attractors of one kind apart: unit, meaning, comment."""


def table(orbits: Sequence[_core.Attractor], units: Units, one: str) -> dict[str, Any]:
    """Return orbits as variables over the dimension ``one``, their points over ``point``."""

    def measured(key: str, power: int) -> Floats:
        return np.asarray(units.given(np.array([getattr(a, key) for a in orbits], float), power))

    multipliers = np.full((len(orbits), 2, 2), np.nan)
    for pairs, orbit in zip(multipliers, orbits, strict=True):
        for k, pair in enumerate(orbit.multipliers):
            pairs[k] = pair
    closed = [a.points[0] if a.n is not None else (np.nan, np.nan) for a in orbits]
    points = [(k + 1, *p) for k, a in enumerate(orbits) for p in a.points]
    flat = np.array(points, dtype=float).reshape(-1, 3)
    flat[:, 2] = units.given(flat[:, 2], VELOCITY)
    speed = units.given(np.array([c[1] for c in closed], dtype=float), VELOCITY)
    theta = np.array([c[0] for c in closed], dtype=float)
    rate, error = measured("exponent", RATE), measured("exponent_stderr", RATE)
    names = np.array([orbit.name for orbit in orbits], dtype=str)
    number = np.arange(1, len(orbits) + 1, dtype=np.int32)
    image = "its own number where symmetric, 0 if not known"
    multiplier, owner = "Floquet multiplier, real and imaginary part", f"number of the {one}"
    return {
        one: variable(one, names, long_name=f"name of the {one}"),
        "id": variable(one, number, "1", owner),
        **described(orbits, one),
        **point(one, theta, speed, units.of_velocity, "{}_point"),
        "period": variable(one, measured("period", TIME), units.of_time, "period as a time"),
        "exponent": variable(one, rate, units.of_rate, "largest Lyapunov exponent"),
        "exponent_stderr": variable(one, error, units.of_rate, "standard error of the exponent"),
        "twin": variable(one, _whole(orbits, "twin"), "1", "number of the mirror image", image),
        "multipliers": variable((one, "eigenvalue", "part"), multipliers, "1", multiplier),
        f"point_{one}": variable("point", flat[:, 0].astype(np.int32), "1", owner),
        **point("point", flat[:, 1], flat[:, 2], units.of_velocity, "point_{}"),
    }


def _whole(attractors: Sequence[_core.Attractor], key: str) -> NDArray[np.int32]:
    return np.array([getattr(one, key) or 0 for one in attractors], dtype=np.int32)


def described(attractors: Sequence[_core.Attractor], dim: str, prefix: str = "") -> dict[str, Any]:
    """Return the variables from which :func:`attractors_of` makes attractors again."""
    kind = np.array([one.kind for one in attractors], dtype=str)
    return {
        f"{prefix}kind": variable(dim, kind, long_name=f"kind of {dim}"),
        **{
            f"{prefix}{key}": variable(dim, _whole(attractors, key), *texts)
            for key, texts in DESCRIBED.items()
        },
    }


def attractors_of(dataset: xr.Dataset, prefix: str = "") -> list[_core.Attractor]:
    """Return the attractors of :func:`described` variables, without points."""
    every = rows(dataset, *(f"{prefix}{key}" for key in ("kind", *DESCRIBED)))
    return [_core.Attractor(*row) for row in every]


def chaotic(dataset: xr.Dataset) -> Mask:
    """Return which attractors of a table are chaotic."""
    return np.array([one.chaotic for one in attractors_of(dataset)], dtype=bool)


def objects(dataset: xr.Dataset, one: str, *more: str) -> list[dict[str, Any]]:
    """Return the orbits of a :func:`table` over ``one`` for JSON, with ``more`` variables."""
    columns = {"id": "id", "name": one, "kind": "kind", "n": "n", "w": "w"}
    columns |= {"theta": "theta_point", "velocity": "velocity_point", "points": "id"}
    alike = ("multipliers", "exponent", "exponent_stderr", "period", "twin", *more)
    orbits = records(dataset, **columns, **{name: name for name in alike})
    for orbit, points in zip(orbits, points_of(dataset, one), strict=True):
        orbit["points"] = points.tolist()
        if orbit["n"] <= 0:  # chaos
            orbit["n"] = orbit["w"] = orbit["points"] = None
        orbit["multipliers"] = [p for p in orbit["multipliers"] if not math.isnan(p[0])] or None
        orbit["twin"] = orbit["twin"] or None
    return orbits


def points_of(dataset: xr.Dataset, one: str) -> list[Floats]:
    """Return the stroboscopic points of each orbit, shape (M, 2)."""
    points = np.stack([dataset["point_theta"].values, dataset["point_velocity"].values], axis=1)
    owner = dataset[f"point_{one}"].values
    return [points[owner == k] for k in dataset["id"].values]
