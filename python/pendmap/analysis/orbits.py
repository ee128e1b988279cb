"""All closed orbits of one period and winding, stable and unstable."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import result
from pendmap.analysis.grid import Axis, Grid
from pendmap.analysis.orbit_table import objects, table
from pendmap.analysis.result import Field, Schema, rows, summarised
from pendmap.analysis.run import Numerics, RunOptions
from pendmap.errors import MOST_CELLS, check_type, check_whole, core_errors
from pendmap.files import facts
from pendmap.files.variables import flag, variable
from pendmap.formatting import counted
from pendmap.model import without_dimensions
from pendmap.units import VELOCITY, Units

if TYPE_CHECKING:
    from pendmap.analysis.run import Keywords
    from pendmap.model import Pendulum, Rig


LONGEST = 64  # Longest period of an orbit, in forcing periods
_CELLS, _FINER = 200, 4  # Cells a side of the box per period, largest number of periods counted
_SAMPLES = 128  # Samples of an orbit's path in a forcing period
_TOLERANCE = 1e-9  # Error of a path after a period, sufficient for figures
_LISTED = 12  # Largest number of orbits in a summary


def _orbits(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the orbits for the JSON object."""
    entries = objects(dataset, "orbit", "stable")
    return [entry | {"stable": bool(entry["stable"])} for entry in entries]


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


def orbit(
    pendulum: Pendulum | Rig,
    n: int = 1,
    w: int = 0,
    grid: Grid | None = None,
    *,
    run: RunOptions | None = None,
    **options: Unpack[Keywords],
) -> xr.Dataset:
    """Find all periodic orbits of smallest period ``n`` and ``w`` net turns, stable and unstable.

    An orbit is a fixed point of ``P^n(x) - (2 pi w, 0)``, ``P`` the stroboscopic map. The
    displacement is compared with its linear part on every cell of the grid; cells in which it
    cannot vanish are discarded, the others quartered, four times. Newton's method begins in those
    that remain, and beside orbits near their birth with the known ones divided out. Orbits that
    close to 1e-12, or to rounding where the multipliers are large, are kept, with the Floquet
    multipliers, the eigenvalues of the derivative of ``P^n``. An orbit whose neighbours in the
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
    run : RunOptions, optional
        As for :func:`pendmap.basins`.

    Returns
    -------
    xarray.Dataset
        The table of orbits over ``orbit``: ``kind``, ``n``, ``w``, ``theta_point`` and
        ``velocity_point`` (the point with the lowest angle), ``multipliers``, ``stable``,
        ``exponent``, ``period``, ``twin``; all points over ``point``; the motion,
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
    with core_errors():
        box = grid.bare(units)
        raw = _core.orbits(bare, (n, w), *box, run.workers, run.progress)
        paths = _paths(bare, raw.orbits, units)
    dataset = xr.Dataset(
        {
            **table(raw.orbits, units, "orbit"),
            "stable": flag("orbit", [o.stable for o in raw.orbits], "whether it is stable"),
            **paths,
        }
    )
    values = {**numerics.provenance(), **grid.attributes, "n": n, "w": w, "cells": grid.cells}
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
    a, count = facts(dataset), dataset.sizes["orbit"]
    units = Units.of(a)
    which = f"period {a['n']} and {counted(abs(a['w']), 'net turn')}"
    which += f" {'forward' if a['w'] > 0 else 'backward'}" if a["w"] else ""
    number = counted(count, "orbit") if count else "No orbit"
    lines = [f"{number} of {which}, {int(dataset['stable'].sum())} stable."]
    names = ("orbit", "stable", "theta_point", "velocity_point", "multipliers", "period")
    for name, stable, theta, velocity, pairs, period in list(rows(dataset, *names))[:_LISTED]:
        values = [complex(*pair) for pair in pairs if math.isfinite(pair[0])]
        texts = ", ".join(f"{v:.6g}" if v.imag else f"{v.real:.6g}" for v in values)
        of_own = f", period {units.seconds(f'{period:.9g}')}" if pendulum.p == 0 and a["w"] else ""
        lines.append(
            f"{name}: {'stable' if stable else 'unstable'}, theta = {theta:.9g} rad, velocity = "
            f"{units.spoken(f'{velocity:.9g}')}, multipliers {texts}{of_own}."
        )
    if count > _LISTED:
        lines.append(f"{count - _LISTED} more are in the result.")
    if pendulum.p == 0 and (a["n"] > 1 or (pendulum.gamma == 0 and a["w"])):
        lines.append(
            "Without drive every orbit closes after one period (n = 1); without damping too "
            "rotations are not isolated, and Newton's method finds none."
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
