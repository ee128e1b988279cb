"""Basins of attraction: which attractor each initial condition of a plane, or a list, reaches."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import orbit_table, result
from pendmap.analysis.draws import drawn
from pendmap.analysis.draws.basins import basins_over, drawn_basins
from pendmap.analysis.fractality import fitted_map, passes_log2
from pendmap.analysis.grid import Grid, coordinate, starts
from pendmap.analysis.numerics import Numerics, optional_whole
from pendmap.analysis.result import Field, Found, Schema, none_below_0, variable
from pendmap.analysis.summary import summarise
from pendmap.errors import MOST_PERIODS, check_flag, core_errors
from pendmap.files import facts
from pendmap.formatting import counted
from pendmap.model import without_dimensions
from pendmap.units import RATE, VELOCITY, Units

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from pendmap.analysis.numerics import Progress
    from pendmap.model import Pendulum, Rig


DEFAULT_CELLS = 1000  # Default number of cells on each side of a map
RELIABLE: Final = 0.05
"""Share of labels changed by half the step or mirroring above which labels are not reliable."""
_LAYERS: Final = {
    "basins": "labels",
    "only_chaos": "finite_time",
    "conservative": "finite_time",
}


def _uncertainty(dataset: xr.Dataset) -> dict[str, Any] | None:
    """Return the uncertainty exponent of the boundary for the JSON object."""
    a = facts(dataset)
    if "uncertainty_exponent" not in a:
        return None
    value = a["uncertainty_exponent"]
    low, high = (a[f"uncertainty_exponent_{end}"] for end in ("low", "high"))
    return {
        "value": value,
        "stderr": a["uncertainty_exponent_stderr"],
        "ci95": [low, high],
        "dimension": 2 - value,
        "dimension_ci95": [2 - high, 2 - low],
        "eps": [a["uncertainty_eps_low"], a["uncertainty_eps_high"]],
    }


SCHEMA = Schema(
    "basins",
    result.UNITS,
    Field(
        "attractors",
        "",
        "attractors with their shares of the starts",
        read=lambda d: orbit_table.objects(d, "attractor", "fraction", "stderr"),
    ),
    Found("undecided", "1", "share of the starts that no attractor captured within the bound"),
    Found("failed", "1", "share of the starts that failed or diverged"),
    Field("cells", "1", "starts"),
    Found("mean_periods", "periods", "periods computed for a start, on average"),
    result.SECONDS,
    result.REACHED,
    Found(
        "basin_entropy",
        "nat",
        "mean entropy of the labels in boxes of 5 x 5 cells",
        "texture.basin_entropy",
    ),
    Found("boundary_basin_entropy", "nat", "the same, of boxes with more than one label", None),
    Found("boundary_basin_entropy_stderr", "nat", "its standard error over those boxes", None),
    Found("unreliable", "1", "share of sampled labels that half the step or mirroring changes"),
    Field("labels_sampled", "1", "labels checked so"),
    Found("unreliable_half_step", "1", "share that half the step changes"),
    Found("unreliable_mirror", "1", "share that mirroring changes; absent without the symmetry"),
    Found(
        "neighbours_agree",
        "1",
        "share of neighbouring cells with the same label",
        "texture.neighbours_agree",
    ),
    Found("neighbours_chance", "1", "share that would agree by chance", "texture.chance"),
    result.CHAOS_BOUND,
    Field("searched_starts", "1", "starts of the search for attractors"),
    Field("plane", "", "basins, only_chaos or conservative"),
    Field("layer_periods", "periods", "length of the finite-time layers"),
    result.STEPS,
    result.BOUND,
    result.TOL,
    *result.RUN[1:],
    Found(
        "log2_criterion",
        result.FLAG,
        "1 where the log 2 criterion is met: fractal",
        None,
        convert=bool,
    ),
    Found("uncertainty_exponent", "1", "exponent of the uncertain share", read=_uncertainty),
    Found("mean_settle", "periods", "mean time of capture; -1: none", convert=none_below_0),
    Found("longest_settle", "periods", "longest time of capture; -1: none", convert=none_below_0),
    *result.END,
    drawn_basins,
    result.SECTION,
    Field("layers", "", "labels or finite_time: layers that describe the plane", json=False),
    Found("boundary_boxes", "1", "boxes with more than one label", None, json=False),
    Found(
        "labels_reliable", result.FLAG, "1 where labels of single cells are reliable", json=False
    ),
    Found("uncertainty_exponent_stderr", "1", "its standard error", None, json=False),
    Found("uncertainty_exponent_low", "1", "lower end of its 95 % interval", None, json=False),
    Found("uncertainty_exponent_high", "1", "upper end of its 95 % interval", None, json=False),
    Found("uncertainty_eps_low", "1", "least distance, in sides of the window", None, json=False),
    Found("uncertainty_eps_high", "1", "greatest distance that was fitted", None, json=False),
)


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
    """Compute the basins of attraction: the attractor on which each initial condition ends.

    Attractors are found from a coarse set of starts, refined by Newton's method to 1e-12 and
    classified by their period ``n`` (in forcing periods) and winding ``w`` (net turns over it).
    Then every cell runs until an attractor has captured it; cells that reach none begin new
    searches. Without damping, or if one chaotic attractor captures all starts, labels have no
    meaning: net turns and the finite-time exponent after ``layer_periods`` are given instead.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model. With a rig velocities are in rad/s, times in s and exponents in 1/s; ``tol`` and
        the errors are of numbers without dimensions. Effects of the group ``reading`` change
        nothing: a map shows the motion, not the sensor's reading.
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
        Periods of the finite-time layers; by default those in which an exponent stretches one cell
        to the size of the plane.
    threads : int, optional
        Number of threads; by default one per processor. The result does not depend on it.
    seed : int
        Shifts the samples of starts.
    check : bool
        Whether to check labels of a sample with half the step and mirrored, and to measure the
        share of starts whose label changes nearby.
    draws : int, optional
        Number of models drawn from the model's ``[covariance]`` with ``seed``, each mapped too:
        the probability of each outcome in each cell, and the uncertainty due to the parameters
        (:mod:`pendmap.analysis.draws.basins`).
    progress : callable, optional
        Called repeatedly with the units of work done and in total.

    Returns
    -------
    xarray.Dataset
        ``label``, ``settle_periods`` and ``net_turns`` over (velocity, theta), the table of
        attractors over ``attractor``, their stroboscopic points over ``point``; without dimensions
        shares and the error reached, as coordinates the parameters. The bounds of the cells are
        ``theta_bounds`` and ``velocity_bounds``. A selection of cells keeps shares, attributes and
        summary of the whole map; figures and recordings of it count its own cells. ``fraction`` is
        the basin stability of an attractor in this window (Menck et al. 2013, Nature Physics 9,
        89), ``stderr`` its standard error as if the starts were drawn at random, more than that of
        a grid. ``basin_entropy``, ``boundary_basin_entropy`` and ``uncertainty_exponent`` measure
        how the basins are interwoven (:func:`pendmap.basin_entropy`,
        :func:`pendmap.uncertainty_exponent`); the exponent's counts, from 10,000 cells on, are
        ``uncertain`` of ``uncertainty_tried`` starts over ``distance``. With ``draws`` also the
        variables of :func:`pendmap.analysis.draws.basins.basins_over`.

    Notes
    -----
    The same request gives the same bits on any number of threads and on all processors that
    multiply and add with one rounding (AVX2, AVX-512). Other processors, or ``sse`` and
    ``portable`` of the environment variable ``PENDMAP_SIMD``, round otherwise: where basins are
    smooth no label differs, where they are fractal up to 33 % do (``p = 1.7``). The attribute
    ``simd`` names the instruction set.

    Raises
    ------
    InputError
        If a value is outside its range, or no step reaches ``tol``.
    MemoryError
        If there is too little memory for the cells; by every analysis.
    KeyboardInterrupt
        After Ctrl-C, within a fraction of a second; by every analysis.

    See Also
    --------
    basins_of : Attractors reached by a list of starts.

    Examples
    --------
    >>> import pendmap
    >>> pendulum = pendmap.Pendulum(gamma=0.1, p=0.6, omega=2.0)
    >>> result = pendmap.basins(pendulum, pendmap.Grid.square(20))
    >>> list(map(str, result.attractor.values))
    ['oscillation 2:0', 'rotation 1:-1', 'rotation 1:+1']
    """
    bare, units = without_dimensions(pendulum)
    grid = Grid.of(grid, DEFAULT_CELLS, units.given(1.0, VELOCITY))
    numerics = Numerics(tol, max_periods, threads, seed, progress)
    choices = _choices(numerics, layer_periods, check=check)
    if draws is not None:
        several = drawn(pendulum, draws, seed, progress)
        same = partial(basins, grid=grid, layer_periods=layer_periods, **numerics.options)
        own = same(pendulum, check=check, progress=several.first)
        return basins_over(own, several, partial(same, check=False))
    with core_errors():
        raw = _core.basins_grid(bare, *grid.bare(units), choices, progress)
    angle, speed = grid.theta, grid.velocity
    shape, unit = (speed.count, angle.count), units.of_velocity
    said = f"initial velocity {units.derivative}"
    dataset = xr.Dataset(
        {**_cells(raw, ("velocity", "theta"), shape, units), **_uncertain_starts(raw)},
        coords={
            **coordinate("theta", angle.centres, angle.edges, "rad", "initial angle"),
            **coordinate("velocity", speed.centres, speed.edges, unit, said),
        },
    )
    return _complete(dataset, raw, pendulum, numerics)


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
    """Find the attractor on which each start of a list ends.

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
        As for :func:`basins`, with the dimension ``start`` instead of the grid; there is no basin
        entropy.

    Raises
    ------
    InputError
        If the lengths differ, a start is not finite, or a value is outside its range.

    Examples
    --------
    >>> import pendmap
    >>> pendulum = pendmap.Pendulum(gamma=0.1, p=0.6, omega=2.0)
    >>> pendmap.basins_of(pendulum, [0.0, 1.0], [0.1, 2.5]).label.values
    array([1, 1], dtype=int16)
    """
    bare, units = without_dimensions(pendulum)
    numerics = Numerics(tol, max_periods, threads, seed, progress)
    choices = _choices(numerics, layer_periods, check=check)
    angles, speeds = starts(theta, velocity)
    with core_errors():
        raw = _core.basins_list(bare, angles, units.bare(speeds, VELOCITY), choices, progress)
    dataset = xr.Dataset(
        {
            **_cells(raw, ("start",), angles.shape, units),
            "start_theta": variable("start", angles, "rad", "initial angle"),
            "start_velocity": variable("start", speeds, units.of_velocity, "initial velocity"),
        }
    )
    return _complete(dataset, raw, pendulum, numerics)


def _choices(numerics: Numerics, layer_periods: int | None, *, check: bool) -> _core._Choices:
    layers = optional_whole("layer_periods", layer_periods, 1, MOST_PERIODS)
    return {**numerics.core, "layer_periods": layers, "check": check_flag("check", check)}


def _cells(
    raw: _core.BasinMap, dims: tuple[str, ...], shape: tuple[int, ...], units: Units
) -> dict[str, Any]:
    """Return the variables with one value a start, over ``dims`` of ``shape``."""
    finite_time = _LAYERS[raw.plane] == "finite_time"
    when = "until settled"
    if finite_time:
        when = f"after {counted(raw.layer_periods, 'period')}"
    elif not (raw.settle >= 0).any():
        when = f"after {counted(raw.bound, 'period')}"
    cells: dict[str, Any] = {
        "label": variable(
            dims,
            raw.label.reshape(shape),
            long_name="attractor",
            comment="number of the attractor; 0 undecided within the bound, -1 failed or diverged",
            flags=dict(enumerate(["failed", "undecided", *(a.name for a in raw.attractors)], -1)),
        ),
        "settle_periods": variable(
            dims,
            raw.settle.reshape(shape),
            "1",
            "periods until the trap of an attractor captures the trajectory",
            "-1 where no attractor captured it",
            missing=-1,
        ),
        "net_turns": variable(
            dims,
            raw.turns.reshape(shape),
            "1",
            f"net turns {when}",
            "the angle's displacement over 2 pi, rounded",
        ),
    }
    exponent = raw.finite_time_exponent
    if exponent is not None:
        values = units.given(exponent, RATE).reshape(shape)
        name = f"finite-time Lyapunov exponent {when}"
        cells["finite_time_exponent"] = variable(dims, values, units.of_rate, name)
    return cells


def _uncertain_starts(raw: _core.BasinMap) -> dict[str, Any]:
    """Return the counts of starts whose label changes nearby; none without a boundary."""
    if not raw.uncertainty_eps.size:
        return {}
    what = "distance in sides of the window"
    return {
        "uncertainty_eps": variable("distance", raw.uncertainty_eps, "1", what),
        "uncertain": variable(
            "distance",
            raw.uncertain.astype(np.int64),
            "1",
            "starts with another label at this distance on one side or the other",
        ),
        "uncertainty_tried": variable(
            "distance",
            raw.uncertainty_tried.astype(np.int64),
            "1",
            "starts with known ends, drawn anew for each distance; where drawn by "
            "strata, the equivalent number of evenly drawn starts",
        ),
    }


def _complete(
    dataset: xr.Dataset, raw: _core.BasinMap, model: Pendulum | Rig, numerics: Numerics
) -> xr.Dataset:
    """Add the table of attractors, all facts and the summary to the cells."""
    count, attractors = dataset["label"].size, raw.attractors
    fraction = np.array([a.fraction for a in attractors], dtype=float)
    stderr = np.sqrt(fraction * (1 - fraction) / max(count, 1))
    dataset = dataset.assign(
        {
            **orbit_table.table(attractors, model.units, "attractor"),
            "fraction": variable("attractor", fraction, "1", "share of the starts"),
            "stderr": variable("attractor", stderr, "1", "standard error of the share"),
        }
    )
    settle = dataset["settle_periods"].values
    settled = settle[settle >= 0]
    values = {
        **numerics.provenance(),
        **_boundary(dataset, raw),
        "layers": _LAYERS[raw.plane],
        "cells": count,
        "mean_settle": float(settled.mean()) if settled.size else -1.0,
        "longest_settle": int(settled.max()) if settled.size else -1,
        "labels_reliable": int(raw.unreliable <= RELIABLE),
    }
    SCHEMA.complete(dataset, model, values, raw)
    pendulum, _ = without_dimensions(model)
    chosen = numerics.max_periods is None
    dataset.attrs["summary"] = summarise(dataset, pendulum, bound_was_chosen=chosen)
    return dataset


def _boundary(dataset: xr.Dataset, raw: _core.BasinMap) -> dict[str, float | None]:
    """Return the measures of the boundary as facts, None without a boundary."""
    found: dict[str, float | None] = {}
    if raw.texture.boundary_boxes:
        entropy, stderr = raw.texture.boundary_basin_entropy, raw.texture.boundary_stderr
        found["boundary_basin_entropy"] = entropy
        found["boundary_boxes"] = raw.texture.boundary_boxes
        found["boundary_basin_entropy_stderr"] = stderr if math.isfinite(stderr) else None
        found["log2_criterion"] = int(passes_log2(entropy, stderr))
    law = fitted_map(dataset) if "uncertainty_eps" in dataset else None
    if law is not None:
        found["uncertainty_exponent"] = law.value
        found["uncertainty_exponent_stderr"] = law.stderr
        found["uncertainty_exponent_low"], found["uncertainty_exponent_high"] = law.ci95
        found["uncertainty_eps_low"] = float(law.eps[0])
        found["uncertainty_eps_high"] = float(law.eps[law.scales - 1])
    return found
