"""Critical curves of the stability of rest, hanging and inverted, under a drive of the pivot.

Curves by perturbation: a periodic solution of ``th'' + gamma th' + (1 + p cos(omega tau)) th = 0``
is written with few harmonics, and those that are not resonant are eliminated, their damping left
out: the methods of Struble, of averaging and of multiple scales agree to this order. First tongue,
about ``omega = 2``, ``a = 1 - omega^2/4``, ``c = gamma omega/2``: the third harmonic adds
``k p^2``, ``k = 1/(9 omega^2 - 4)``, to ``a`` in ``a^2 + c^2 = p^2/4``. Second tongue, about
``omega = 1``, ``a = 1 - omega^2``, ``c = gamma omega``: the constant takes ``p^2/2`` off the
stiffness of the cosine, the second harmonic adds ``s p^2``, ``s = 1/(4 (4 omega^2 - 1))``, to both:
``(a - (1/2 - s) p^2)(a + s p^2) + c^2 = 0``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis import curves, grid, result, varied
from pendmap.analysis.result import Field, Found, Schema, summarised
from pendmap.analysis.run import Numerics, RunOptions
from pendmap.errors import check_number, core_errors
from pendmap.files import facts
from pendmap.files.variables import NO_YES, flag, variable
from pendmap.formatting import counted, listed
from pendmap.model import without_dimensions
from pendmap.units import RATE

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from pendmap.analysis.run import Keywords
    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats

OMEGA = (0.5, 3.0, 200)  # Default frequencies
_OF_P = "1", "amplitude of the drive over gravity"  # Unit and meaning of p
_STABLE = {0: "unstable", 1: "stable"}  # Meanings of a flag


def _curves(dataset: xr.Dataset, *, inverted: bool) -> list[dict[str, Any]]:
    """Return the critical amplitudes of a rest at each frequency for the JSON object."""
    mine = dataset["critical_inverted"].values == inverted
    names = ("index", "p", "multiplier", "stable_above")
    index, *columns = (dataset[f"critical_{name}"].values[mine] for name in names)
    columns[-1] = columns[-1].astype(bool)
    return [
        {
            "omega": omega,
            **{n: x[index == k].tolist() for n, x in zip(names[1:], columns, strict=True)},
        }
        for k, omega in enumerate(dataset["omega"].values.tolist())
    ]


def _asymptotic(dataset: xr.Dataset) -> dict[str, list[float]]:
    """Return the asymptotic curves by name for the JSON object."""
    rows = zip(dataset["formula"].values, dataset["asymptotic"].values, strict=True)
    return {str(name): p.tolist() for name, p in rows}


SCHEMA = Schema(
    "tongues",
    result.UNITS,
    Field(
        "curves",
        "1",
        "critical amplitudes of hanging rest",
        read=lambda d: _curves(d, inverted=False),
    ),
    Field("inverted", "", "the same of inverted rest", read=lambda d: _curves(d, inverted=True)),
    Field("asymptotic", "1", "critical amplitudes by perturbation", read=_asymptotic),
    Field("p_max", "1", "largest amplitude that was looked at"),
    *result.TIMED,
    *result.END,
    Found("moved", result.FLAG, "whether a torque makes an orbit of rest", json=False),
    Found("inverted_rest", result.FLAG, "whether upright is a rest", json=False),
    *result.OWN,
    *result.VERSIONS,
)


def tongues(
    pendulum: Pendulum | Rig,
    omega: ArrayLike | None = None,
    p_max: float = 6.0,
    *,
    run: RunOptions | None = None,
    **options: Unpack[Keywords],
) -> xr.Dataset:
    """Compute the critical curves of rest, exact, with folds and asymptotic curves.

    Hanging rest obeys ``th'' + gamma th' + (1 + p cos(omega tau)) th = 0`` (eq. 1.3 with damping);
    inverted rest the same with ``-(1 + p cos(omega tau))``. Its stability changes where a Floquet
    multiplier passes +1 or -1: events on the branch of rest over ``p``, symmetry breakings and
    period doublings of :func:`pendmap.continuation`. The curves through them are followed, with
    the points at which they change between super- and subcritical and the folds that begin there:
    between fold and curve an oscillation (eq. 1.5) coexists with a stable rest. A figure has the
    plane of eq. 1.2, its layer ``e-alpha2`` that of eq. 1.4, ``(p/omega^2, 1/omega^2)``.

    A constant torque turns rest into an orbit of the drive's period, with folds at +1.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; its own ``p``, ``omega`` and phase do not matter. Rest must be a solution.
    omega : array_like, optional
        Frequencies ``Omega/w0`` in ascending order, by default 200 from 0.5 to 3.
    p_max : float
        Largest amplitude, up to 50,000 times the square of the lowest frequency.
    run : RunOptions, optional
        As for :func:`pendmap.basins`.

    Returns
    -------
    xarray.Dataset
        Over ``critical``, a critical amplitude each: ``critical_p``, ``critical_omega``,
        ``critical_index`` of its frequency, ``critical_multiplier`` (1 or -1),
        ``critical_stable_above`` (whether rest is stable right above), ``critical_inverted``
        (whether it is inverted rest; ``inverted_rest`` is 0 where upright is no rest). Over
        ``omega``: ``stable_at_first`` (hanging rest below the first). Over ``formula`` and
        ``omega``: ``asymptotic``. Of two frequencies or more, the curves as those in the plane of
        :func:`pendmap.continuation`; not of a rest whose linear equation is none (an asymmetric
        damping), or that has no mirror symmetry. ``moved`` is 1 under a torque.

    Raises
    ------
    InputError
        If a value is outside its range; if the model has friction, which holds rest whatever the
        drive, or a load that is no constant torque, which moves it.

    Examples
    --------
    >>> import pendmap
    >>> result = pendmap.tongues(pendmap.Pendulum(gamma=0.1), omega=[1.9, 2.0, 2.1])
    >>> round(float(result.critical_p[result.critical_inverted == 0].min()), 3)
    0.2
    """
    bare, units = without_dimensions(pendulum)
    omega = grid.frequencies(np.linspace(*OMEGA) if omega is None else omega)
    p_max, run = check_number("p_max", p_max), RunOptions.of(run, options).in_memory("tongues")
    numerics = Numerics(run)
    with core_errors():
        raw = _core.tongues(bare, omega.tolist(), p_max, run.workers, run.progress)
    with np.errstate(divide="ignore", invalid="ignore"):
        by_perturbation = np.array([formula(omega, bare.gamma) for _, formula in CURVES.values()])
    # An expansion in p.
    by_perturbation[(by_perturbation > min(1.0, p_max)) | (bare.torque != 0)] = np.nan
    variables: dict[str, Any] = {
        "critical_p": variable("critical", raw.p, *_OF_P),
        "critical_omega": variable("critical", omega[raw.index], "1", "Omega/w0"),
        "critical_index": variable("critical", raw.index, "1", "place of its frequency in omega"),
        "critical_multiplier": variable(
            "critical", raw.multiplier.astype(np.int8), "1", "Floquet multiplier"
        ),
        "critical_stable_above": flag("critical", raw.above, "rest right above it", _STABLE),
        "critical_inverted": flag("critical", raw.inverted, "whether inverted rest", NO_YES),
        "stable_at_first": flag("omega", [a for a, _ in raw.first], "hanging rest below", _STABLE),
        "asymptotic": variable(("formula", "omega"), by_perturbation, *_OF_P),
    }
    coords: dict[str, Any] = {
        "omega": variable("omega", omega, "1", "Omega/w0"),
        "formula": variable("formula", np.array([*CURVES]), "", "by perturbation"),
    }
    if units.si:
        given = units.given(omega, RATE)
        coords["Omega"] = variable("omega", given, "rad/s", "angular frequency of the drive")
    dataset = xr.Dataset(variables, coords=coords)
    if raw.curves is not None:
        ranges = {"p": (0.0, p_max, 2), "omega": (omega[0], omega[-1], 2)}
        axes = varied.varied(bare, ranges, 2)
        dataset = dataset.assign(curves.variables(raw.curves, axes, units))
    values = {
        **numerics.provenance(),
        "p_max": p_max,
        "moved": int(bare.torque != 0),
        "inverted_rest": int(raw.upright),
        "own_p": bare.p,
        "own_omega": bare.omega,
    }
    SCHEMA.complete(dataset, pendulum, values)
    dataset.attrs["title"] = varied.title_without(pendulum, "p", "omega", "phase")
    summarised(dataset, _summary(dataset), pendulum, "curves are")
    return dataset


def _summary(dataset: xr.Dataset) -> list[str]:
    a, omega = facts(dataset), dataset["omega"].values
    names = ("inverted", "p", "omega", "stable_above")
    every = list(result.rows(dataset, *(f"critical_{name}" for name in names)))
    rest = "the orbit about {} rest" if a["moved"] else "{} rest"
    hanging, inverted = (rest.format(which) for which in ("hanging", "inverted"))
    lost = [(p, f"omega = {at:.6g}: p = {p:.9g}") for up, p, at, _ in every if not up]
    number = counted(len(lost), "critical amplitude")
    where = f"{counted(omega.size, 'value')} of omega from {omega[0]:g} to {omega[-1]:g}"
    lines = [f"{number} up to p = {a['p_max']:g} at {where}."]
    never = omega[dataset["stable_at_first"].values == 0]
    if never.size:
        at = listed([f"{value:.6g}" for value in never], 3)
        lines.append(f"{hanging.capitalize()} is unstable from p = 0 on at omega = {at}.")
    elif lost:
        soonest = f"soonest at {min(lost)[1]}"
        lines.append(f"Of these frequencies {hanging} loses its stability {soonest}.")
    lines += curves.degenerate_lines(dataset, ("p", "omega"))
    gained = [(p, f"p = {p:.9g} on at omega = {at:.6g}") for up, p, at, yes in every if up and yes]
    if a["inverted_rest"]:
        lowest = f"from {min(gained)[1]}, the lowest" if gained else "nowhere there"
        lines.append(f"{inverted.capitalize()} is stable {lowest}.")
    return [*lines, f"{a['seconds']:.2f} s on {counted(a['threads'], 'thread')}."]


def first_tongue(omega: Floats, gamma: float) -> Floats:
    """Return critical ``p`` of the first tongue to second order; nan if there is none."""
    a, c, k = 1 - omega**2 / 4, gamma * omega / 2, 1 / (9 * omega**2 - 4)
    # k^2 P^2 + (2 a k - 1/4) P + a^2 + c^2 = 0 in P = p^2: the root that is finite for k = 0.
    half, last = 1 / 8 - a * k, a**2 + c**2
    p = np.sqrt(last / (half + np.sqrt(half**2 - k**2 * last)))
    # Left of 2/3 the third harmonic is resonant before the first.
    return np.where((omega > 1.0) & np.isfinite(p), p, np.nan)


def second_tongue(omega: Floats, gamma: float) -> Floats:
    """Return critical ``p`` of the second tongue to second order; nan if there is none."""
    a, c, s = 1 - omega**2, gamma * omega, 1 / (4 * (4 * omega**2 - 1))
    # s (1/2 - s) P^2 + a (1/2 - 2 s) P - (a^2 + c^2) = 0.
    leading, half = s * (0.5 - s), a * (0.25 - s)
    p = np.sqrt((np.sqrt(half**2 + leading * (a**2 + c**2)) - half) / leading)
    # Left of 1/sqrt(2) the second harmonic is nearly resonant itself.
    return np.where((omega > np.sqrt(0.5)) & np.isfinite(p), p, np.nan)


CURVES: dict[str, tuple[int, Callable[[Floats, float], Floats]]] = {
    "tongue 1, second order": (-1, first_tongue),
    "tongue 2, second order": (1, second_tongue),
}
"""Name of each curve, the multiplier on it, and its formula."""
