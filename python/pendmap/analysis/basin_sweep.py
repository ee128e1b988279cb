"""Sweeps: basins of attraction along one or two parameters, their attractors matched."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, Unpack

import numpy as np

from pendmap import _core
from pendmap.analysis import along, result, varied
from pendmap.analysis.basins import choices_of
from pendmap.analysis.grid import Grid
from pendmap.analysis.numerics import Numerics
from pendmap.analysis.result import Field, Found, Schema, summarised
from pendmap.analysis.run import RunOptions
from pendmap.analysis.sweeps import report
from pendmap.analysis.sweeps.branches import branches
from pendmap.analysis.sweeps.table import sweep_dataset
from pendmap.analysis.sweeps.tiles import SweepTiles
from pendmap.errors import InputError, short_repr
from pendmap.model import without_dimensions
from pendmap.units import VELOCITY

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike

    from pendmap.analysis.run import Keywords
    from pendmap.engine import Work
    from pendmap.model import Pendulum, Rig

DEFAULT_CELLS: Final = 100  # Default number of cells on each side of a map
_BYTES: Final = 8  # Memory of a start during the computation

SCHEMA = Schema(
    "basin_sweep",
    result.UNITS,
    Field("analysis", "", "analysis of each model"),
    Field("varied", "", "names of the parameters", convert=lambda names: names.split()),
    Field("models", "1", "models: values of the parameters"),
    Field("blocks", "1", "blocks of neighbouring models; the first of each was searched alone"),
    Field("cells", "1", "starts of each map"),
    Field(
        "attractors",
        "",
        "attractors with the ranges in which they exist",
        read=report.attractors,
    ),
    Field("maps", "", "maps, each with its attractors", read=report.maps),
    Found(
        "undecided",
        "1",
        "share of all starts that no attractor captured",
        None,
        variable="undecided_share",
    ),
    Found(
        "failed", "1", "share of all starts that failed or diverged", None, variable="failed_share"
    ),
    *along.DRIVE,
    *result.TIMED,
    Found("reached_error", "1", "largest error after 5 periods that was reached", None),
    *result.END,
    result.SECTION,
    result.TOL.hidden,
    Field(
        "layer_periods", "periods", "periods of planes without basins; 0: by default", json=False
    ),
    result.SEED.hidden,
    *result.VERSIONS,
    references="Datseris, Luiz Rossi & Wagemakers (2023), Chaos 33, 073151",
)


def sweep(  # noqa: PLR0913 (numerical choices, all with defaults that serve)
    pendulum: Pendulum | Rig,
    ranges: Mapping[str, ArrayLike],
    *,
    grid: Grid | int | None = None,
    tol: float = 1e-6,
    max_periods: int | None = None,
    layer_periods: int | None = None,
    check: bool = True,
    run: RunOptions | None = None,
    **options: Unpack[Keywords],
) -> xr.Dataset:
    """Map the basins of attraction along one or two parameters, and match the attractors.

    Models are mapped in fixed blocks of neighbours, 16 along one parameter and 8 x 8 over two. The
    first model of a block is searched as by :func:`pendmap.basins`. Each further one starts from
    its neighbour's attractors, followed by Newton's method; then the same sample of starts is
    searched for others, and all starts that end undecided begin further searches. Only chaos is
    confirmed by fewer runs than in a map alone (16 instead of 256; 64 starts where it attracted
    everything).

    Then attractors are matched between neighbours along both parameters. Orbits are one where
    Newton's method leads from each to the other, in halved steps where a whole one fails, without a
    change of symmetry; those left are matched by least distance, if their turns and their symmetry
    are equal: chaos, and what an orbit becomes where its period doubles. So an attractor has one
    number in the whole sweep, in the order of first appearance along rising parameters. Mirror
    images stay two attractors.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; parameters that vary replace its own.
    ranges : mapping of str to array_like or (float, float, int)
        One or two parameters with an array of rising or falling values, or a tuple of first value,
        last value (both included) and how many; names as for :func:`pendmap.parameter_map`. The
        result is the same for both directions, its coordinates rise.
    grid : Grid or int, optional
        As for :func:`pendmap.basins`, a whole number too; by default 100 cells on each side.
    tol, max_periods, layer_periods
        As for :func:`pendmap.basins`.
    check : bool
        Whether to check a sample of the labels of the first map of each block with half the step
        and mirrored.
    run : RunOptions, optional
        As for :func:`pendmap.basins`; tiles are blocks, computed at once on the threads.

    Returns
    -------
    xarray.Dataset
        Over the parameters and ``attractor``: ``fraction`` of the starts (0 where it does not
        exist) with ``stderr``, ``exists``, ``kind``, ``n``, ``w``, ``exponent`` with
        ``exponent_stderr``, and a stroboscopic point, ``theta_point`` and ``velocity_point``. Over
        the parameters: ``plane``, ``attractors`` (how many), ``basin_entropy``,
        ``boundary_basin_entropy`` with its standard error, ``uncertainty_exponent`` of the labels
        on the grid (:func:`pendmap.uncertainty_exponent`) with its standard error, ``undecided``,
        ``failed``, ``steps_per_period``, ``max_periods``, and for the first map of a block
        ``unreliable``. ``label`` over the parameters, velocity and theta has the number of the
        attractor. ``twin`` over ``attractor`` is the number of the mirror image. All points of the
        attractors, of chaos at most 128, are over ``point``.

    Raises
    ------
    InputError
        If a parameter or value is not allowed, the model has an effect that no map can have, or no
        step reaches ``tol``.

    References
    ----------
    G. Datseris, K. Luiz Rossi & A. Wagemakers (2023), Chaos 33, 073151 (matching along parameters).

    Examples
    --------
    >>> import pendmap
    >>> pendulum = pendmap.Pendulum(gamma=0.1, omega=2.0)
    >>> result = pendmap.sweep(pendulum, {"p": (0.4, 0.7, 4)}, grid=20)
    >>> [str(name) for name in result.attractor.values]
    ['oscillation 2:0', 'rotation 1:-1', 'rotation 1:+1']
    >>> result.exists.sel(attractor="rotation 1:+1").values
    array([0, 1, 1, 1], dtype=int8)
    """
    if not isinstance(ranges, Mapping) or len(ranges) not in {1, 2}:
        given = ", ".join(map(str, ranges)) if isinstance(ranges, Mapping) else short_repr(ranges)
        raise InputError(
            "ranges must have one or two parameters, like {'p': (0.5, 2.0, 25)}, or on the command "
            f"line --p 0.5:2:25; got {given or 'nothing'}"
        )
    pendulum = varied.having(pendulum, ranges)
    bare, units = without_dimensions(pendulum)
    axes = varied.varied(pendulum, ranges, len(ranges))
    grid = Grid.of(grid, DEFAULT_CELLS, units.given(1.0, VELOCITY))
    run = RunOptions.of(run, options)
    numerics = Numerics(run, tol, max_periods)
    choices = choices_of(numerics, layer_periods, check=check)
    job = SweepTiles(bare, tuple(axis.kernel for axis in axes), grid.bare(units), choices)
    job = job.on(*run.tiles(job.blocks))
    models = math.prod(job.shape)
    _core.reckon("starts", models * grid.cells, _BYTES)

    def compute(work: Work) -> xr.Dataset:
        maps = job.run(work)
        numbers = branches(job, maps)
        label = np.zeros((*job.shape, grid.velocity.count, grid.theta.count), dtype=np.int16)
        for place, one in job.labels(work.store):
            moved = np.array([-1, 0, *(k + 1 for k in numbers[place])], dtype=np.int16)
            label[place] = moved[one + 1].reshape(label.shape[-2:])
        dataset = sweep_dataset(maps, numbers, axes, grid, units, label)
        values = {
            **numerics.provenance(),
            **along.kept(pendulum, axes),
            "analysis": "basins",
            "varied": " ".join(axis.name for axis in axes),
            "models": models,
            "blocks": job.blocks,
            "cells": grid.cells,
            "layer_periods": layer_periods or 0,
            "undecided": float(dataset["undecided"].mean()),
            "failed": float(dataset["failed"].mean()),
            "reached_error": float(dataset["step_error"].max()),
        }
        replaced = [name for axis in axes for name in axis.replaced]
        SCHEMA.complete(dataset, pendulum, values, None, replaced)
        dataset.attrs["title"] = varied.title(pendulum, *axes)
        lines = [*report.summary(dataset), *varied.remarks(pendulum, *axes)]
        summarised(dataset, lines, pendulum, "basins are")
        return dataset

    request = {
        **numerics.request,
        "ranges": varied.requested(axes, ranges),
        "grid": grid,
        "layer_periods": layer_periods,
        "check": check,
    }
    return run.complete("sweep", pendulum, request, job, compute)
