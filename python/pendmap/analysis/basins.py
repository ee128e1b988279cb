"""Maps of whole planes as labelled datasets."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import orbit_table
from pendmap.analysis.draws import drawn, part
from pendmap.analysis.draws.basins import basins_over
from pendmap.analysis.fractality import fitted_map, passes_log2
from pendmap.analysis.grid import Grid, coordinate, starts
from pendmap.analysis.summary import summarise
from pendmap.errors import (
    MOST_PERIODS,
    MOST_SEED,
    MOST_THREADS,
    check_callable,
    check_flag,
    check_number,
    check_whole,
    core_errors,
)
from pendmap.files.dataset import FORMAT_VERSION
from pendmap.formatting import counted
from pendmap.model import without_dimensions
from pendmap.units import RATE, VELOCITY, Units

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from pendmap.model import Pendulum, Rig

    Progress = Callable[[int, int], object]


DEFAULT_CELLS = 1000
"""Cells on each side of a map where nothing is said."""


def basins(  # noqa: PLR0913 (numerical choices, all with defaults that serve)
    pendulum: Pendulum | Rig,
    grid: Grid | int | None = None,
    *,
    tol: float = 1e-6,
    max_periods: int | None = None,
    layer_periods: int | None = None,
    threads: int | None = None,
    seed: int = 0,
    check: bool = True,
    draws: int | None = None,
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
    pendulum : Pendulum or Rig
        The model. With a rig velocities are in rad/s, times in s and exponents in 1/s; only ``tol``
        and the errors are of numbers without dimensions. Effects of the group ``reading`` change
        nothing: a map is of the motion, not of what a sensor shows of it.
    grid : Grid or int, optional
        The initial conditions at ``tau = 0``, or how many cells each side of the default window
        has: [-pi, pi] x [-3, 3], with a rig [-pi, pi] x [-3 w0, 3 w0]. By default 1000.
    tol : float
        The 95th percentile, over a sample of the starts, of the difference that halving the step
        makes after 5 periods; 1e-13 to 1e-2.
    max_periods : int, optional
        Periods after which a start is undecided; by default those in which damping shrinks a free
        motion by exp(-200), ``400 / (gamma T)``, from 4000 to a million; with dry friction
        ``theta_r`` adds to ``gamma``. Where chaos coexists with other attractors ten times the
        longest settling time seen.
    layer_periods : int, optional
        Periods of the finite-time layers; by default what an exponent needs to stretch one cell to
        the size of the plane.
    threads : int, optional
        Number of threads; by default one a processor. The result does not depend on it.
    seed : int
        Shifts the samples of starts.
    check : bool
        Whether to measure what takes further starts: labels of a sample with half the step and
        mirrored, and the share of starts whose label changes nearby.
    draws : int, optional
        How many models are drawn from the model's ``[covariance]``, each mapped too: how probable
        each end is in each cell, and what of the doubt is the parameters'
        (:mod:`pendmap.analysis.draws.basins`). ``seed`` draws them.
    progress : callable, optional
        Called now and then with the number of cells done and in all.

    Returns
    -------
    xarray.Dataset
        ``label``, ``settle_periods`` and ``net_turns`` over (velocity, theta), the table of
        attractors over ``attractor``, their stroboscopic points over ``point``; parameters, shares
        and the error reached as attributes. The bounds of the cells are the coordinates
        ``theta_bounds`` and ``velocity_bounds``. A selection of cells keeps shares, attributes and
        summary of the whole map; figures and recordings of it count its own cells. ``fraction`` is
        the basin stability of an attractor in this window (Menck et al. 2013, Nature Physics 9,
        89), ``stderr`` its standard error as if the starts were drawn at random, more than that of
        a grid. ``basin_entropy``,
        ``boundary_basin_entropy`` and ``uncertainty_exponent`` say how the basins are interwoven:
        see :func:`pendmap.basin_entropy` and :func:`pendmap.uncertainty_exponent`; the counts
        behind the exponent, from 10,000 cells on, are ``uncertain`` of ``uncertainty_tried``
        starts over ``distance``. With ``draws`` also what
        :func:`pendmap.analysis.draws.basins.basins_over` adds.

    Notes
    -----
    The same request gives the same bits on any number of threads and on all processors that
    multiply and add with one rounding (AVX2, AVX-512). Processors without that, or ``sse`` and
    ``portable`` of the environment variable ``PENDMAP_SIMD``, round otherwise: where basins are
    smooth no label differs, where they are fractal as many do as rounding decides, 33 % at
    ``p = 1.7``. ``simd`` of the result says which instruction set it was.

    Raises
    ------
    InputError
        If a value is outside its range, or no step reaches ``tol``.
    MemoryError
        If there is too little memory for the cells.
    KeyboardInterrupt
        After Ctrl-C, within a fraction of a second.

    See Also
    --------
    basins_of : the same for a list of starts.
    """
    model = pendulum
    pendulum, units = without_dimensions(model)
    grid = Grid.of(grid, DEFAULT_CELLS, units.given(1.0, VELOCITY))
    check_callable("progress", progress)
    choices = _choices(tol, max_periods, layer_periods, threads, seed, check=check)
    several = None if draws is None else drawn(model, draws, seed)
    whole, progress = progress, progress if several is None else part(progress, 0, len(several) + 1)
    began = time.perf_counter()
    low, high, count = grid.velocity.as_tuple
    slow, fast = units.bare(low, VELOCITY), units.bare(high, VELOCITY)
    axes = grid.theta.as_tuple, (slow, fast, count)
    raw = _call(_core.basins_grid, pendulum, *axes, choices, progress)
    seconds = time.perf_counter() - began
    shape = (grid.velocity.count, grid.theta.count)
    dims = ("velocity", "theta")
    dataset = xr.Dataset(
        cells(raw, dims, shape, units),
        coords=coordinate(
            "theta",
            grid.theta.centres,
            grid.theta.edges,
            {"units": "rad", "long_name": "initial angle"},
        )
        | coordinate(
            "velocity",
            grid.velocity.centres,
            grid.velocity.edges,
            {"units": units.of_velocity, "long_name": f"initial velocity {units.derivative}"},
        ),
    )
    dataset = dataset.assign(uncertain_starts(raw))
    dataset = complete(dataset, raw, model, choices, seconds)
    if several is None:
        return dataset

    def again(one: Pendulum | Rig, report: Progress | None) -> xr.Dataset:
        bounds = {"max_periods": max_periods, "layer_periods": layer_periods}
        shared = {"tol": tol, "threads": threads, "seed": seed, "check": False}
        return basins(one, grid, **bounds, **shared, progress=report)  # type: ignore[arg-type]

    return basins_over(dataset, several, again, whole)


