"""Critical curves of the stability of rest, hanging and inverted, under a drive of the pivot."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias, Unpack

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import critical_curves, result
from pendmap.analysis import grid as grids
from pendmap.analysis.critical_curves import PLANES, in_picture
from pendmap.analysis.draws import drawn, drawn_field, interval
from pendmap.analysis.numerics import Numerics
from pendmap.analysis.result import Field, Found, Schema, summarised
from pendmap.analysis.run import RunOptions, in_rounds
from pendmap.analysis.varied import title_without
from pendmap.errors import InputError, check_flag, check_number, core_errors, short_repr
from pendmap.files import facts
from pendmap.files.variables import flag, variable
from pendmap.formatting import counted
from pendmap.model import effects_of, without_dimensions
from pendmap.units import RATE

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from pendmap.analysis.draws import Analysis, Draws
    from pendmap.analysis.run import Keywords
    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats, Mask


_Row: TypeAlias = _core.CriticalAmplitudes
"""Critical amplitudes, multipliers and fold at one frequency."""
OMEGA = (0.5, 3.0, 200)  # Default frequencies
_OF_P = "1", "amplitude of the drive over gravity"  # Unit and meaning of p
_STABLE = {0: "unstable", 1: "stable"}  # Meanings of a flag
_NO_REST = _core.CriticalAmplitudes.no_rest()  # Result for a rest that is no solution
_TIPS = 8  # Tips of tongues, omega = 2/k, k = 1, 2, ..., that a summary lists without damping
_ROUNDS = 8  # Searches that are half of the work
_STRIP = 1e-6  # Width in p of a strip of stability below which a summary leaves it out
_TABLES = {"curves": ("critical", ""), "inverted": ("inverted", "inverted_")}
"""Tables of critical amplitudes over draws: JSON key, dimension, prefix of the variables."""
NEAR = 0.05  # Relative error below which an asymptotic curve is near the exact one


def _curves(dataset: xr.Dataset, prefix: str, fold: str = "") -> list[dict[str, Any]]:
    """Return the critical amplitudes at each requested frequency for the JSON object."""
    index = dataset[f"{prefix}index"].values
    curves = []
    for k in np.flatnonzero(dataset["asked"].values):
        mine = index == k
        curve: dict[str, Any] = {
            "omega": float(dataset["omega"].values[k]),
            "p": dataset[f"{prefix}p"].values[mine].tolist(),
            "multiplier": dataset[f"{prefix}multiplier"].values[mine].tolist(),
        }
        if f"{prefix}stable_above" in dataset:
            stable = dataset[f"{prefix}stable_above"].values[mine]
            curve["stable_above"] = stable.astype(bool).tolist()
        if fold:
            curve["fold"] = float(dataset[fold].values[k])
        curves.append(curve)
    return curves


def _asymptotic_curves(dataset: xr.Dataset) -> dict[str, list[float]]:
    """Return the asymptotic curves by name for the JSON object."""
    asked = dataset["asked"].values.astype(bool)
    rows = zip(dataset["curve"].values, dataset["asymptotic"].values, strict=True)
    return {str(name): p[asked].tolist() for name, p in rows}


@drawn_field
def drawn_tongues(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the draws of critical curves for the JSON object."""
    asked = dataset["asked"].values.astype(bool)
    tables = {}
    for key, (table, prefix) in _TABLES.items():
        mine = dataset.isel({table: asked[dataset[f"{prefix}index"].values]})
        names = (f"{prefix}{name}" for name in ("multiplier", "p", "p_low", "p_high", "exists"))
        tables[key] = [
            {"omega": omega, "multiplier": sign, "p": p, "ci95": [low, high], "exists": exists}
            for omega, sign, p, low, high, exists in result.rows(mine, f"{table}_omega", *names)
        ]
    return tables


SCHEMA = Schema(
    "tongues",
    result.UNITS,
    Field(
        "curves", "1", "critical amplitudes of hanging rest", read=lambda d: _curves(d, "", "fold")
    ),
    Field("inverted", "", "the same of inverted rest", read=lambda d: _curves(d, "inverted_")),
    Field("undamped", "", "the same without damping", read=lambda d: _curves(d, "undamped_")),
    Field("asymptotic", "1", "critical amplitudes by perturbation", read=_asymptotic_curves),
    Field("p_max", "1", "largest amplitude that was looked at"),
    *result.TIMED,
    *result.END,
    drawn_tongues,
    Field("plane", "", "plane of the figure: omega-p or e-alpha2", json=False),
    Found("moved", result.FLAG, "whether a torque makes an orbit of rest", json=False),
    Found("inverted_rest", result.FLAG, "whether upright is a rest", json=False),
    *result.OWN,
    *result.VERSIONS,
)


