"""Small maps and trajectories with real motions, for tests of figures and recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pendmap
from pendmap import Pendulum

if TYPE_CHECKING:
    import xarray as xr


def chaotic(
    *, p: float = 1.7, gamma: float = 0.1, omega: float = 0.87, cells: int = 60, periods: int = 10
) -> xr.Dataset:
    """Return a map without meaningful labels: one chaotic attractor, or none (gamma = 0)."""
    model = Pendulum(gamma=gamma, p=p, omega=omega)
    return pendmap.basins(model, cells, layer_periods=periods)


def swing(
    *, p: float = 1.7, gamma: float = 0.1, omega: float = 0.87, periods: int = 60, steps: int = 60
) -> xr.Dataset:
    """Return a trajectory from theta = 1 rad at rest, ``steps`` samples a forcing period."""
    model = Pendulum(gamma=gamma, p=p, omega=omega)
    run = pendmap.simulate(model, 1.0, 0.0, max(periods, 1) * model.period, samples=steps)
    return run.isel(time=slice(periods * steps + 1), period=slice(periods + 1))
