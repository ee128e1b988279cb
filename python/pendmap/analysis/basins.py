"""Basins of attraction: which attractor each initial condition of a plane, or a list, reaches."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any, Final, Unpack

import numpy as np
import xarray as xr

from pendmap.analysis import orbit_table, result
from pendmap.analysis.basin_tiles import BasinTiles, Starts
from pendmap.analysis.draws import basins_over, drawn, drawn_basins
from pendmap.analysis.fractality import fitted_map, passes_log2
from pendmap.analysis.grid import Grid, starts
from pendmap.analysis.result import Field, Found, Schema, none_below_0, summarised
from pendmap.analysis.run import Numerics, RunOptions, optional_whole
from pendmap.analysis.summary import summary_of
from pendmap.engine import Work
from pendmap.errors import MOST_PERIODS, check_flag
from pendmap.files import facts
from pendmap.files.variables import variable
from pendmap.formatting import counted
from pendmap.model import without_dimensions
from pendmap.units import RATE, VELOCITY

if TYPE_CHECKING:
    from types import SimpleNamespace

    from numpy.typing import ArrayLike

    from pendmap import _core
    from pendmap.analysis.run import Keywords
    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats
    from pendmap.units import Units


DEFAULT_CELLS = 1000  # Default number of cells on each side of a map
RELIABLE: Final = 0.05
"""Share of labels changed by half the step or mirroring above which labels are not reliable."""


def _uncertainty(dataset: xr.Dataset) -> dict[str, Any] | None:
    """Return the uncertainty exponent of the boundary for the JSON object."""
    a, name = facts(dataset), "uncertainty_exponent"
    if name not in a:
        return None
    value, low, high = a[name], a[f"{name}_low"], a[f"{name}_high"]
    return {
        "value": value,
        "stderr": a[f"{name}_stderr"],
        "ci95": [low, high],
        "dimension": 2 - value,
        "dimension_ci95": [2 - high, 2 - low],
    }


SCHEMA = Schema(
    "basins",
    result.UNITS,
    Field(
        *("attractors", "", "attractors with their shares of the starts"),
        read=lambda d: orbit_table.objects(d, "attractor", "fraction", "stderr", "ci95"),
    ),
    Found("undecided", "1", "share of the starts that no attractor captured within the bound"),
    Found("failed", "1", "share of the starts that failed or diverged"),
    Field("cells", "1", "starts"),
    Found("mean_periods", "periods", "periods computed for a start, on average"),
    result.SECONDS,
    result.REACHED,
    Found("basin_entropy", "nat", "mean entropy of the labels in boxes of 5 x 5 cells"),
    Found("boundary_basin_entropy", "nat", "the same, of boxes with more than one label", None),
    Found("boundary_basin_entropy_stderr", "nat", "its standard error over those boxes", None),
    Found("unreliable", "1", "share of sampled labels that half the step or mirroring changes"),
    Field("labels_sampled", "1", "labels checked so"),
    Found("unreliable_half_step", "1", "share that half the step changes"),
    Found("unreliable_mirror", "1", "share that mirroring changes; absent without the symmetry"),
    Found("neighbours_agree", "1", "share of neighbouring cells with the same label"),
    Found("neighbours_chance", "1", "share that would agree by chance", "chance"),
    result.CHAOS_BOUND,
    Field("searched_starts", "1", "starts of the search for attractors"),
    Field("plane", "", "basins, only_chaos or conservative"),
    Field("layer_periods", "periods", "length of the finite-time layers"),
    result.STEPS,
    result.BOUND,
    result.TOL,
    *result.RUN[1:],
    Found("log2_criterion", result.FLAG, "1 where it is met: fractal", None, convert=bool),
    Found("uncertainty_exponent", "1", "exponent of the uncertain share", read=_uncertainty),
    Found("mean_settle", "periods", "mean time of capture; -1: none", convert=none_below_0),
    Found("longest_settle", "periods", "longest time of capture; -1: none", convert=none_below_0),
    *result.END,
    drawn_basins,
    result.SECTION,
    Field("layers", "", "labels or finite_time: layers that describe the plane", json=False),
    Found("boundary_boxes", "1", "boxes with more than one label", None, json=False),
    Found("labels_reliable", result.FLAG, "1 where single labels are reliable", json=False),
    Found("uncertainty_exponent_stderr", "1", "its standard error", None, json=False),
    Found("uncertainty_exponent_low", "1", "lower end of its 95 % interval", None, json=False),
    Found("uncertainty_exponent_high", "1", "upper end of its 95 % interval", None, json=False),
)


def basins(  # noqa: PLR0913 (numerical choices, all with defaults that serve)
    pendulum: Pendulum | Rig,
    grid: Grid | int | None = None,
    *,
    tol: float = 1e-6,
    max_periods: int | None = None,
    layer_periods: int | None = None,
    check: bool = True,
    draws: int | None = None,
    run: RunOptions | None = None,
    **options: Unpack[Keywords],
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
        Error of a state after 5 periods; 1e-13 to 1e-2. It is the 95th percentile, over a sample of
        the starts, of the difference that halving the step makes.
    max_periods : int, optional
        Periods after which a start is undecided. By default those in which damping shrinks a free
        motion by exp(-200), ``400 / (gamma T)``, from 4000 to a million (dry friction ``theta_r``
        adds to ``gamma``), or ``200 / (abs(lambda) T)`` where the exponent ``lambda`` of the
        slowest attractor makes that longer; where chaos coexists with other attractors ten times
        the longest settling time seen. A bound that is given is one for the search for attractors
        too, from 1000 periods on.
    layer_periods : int, optional
        Periods of the finite-time layers; by default those in which an exponent stretches one cell
        to the size of the plane.
    check : bool
        Whether to check labels of a sample with half the step and mirrored, and to measure the
        share of starts whose label changes nearby.
    draws : int, optional
        Number of models drawn from the ``[covariance]`` of the model: the uncertainty of the
        result. Each is mapped too, for the probability of each outcome in each cell.
    run : RunOptions, optional
        Threads, seed, progress, the store of the tiles and who computes them
        (:class:`pendmap.RunOptions`); tiles are of about 2^20 starts.
    options
        Options of the run by name: ``threads=2, store="map.zarr"``.

    Returns
    -------
    xarray.Dataset
        ``label``, ``settle_periods`` and ``net_turns`` over (velocity, theta), the table of
        attractors over ``attractor``, their stroboscopic points over ``point``; without dimensions
        shares and the error reached, as coordinates the parameters; ``theta_bounds`` and
        ``velocity_bounds``. A selection of cells keeps shares, attributes and summary of the whole
        map. ``fraction`` is the basin stability of an attractor in this window (Menck et al. 2013,
        Nature Physics 9, 89), ``stderr`` its standard error as if the starts were drawn at random,
        more than that of a grid. ``basin_entropy``, ``boundary_basin_entropy`` and
        ``uncertainty_exponent`` measure how the basins are interwoven
        (:func:`pendmap.basin_entropy`, :func:`pendmap.uncertainty_exponent`); the exponent's
        counts are ``uncertain`` of ``uncertainty_tried`` starts over ``distance``. With ``draws``
        also ``probability``, ``certainty`` and ``label_entropy`` over the draws.

    Notes
    -----
    The same request gives the same bits on any number of threads and on all processors with AVX2 or
    AVX-512. Other instruction sets (the attribute ``simd``, ``PENDMAP_SIMD``) may round otherwise:
    where basins are smooth no label differs, where they are fractal up to 33 % do (``p = 1.7``).

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
    run = RunOptions.of(run, options)
    numerics = Numerics(run, tol, max_periods)
    choices = choices_of(numerics, layer_periods, check=check)
    if draws is not None:
        several = drawn(pendulum, draws, run)
        same = partial(
            basins, grid=grid, tol=tol, max_periods=max_periods, layer_periods=layer_periods
        )
        first = same(pendulum, check=check, run=several.first)
        return basins_over(first, several, partial(same, check=False))
    cells, threads = Starts(grid.bare(units)), run.tiles(1)[0]
    job = BasinTiles(bare, cells, choices, units.given(1.0, RATE), threads)

    def compute(work: Work) -> xr.Dataset:
        dataset, raw = xr.Dataset(coords=grid.coordinates(units)), job.run(work, check=check)
        return _complete(dataset, job, raw, pendulum, numerics)

    more = {"grid": grid, "layer_periods": layer_periods, "check": check}
    return run.complete("basins", pendulum, numerics.request | more, job, compute)


def basins_of(  # noqa: PLR0913 (as for basins)
    pendulum: Pendulum | Rig,
    theta: ArrayLike,
    velocity: ArrayLike,
    *,
    tol: float = 1e-6,
    max_periods: int | None = None,
    layer_periods: int | None = None,
    check: bool = True,
    run: RunOptions | None = None,
    **options: Unpack[Keywords],
) -> xr.Dataset:
    """Find the attractor on which each start of a list ends.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; as for :func:`basins`.
    theta, velocity : array_like, shape (N,)
        Angles in rad and velocities at ``tau = 0``.
    tol, max_periods, layer_periods, check, run
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
    run = RunOptions.of(run, options).in_memory("a list of starts")
    numerics = Numerics(run, tol, max_periods)
    choices = choices_of(numerics, layer_periods, check=check)
    angles, speeds = starts(theta, velocity)
    states = Starts(None, angles, units.bare(speeds, VELOCITY))
    job = BasinTiles(bare, states, choices, units.given(1.0, RATE), run.tiles(1)[0])
    work = Work(job, progress=run.progress)
    return ends_of_list(job, work, speeds, pendulum, numerics, check=check)


