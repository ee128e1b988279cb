"""Maps of whole planes as labelled datasets."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.errors import InputError
from pendmap.grid import Grid
from pendmap.store import FORMAT_VERSION
from pendmap.summary import summarise

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from pendmap.model import Pendulum

    Progress = Callable[[int, int], object]

__all__ = ["RELIABLE", "basins", "basins_of"]

RELIABLE: Final = 0.05
"""Labels of which a larger share changes under half the step or mirroring are not reliable."""

_MAP_POINTS: Final = {
    "basins": "labels",
    "only_chaos": "finite_time",
    "conservative": "finite_time",
}


def basins(  # noqa: PLR0913 (numerical choices, all with defaults that serve)
    pendulum: Pendulum,
    grid: Grid | None = None,
    *,
    tol: float = 1e-6,
    max_periods: int | None = None,
    layer_periods: int | None = None,
    threads: int | None = None,
    seed: int = 0,
    check: bool = True,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Basins of attraction: which attractor each initial condition ends on.

    Attractors are found from a coarse set of starts, polished by Newton's method to 1e-12 and
    classified by their period ``n`` (in forcing periods) and winding ``w`` (net turns over it).
    Then every cell runs until an attractor has captured it. Cells that meet none begin new
    searches. Without damping, or where one chaotic attractor takes everything, there is nothing to
    tell by labels: net turns and the finite-time exponent after ``layer_periods`` are given
    instead.

    Parameters
    ----------
    pendulum : Pendulum
        The model.
    grid : Grid, optional
        The initial conditions at ``tau = 0``; by default 1000 x 1000 cells of
        [-pi, pi] x [-3, 3].
    tol : float
        The 95th percentile, over a sample of the starts, of the difference that halving the step
        makes after 5 periods; 1e-13 to 1e-2.
    max_periods : int, optional
        Periods after which a start is undecided; by default 4000, and where chaos coexists with
        other attractors ten times the longest settling time seen.
    layer_periods : int, optional
        Periods of the finite-time layers; by default what an exponent needs to stretch one cell to
        the size of the plane.
    threads : int, optional
        Number of threads; by default one a processor. The result does not depend on it.
    seed : int
        Shifts the samples of starts.
    check : bool
        Whether to label a sample again with half the step and mirrored.
    progress : callable, optional
        Called now and then with the number of cells done and in all.

    Returns
    -------
    xarray.Dataset
        ``label``, ``settle_periods`` and ``net_turns`` over (velocity, theta), the table of
        attractors over ``attractor``, their stroboscopic points over ``point``; parameters, shares
        and the error reached as attributes.

    Raises
    ------
    InputError
        If a value is outside its range, or no step reaches ``tol``.
    KeyboardInterrupt
        After Ctrl-C, within a fraction of a second.

    See Also
    --------
    basins_of : the same for a list of starts.
    """
    grid = Grid() if grid is None else grid
    choices = _choices(tol, max_periods, layer_periods, threads, seed, check=check)
    began = time.perf_counter()
    axes = grid.theta.as_tuple, grid.velocity.as_tuple
    raw = _call(_core.basins_grid, pendulum.parameters, *axes, choices, progress)
    seconds = time.perf_counter() - began
    shape = (grid.velocity.count, grid.theta.count)
    dims = ("velocity", "theta")
    dataset = xr.Dataset(
        _cells(raw, dims, shape),
        coords={
            "theta": ("theta", grid.theta.centres, {"units": "rad", "long_name": "initial angle"}),
            "velocity": (
                "velocity",
                grid.velocity.centres,
                {"units": "1", "long_name": "initial velocity dtheta/dtau"},
            ),
        },
    )
    return _complete(dataset, raw, pendulum, choices, seconds)


