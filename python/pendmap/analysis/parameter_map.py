"""Maps of the attractors that exist over two parameters."""

from __future__ import annotations

import itertools
from collections import Counter
from functools import partial
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import xarray as xr

from pendmap.analysis import cell_search, result, varied
from pendmap.analysis.draws import drawn, drawn_field, outcome_lines, outcomes
from pendmap.analysis.orbit_table import attractors_of
from pendmap.analysis.result import Field, Schema, rows
from pendmap.analysis.run import Numerics, RunOptions
from pendmap.analysis.tongues import tongues
from pendmap.errors import InputError, check_flag
from pendmap.files import facts
from pendmap.files.variables import flag, variable
from pendmap.formatting import counted, span
from pendmap.units import RATE

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from numpy.typing import ArrayLike, NDArray

    from pendmap import _core
    from pendmap.analysis.draws import Analysis, Draws
    from pendmap.analysis.grid import Grid
    from pendmap.analysis.run import Keywords
    from pendmap.analysis.varied import Varied
    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats
    from pendmap.units import Units


_LISTED = 10  # Largest number of regimes in a summary
_FREQUENCIES = 201  # Number of frequencies of the critical curves over a map, besides turns


def _regimes(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the regimes with their shares of the cells for the JSON object."""
    both = zip(sets(dataset), dataset["regime_share"].values.tolist(), strict=True)
    return [{"kinds": kinds, "share": share} for kinds, share in both]


def sets(dataset: xr.Dataset, which: str = "regime_has", kind: str = "kind") -> list[list[str]]:
    """Return the kinds of attractor in each regime, rest first, chaos last."""
    names, every = dataset[kind].values, dataset[which].transpose(..., kind).values
    return [names[has.astype(bool)].tolist() or [cell_search.UNDECIDED] for has in every]


def having(dim: str, sets: Iterable[Collection[str]], kinds: Iterable[str]) -> tuple[Any, ...]:
    """Return which of the kinds each set contains, as a variable."""
    has = [[kind in one for kind in kinds] for one in sets]
    both = (dim, "kind" if dim == "set" else f"{dim}_kind")
    array = np.array(has, dtype=np.int8).reshape(len(has), -1)
    return flag(both, array, "whether the regime has the kind of attractor")


@drawn_field
def drawn_regimes(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the draws of a map over two parameters for the JSON object."""
    shares = rows(dataset, "share_mean", "share_low", "share_high")
    both = zip(sets(dataset, "outcome_has", "outcome_kind"), shares, strict=True)
    regimes = [{"kinds": k, "share": mean, "ci95": [low, high]} for k, (mean, low, high) in both]
    return {"regimes": regimes, "sure_cells": float(dataset["sure_cells"])}


SCHEMA = Schema(
    "parameter_map",
    result.UNITS,
    Field("columns", "", "parameter that varies along columns"),
    Field("rows", "", "parameter that varies along rows"),
    Field("regimes", "", "sets of attractors with their shares of the cells", read=_regimes),
    Field("cells", "1", "cells of the plane"),
    *cell_search.SEARCH,
    drawn_regimes,
    references="Xu, Wiercigroch & Cartmell (2005), Chaos, Solitons & Fractals 23, 1537",
)


def parameter_map(  # noqa: PLR0913 (physics first, numerical choices by name)
    pendulum: Pendulum | Rig,
    ranges: Mapping[str, ArrayLike],
    *,
    starts: int = 9,
    box: Grid | None = None,
    tol: float = 1e-6,
    max_periods: int | None = None,
    curves: bool = False,
    draws: int | None = None,
    run: RunOptions | None = None,
    **options: Unpack[Keywords],
) -> xr.Dataset:
    """Find the set of attractors in every cell of a plane of two parameters.

    Every cell is searched from a few initial conditions, different from its neighbours', and from
    points of its neighbours' attractors: within blocks of 16 by 16 cells from coarse grids to fine
    ones, then, pass by pass over the whole plane, from the attractors that cells at distances of
    eight, four, two and one have and it lacks, until none gains any. So coexisting branches are
    followed, and the result does not depend on the order of the work.

    Trajectories run until a stable orbit, found by Newton's method, has captured them. Those not
    captured are followed four times as long again, in four windows. A set of windows of one sense
    of rotation that no trajectory leaves, with an exponent that is positive by four standard
    errors, is chaos of its kind, unless a stable orbit of period 1 to 4 in it captures it. If the
    cell has another attractor, which could end chaos, none of 32 runs may end within 2500 periods.
    All other starts are undecided.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; parameters that vary replace its own.
    ranges : mapping of str to (float, float, int) or array_like
        Two parameters, columns, then rows, each with an array of monotonic values, evenly spaced or
        not, or a tuple of first value, last value (both included) and how many. Any of ``p``,
        ``omega``, ``gamma``, ``theta_r``, ``torque``, ``phase`` without dimensions, with a rig also
        ``Omega``, ``c_over_m``, ``Tr``, ``phi`` in SI, ``frequency_hz`` and ``stroke_mm``; or
        ``EFFECT.PARAMETER`` of an effect that the model has, or that has no other parameter. Where
        the frequency varies, a rig that gives its stroke keeps it, and ``p`` varies; else ``p`` is
        constant (``kept``). A mapping of arrays of one length, under any name, is a curve: the
        dimension is its first parameter, the others are coordinates along it.
    starts : int
        Initial conditions of each cell.
    box : Grid, optional
        Where they lie; by default that of :func:`pendmap.basins`.
    tol : float
        As for :func:`pendmap.basins`, on 25 cells spread over the plane; the length of steps scales
        with the period and the drive's pull.
    max_periods : int, optional
        Periods before the four windows of trajectories not captured; by default those in which
        damping shrinks a free motion by exp(-40), at least 64.
    curves : bool
        Whether to add the critical curves of rest (:func:`pendmap.tongues`), over ``p`` and
        ``omega`` (or ``Omega``): figures draw them over the map.
    draws : int, optional
        As for :func:`pendmap.basins`; adds the probability of each regime in each cell.
    run : RunOptions, optional
        As for :func:`pendmap.basins`; tiles are blocks of 16 x 16 cells.

    Returns
    -------
    xarray.Dataset
        Over (row, column): ``regime`` (index into ``regime_share``, and ``regime_has`` over
        ``kind`` too), ``attractors`` (how many coexist, mirror images counted), ``period`` and
        ``winding`` of the kind that most starts end on (0 for chaos), ``exponent`` (the largest of
        all attractors), ``undecided`` and ``failed`` (shares of the starts), ``chaos_periods``
        (periods within which nothing captured the chaos of a cell, 0 without), ``share`` over
        ``kind`` too. All attractors over ``entry``: ``entry_cell``, ``entry_kind``, ``entry_n``,
        ``entry_w``, ``entry_theta``, ``entry_velocity``, ``entry_exponent``,
        ``entry_exponent_stderr``, ``entry_share``. One that only a neighbour led to has share 0.

    Raises
    ------
    InputError
        If a parameter or value is not allowed, the model has an effect that no map can have, or no
        step reaches ``tol``.

    References
    ----------
    Xu, Wiercigroch & Cartmell (2005), Chaos, Solitons & Fractals 23, 1537.

    Examples
    --------
    >>> import pendmap
    >>> pendulum = pendmap.Pendulum(gamma=0.1)
    >>> ranges = {"p": (0.2, 1.8, 3), "omega": (1.8, 2.2, 2)}
    >>> sorted(pendmap.parameter_map(pendulum, ranges, starts=4).sizes)
    ['bound', 'entry', 'kind', 'omega', 'p', 'set']
    """
    pendulum = varied.having(pendulum, ranges)
    columns, rows = axes = varied.varied(pendulum, ranges, 2)
    run = RunOptions.of(run, options)
    units, curves = pendulum.units, check_flag("curves", curves)
    several = None if draws is None else drawn(pendulum, draws, run)
    over: dict[str, Any] = {}
    if curves and several is None:
        over, run = _curves(pendulum, columns, rows, run.part(0, 2)), run.part(1, 2)
    search = cell_search.CellSearch(pendulum, axes, starts, box, Numerics(run, tol, max_periods))
    if several is not None:
        same = partial(parameter_map, ranges=ranges, starts=starts, box=search.box)
        same = partial(same, tol=tol, max_periods=max_periods)
        return regimes_over(same(pendulum, curves=curves, run=several.first), several, same)

    def make(survey: _core.Survey, blocks: list[bytes]) -> cell_search.Made:
        raw = survey.result(blocks)
        cells = columns.values.size * rows.values.size
        names = {"columns": columns.name, "rows": rows.name, "cells": cells}
        return raw, _dataset(raw, columns, rows, units).assign(over), names

    return search.result(SCHEMA, make, _summary, {"curves": curves})


def regimes(
    raw: _core.ParameterMap, cells: int
) -> tuple[list[tuple[int, ...]], NDArray[np.int16], Floats]:
    """Return the sets of kinds, the most frequent first; the set of each cell; their shares."""
    bounds = np.searchsorted(raw.cell, np.arange(cells + 1))
    of_cell = [
        tuple(np.unique(raw.kind[low:high]).tolist()) for low, high in itertools.pairwise(bounds)
    ]
    count = Counter(of_cell)
    # Those without any attractor are the last of equally frequent ones.
    sets = sorted(count, key=lambda one: (-count[one], one or (len(raw.kinds),)))
    place = {one: k for k, one in enumerate(sets)}
    share = np.array([count[one] / cells for one in sets])
    return sets, np.array([place[one] for one in of_cell], dtype=np.int16), share


def _dataset(raw: _core.ParameterMap, columns: Varied, rows: Varied, units: Units) -> xr.Dataset:
    dims, shape = (rows.name, columns.name), (rows.values.size, columns.values.size)
    cells, cell, which = shape[0] * shape[1], raw.cell, raw.kind
    kinds = [one.name for one in raw.kinds]
    every, regime, frequency = regimes(raw, cells)
    sets = [[kinds[k] for k in one] or [cell_search.UNDECIDED] for one in every]
    share = np.zeros((len(kinds), cells))
    np.add.at(share, (which, cell), raw.share)
    exponent = np.full(cells, np.nan)
    np.fmax.at(exponent, cell, raw.exponent)
    # The kind on which most starts end, the first of equal ones.
    period, winding = (np.zeros(cells, dtype=np.int32) for _ in range(2))
    order = np.lexsort((-np.arange(cell.size), share[which, cell]))
    period[cell[order]] = raw.n[order]
    winding[cell[order]] = np.where(raw.n > 0, np.abs(raw.w), 0)[order]
    coexist = np.bincount(cell, minlength=cells).astype(np.int16)
    on_kind, largest = "share of the starts on a kind", units.given(exponent, RATE)
    names = dict(enumerate(map("+".join, sets)))

    def over(values: NDArray[Any], *texts: str, **flags: Any) -> tuple[Any, ...]:  # noqa: ANN401
        return variable(dims, values.reshape(shape), *texts, **flags)

    return xr.Dataset(
        {
            "regime": over(regime, "", "set of attractors", flags=names),
            "set": variable("set", np.arange(len(sets)), "1", "number of the regime"),
            "regime_share": variable("set", frequency, "1", "share of the cells"),
            "regime_has": having("set", sets, kinds),
            "attractors": over(coexist, "1", "attractors that coexist"),
            "period": over(period, "periods", "period of the kind that most starts end on"),
            "winding": over(winding, "turns", "net turns in that period"),
            "exponent": over(largest, units.of_rate, "largest Lyapunov exponent"),
            "share": variable(("kind", *dims), share.reshape((-1, *shape)), "1", on_kind),
            **cell_search.variables(raw, dims, shape, units),
        },
        coords={**columns.coordinates, **rows.coordinates},
    )


def _curves(
    model: Pendulum | Rig, columns: Varied, rows: Varied, run: RunOptions
) -> dict[str, Any]:
    """Return the critical curves between the ends of the axes."""
    by_name = {axis.name.lower(): axis for axis in (columns, rows)}
    if set(by_name) != {"p", "omega"}:
        raise InputError(f"curves must be over p and omega, got {columns.name} and {rows.name}")
    omega, p = by_name["omega"], by_name["p"]
    if omega.values.size == 1 or p.bare[-1] <= 0:
        raise InputError("curves must have ranges of omega and of p above 0")
    # Cells extend half a spacing beyond their centres: curves go to the edges of the figure.
    half = np.diff(omega.bare)[0] / 2
    low, high = omega.bare[0] - half, omega.bare[-1] + half
    p_max = float(p.bare[-1] + (np.diff(p.bare)[0] / 2 if p.bare.size > 1 else 0.0))
    frequency = np.linspace(max(low, omega.bare[0] / 2), high, _FREQUENCIES)
    curves = tongues(model, frequency, p_max, inverted=False, refine=True, run=run)
    scaled = omega.values[-1] / omega.bare[-1] * curves["omega"].values
    along, at = "curve_frequency", "curve_point"
    return {
        "curve_omega": (along, scaled, omega.attributes),
        "curve_fold": (along, curves["fold"].values, p.attributes),
        "curve_fold_sought": (along, curves["asked"].values, curves["asked"].attrs),
        "curve_index": (at, curves["index"].values, curves["index"].attrs),
        "curve_p": (at, curves["p"].values, p.attributes),
        "curve_multiplier": (at, curves["multiplier"].values, curves["multiplier"].attrs),
    }


def _summary(dataset: xr.Dataset) -> list[str]:
    a, kinds = facts(dataset), sets(dataset)
    ranges = [span(name, *dataset[name].values[[0, -1]]) for name in (a["columns"], a["rows"])]
    lines = [
        f"{', '.join(ranges)}: {counted(a['cells'], 'cell')}, {counted(len(kinds), 'regime')}."
    ]
    shares = dataset["regime_share"].values
    for share, one in zip(shares[:_LISTED], kinds, strict=False):
        lines.append(f"{100 * share:.3g} %: {', '.join(one)}.")
    if len(kinds) > _LISTED:
        rest = 100 * shares[_LISTED:].sum()
        lines.append(f"{rest:.3g} %: {len(kinds) - _LISTED} more regimes, in the result.")
    return lines


def regimes_over(dataset: xr.Dataset, draws: Draws, analysis: Analysis) -> xr.Dataset:
    """Return a map with the regimes of draws of the other parameters."""
    ranks: dict[str, tuple[int, ...]] = {}

    def cells() -> Iterator[tuple[NDArray[Any], dict[int, tuple[str, ...]]]]:
        for one in draws.results(analysis):
            ranks.update((kind.pair, kind.rank) for kind in attractors_of(one, "kind_"))
            yield one["regime"].values, dict(enumerate(map(tuple, sets(one))))

    regimes, over = outcomes(dataset["regime"].dims, cells())
    order = np.argsort(-over["share_mean"].values, kind="stable")
    over, regimes = over.isel(outcome=order), [regimes[k] for k in order]
    kinds = sorted(set().union(*regimes) - {cell_search.UNDECIDED}, key=ranks.__getitem__)
    names = variable("outcome_kind", np.array(kinds, dtype=str), long_name="kind of attractor")
    over = over.assign(outcome_has=having("outcome", regimes, kinds), outcome_kind=names)
    lines = outcome_lines(over, [", ".join(one) for one in regimes], "cells", _LISTED)
    return draws.complete(dataset.assign(over), lines)