def basins_of(  # noqa: PLR0913 (as for basins)
    pendulum: Pendulum | Rig,
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
    pendulum : Pendulum or Rig
        The model; as for :func:`basins`.
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
    model = pendulum
    pendulum, units = without_dimensions(model)
    check_callable("progress", progress)
    angles, speeds = starts(theta, velocity)
    bare = units.bare(speeds, VELOCITY)
    choices = _choices(tol, max_periods, layer_periods, threads, seed, check=check)
    began = time.perf_counter()
    raw = _call(_core.basins_list, pendulum, angles, bare, choices, progress)
    seconds = time.perf_counter() - began
    dataset = xr.Dataset(
        cells(raw, ("start",), angles.shape, units)
        | {
            "start_theta": ("start", angles, {"units": "rad"}),
            "start_velocity": ("start", speeds, {"units": units.of_velocity}),
        }
    )
    return complete(dataset, raw, model, choices, seconds)


def _choices(  # noqa: PLR0913
    tol: float,
    max_periods: int | None,
    layer_periods: int | None,
    threads: int | None,
    seed: int,
    *,
    check: bool,
) -> _core._Choices:
    def periods(name: str, value: int | None) -> int | None:
        return None if value is None else check_whole(name, value, 1, MOST_PERIODS)

    return {
        "tol": check_number("tol", tol),
        "max_periods": periods("max_periods", max_periods),
        "layer_periods": periods("layer_periods", layer_periods),
        "threads": 0 if threads is None else check_whole("threads", threads, 1, MOST_THREADS),
        "seed": check_whole("seed", seed, 0, MOST_SEED),
        "check": check_flag("check", check),
    }


def _call(function: Callable[..., dict[str, Any]], *arguments: object) -> dict[str, Any]:
    with core_errors():
        return function(*arguments)


# The labelled dataset of a basin map: cells, table of attractors, attributes.


RELIABLE: Final = 0.05
"""Labels of which a larger share changes under half the step or mirroring are not reliable."""

_LAYERS: Final = {
    "basins": "labels",
    "only_chaos": "finite_time",
    "conservative": "finite_time",
}


def cells(
    raw: dict[str, Any], dims: tuple[str, ...], shape: tuple[int, ...], units: Units
) -> dict[str, Any]:
    """Return the variables with one value a start, over ``dims`` of ``shape``."""
    finite_time = _LAYERS[raw["plane"]] == "finite_time"
    when = "until settled"
    if finite_time:
        when = f"after {counted(raw['layer_periods'], 'period')}"
    elif not (raw["settle"] >= 0).any():
        when = f"after {counted(raw['bound'], 'period')}"
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
                "long_name": "periods until an attractor's trap holds the trajectory",
                "units": "1",
                "comment": "-1 where no attractor captured it",
            },
        ),
        "net_turns": (
            dims,
            raw["turns"].reshape(shape),
            {
                "long_name": f"net turns {when}",
                "units": "1",
                "comment": "the angle's displacement over 2 pi, rounded",
            },
        ),
    }
    exponent = raw["finite_time_exponent"]
    if exponent is not None:
        attributes = {"long_name": f"finite-time Lyapunov exponent {when}", "units": units.of_rate}
        values = units.given(exponent, RATE).reshape(shape)
        cells["finite_time_exponent"] = (dims, values, attributes)
    return cells