def tongues(  # noqa: PLR0913 (physics first, numerical choices by name)
    pendulum: Pendulum | Rig,
    omega: ArrayLike | None = None,
    p_max: float = 6.0,
    *,
    plane: str = "omega-p",
    inverted: bool = True,
    refine: bool = False,
    draws: int | None = None,
    run: RunOptions | None = None,
    **options: Unpack[Keywords],
) -> xr.Dataset:
    """Compute the critical curves of rest, exact, with folds and asymptotic curves.

    Hanging rest obeys ``th'' + gamma th' + (1 + p cos(omega tau)) th = 0`` (eq. 1.3 with damping);
    inverted rest the same with ``-(1 + p cos(omega tau))``. The derivative of the stroboscopic map
    there is its monodromy matrix ``M``, and rest changes its stability where a multiplier passes
    +1, ``1 - tr M + det M = 0``, or -1, ``1 + tr M + det M = 0``. As ``p`` enters linearly, ``M``
    is an entire function of ``p``: from its Chebyshev series all such amplitudes up to ``p_max``
    are found, and moved onto the map itself. In the plane of eq. 1.4 a point is ``(e, alpha^2) =
    (p/omega^2, 1/omega^2)``.

    A constant torque turns rest into an orbit of the drive's period. Where rest is stable without
    the torque, the orbit that it becomes as the torque grows from 0 is followed along ``p``, in
    both directions, by Newton's method. It is stable between critical amplitudes as rest is; it
    ceases at a fold, the one with multiplier +1. Where two oscillations of period 1 branch from
    rest, a torque makes one of them the continuation of rest, without a critical amplitude.

    Without a torque, an oscillation branches off where hanging rest first loses its stability, with
    period 1 (multiplier +1) or 2 (-1). If it branches toward smaller ``p`` it is followed to its
    fold: between fold and critical curve it coexists with a stable rest.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; its own ``p``, ``omega`` and phase do not matter. With gamma = 0 the curves are
        those of Mathieu's equation. Effects are included; rest must be a solution.
    omega : array_like, optional
        Frequencies ``Omega/w0`` in ascending order, by default 200 from 0.5 to 3,
        evenly in omega or, for the plane of eq. 1.4, in 1/omega^2.
    p_max : float
        Largest amplitude. It may be up to 50,000 times the square of the lowest frequency: there
        motions about rest grow nearly beyond the range of numbers in a period.
    plane : str
        Plane of a figure: ``omega-p`` of eq. 1.2, or ``e-alpha2`` of eq. 1.4.
    inverted : bool
        Whether to find where inverted rest is stable too.
    refine : bool
        Whether to add frequencies where curves begin, end, turn or bend between two given ones, for
        figures.
    draws : int, optional
        As for :func:`pendmap.basins`; adds the band of each critical amplitude.
    run : RunOptions, optional
        As for :func:`pendmap.basins`.

    Returns
    -------
    xarray.Dataset
        Over ``critical``, a critical amplitude each: ``index`` of its frequency, ``p``,
        ``multiplier`` (1 or -1), ``stable_above`` (whether rest is stable right above) and
        ``critical_omega``, its frequency. Over
        ``omega``: ``asked`` (0 where the frequency was added), ``stable_at_first`` (below the
        first), ``fold`` (nan where none) and the point ``fold_theta``, ``fold_velocity`` of the
        oscillation there, ``fold_sought`` (0 where the frequency was added and no fold ends). The
        same without damping: ``undamped_index``, ``undamped_p``, ``undamped_multiplier`` over
        ``undamped``. Of inverted rest, which is unstable without drive: ``inverted_index``,
        ``inverted_p``, ``inverted_multiplier``, ``inverted_stable_above`` over ``inverted``; none,
        and ``inverted_rest`` is 0, where upright is no rest. Under a torque, when ``moved`` is 1,
        there are no folds and none without damping. Over ``curve`` and
        ``omega``: ``asymptotic`` and ``asymptotic_error``, relative to the exact curve nearest by.

    Raises
    ------
    InputError
        If a value is outside its range; if the model has friction, which holds rest whatever the
        drive, or a load that is no constant torque, which moves it.

    Examples
    --------
    >>> import pendmap
    >>> result = pendmap.tongues(pendmap.Pendulum(gamma=0.1), omega=[1.9, 2.0, 2.1])
    >>> round(float(result.p.min()), 3)
    0.2
    """
    bare, units = without_dimensions(pendulum)
    if omega is None:  # evenly spread in the plane
        low, high, count = OMEGA
        omega = np.linspace(*OMEGA)
        if plane != PLANES[0]:
            omega = 1 / np.sqrt(np.linspace(1 / low**2, 1 / high**2, count))
    asked = grids.frequencies(omega)
    p_max = check_number("p_max", p_max)
    run = RunOptions.of(run, options).in_memory("tongues")
    numerics = Numerics(run)
    if plane not in PLANES:
        raise InputError(f"plane must be one of {', '.join(PLANES)}, got {short_repr(plane)}")
    refine, inverted = check_flag("refine", refine), check_flag("inverted", inverted)
    if bare.theta_r > 0:
        raise InputError(
            f"theta_r must be 0, got {bare.theta_r:g}: friction holds hanging rest whatever "
            "the drive, and it never loses its stability"
        )
    if draws is not None:
        several = drawn(pendulum, draws, run)
        same = partial(tongues, p_max=p_max, inverted=inverted)
        first = same(pendulum, asked, plane=plane, refine=refine, run=several.first)
        return tongues_over(first, several, partial(same, omega=first["omega"]))
    frequencies, looked, (hanging, undamped, upright) = _solved(
        bare, asked, p_max, numerics, inverted=inverted, refine=refine
    )
    if moved := bool(hanging[0].moved):
        undamped = [_NO_REST] * len(hanging)
    reach = 0.0 if moved else p_max
    asymptotic, errors = critical_curves.asymptotic(hanging, frequencies, bare.gamma, reach)
    variables = {
        **_variables(frequencies, hanging, undamped, upright),
        "asked": flag("omega", np.isin(frequencies, asked), "whether the frequency was asked for"),
        "fold_sought": flag("omega", looked, "whether a fold was sought here"),
        "asymptotic": variable(("curve", "omega"), asymptotic, *_OF_P),
        "asymptotic_error": variable(("curve", "omega"), errors, "1", "relative error of p"),
    }
    coords: dict[str, Any] = {
        "omega": variable("omega", frequencies, "1", "Omega/w0"),
        "curve": variable("curve", np.array([*critical_curves.CURVES]), "", "by perturbation"),
    }
    if units.si:
        given = units.given(frequencies, RATE)
        coords["Omega"] = variable("omega", given, "rad/s", "angular frequency of the drive")
    dataset = xr.Dataset(variables, coords=coords)
    values = {
        **numerics.provenance(),
        "plane": plane,
        "p_max": p_max,
        "moved": int(moved),
        "inverted_rest": int(upright[0].rest),
        "own_p": bare.p,
        "own_omega": bare.omega,
    }
    SCHEMA.complete(dataset, pendulum, values)
    dataset.attrs["title"] = title_without(pendulum, "p", "omega", "phase")
    summarised(dataset, _summary(dataset), pendulum, "curves are")
    return dataset


