"""Critical curves of the stability of rest, hanging and inverted, under a drive of the pivot.

Curves by perturbation: a periodic solution of ``th'' + gamma th' + (1 + p cos(omega tau)) th = 0``
is written with few harmonics, and those that are not resonant are eliminated, their damping left
out: the methods of Struble, of averaging and of multiple scales agree to this order. First tongue,
about ``omega = 2``, ``a = 1 - omega^2/4``, ``c = gamma omega/2``: to first order
``a^2 + c^2 = p^2/4``; the third harmonic, ``C = (p/2) A / (9 omega^2/4 - 1)``, adds ``k p^2``,
``k = 1/(9 omega^2 - 4)``, to ``a``. Second tongue, about ``omega = 1``, ``a = 1 - omega^2``,
``c = gamma omega``: the constant ``-(p/2) A`` takes ``p^2/2`` off the stiffness of the cosine, the
second harmonic adds ``s p^2``, ``s = 1/(4 (4 omega^2 - 1))``, to both:
``(a - (1/2 - s) p^2)(a + s p^2) + c^2 = 0``.
"""

from __future__ import annotations

import dataclasses
import itertools
from typing import TYPE_CHECKING, Any, TypeAlias, Unpack

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import grid, result
from pendmap.analysis.result import Field, Found, Schema, summarised
from pendmap.analysis.run import Numerics, RunOptions, in_rounds
from pendmap.analysis.varied import title_without
from pendmap.errors import InputError, check_flag, check_number, core_errors, short_repr
from pendmap.files import facts
from pendmap.files.variables import flag, variable
from pendmap.formatting import counted, listed
from pendmap.model import without_dimensions
from pendmap.units import RATE

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from pendmap.analysis.run import Keywords
    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats


Row: TypeAlias = _core.CriticalAmplitudes
"""Critical amplitudes, multipliers and fold at one frequency."""
_NOSE = 1e-6
"""Width of an interval in which a curve turns back, below which it is not halved, fraction of the
range. Near such a turn the amplitude varies as the square root of the distance."""
_TOP = 0.995  # Share of the largest amplitude from which a curve leaves the figure
PLANES = ("omega-p", "e-alpha2")
"""Eq. 1.2's ``(omega, p)``, and eq. 1.4's ``(alpha^2, e) = (1/omega^2, p/omega^2)``."""
_HIGHEST = 2.6  # Largest ``e`` of a figure in the plane of eq. 1.4, if it was computed
OMEGA = (0.5, 3.0, 200)  # Default frequencies
_OF_P = "1", "amplitude of the drive over gravity"  # Unit and meaning of p
_STABLE = {0: "unstable", 1: "stable"}  # Meanings of a flag
_NO_REST = Row.no_rest()  # Result for a rest that is no solution
_ROUNDS = 8  # Searches that are half of the work
NEAR = 0.05  # Relative error below which an asymptotic curve is near the exact one


def _curves(dataset: xr.Dataset, prefix: str) -> list[dict[str, Any]]:
    """Return the critical amplitudes at each requested frequency for the JSON object."""
    index, fold = dataset[f"{prefix}index"].values, dataset["fold"].values
    columns = {name: dataset[f"{prefix}{name}"].values for name in ("p", "multiplier")}
    if f"{prefix}stable_above" in dataset:
        columns["stable_above"] = dataset[f"{prefix}stable_above"].values.astype(bool)
    curves = []
    for k in np.flatnonzero(dataset["asked"].values):
        curve: dict[str, Any] = {"omega": float(dataset["omega"].values[k])}
        curve |= {name: values[index == k].tolist() for name, values in columns.items()}
        curves.append(curve if prefix else curve | {"fold": float(fold[k])})
    return curves


def _asymptotic(dataset: xr.Dataset) -> dict[str, list[float]]:
    """Return the asymptotic curves by name for the JSON object."""
    asked = dataset["asked"].values.astype(bool)
    rows = zip(dataset["curve"].values, dataset["asymptotic"].values, strict=True)
    return {str(name): p[asked].tolist() for name, p in rows}


