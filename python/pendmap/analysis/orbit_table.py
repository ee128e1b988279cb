"""Closed orbits and attractors as columns: kind, multipliers, stroboscopic points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap.units import RATE, TIME, VELOCITY, Units

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

    from pendmap import _core
    from pendmap.signal import Floats


def table(orbits: Sequence[_core.Attractor], units: Units, one: str) -> dict[str, Any]:
    """Return orbits as variables over the dimension ``one``, their points over ``point``."""

    def column(key: str, none: float) -> list[float]:
        return [none if getattr(a, key) is None else getattr(a, key) for a in orbits]

    def measured(key: str, power: int) -> Floats:
        values: Floats = np.array(column(key, np.nan), dtype=float)
        return np.asarray(units.given(values, power))

    multipliers = np.full((len(orbits), 2, 2), np.nan)
    for pairs, orbit in zip(multipliers, orbits, strict=True):
        for k, pair in enumerate(orbit.multipliers):
            pairs[k] = pair
    closed = [a.points[0] if a.n is not None else (np.nan, np.nan) for a in orbits]
    points = [(k + 1, *p) for k, a in enumerate(orbits) for p in a.points]
    flat = np.array(points, dtype=float).reshape(-1, 3)
    flat[:, 2] = units.given(flat[:, 2], VELOCITY)
    speed = units.given(np.array([c[1] for c in closed], dtype=float), VELOCITY)
    of_velocity = {"units": units.of_velocity}
    return {
        "id": (one, np.arange(1, len(orbits) + 1, dtype=np.int32)),
        "kind": (one, np.array([a.kind for a in orbits], dtype=str)),
        "n": (one, np.array(column("n", 0), dtype=np.int32), {"comment": "0: no meaning"}),
        "w": (one, np.array(column("w", 0), dtype=np.int32)),
        "theta_point": (one, np.array([c[0] for c in closed], dtype=float), {"units": "rad"}),
        "velocity_point": (one, speed, of_velocity),
        "period": (one, measured("period", TIME), {"units": units.of_time}),
        "exponent": (one, measured("exponent", RATE), {"units": units.of_rate}),
        "exponent_stderr": (one, measured("exponent_stderr", RATE), {"units": units.of_rate}),
        "twin": (
            one,
            np.array(column("twin", 0), dtype=np.int32),
            {"comment": "number of the mirror image; its own where symmetric, 0 if not known"},
        ),
        "multipliers": ((one, "eigenvalue", "part"), multipliers, {"comment": "part: re, im"}),
        f"point_{one}": ("point", flat[:, 0].astype(np.int32)),
        "point_theta": ("point", flat[:, 1], {"units": "rad"}),
        "point_velocity": ("point", flat[:, 2], of_velocity),
    }


def row(dataset: xr.Dataset, one: str, k: int) -> dict[str, Any]:
    """Return one orbit of a :func:`table` over ``one`` for the JSON object."""
    own = dataset.isel({one: k})
    n = int(own["n"])
    closed = n > 0
    multipliers = [[float(x) for x in pair] for pair in own["multipliers"].values]
    multipliers = [pair for pair in multipliers if pair[0] == pair[0]]
    mine = dataset[f"point_{one}"].values == int(own["id"])
    points = zip(
        dataset["point_theta"].values[mine], dataset["point_velocity"].values[mine], strict=True
    )
    return {
        "id": int(own["id"]),
        "name": str(own[one].values),
        "kind": str(own["kind"].values),
        "n": n if closed else None,
        "w": int(own["w"]) if closed else None,
        "theta": float(own["theta_point"]),
        "velocity": float(own["velocity_point"]),
        "points": [list(point) for point in points] if closed else None,
        "multipliers": multipliers or None,
        "exponent": float(own["exponent"]),
        "exponent_stderr": float(own["exponent_stderr"]),
        "period": float(own["period"]),
        "twin": int(own["twin"]) or None,
    }