def _solved(  # noqa: PLR0913 (as for tongues)
    pendulum: Pendulum,
    asked: Floats,
    p_max: float,
    numerics: Numerics,
    *,
    inverted: bool,
    refine: bool,
) -> tuple[Floats, Mask, tuple[list[_Row], list[_Row], list[_Row]]]:
    """Return frequencies, where folds were sought, and rows: hanging, undamped, inverted rest."""
    free = dataclasses.replace(pendulum, gamma=0.0) if pendulum.gamma else None

    moved = in_rounds(numerics.run.progress, _ROUNDS)

    def solve(at: Floats, one: Pendulum, *, upright: bool, folds: bool = False) -> list[_Row]:
        return _core.tongues(one, upright, at.tolist(), p_max, folds, numerics.run.workers, moved)

    def all_at(at: Floats, *, folds: bool = False) -> list[tuple[_Row, ...]]:
        hanging = solve(at, pendulum, upright=False, folds=folds)
        undamped = solve(at, free, upright=False) if free and not hanging[0].moved else hanging
        above = solve(at, pendulum, upright=True) if inverted else [_NO_REST] * at.size
        return list(zip(hanging, undamped, above, strict=True))

    def curves(rows: tuple[_Row, ...]) -> list[tuple[Floats, Floats]]:
        # The end of the search bounds the last strip.
        return [(np.array([*r.p, p_max]), np.array([*r.multiplier, 0.0])) for r in rows]

    with core_errors():
        frequencies, rows = asked, all_at(asked, folds=True)
        if refine and asked.size > 1:
            views = [in_picture(asked, p_max, one) for one in PLANES]
            frequencies, rows = critical_curves.denser(asked, rows, all_at, curves, views)
        hanging, undamped, upright = (list(column) for column in zip(*rows, strict=True))
        again = partial(solve, one=pendulum, upright=False, folds=True)
        looked = critical_curves.fold_ends(frequencies, hanging, np.isin(frequencies, asked), again)
    return frequencies, looked, (hanging, undamped, upright)