def ends_of_list(  # noqa: PLR0913 (the parts of a map)
    job: BasinTiles,
    work: Work,
    speeds: Floats,
    model: Pendulum | Rig,
    numerics: Numerics,
    *,
    check: bool,
) -> xr.Dataset:
    """Return the attractors that the starts of a list reach; ``speeds`` in the model's units."""
    raw, of_velocity = job.run(work, check=check), model.units.of_velocity
    dataset = xr.Dataset(
        {
            "start_theta": variable("start", job.starts.theta, "rad", "initial angle"),
            "start_velocity": variable("start", speeds, of_velocity, "initial velocity"),
        }
    )
    return _complete(dataset, job, raw, model, numerics)


def choices_of(numerics: Numerics, layer_periods: int | None, *, check: bool) -> _core._Choices:
    """Return the numerical choices of a map as passed to the core."""
    layers = optional_whole("layer_periods", layer_periods, 1, MOST_PERIODS)
    return {**numerics.core, "layer_periods": layers, "check": check_flag("check", check)}


def _complete(
    dataset: xr.Dataset,
    job: BasinTiles,
    raw: SimpleNamespace,
    model: Pendulum | Rig,
    numerics: Numerics,
) -> xr.Dataset:
    """Add the cells, the table of attractors, all facts and the summary to the starts."""
    count, attractors = math.prod(job.starts.shape), raw.attractors
    fraction = np.array([a.fraction for a in attractors], dtype=float)
    dataset = dataset.assign(
        {
            **_cells(raw, job.starts.dims, model.units),
            **orbit_table.table(attractors, model.units, "attractor"),
            **result.shares(("attractor",), fraction, count),
        }
    )
    values = {
        **numerics.provenance(),
        **_boundary(dataset, raw.texture),
        "layers": "labels" if raw.plan.plane == "basins" else "finite_time",
        "cells": count,
        "labels_reliable": int(raw.checked is None or raw.checked.unreliable <= RELIABLE),
    }
    SCHEMA.complete(dataset, model, values, raw.sources)
    summarised(dataset, summary_of(dataset, job.pendulum), model, "this map is")
    return dataset


