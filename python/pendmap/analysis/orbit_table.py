"""Closed orbits and attractors: columns, JSON objects, identification between two models."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap.analysis.result import point, records
from pendmap.files.variables import variable
from pendmap.units import RATE, TIME, VELOCITY, Units

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from pendmap import _core
    from pendmap.signal import Floats


_APART = math.pi  # Distance assigned to an attractor without points, rad


def table(orbits: Sequence[_core.Attractor], units: Units, one: str) -> dict[str, Any]:
    """Return orbits as variables over the dimension ``one``, their points over ``point``."""

    def whole(key: str) -> NDArray[np.int32]:
        return np.array([getattr(a, key) or 0 for a in orbits], dtype=np.int32)

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
    names = {
        key: np.array([getattr(a, key) for a in orbits], dtype=str) for key in ("name", "kind")
    }
    number, none = np.arange(1, len(orbits) + 1, dtype=np.int32), "0: no meaning"
    image = "its own number where symmetric, 0 if not known"
    multiplier, owner = "Floquet multiplier, real and imaginary part", f"number of the {one}"
    return {
        one: variable(one, names["name"], long_name=f"name of the {one}"),
        "id": variable(one, number, "1", owner),
        "kind": variable(one, names["kind"], long_name=f"kind of {one}"),
        "n": variable(one, whole("n"), "periods", "period n", none),
        "w": variable(one, whole("w"), "turns", "net turns w over a period"),
        **point(one, theta, speed, units.of_velocity, "{}_point"),
        "period": variable(one, measured("period", TIME), units.of_time, "period as a time"),
        "exponent": variable(one, rate, units.of_rate, "largest Lyapunov exponent"),
        "exponent_stderr": variable(one, error, units.of_rate, "standard error of the exponent"),
        "twin": variable(one, whole("twin"), "1", "number of the mirror image", image),
        "multipliers": variable((one, "eigenvalue", "part"), multipliers, "1", multiplier),
        f"point_{one}": variable("point", flat[:, 0].astype(np.int32), "1", owner),
        **point("point", flat[:, 1], flat[:, 2], units.of_velocity, "point_{}"),
    }


def objects(dataset: xr.Dataset, one: str, *more: str) -> list[dict[str, Any]]:
    """Return the orbits of a :func:`table` over ``one`` for JSON, with ``more`` variables."""
    found = records(
        dataset,
        id="id",
        name=one,
        kind="kind",
        n="n",
        w="w",
        theta="theta_point",
        velocity="velocity_point",
        points="id",  # replaced below
        multipliers="multipliers",
        exponent="exponent",
        exponent_stderr="exponent_stderr",
        period="period",
        twin="twin",
        **{name: name for name in more if name in dataset},  # files of earlier versions lack some
    )
    for own, points in zip(found, points_of(dataset, one), strict=True):
        own["points"] = points.tolist()
        if own["n"] <= 0:  # chaos
            own["n"] = own["w"] = own["points"] = None
        own["multipliers"] = [p for p in own["multipliers"] if not math.isnan(p[0])] or None
        own["twin"] = own["twin"] or None
    return found


def points_of(dataset: xr.Dataset, one: str) -> list[Floats]:
    """Return the stroboscopic points of each orbit, shape (M, 2)."""
    points = np.stack([dataset["point_theta"].values, dataset["point_velocity"].values], axis=1)
    owner = dataset[f"point_{one}"].values
    return [points[owner == k] for k in dataset["id"].values]


def plain(name: str) -> str:
    """Return a name without its angle (``... at +0.1234``), which moves with the parameters."""
    return name.partition(" at ")[0]


def matched(
    names: list[str],
    points: list[Floats],
    others: list[str],
    theirs: list[Floats],
) -> list[int]:
    """Match attractors of equal :func:`plain` names by least distance; return indices, else -1."""
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 (only draws need it)

    found = [-1] * len(others)
    for name in dict.fromkeys(map(plain, others)):
        mine = [k for k, own in enumerate(names) if plain(own) == name]
        new = [k for k, own in enumerate(others) if plain(own) == name]
        if not mine:
            continue
        far = np.array([[distance(points[i], theirs[j]) for j in new] for i in mine])
        for i, j in zip(*linear_sum_assignment(far), strict=True):
            found[new[j]] = mine[i]
    return found


def distance(one: Floats, other: Floats, *, circle: bool = True) -> float:
    """Return the mean distance from points of ``one`` to the nearest of ``other``.

    On a ``circle`` angles are taken modulo turns.
    """
    if not (one.size and other.size):
        return _APART
    away = one[:, None] - other[None]
    if circle:
        away[..., 0] = np.remainder(away[..., 0] + math.pi, math.tau) - math.pi
    return float(np.hypot(away[..., 0], away[..., 1]).min(axis=1).mean())