SCHEMA = Schema(
    "tongues",
    result.UNITS,
    Field("curves", "1", "critical amplitudes of hanging rest", read=lambda d: _curves(d, "")),
    Field("inverted", "", "the same of inverted rest", read=lambda d: _curves(d, "inverted_")),
    Field("undamped", "", "the same without damping", read=lambda d: _curves(d, "undamped_")),
    Field("asymptotic", "1", "critical amplitudes by perturbation", read=_asymptotic),
    Field("p_max", "1", "largest amplitude that was looked at"),
    *result.TIMED,
    *result.END,
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
    run: RunOptions | None = None,
    **options: Unpack[Keywords],
) -> xr.Dataset:
    """Compute the critical curves of rest, exact, with folds and asymptotic curves.

    Hanging rest obeys ``th'' + gamma th' + (1 + p cos(omega tau)) th = 0`` (eq. 1.3 with damping);
    inverted rest the same with ``-(1 + p cos(omega tau))``. The derivative of the stroboscopic map
    there is its monodromy matrix ``M``, and rest changes its stability where a multiplier passes
    +1, ``1 - tr M + det M = 0``, or -1, ``1 + tr M + det M = 0``. As ``M`` is an entire function of
    ``p``, its Chebyshev series gives all such amplitudes up to ``p_max``. In the plane of eq. 1.4 a
    point is ``(e, alpha^2) = (p/omega^2, 1/omega^2)``.

    A constant torque turns rest into an orbit of the drive's period, which is followed along ``p``
    by Newton's method, to a fold, its critical amplitude with multiplier +1. Without a torque, an
    oscillation branches off where hanging rest first loses its stability, with period 1 (multiplier
    +1) or 2 (-1). If it branches toward smaller ``p`` it is followed to its fold: between fold and
    critical curve it coexists with a stable rest.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; its own ``p``, ``omega`` and phase do not matter. With gamma = 0 the curves are
        those of Mathieu's equation. Effects are included; rest must be a solution.
    omega : array_like, optional
        Frequencies ``Omega/w0`` in ascending order, by default 200 from 0.5 to 3,
        evenly in omega or, for the plane of eq. 1.4, in 1/omega^2.
    p_max : float
        Largest amplitude, up to 50,000 times the square of the lowest frequency.
    plane : str
        Plane of a figure: ``omega-p`` of eq. 1.2, or ``e-alpha2`` of eq. 1.4.
    inverted : bool
        Whether to find where inverted rest is stable too.
    refine : bool
        Whether to add frequencies where curves turn back between two given ones, for figures.
    run : RunOptions, optional
        As for :func:`pendmap.basins`.

    Returns
    -------
    xarray.Dataset
        Over ``critical``, a critical amplitude each: ``index`` of its frequency, ``p``,
        ``multiplier`` (1 or -1), ``stable_above`` (whether rest is stable right above) and
        ``critical_omega``, its frequency. Over ``omega``: ``asked`` (0 where the frequency was
        added), ``stable_at_first`` (below the first), ``fold`` (nan where none, and where the
        frequency was added) and the point ``fold_theta``, ``fold_velocity`` of the oscillation
        there. The same without damping: ``undamped_index``, ``undamped_p``, ``undamped_multiplier``
        over ``undamped``. Of inverted rest, which is unstable without drive: ``inverted_index``,
        ``inverted_p``, ``inverted_multiplier``, ``inverted_stable_above`` over ``inverted``; none,
        and ``inverted_rest`` is 0, where upright is no rest. Under a torque, when ``moved`` is 1,
        there are no folds and none without damping. Over ``curve`` and ``omega``: ``asymptotic``
        and ``asymptotic_error``, relative to the exact curve nearest by.

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
    asked = grid.frequencies(omega)
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
    free = dataclasses.replace(bare, gamma=0.0)
    progress = in_rounds(run.progress, _ROUNDS)

    def solve(at: Floats, *, folds: bool = False) -> list[tuple[Row, ...]]:
        def rows(one: Pendulum, *, upright: bool, folds: bool = False) -> list[Row]:
            shared = at.tolist(), p_max, folds, run.workers, progress
            return _core.tongues(one, upright, *shared)

        hanging, none = rows(bare, upright=False, folds=folds), [_NO_REST] * at.size
        undamped = none if hanging[0].moved else rows(free, upright=False)
        upright = rows(bare, upright=True) if inverted else none
        return list(zip(hanging, undamped, upright, strict=True))

    with core_errors():
        frequencies, rows = asked, solve(asked, folds=True)
        if refine:
            frequencies, rows = with_turns(asked, rows, solve, p_max)
    hanging, undamped, upright = (list(column) for column in zip(*rows, strict=True))
    moved = bool(hanging[0].moved)
    by_perturbation = asymptotic(hanging, frequencies, bare.gamma, 0.0 if moved else p_max)
    both = ("curve", "omega")
    variables = {
        **_variables(frequencies, hanging, undamped, upright),
        "asked": flag("omega", np.isin(frequencies, asked), "whether the frequency was asked for"),
        "asymptotic": variable(both, by_perturbation[0], *_OF_P),
        "asymptotic_error": variable(both, by_perturbation[1], "1", "relative error of p"),
    }
    coords: dict[str, Any] = {
        "omega": variable("omega", frequencies, "1", "Omega/w0"),
        "curve": variable("curve", np.array([*CURVES]), "", "by perturbation"),
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


def _variables(
    omega: Floats, hanging: list[Row], undamped: list[Row], upright: list[Row]
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
    asked = dataset["asked"].values.astype(bool)
    omega, index, p = (dataset[name].values for name in ("omega", "index", "p"))
    hanging = "the orbit about hanging rest" if a["moved"] else "hanging rest"
    number = counted(int(asked[index].sum()), "critical amplitude")
    values = counted(int(asked.sum()), "value")
    where = f"{values} of omega from {omega[0]:g} to {omega[-1]:g}"
    lines = [f"{number} up to p = {a['p_max']:g} at {where}."]
    never = omega[(dataset["stable_at_first"].values == 0) & asked]
    if never.size:
        omegas = listed([f"{value:.6g}" for value in never], 3)
        lines.append(f"{hanging.capitalize()} is unstable from p = 0 on at omega = {omegas}.")
    elif p.size:
        least = int(np.argmin(p))
        soonest = f"soonest at omega = {omega[index[least]]:.6g}: p = {p[least]:.9g}"
        lines.append(f"Of these frequencies {hanging} loses its stability {soonest}.")
    born = omega[np.isfinite(dataset["fold"].values)]
    if born.size:
        where = f"{counted(born.size, 'value')} of omega, {born.min():.4g} to {born.max():.4g},"
        lines.append(f"At {where} the oscillation is born toward smaller p: it has a fold.")
    if a["inverted_rest"]:
        rest = "The orbit about inverted rest" if a["moved"] else "Inverted rest"
        names = ("inverted_p", "inverted_omega", "inverted_stable_above")
        stable = [row[:2] for row in result.rows(dataset, *names) if row[2]]
        at, low = min(stable, default=(0.0, 0.0))
        lowest = f"from p = {at:.9g} on at omega = {low:.6g}, the lowest"
        lines.append(f"{rest} is stable {lowest if stable else 'nowhere there'}.")
    return [*lines, f"{a['seconds']:.2f} s on {counted(a['threads'], 'thread')}."]


def with_turns(
    omega: Floats,
    rows: list[tuple[Row, ...]],
    solve: Callable[[Floats], list[tuple[Row, ...]]],
    p_max: float,
) -> tuple[Floats, list[tuple[Row, ...]]]:
    """Return frequencies, also where a curve turns back or ends between two, and their rows."""
    rows, least = list(rows), _NOSE * (omega[-1] - omega[0])
    while True:
        pairs = (zip(a, b, strict=True) for a, b in itertools.pairwise(rows))
        ends = np.array([any(_ends(*one, p_max) for one in pair) for pair in pairs], dtype=bool)
        places = np.flatnonzero(ends & (np.diff(omega) > least))
        if not places.size:
            return omega, rows
        between = (omega[places] + omega[places + 1]) / 2
        more = solve(between)
        omega = np.insert(omega, places + 1, between)
        for place, row in zip(places[::-1], more[::-1], strict=True):
            rows.insert(place + 1, row)


def _ends(row: Row, other: Row, p_max: float) -> bool:
    """Return whether a curve is at one of two frequencies alone, unless it is about to leave."""
    for m in (1, -1):
        amplitudes = [np.array(r.p)[np.array(r.multiplier) == m] for r in (row, other)]
        short, long = sorted(amplitudes, key=np.size)
        if long.size > short.size + 1 or (long.size > short.size and long[-1] < _TOP * p_max):
            return True
    return False


def in_plane(omega: Floats, p: Floats, plane: str) -> tuple[Floats, Floats]:
    """Convert frequencies and amplitudes to coordinates in one of :data:`PLANES`."""
    if plane == PLANES[0]:
        return omega, p
    square = 1 / np.asarray(omega) ** 2
    return square, p * square


def window(omega: Floats, p_max: float, plane: str) -> tuple[tuple[float, float], float]:
    """Return the ends of a figure's abscissa, and its height above 0."""
    low, high = float(omega[0]), float(omega[-1])
    if plane == PLANES[0]:
        aside = 0.0 if low < high else 0.05 * low
        return (low - aside, high + aside), p_max
    return (0.0, 1 / low**2), min(_HIGHEST, p_max / low**2)