def _variables(
    omega: Floats, hanging: list[_Row], undamped: list[_Row], upright: list[_Row]
) -> dict[str, Any]:
    """Return the tables of critical amplitudes, and the folds, at these frequencies."""
    folds = [row.fold or (np.nan, np.nan, np.nan) for row in hanging]
    fold, theta, velocity = np.array(folds).T
    first = [row.stable[0] for row in hanging]
    variables: dict[str, Any] = {
        "stable_at_first": flag("omega", first, "rest below the first amplitude", _STABLE),
        "fold": variable("omega", fold, *_OF_P, "of the oscillation born at the first loss"),
        "fold_theta": variable("omega", theta, "rad", "angle of a point of the fold"),
        "fold_velocity": variable("omega", velocity, "1", "velocity dtheta/dtau of this point"),
    }
    for one, prefix, rows in (
        ("critical", "", hanging),
        ("undamped", "undamped_", undamped),
        ("inverted", "inverted_", upright),
    ):
        index = np.repeat(np.arange(omega.size, dtype=np.int32), [len(row.p) for row in rows])
        p = np.array([p for row in rows for p in row.p], dtype=float)
        multiplier = np.array([m for row in rows for m in row.multiplier], dtype=np.int8)
        variables |= {
            f"{prefix}index": variable(one, index, "1", "place of its frequency in omega"),
            f"{prefix}p": variable(one, p, *_OF_P),
            f"{prefix}multiplier": variable(one, multiplier, "1", "Floquet multiplier"),
            f"{one}_omega": variable(one, omega[index], "1", "Omega/w0"),
        }
        if one != "undamped":
            above = [stable for row in rows for stable in row.stable[1:]]
            variables[f"{prefix}stable_above"] = flag(one, above, "rest right above it", _STABLE)
    return variables


def _summary(dataset: xr.Dataset) -> list[str]:
    a = facts(dataset)
    omega, asked = dataset["omega"].values, dataset["asked"].values.astype(bool)
    count = dataset.sizes["critical"]
    of_asked = int(asked[dataset["index"].values].sum())
    where = f"{counted(int(asked.sum()), 'value')} of omega from {omega[0]:g} to {omega[-1]:g}"
    hanging = "the orbit about hanging rest" if a["moved"] else "hanging rest"
    lines = [f"{counted(of_asked, 'critical amplitude')} up to p = {a['p_max']:g} at {where}."]
    if added := int((~asked).sum()):
        lines[0] += f" {added} more values of omega where curves turn, end or bend."
    index, p = dataset["index"].values, dataset["p"].values
    first = [k for k in range(count) if k == 0 or index[k] != index[k - 1]]
    never = omega[(dataset["stable_at_first"].values == 0) & asked]
    if a["gamma"] == 0 and not effects_of(a):
        tips = [2 / k for k in range(1, _TIPS + 1)]
        never = np.array([tip for tip in tips if omega[0] <= tip <= omega[-1]])
    if never.size:
        omegas = ", ".join(f"{value:.6g}" for value in never[:3])
        more = f" and {never.size - 3} more" if never.size > 3 else ""  # noqa: PLR2004
        lines.append(f"{hanging.capitalize()} is unstable from p = 0 on at omega = {omegas}{more}.")
    elif first:
        least = min(first, key=lambda k: p[k])
        lines.append(
            f"Of these frequencies {hanging} loses its stability soonest at omega = "
            f"{omega[index[least]]:.6g}: p = {p[least]:.9g} (multiplier "
            f"{dataset['multiplier'].values[least]})."
        )
    fold = dataset["fold"].values
    if (born := np.isfinite(fold) & asked).any():
        at = omega[born]
        lines.append(
            f"At {counted(at.size, 'value')} of omega from {at.min():.4g} to {at.max():.4g} the "
            "oscillation is born toward smaller p: it exists from its fold on."
        )
    lines += _inverted(dataset, asked)
    for name in dataset["curve"].values:
        error = dataset["asymptotic_error"].sel(curve=name).values
        near = omega[(error < NEAR) & asked]
        if near.size:
            lines.append(
                f"{str(name).capitalize()}: within {100 * NEAR:g} % of the exact curve at "
                f"omega = {near.min():.4g} to {near.max():.4g}."
            )
    lines.append(f"{a['seconds']:.2f} s on {counted(a['threads'], 'thread')}.")
    return lines


