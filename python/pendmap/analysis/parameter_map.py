"""Maps of the attractors that exist over two parameters."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import xarray as xr

from pendmap.analysis import along, cell_search, result, varied
from pendmap.analysis.draws import drawn, drawn_field, outcome_lines, outcomes
from pendmap.analysis.numerics import Numerics
from pendmap.analysis.orbit_table import attractors_of
from pendmap.analysis.result import Field, Schema, rows, summarised
from pendmap.analysis.run import RunOptions
from pendmap.analysis.summary import box_said
from pendmap.analysis.survey_tiles import SurveyTiles
from pendmap.analysis.tongues import tongues
from pendmap.errors import InputError, check_flag, core_errors
from pendmap.files import facts
from pendmap.files.variables import flag, variable
from pendmap.formatting import counted
from pendmap.model import without_dimensions
from pendmap.units import RATE

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from numpy.typing import ArrayLike, NDArray

    from pendmap import _core
    from pendmap.analysis.along import Varied
    from pendmap.analysis.draws import Analysis, Draws
    from pendmap.analysis.grid import Grid
    from pendmap.analysis.run import Keywords
    from pendmap.engine import Work
    from pendmap.model import Pendulum, Rig
    from pendmap.units import Units


_LISTED = 10  # Largest number of regimes in a summary
_PLACES = 3  # Largest number of groups of cells with undecided starts in a summary
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
    points of its neighbours' attractors: within blocks of 16 by 16 cells, grids are refined from
    every eighth cell to all, each cell starting also from the attractors of its neighbours on the
    coarser grid; then, pass by pass over the whole plane, from the attractors that cells at
    distances of eight, four, two and one have and it lacks, until none gains any. In this way
    coexisting branches are followed, and the result does not depend on the order of the work.

    Trajectories run until a stable orbit, found by Newton's method, has captured them. Those not
    captured are followed four times as long again, in four windows. Windows of equal senses of
    rotation whose regions meet form a group; a set of groups that no trajectory leaves, with an
    exponent that is positive by four standard errors, is chaos of its kind, unless it contains a
    stable orbit of period 1 to 4 (Newton's method from the least gaps of 64 by 64 starts) that
    captures it. A run continues while its last group has no known successor, and a set of fewer
    than 16 runs gets 16 more from its points. If the cell has another attractor, which could end
    chaos, none of 32 runs may end within 2500 periods. All other starts are undecided.

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
        Over (row, column): ``regime`` (index into ``regime_has``, over ``kind``
        too, and ``regime_share``),
        ``attractors`` (how many coexist, mirror images counted), ``period`` and ``winding`` of the
        kind that most starts end on (0 for chaos), ``exponent`` (the largest of all attractors),
        ``undecided`` and ``failed`` (shares of the starts), ``chaos_periods`` (periods within which
        nothing captured the chaos of a cell, 0 without), ``share`` over ``kind`` too. All
        attractors over ``entry``: ``entry_cell``, ``entry_kind``, ``entry_n``, ``entry_w``,
        ``entry_theta``, ``entry_velocity``, ``entry_exponent``, ``entry_exponent_stderr``,
        ``entry_share``. An attractor that only a neighbour led to has the share 0.

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
    bare, units = without_dimensions(pendulum)
    columns, rows = varied.varied(pendulum, ranges, 2)
    run = RunOptions.of(run, options)
    numerics = Numerics(run, tol, max_periods)
    search = cell_search.CellSearch(starts, box, numerics)
    curves = check_flag("curves", curves)
    if draws is not None:
        several = drawn(pendulum, draws, run)
        same = partial(
            parameter_map,
            ranges=ranges,
            starts=starts,
            box=search.within(units),
            tol=tol,
            max_periods=max_periods,
        )
        return regimes_over(same(pendulum, curves=curves, run=several.first), several, same)
    over: dict[str, Any] = {}
    if curves:
        over = _curves(pendulum, columns, rows, run.part(0, 2))
        run = run.part(1, 2)
    axes, initial = (columns.kernel, rows.kernel), search.initial(units)
    job = SurveyTiles(bare, axes, initial, (numerics.tol, numerics.max_periods))

    def compute(work: Work) -> xr.Dataset:
        with core_errors():
            survey, blocks = job.run(work, run)
            raw = survey.result(blocks)
        dataset = _dataset(raw, (columns, rows), units).assign(over)
        values = {
            **search.attributes(raw, units),
            **along.kept(pendulum, (columns, rows)),
            "columns": columns.name,
            "rows": rows.name,
            "cells": columns.values.size * rows.values.size,
        }
        replaced = [*columns.replaced, *rows.replaced]
        SCHEMA.complete(dataset, pendulum, values, raw, replaced)
        dataset.attrs["title"] = varied.title(pendulum, columns, rows)
        lines = [*_summary(dataset), *varied.remarks(pendulum, columns, rows)]
        summarised(dataset, lines, pendulum, "attractors are")
        return dataset

    request = {
        "ranges": varied.requested([columns, rows], ranges),
        **search.request,
        "curves": curves,
    }
    return run.complete("parameter_map", pendulum, request, job, compute)


def _dataset(raw: _core.ParameterMap, axes: tuple[Varied, Varied], units: Units) -> xr.Dataset:
    columns, rows = axes
    shape = (rows.values.size, columns.values.size)
    dims = (rows.name, columns.name)
    cells = shape[0] * shape[1]
    cell, n, w = raw.cell, raw.n, raw.w
    kinds, which = cell_search.names(raw), raw.kind
    regimes, regime, frequency = cell_search.regimes(raw, cells)
    sets = [[kinds[k] for k in one] or [cell_search.UNDECIDED] for one in regimes]
    share = np.zeros((len(kinds), cells))
    np.add.at(share, (which, cell), raw.share)
    exponent = np.full(cells, np.nan)
    np.fmax.at(exponent, cell, raw.exponent)
    period, winding = (np.zeros(cells, dtype=np.int32) for _ in range(2))
    # The kind on which most starts end, the first of equal ones.
    leading = share[which, cell]
    for k in np.lexsort((-np.arange(cell.size), leading)):
        period[cell[k]], winding[cell[k]] = n[k], abs(w[k]) if n[k] else 0
    coexist = np.bincount(cell, minlength=cells).astype(np.int16)
    on_kind = "share of the starts on a kind of attractor"

    def over(values: NDArray[Any], *texts: str, **flags: Any) -> tuple[Any, ...]:  # noqa: ANN401
        return variable(dims, values.reshape(shape), *texts, **flags)

    data: dict[str, Any] = {
        "regime": over(regime, "", "set of attractors", flags=dict(enumerate(map("+".join, sets)))),
        "regime_share": variable("set", frequency, "1", "share of the cells"),
        "regime_has": having("set", sets, kinds),
        "attractors": over(coexist, "1", "attractors that coexist"),
        "period": over(period, "periods", "period of the kind that most starts end on"),
        "winding": over(winding, "turns", "net turns in that period"),
        "exponent": over(units.given(exponent, RATE), units.of_rate, "largest Lyapunov exponent"),
        "share": variable(("kind", *dims), share.reshape((len(kinds), *shape)), "1", on_kind),
        **cell_search.shares(raw, dims, shape),
        **cell_search.entries(raw, units),
    }
    coordinates = {
        **columns.coordinates,
        **rows.coordinates,
        "kind": variable("kind", np.array(kinds, dtype=str), long_name="kind of attractor"),
        "set": variable("set", np.arange(len(sets)), "1", "number of the regime"),
    }
    return xr.Dataset(data, coords=coordinates)


def _curves(
    model: Pendulum | Rig, columns: Varied, rows: Varied, run: RunOptions
) -> dict[str, Any]:
    """Return the critical curves between the ends of the axes."""
    axes = (columns, rows)
    by_name = {axis.name.lower(): axis for axis in axes}
    if set(by_name) != {"p", "omega"}:
        given = " and ".join(axis.name for axis in axes)
        raise InputError(f"curves must be over p and omega, got {given}")
    omega, p = by_name["omega"], by_name["p"]
    if omega.values.size == 1 or p.bare[-1] <= 0:
        raise InputError("curves must have ranges of omega and of p above 0")
    # Cells extend half a spacing beyond their centres: curves go to the edges of the figure.
    half = np.diff(omega.bare)[0] / 2
    low, high = omega.bare[0] - half, omega.bare[-1] + half
    p_max = float(p.bare[-1] + (np.diff(p.bare)[0] / 2 if p.bare.size > 1 else 0.0))
    frequency = np.linspace(max(low, omega.bare[0] / 2), high, _FREQUENCIES)
    curves = tongues(model, frequency, p_max, inverted=False, refine=True, run=run)
    scale, sought = omega.values[-1] / omega.bare[-1], curves["asked"]
    return {
        "curve_omega": ("curve_frequency", scale * curves["omega"].values, omega.attributes),
        "curve_fold": ("curve_frequency", curves["fold"].values, p.attributes),
        "curve_fold_sought": ("curve_frequency", sought.values, sought.attrs),
        "curve_index": ("curve_point", curves["index"].values, curves["index"].attrs),
        "curve_p": ("curve_point", curves["p"].values, p.attributes),
        "curve_multiplier": (
            "curve_point",
            curves["multiplier"].values,
            curves["multiplier"].attrs,
        ),
    }


def _place_text(place: dict[str, Any]) -> str:
    """Return the ranges of a group of cells, and its size, as text."""
    spans = [
        f"{name} = {low:.4g}" + (f" to {high:.4g}" if high > low else "")
        for name, (low, high) in place["ranges"].items()
    ]
    return f"{', '.join(spans)} ({counted(place['cells'], 'cell')})"


def _summary(dataset: xr.Dataset) -> list[str]:
    a = facts(dataset)
    count, kinds = dataset.sizes["set"], sets(dataset)
    spans = [
        f"{name} = {dataset[name].values[0]:g} to {dataset[name].values[-1]:g}"
        for name in (a["columns"], a["rows"])
    ]
    counts = f"{counted(a['cells'], 'cell')}, {counted(count, 'regime')}."
    lines = [f"{', '.join(spans)}: {counts}"]
    shares = dataset["regime_share"].values[:_LISTED]
    lines += [f"{100 * share:.3g} %: {', '.join(kinds[k])}." for k, share in enumerate(shares)]
    if count > _LISTED:
        rest = float(dataset["regime_share"][_LISTED:].sum())
        lines.append(f"{100 * rest:.3g} %: {count - _LISTED} more regimes, in the result.")
    lines.append(cell_search.missed(a, a["cells"], "cell"))
    lines += [*cell_search.chaos(a), *cell_search.undecided(a)]
    places = cell_search.undecided_cells(dataset)
    if places:
        listed = "; ".join(_place_text(place) for place in places[:_PLACES])
        more = f"; {len(places) - _PLACES} smaller groups" if len(places) > _PLACES else ""
        lines.append(f"Cells with undecided starts: {listed}{more}.")
    lines.append(
        f"{counted(a['starts'], 'start')} a cell, {box_said(a)}; "
        f"{counted(a['searched_again'], 'cell')} searched again for attractors of a neighbour; "
        f"error after 5 periods {a['reached_error']:.2g}; "
        f"{a['seconds']:.1f} s on {counted(a['threads'], 'thread')}."
    )
    return lines


def regimes_over(dataset: xr.Dataset, draws: Draws, analysis: Analysis) -> xr.Dataset:
    """Return a map of M x N cells with the regimes of D draws of the other parameters.

    Adds ``outcome_has`` (as ``regime_has``), the variables of ``draws.outcomes`` over ``outcome``,
    all regimes, and over the cells, and ``drawn`` (D, parameter).
    """
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