def first_tongue(omega: Floats, gamma: float) -> Floats:
    """Return critical ``p`` of the first tongue to first order; nan nearer to the second tongue."""
    a, c = 1 - omega**2 / 4, gamma * omega / 2
    return np.where(omega > 1.0, 2 * np.hypot(a, c), np.nan)


def first_tongue_second_order(omega: Floats, gamma: float) -> Floats:
    """Return critical ``p`` of the first tongue to second order; nan if there is none."""
    a, c = 1 - omega**2 / 4, gamma * omega / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        k = 1 / (9 * omega**2 - 4)
        # k^2 P^2 + (2 a k - 1/4) P + a^2 + c^2 = 0 in P = p^2: the root that is finite for k = 0.
        half = 1 / 8 - a * k
        square = (a**2 + c**2) / (half + np.sqrt(half**2 - k**2 * (a**2 + c**2)))
        amplitude = np.sqrt(square)
    # Left of 2/3 the third harmonic is resonant before the first.
    return np.where((omega > 1.0) & np.isfinite(amplitude), amplitude, np.nan)


def second_tongue(omega: Floats, gamma: float) -> Floats:
    """Return critical ``p`` of the second tongue to second order; nan if there is none."""
    a, c = 1 - omega**2, gamma * omega
    with np.errstate(divide="ignore", invalid="ignore"):
        s = 1 / (4 * (4 * omega**2 - 1))
        # s (1/2 - s) P^2 + a (1/2 - 2 s) P - (a^2 + c^2) = 0.
        leading, half = s * (0.5 - s), a * (0.5 - 2 * s) / 2
        square = (-half + np.sqrt(half**2 + leading * (a**2 + c**2))) / leading
        amplitude = np.sqrt(square)
    # Left of 1/sqrt(2) the second harmonic is nearly resonant itself.
    return np.where((omega > np.sqrt(0.5)) & np.isfinite(amplitude), amplitude, np.nan)


CURVES: dict[str, tuple[int, Callable[[Floats, float], Floats]]] = {
    "tongue 1, first order": (-1, first_tongue),
    "tongue 1, second order": (-1, first_tongue_second_order),
    "tongue 2, second order": (1, second_tongue),
}
"""Name of each curve, the multiplier on it, and its formula."""


def asymptotic(rows: list[Row], omega: Floats, gamma: float, p_max: float) -> tuple[Floats, Floats]:
    """Return the asymptotic curves and their errors against exact ones of equal multiplier."""
    curves = np.array([formula(omega, gamma) for _, formula in CURVES.values()])
    curves[curves > p_max] = np.nan
    errors = np.full_like(curves, np.nan)
    for (multiplier, _), p, error in zip(CURVES.values(), curves, errors, strict=True):
        for k, row in enumerate(rows):
            exact = np.array(row.p)[np.array(row.multiplier) == multiplier]
            if exact.size and np.isfinite(p[k]):
                nearest = exact[np.argmin(np.abs(exact - p[k]))]
                error[k] = abs(p[k] - nearest) / nearest if nearest else np.nan
    return curves, errors