def _inverted(dataset: xr.Dataset, asked: Mask) -> list[str]:
    """Return a summary line on the range in which inverted rest is stable."""
    a = facts(dataset)
    rest = "The orbit about inverted rest" if a["moved"] else "Inverted rest"
    if not a["inverted_rest"]:
        return []
    omega, p_max = dataset["omega"].values, a["p_max"]
    index, p = dataset["inverted_index"].values, dataset["inverted_p"].values
    wide = []
    for k in np.flatnonzero(dataset["inverted_stable_above"].values):
        last = k + 1 == p.size or index[k + 1] != index[k]
        high = p_max if last else p[k + 1]
        if asked[index[k]] and high - p[k] > _STRIP:
            wide.append((p[k], high, omega[index[k]]))
    if not wide:
        return [f"{rest} is stable nowhere there."]
    low, high, where = max(wide, key=lambda strip: strip[1] - strip[0])
    count = counted(len({w for *_, w in wide}), "value")
    on = " and on" if high == p_max else ""
    widest = f"in the widest strip from p = {low:.9g} to {high:.9g}{on}, at omega = {where:.6g}"
    return [f"{rest} is stable at {count} of omega, {widest}."]


def tongues_over(dataset: xr.Dataset, draws: Draws, analysis: Analysis) -> xr.Dataset:
    """Return K critical amplitudes with their 95 % bands over D draws.

    At each frequency ``Omega/w0`` the critical amplitudes of one multiplier are counted from the
    lowest, and matched by this number. Adds ``drawn_p`` (K, D), nan where a draw has no such
    amplitude, ``p_low`` and ``p_high``, the 95 % interval over the draws, and ``exists``, the share
    of the draws that have it; the same for inverted rest with the prefix ``inverted_``; ``drawn``
    (D, parameter).
    """
    tables = _TABLES.values()
    results = draws.each(analysis)
    every = [{table: _numbered(one, prefix) for table, prefix in tables} for one in results]
    with_draws = dataset
    for table, prefix in tables:
        mine = [[one[table].get(k, np.nan) for one in every] for k in _numbered(dataset, prefix)]
        p = np.array(mine, dtype=float).reshape(-1, len(draws))
        there = np.isfinite(p).mean(axis=1)
        _, _, low, high = interval(p)
        with_draws = with_draws.assign(
            {
                f"{prefix}drawn_p": variable((table, "draw"), p, *_OF_P),
                f"{prefix}p_low": variable(table, low, "1", "lower end of 95 % of the draws"),
                f"{prefix}p_high": variable(table, high, "1", "upper end of 95 % of the draws"),
                f"{prefix}exists": variable(table, there, "1", "share of the draws that have it"),
            }
        )
    return draws.complete(with_draws, _lowest(with_draws))


def _numbered(dataset: xr.Dataset, prefix: str) -> dict[tuple[int, int, int], float]:
    """Return critical amplitudes by frequency index, multiplier and number."""
    seen: dict[tuple[int, int], int] = {}
    numbered = {}
    names = (f"{prefix}{name}" for name in ("index", "multiplier", "p"))
    for index, multiplier, p in result.rows(dataset, *names):
        number = seen[index, multiplier] = seen.get((index, multiplier), -1) + 1
        numbered[index, multiplier, number] = p
    return numbered


def _lowest(dataset: xr.Dataset) -> list[str]:
    p, low, high = (dataset[name].values for name in ("p", "p_low", "p_high"))
    asked = dataset["asked"].values.astype(bool)[dataset["index"].values]
    if not asked.any():
        return []
    k = int(np.argmin(np.where(asked, p, np.inf)))
    omega = float(dataset["omega"].values[dataset["index"].values[k]])
    line = (
        f"The lowest critical amplitude, p = {p[k]:.6g} at omega = {omega:.6g}: 95 % of the "
        f"draws in [{low[k]:.6g}, {high[k]:.6g}]."
    )
    return [line]
