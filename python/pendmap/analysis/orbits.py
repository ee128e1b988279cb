"""All closed orbits of one period and winding, stable and unstable."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import result
from pendmap.analysis.draws import drawn, drawn_field, interval
from pendmap.analysis.grid import Axis, Grid
from pendmap.analysis.numerics import Numerics
from pendmap.analysis.orbit_table import attractors_of, named_alike, objects, points_of, table
from pendmap.analysis.result import Field, Schema, records, summarised
from pendmap.analysis.run import RunOptions
from pendmap.errors import MOST_CELLS, check_type, check_whole, core_errors
from pendmap.files import facts
from pendmap.files.variables import flag, variable
from pendmap.formatting import counted, with_error
from pendmap.model import without_dimensions
from pendmap.units import VELOCITY, Units

if TYPE_CHECKING:
    from pendmap.analysis.draws import Analysis, Draws
    from pendmap.analysis.run import Keywords
    from pendmap.model import Pendulum, Rig


LONGEST = 64  # Longest period of an orbit, in forcing periods
_CELLS, _FINER = 200, 4  # Cells a side of the box per period, largest number of periods counted
_SAMPLES = 128  # Samples of an orbit's path in a forcing period
_TOLERANCE = 1e-9  # Error of a path after a period, sufficient for figures
_LISTED = 12  # Largest number of orbits in a summary


def _orbits(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the orbits for the JSON object."""
    entries = objects(dataset, "orbit", "stable", "residual")
    return [entry | {"stable": bool(entry["stable"])} for entry in entries]


