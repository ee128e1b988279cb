"""Sweeps: basins of attraction along one or two parameters, their attractors matched."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, Unpack

from pendmap import _core
from pendmap.analysis import result, varied
from pendmap.analysis import sweep_table as table
from pendmap.analysis.basins import RELIABLE, choices_of
from pendmap.analysis.grid import Grid
from pendmap.analysis.result import Field, Found, Schema
from pendmap.analysis.run import Numerics, RunOptions
from pendmap.analysis.summary import bound_said, cost, undecided
from pendmap.analysis.sweep_tiles import PLANES, SweepTiles, branches
from pendmap.files import facts
from pendmap.formatting import counted, percent, span
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
_LISTED: Final = 8  # Attractors that the summary names

SCHEMA = Schema(
    "basin_sweep",
    result.UNITS,
    Field("analysis", "", "analysis of each model"),
    Field("varied", "", "names of the parameters", convert=lambda names: names.split()),
    Field("models", "1", "models: values of the parameters"),
    Field("blocks", "1", "blocks of neighbouring models; the first of each was searched alone"),
    Field("cells", "1", "starts of each map"),
    Field("attractors", "", "attractors, and where they exist", read=table.attractors),
    Field("maps", "", "maps, each with its attractors", read=table.maps_of),
    Found("undecided", "1", "share of all starts not captured", variable="undecided_share"),
    Found("failed", "1", "share of all starts that failed", variable="failed_share"),
    *varied.DRIVE,
    *result.TIMED,
    Found("reached_error", "1", "largest error after 5 periods that was reached", None),
    *result.END,
    result.SECTION,
    result.TOL.hidden,
    Field("layer_periods", "periods", "of planes without basins; 0: by default", json=False),
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
    first model of a block is searched as by :func:`pendmap.basins`, each further one from its
    neighbour's attractors too. Only chaos is confirmed by fewer runs than in a map alone (16
    instead of 256; 64 starts where it attracted everything).

    Then attractors are matched between neighbours along both parameters. Orbits are one where
    Newton's method leads from each to the other without a change of symmetry; those left are
    matched by least distance, if their turns and their symmetry are equal: chaos, and what an orbit
    becomes where its period doubles. So an attractor has one number in the whole sweep, in the
    order of first appearance along rising parameters. Mirror images stay two attractors.

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
        the parameters: ``plane``, ``attractors`` (how many), the measures of a map, and for the
        first map of a block ``unreliable``; ``uncertainty_exponent`` is that of the labels on the
        grid (:func:`pendmap.uncertainty_exponent`). ``label`` over the parameters, velocity and
        theta has the number of the attractor. ``twin`` over ``attractor`` is the number of the
        mirror image. All points of the attractors, of chaos at most 128, are over ``point``.

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
    pendulum = varied.having(pendulum, ranges)
    bare, units = without_dimensions(pendulum)
    count = 2 if isinstance(ranges, Mapping) and len(ranges) > 1 else 1
    axes = varied.varied(pendulum, ranges, count)
    grid = Grid.of(grid, DEFAULT_CELLS, units.given(1.0, VELOCITY))
    run = RunOptions.of(run, options)
    numerics = Numerics(run, tol, max_periods)
    choices = choices_of(numerics, layer_periods, check=check)
    job = SweepTiles(bare, tuple(axis.kernel for axis in axes), grid.bare(units), choices)
    blocks, models = math.prod(job.blocks), math.prod(job.shape)
    threads, at_once = run.tiles(blocks)
    job = dataclasses.replace(job, threads=threads, at_once=at_once)
    _core.reckon("starts", models * grid.cells, _BYTES)

    def compute(work: Work) -> xr.Dataset:
        maps = job.run(work)
        numbers = branches(job, maps)
        label = job.labels(work.store, numbers)
        dataset = table.sweep_dataset(maps, numbers, axes, grid, units, label)
        values = {
            **numerics.provenance(),
            "analysis": "basins",
            "varied": " ".join(axis.name for axis in axes),
            "models": models,
            "blocks": blocks,
            "cells": grid.cells,
            "layer_periods": layer_periods or 0,
            **{key: float(dataset[key].mean()) for key in ("undecided", "failed")},
            "reached_error": float(dataset["step_error"].max()),
        }
        varied.complete(
            *(SCHEMA, dataset, pendulum, axes, values), summary=_summary, what="basins are"
        )
        return dataset

    request = {"ranges": [axis.request for axis in axes], **numerics.request}
    request |= {"grid": grid, "layer_periods": layer_periods, "check": check}
    return run.complete("sweep", pendulum, request, job, compute)


def _summary(dataset: xr.Dataset) -> list[str]:
    """Return the findings, a sentence a line."""
    a, every = facts(dataset), table.attractors(dataset)
    spans = [span(dim, *dataset[dim].values[[0, -1]]) for dim in table.varied_names(dataset)]
    counts = f"{counted(a['models'], 'map')} of {counted(a['cells'], 'start')}"
    lines = [f"{', '.join(spans)}: {counts}, {counted(len(every), 'attractor')}."]
    for one in sorted(every, key=lambda one: -one["largest_fraction"])[:_LISTED]:
        ends = ", ".join(span(dim, *limits) for dim, limits in one["ranges"].items())
        share = percent(100 * one["largest_fraction"])
        bound = bound_said(one["largest_fraction"], a["cells"])
        lines.append(f"{one['name']}: {ends}, up to {share} of the starts{bound}.")
    if len(every) > _LISTED:
        lines.append(f"{len(every) - _LISTED} more attractors are in the result.")
    chaos = int((dataset["plane"].values == PLANES.index("only_chaos")).sum())
    if chaos:
        lines.append(f"Chaos attracts every start in {counted(chaos, 'map')}.")
    changed = dataset["unreliable"].max().item()
    if changed > RELIABLE:
        lines.append(
            "LABELS OF SINGLE CELLS ARE NOT RELIABLE IN SOME MAPS (half the step or mirroring "
            f"changes up to {percent(100 * changed)}): read the shares."
        )
    return [*lines, *undecided(a, ending="_share"), f"Largest {cost(a)}"]