def uncertain_starts(raw: dict[str, Any]) -> dict[str, Any]:
    """Counts of starts whose label changes nearby, over ``distance``; none without a boundary."""
    if not raw["uncertainty_eps"].size:
        return {}
    what = "distance in sides of the window"
    return {
        "uncertainty_eps": ("distance", raw["uncertainty_eps"], {"units": "1", "long_name": what}),
        "uncertain": (
            "distance",
            raw["uncertain"].astype(np.int64),
            {"long_name": "starts with another label at this distance on one side or the other"},
        ),
        "uncertainty_tried": (
            "distance",
            raw["uncertainty_tried"].astype(np.int64),
            {
                "long_name": "starts with known ends, drawn anew for each distance; where drawn by "
                "strata, as many drawn evenly as tell the share as precisely"
            },
        ),
    }


def complete(
    dataset: xr.Dataset,
    raw: dict[str, Any],
    model: Pendulum | Rig,
    choices: _core._Choices,
    seconds: float,
) -> xr.Dataset:
    """Add the table of attractors, all attributes and the summary to the cells."""
    count = dataset["label"].size
    dataset = dataset.assign(table(raw["attractors"], count, model.units)).assign_coords(
        attractor=("attractor", np.array([a["name"] for a in raw["attractors"]], dtype=str)),
    )
    settle = dataset["settle_periods"].values
    settled = settle[settle >= 0]
    mirror = raw["unreliable_mirror"]
    dataset.attrs = {
        "kind": "basins",
        "title": model.title,
        **model.attributes,
        "section": model.units.section,
        "tol": choices["tol"],
        "reached_error": raw["reached_error"],
        "steps_per_period": raw["steps_per_period"],
        "max_periods": raw["bound"],
        "chaos_bound": raw["chaos_bound"],
        "searched_starts": raw["searched_starts"],
        "plane": raw["plane"],
        "layers": _LAYERS[raw["plane"]],
        "layer_periods": raw["layer_periods"],
        "cells": count,
        "undecided": raw["undecided"],
        "failed": raw["failed"],
        "mean_periods": raw["mean_periods"],
        "mean_settle": float(settled.mean()) if settled.size else -1.0,
        "longest_settle": int(settled.max()) if settled.size else -1,
        "basin_entropy": raw["basin_entropy"],
        **_boundary(dataset, raw),
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
    chosen = choices["max_periods"] is None
    pendulum, _ = without_dimensions(model)
    dataset.attrs["summary"] = summarise(dataset, pendulum, bound_was_chosen=chosen)
    return dataset


def _boundary(dataset: xr.Dataset, raw: dict[str, Any]) -> dict[str, float]:
    """What tells how fractal the boundary is, as far as there is one."""
    found: dict[str, float] = {}
    if raw["boundary_boxes"]:
        found["boundary_basin_entropy"] = raw["boundary_basin_entropy"]
        found["boundary_boxes"] = raw["boundary_boxes"]
        if math.isfinite(raw["boundary_stderr"]):
            found["boundary_basin_entropy_stderr"] = raw["boundary_stderr"]
        found["log2_criterion"] = int(
            passes_log2(raw["boundary_basin_entropy"], raw["boundary_stderr"])
        )
    if "uncertainty_eps" in dataset:
        law = fitted_map(dataset)
        if law is not None:
            found["uncertainty_exponent"] = law.value
            found["uncertainty_exponent_stderr"] = law.stderr
            found["uncertainty_exponent_low"], found["uncertainty_exponent_high"] = law.ci95
            found["uncertainty_eps_low"] = float(law.eps[0])
            found["uncertainty_eps_high"] = float(law.eps[law.scales - 1])
    return found


def table(attractors: list[dict[str, Any]], count: int, units: Units) -> dict[str, Any]:
    """The attractors with their shares of ``count`` starts, and their points, as variables."""
    one = "attractor"
    fraction = np.array([a["fraction"] for a in attractors], dtype=float)
    return {
        **orbit_table.table(attractors, units, one),
        "fraction": (one, fraction),
        "stderr": (one, np.sqrt(fraction * (1 - fraction) / max(count, 1))),
    }