@drawn_field
def drawn_orbits(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the draws of closed orbits for the JSON object."""
    spreads = {key: key for key in ("theta_spread", "velocity_spread", "multipliers_spread")}
    orbits = records(dataset, name="orbit", exists="exists", stable="stable_share", **spreads)
    return {"orbits": orbits, "others": facts(dataset)["drawn_others"]}


SCHEMA = Schema(
    "orbits",
    result.UNITS,
    Field("orbits", "", "closed orbits, stable and unstable", read=_orbits),
    Field("n", "periods", "smallest period"),
    Field("w", "turns", "net turns over it"),
    Field("cells", "1", "cells of the box"),
    Field("begun", "1", "places from which Newton's method began"),
    *result.TIMED,
    *result.END,
    drawn_orbits,
    result.SECTION,
    *result.BOX,
    *result.VERSIONS,
)


def window(pendulum: Pendulum | Rig, n: int, w: int) -> Grid:
    """Return the default box: velocities to ``v = |w| omega / n + 2 sqrt(1 + |p|)``.

    The terms are the mean speed of the rotation and the speed after a fall from the top under the
    drive's largest acceleration.
    """
    bare, units = without_dimensions(pendulum)
    n, w = check_whole("n", n, 1, LONGEST), check_whole("w", w, -MOST_CELLS, MOST_CELLS)
    fastest = abs(w) / n * 2 * math.pi / bare.period + 2 * math.sqrt(1 + abs(bare.p))
    cells = _CELLS * min(n, _FINER)
    reach = units.given(fastest, VELOCITY)
    return Grid(Axis(-math.pi, math.pi, cells), Axis(-reach, reach, cells))


def orbit(  # noqa: PLR0913 (physics first, numerical choices by name)
    pendulum: Pendulum | Rig,
    n: int = 1,
    w: int = 0,
    grid: Grid | None = None,
    *,
    draws: int | None = None,
    run: RunOptions | None = None,
    **options: Unpack[Keywords],
) -> xr.Dataset:
    """Find all periodic orbits of smallest period ``n`` and ``w`` net turns, stable and unstable.

    An orbit is a fixed point of ``P^n(x) - (2 pi w, 0)``, ``P`` the stroboscopic map. The
    displacement is compared with its linear part on every cell of the grid; cells in which it
    cannot vanish are discarded, the others quartered, four times. Newton's method begins in those
    that remain, first by differences, then on the precise map, and beside orbits near their birth
    with the known ones divided out. Orbits that close to 1e-12, or to rounding where the
    multipliers are large, are kept, with the Floquet multipliers, the eigenvalues of the derivative
    of ``P^n``, also where friction stops the pendulum on its way. An orbit whose neighbours in the
    plane lie nearer than a cell may be missed; a finer grid finds it. Rest states that friction
    holds form a continuum and are not listed.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model. With a rig velocities are in rad/s, times in s and exponents in 1/s.
    n : int
        Smallest period, in forcing periods; 1 to 64. Without drive 1: rests (``w = 0``) and the
        rotation that a torque keeps up (``w = 1`` or ``-1``), closed on the angle section, with
        its own ``period`` and without the trivial multiplier.
    w : int
        Net turns over that period, forward positive.
    grid : Grid, optional
        The box in which an orbit must have a point, and its cells; by default :func:`window`.
    draws : int, optional
        As for :func:`pendmap.basins`; adds how far orbits move, and in how many draws they exist
        and are stable.
    run : RunOptions, optional
        As for :func:`pendmap.basins`.

    Returns
    -------
    xarray.Dataset
        The table of orbits over ``orbit``: ``kind``, ``n``, ``w``, ``theta_point`` and
        ``velocity_point`` (the point with the lowest angle), ``multipliers``, ``stable``,
        ``exponent``, ``period``, ``twin``, ``residual``; all points over ``point``; the motion,
        piece by piece of a period, over ``sample``.

    Raises
    ------
    InputError
        If a value is outside its range, or the model has an effect that no map can have.

    Examples
    --------
    >>> import pendmap
    >>> result = pendmap.orbit(pendmap.Pendulum(gamma=0.1, p=0.6, omega=2.0), n=2)
    >>> result.theta_point.values.round(3), result.stable.values
    (array([-1.318]), array([1], dtype=int8))
    """
    bare, units = without_dimensions(pendulum)
    n = check_whole("n", n, 1, LONGEST)
    w = check_whole("w", w, -MOST_CELLS, MOST_CELLS)
    run = RunOptions.of(run, options).in_memory("orbit")
    numerics = Numerics(run)
    grid = window(pendulum, n, w) if grid is None else grid
    check_type("grid", grid, Grid, "Grid.square(200)")
    if draws is not None:
        several = drawn(pendulum, draws, run)
        same = partial(orbit, n=n, w=w, grid=grid)
        return orbits_over(same(pendulum, run=several.first), several, same)
    with core_errors():
        box = grid.bare(units)
        raw = _core.orbits(bare, (n, w), *box, run.workers, run.progress)
        paths = _paths(bare, raw.orbits, units)
    orbits = raw.orbits
    residual = np.array([o.residual for o in orbits], dtype=float)
    dataset = xr.Dataset(
        {
            **table(orbits, units, "orbit"),
            "stable": flag("orbit", [o.stable for o in orbits], "whether it is stable"),
            "residual": variable("orbit", residual, "1", "distance that remains after a period"),
            **paths,
        }
    )
    values = {
        **numerics.provenance(),
        **grid.attributes,
        "n": n,
        "w": w,
        "cells": grid.cells,
    }
    SCHEMA.complete(dataset, pendulum, values, raw)
    summarised(dataset, _summary(dataset, bare, friction=raw.friction), pendulum, "orbits are")
    return dataset


def _paths(pendulum: Pendulum, orbits: list[_core.Orbit], units: Units) -> dict[str, Any]:
    """Return the motion along each orbit, integrated from each of its points to limit errors."""
    pieces = []
    for number, orbit in enumerate(orbits, start=1):
        period = orbit.period or pendulum.period
        length = period / len(orbit.points)
        samples = max(1, round(_SAMPLES * pendulum.period / length))
        if orbit.kind in {"rest", "inverted_rest"}:
            continue
        for k, point in enumerate(orbit.points):
            run = _core.simulate(pendulum, point, length, _TOLERANCE, samples, lyapunov=False)
            numbers = (np.full(run.time.size, x, dtype=np.int32) for x in (number, k))
            pieces.append((*numbers, run.theta, units.given(run.velocity, VELOCITY)))
    empty = tuple(np.empty(0, dtype=t) for t in (np.int32, np.int32, float, float))
    columns = [np.concatenate(c) for c in zip(*(pieces or [empty]), strict=True)]
    return {
        "path_orbit": variable("sample", columns[0], "1", "number of the orbit"),
        "path_piece": variable("sample", columns[1], "1", "from which of its points on"),
        "path_theta": variable("sample", columns[2], "rad", "angle, not wrapped"),
        "path_velocity": variable("sample", columns[3], units.of_velocity, "velocity"),
    }


def _summary(dataset: xr.Dataset, pendulum: Pendulum, *, friction: bool) -> list[str]:
    a = facts(dataset)
    units = Units.of(a)
    stable = int(dataset["stable"].sum())
    count = dataset.sizes["orbit"]
    sought = f"period {a['n']} and {counted(abs(a['w']), 'net turn')}"
    sought += f" {'forward' if a['w'] > 0 else 'backward'}" if a["w"] else ""
    lines = [f"{counted(count, 'orbit') if count else 'No orbit'} of {sought}, {stable} stable."]
    for k in range(min(count, _LISTED)):
        row = dataset.isel(orbit=k)
        pairs = [complex(*pair) for pair in row["multipliers"].values if pair[0] == pair[0]]
        multipliers = ", ".join(_written(value) for value in pairs)
        speed = units.spoken(format(float(row["velocity_point"]), ".9g"))
        period = ""
        if pendulum.p == 0 and a["w"]:
            period = f", period {units.seconds(format(float(row['period']), '.9g'))}"
        lines.append(
            f"{row['orbit'].values}: {'stable' if int(row['stable']) else 'unstable'}, "
            f"theta = {float(row['theta_point']):.9g} rad, velocity = {speed}, "
            f"{'multipliers' if len(pairs) > 1 else 'multiplier'} {multipliers}{period}."
        )
    if count > _LISTED:
        lines.append(f"{count - _LISTED} more are in the result.")
    if pendulum.p == 0 and a["n"] > 1:
        lines.append("Without drive every orbit closes after one period: n must be 1.")
    if pendulum.p == 0 and pendulum.gamma == 0 and a["w"]:
        lines.append(
            "Without drive and damping rotations form continuous families, of any period: "
            "Newton's method finds only isolated orbits."
        )
    if friction:
        lines.append("Rest states held by friction form a continuum and are not listed.")
    reach = units.spoken(f"{a['low_velocity']:.4g} to {a['high_velocity']:.4g}")
    lines.append(
        f"Search for a point in theta = {a['low_theta']:.4g} to {a['high_theta']:.4g} rad, "
        f"velocity = {reach}: {counted(a['cells'], 'cell')}, Newton's method from "
        f"{counted(a['begun'], 'place')}, {a['seconds']:.2f} s on "
        f"{counted(a['threads'], 'thread')}."
    )
    return lines


def _written(value: complex) -> str:
    if value.imag == 0:
        return f"{value.real:.6g}"
    return f"{value.real:.6g} {'+' if value.imag > 0 else '-'} {abs(value.imag):.6g} i"


def orbits_over(dataset: xr.Dataset, draws: Draws, analysis: Analysis) -> xr.Dataset:
    """Return K closed orbits with statistics of the orbits of D draws.

    Orbits are matched by name, and among those of one name by their points. Of each the point and
    the multipliers nearest to those of the model's orbit are taken. Adds ``drawn_theta``,
    ``drawn_velocity`` (K, D) and ``drawn_multipliers`` (K, eigenvalue, part, D), nan where a draw
    has no such orbit; ``theta_spread``, ``velocity_spread`` and ``multipliers_spread``, their
    standard deviations over the draws; ``exists`` and ``stable_share``, the shares of the draws in
    which it exists, and exists and is stable; ``drawn`` (D, parameter); ``drawn_others``, the mean
    number of orbits of a draw that the model itself lacks.
    """
    names, points = [one.plain for one in attractors_of(dataset)], points_of(dataset, "orbit")
    count, total = len(names), len(draws)
    state = np.full((count, 2, total), np.nan)
    multipliers = np.full((*dataset["multipliers"].shape, total), np.nan)
    there, stable = np.zeros((count, total), bool), np.zeros((count, total), bool)
    others = 0
    for d, one in enumerate(draws.each(analysis)):
        theirs = points_of(one, "orbit")
        alike = [orbit.plain for orbit in attractors_of(one)]
        for j, k in enumerate(named_alike(names, points, alike, theirs)):
            if k < 0:
                others += 1
                continue
            there[k, d], stable[k, d] = True, bool(one["stable"][j])
            point = np.array([dataset["theta_point"][k], dataset["velocity_point"][k]])
            away = theirs[j] - point
            away[:, 0] = np.remainder(away[:, 0] + math.pi, math.tau) - math.pi
            state[k, :, d] = point + away[np.argmin(np.hypot(*away.T))]
            of_model, pair = dataset["multipliers"].values[k], one["multipliers"].values[j]
            swapped = np.abs(pair[::-1] - of_model).sum() < np.abs(pair - of_model).sum()
            multipliers[k, ..., d] = pair[::-1] if swapped else pair
    spread = interval(state)[1]
    dims, speed = dataset["multipliers"].dims, dataset["velocity_point"].attrs["units"]
    single, per_draw, part = "orbit", ("orbit", "draw"), dataset["multipliers"].attrs["long_name"]
    of = "standard deviation over the draws of"
    with_draws = dataset.assign(
        **result.point(per_draw, state[:, 0], state[:, 1], speed, "drawn_{}"),
        drawn_multipliers=variable((*dims, "draw"), multipliers, "1", part),
        theta_spread=variable(single, spread[:, 0], "rad", f"{of} the angle"),
        velocity_spread=variable(single, spread[:, 1], speed, f"{of} the velocity"),
        multipliers_spread=variable(dims, interval(multipliers)[1], "1", f"{of} a {part}"),
        exists=variable(single, there.mean(axis=1), "1", "share of the draws that have the orbit"),
        stable_share=variable(single, stable.mean(axis=1), "1", "share in which it is stable"),
        drawn_others=variable((), others / total, "1", "orbits of a draw that the model lacks"),
    )
    return draws.complete(with_draws, _drawn_summary(with_draws, others))


def _drawn_summary(dataset: xr.Dataset, others: int) -> list[str]:
    lines = []
    for k, name in enumerate(dataset["orbit"].values):
        theta, velocity = (
            with_error(float(dataset[f"{what}_point"][k]), float(dataset[f"{what}_spread"][k]))
            for what in ("theta", "velocity")
        )
        sizes = np.hypot(*np.moveaxis(dataset["drawn_multipliers"].values[k], 1, 0))
        mean, error, _, _ = interval(sizes.max(axis=0))
        largest = f", largest multiplier {with_error(float(mean), float(error))} in size"
        lines.append(
            f"{name}: there in {100 * float(dataset['exists'][k]):.3g} % of the draws, stable in "
            f"{100 * float(dataset['stable_share'][k]):.3g} %; theta = {theta}, "
            f"velocity = {velocity}{largest if math.isfinite(mean) else ''}."
        )
    if others:
        more = counted(others, "orbit")
        lines.append(f"All draws together have {more} more, which the own model has not.")
    return lines