def basins_of(  # noqa: PLR0913 (as for basins)
    pendulum: Pendulum,
    theta: ArrayLike,
    velocity: ArrayLike,
    *,
    tol: float = 1e-6,
    max_periods: int | None = None,
    layer_periods: int | None = None,
    threads: int | None = None,
    seed: int = 0,
    check: bool = True,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Which attractor each start of a list ends on.

    Parameters
    ----------
    pendulum : Pendulum
        The model.
    theta, velocity : array_like, shape (N,)
        Angles in rad and velocities at ``tau = 0``.
    tol, max_periods, layer_periods, threads, seed, check, progress
        As for :func:`basins`.

    Returns
    -------
    xarray.Dataset
        As of :func:`basins`, with the dimension ``start`` instead of the grid; there is no basin
        entropy.

    Raises
    ------
    InputError
        If the lengths differ, a start is not finite, or a value is outside its range.
    """
    angles: NDArray[np.float64] = np.ascontiguousarray(theta, dtype=np.float64)
    speeds: NDArray[np.float64] = np.ascontiguousarray(velocity, dtype=np.float64)
    if angles.ndim != 1 or speeds.ndim != 1:
        raise InputError("theta and velocity: allowed are arrays of one dimension")
    choices = _choices(tol, max_periods, layer_periods, threads, seed, check=check)
    began = time.perf_counter()
    raw = _call(_core.basins_list, pendulum.parameters, angles, speeds, choices, progress)
    seconds = time.perf_counter() - began
    dataset = xr.Dataset(
        _cells(raw, ("start",), angles.shape)
        | {
            "start_theta": ("start", angles, {"units": "rad"}),
            "start_velocity": ("start", speeds, {"units": "1"}),
        }
    )
    return _complete(dataset, raw, pendulum, choices, seconds)


def _choices(  # noqa: PLR0913
    tol: float,
    max_periods: int | None,
    layer_periods: int | None,
    threads: int | None,
    seed: int,
    *,
    check: bool,
) -> _core._Choices:
    for name, value in (
        ("max_periods", max_periods),
        ("layer_periods", layer_periods),
        ("threads", threads),
    ):
        if value is not None and not 1 <= value < 2**31:
            raise InputError(f"{name} is {value}: allowed is 1 or more")
    if not 0 <= seed < 2**63:
        raise InputError(f"seed is {seed}: allowed is 0 or more")
    return {
        "tol": float(tol),
        "max_periods": max_periods,
        "layer_periods": layer_periods,
        "threads": 0 if threads is None else threads,
        "seed": seed,
        "check": check,
    }


def _call(function: Callable[..., dict[str, Any]], *arguments: object) -> dict[str, Any]:
    try:
        return function(*arguments)
    except ValueError as error:
        raise InputError(str(error)) from None


def _cells(raw: dict[str, Any], dims: tuple[str, ...], shape: tuple[int, ...]) -> dict[str, Any]:
    finite_time = _MAP_POINTS[raw["plane"]] == "finite_time"
    when = f"after {raw['layer_periods']} periods" if finite_time else "until settled"
    label = {
        "long_name": "attractor",
        "comment": "number of the attractor; 0 undecided within the bound, -1 failed or diverged",
    }
    cells: dict[str, Any] = {
        "label": (dims, raw["label"].reshape(shape), label),
        "settle_periods": (
            dims,
            raw["settle"].reshape(shape),
            {
                "long_name": "forcing periods until an attractor's trap holds the trajectory",
                "units": "1",
                "comment": "-1 where no attractor captured it",
            },
        ),
        "net_turns": (
            dims,
            raw["turns"].reshape(shape),
            {"long_name": f"net full turns {when}", "units": "1"},
        ),
    }
    exponent = raw["finite_time_exponent"]
    if exponent is not None:
        attributes = {"long_name": f"finite-time Lyapunov exponent {when}", "units": "1 per tau"}
        cells["finite_time_exponent"] = (dims, exponent.reshape(shape), attributes)
    return cells


def _complete(
    dataset: xr.Dataset,
    raw: dict[str, Any],
    pendulum: Pendulum,
    choices: _core._Choices,
    seconds: float,
) -> xr.Dataset:
    count = dataset["label"].size
    dataset = dataset.assign(_table(raw["attractors"], count)).assign_coords(
        attractor=("attractor", np.array([a["name"] for a in raw["attractors"]], dtype=str)),
    )
    settle = dataset["settle_periods"].values
    settled = settle[settle >= 0]
    mirror = raw["unreliable_mirror"]
    dataset.attrs = {
        "kind": "basins",
        "title": pendulum.title,
        "gamma": pendulum.gamma,
        "p": pendulum.p,
        "omega": pendulum.omega,
        "phase": pendulum.phase,
        "torque": pendulum.torque,
        "section": "tau = 0 mod T, T = 2 pi / omega (2 pi without drive), at the drive's phase",
        "tol": choices["tol"],
        "reached_error": raw["reached_error"],
        "steps_per_period": raw["steps_per_period"],
        "max_periods": raw["bound"],
        "plane": raw["plane"],
        "layers": _MAP_POINTS[raw["plane"]],
        "layer_periods": raw["layer_periods"],
        "cells": count,
        "undecided": raw["undecided"],
        "failed": raw["failed"],
        "mean_periods": raw["mean_periods"],
        "mean_settle": float(settled.mean()) if settled.size else -1.0,
        "longest_settle": int(settled.max()) if settled.size else -1,
        "basin_entropy": raw["basin_entropy"],
        "neighbours_agree": raw["neighbours_agree"],
        "neighbours_chance": raw["chance"],
        "unreliable": raw["unreliable"],
        "unreliable_half_step": raw["unreliable_half_step"],
        **({} if mirror is None else {"unreliable_mirror": mirror}),
        "labels_sampled": raw["labels_sampled"],
        "labels_reliable": int(raw["unreliable"] <= RELIABLE),
        "seconds": seconds,
        "simd": raw["simd"],
        "threads": choices["threads"] or _core.default_threads(),
        "seed": choices["seed"],
        "pendmap_version": _core.__version__,
        "format_version": FORMAT_VERSION,
    }
    dataset.attrs["summary"] = summarise(dataset)
    return dataset


def _table(attractors: list[dict[str, Any]], count: int) -> dict[str, Any]:
    """The attractors and their stroboscopic points as variables."""

    def column(key: str, none: float) -> list[float]:
        return [none if a[key] is None else a[key] for a in attractors]

    multipliers = np.full((len(attractors), 2, 2), np.nan)
    for row, attractor in zip(multipliers, attractors, strict=True):
        for k, pair in enumerate(attractor["multipliers"]):
            row[k] = pair
    closed = [a["points"][0] if a["n"] is not None else (np.nan, np.nan) for a in attractors]
    fraction = np.array([a["fraction"] for a in attractors], dtype=float)
    points = [(k + 1, *p) for k, a in enumerate(attractors) for p in a["points"]]
    flat = np.array(points, dtype=float).reshape(-1, 3)
    one = "attractor"
    return {
        "id": (one, np.arange(1, len(attractors) + 1, dtype=np.int32)),
        "kind": (one, np.array([a["kind"] for a in attractors], dtype=str)),
        "n": (one, np.array(column("n", 0), dtype=np.int32), {"comment": "0: no meaning"}),
        "w": (one, np.array(column("w", 0), dtype=np.int32)),
        "theta_point": (one, np.array([c[0] for c in closed], dtype=float), {"units": "rad"}),
        "velocity_point": (one, np.array([c[1] for c in closed], dtype=float), {"units": "1"}),
        "period": (one, np.array(column("period", np.nan), dtype=float), {"units": "tau"}),
        "exponent": (one, np.array(column("exponent", np.nan), dtype=float)),
        "exponent_stderr": (one, np.array(column("exponent_stderr", np.nan), dtype=float)),
        "fraction": (one, fraction),
        "stderr": (one, np.sqrt(fraction * (1 - fraction) / max(count, 1))),
        "twin": (
            one,
            np.array(column("twin", 0), dtype=np.int32),
            {"comment": "number of the mirror image; its own where symmetric, 0 if not known"},
        ),
        "multipliers": ((one, "eigenvalue", "part"), multipliers, {"comment": "part: re, im"}),
        "point_attractor": ("point", flat[:, 0].astype(np.int32)),
        "point_theta": ("point", flat[:, 1], {"units": "rad"}),
        "point_velocity": ("point", flat[:, 2], {"units": "1"}),
    }