def _cells(raw: SimpleNamespace, dims: tuple[str, ...], units: Units) -> dict[str, Any]:
    """Return the variables with one value a start, and the counts near a boundary, if any."""
    cells, when = raw.cells, "until settled"
    if raw.plan.plane != "basins" or raw.longest_settle < 0:
        when = f"after {counted(raw.plan.layer_periods or raw.plan.bound, 'period')}"
    settled = "periods until the trap of an attractor captures the trajectory"
    none, rounded = "-1 where none did", "the angle's displacement over 2 pi, rounded"
    variables = {
        "label": result.labels(dims, cells["label"], [a.name for a in raw.attractors]),
        "settle_periods": variable(dims, cells["settle_periods"], "1", settled, none, missing=-1),
        "net_turns": variable(dims, cells["net_turns"], "1", f"net turns {when}", rounded),
    }
    if "finite_time_exponent" in cells:
        values, name = cells["finite_time_exponent"], f"finite-time Lyapunov exponent {when}"
        variables["finite_time_exponent"] = variable(dims, values, units.of_rate, name)
    if raw.near is not None:
        other = "starts with another label at this distance on one side or the other"
        tried = "starts with known ends, drawn anew for each distance; by strata: equivalent number"
        counts, of = raw.near.uncertain.astype(np.int64), raw.near.tried.astype(np.int64)
        variables |= {
            "uncertainty_eps": variable("distance", raw.near.eps, "1", "part of the window's side"),
            "uncertain": variable("distance", counts, "1", other),
            "uncertainty_tried": variable("distance", of, "1", tried),
        }
    return variables


def _boundary(dataset: xr.Dataset, texture: _core.Texture) -> dict[str, float]:
    """Return the measures of the boundary as facts; none without a boundary."""
    measures: dict[str, float] = {}
    if texture.boundary_boxes:
        entropy, stderr = texture.boundary_basin_entropy, texture.boundary_stderr
        measures |= {"boundary_basin_entropy": entropy, "boundary_boxes": texture.boundary_boxes}
        measures["log2_criterion"] = int(passes_log2(entropy, stderr))
        if math.isfinite(stderr):
            measures["boundary_basin_entropy_stderr"] = stderr
    law = fitted_map(dataset) if "uncertainty_eps" in dataset else None
    if law is not None:
        name = "uncertainty_exponent"
        measures |= {name: law.value, f"{name}_stderr": law.stderr}
        measures[f"{name}_low"], measures[f"{name}_high"] = law.ci95
    return measures
