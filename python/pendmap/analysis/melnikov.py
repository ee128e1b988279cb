"""Melnikov's criterion: where stable and unstable manifolds of the upright rest first touch."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.polynomial import legendre

from pendmap import _core
from pendmap.analysis import grid, result
from pendmap.analysis.result import Found, Schema, summarised
from pendmap.analysis.run import Numerics
from pendmap.errors import InputError, core_errors
from pendmap.files.variables import variable
from pendmap.model import without_dimensions

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats


_PHASES, _FINE = 64, 4096
"""Numbers of drive phases at which the work is computed, enough for its harmonics up to the 31st,
and at which its Fourier series is evaluated."""
_FASTEST = 14.0
"""Largest ratio of drive frequency to the orbit's rate at upright rest: above it the work is less
than ``exp(-pi/2 14)`` of the power, which is rounding."""
_RANGE = (0.2, 4.0, 191)  # Default frequencies of the curve: first, last, number
_ROUNDING = 1e-13  # Work, and torque, up to which they are taken as 0
_LINEAR = 1e-9  # Relative deviation above which the drive's work is not proportional to p
_RESOLVED = 1e-9  # Work over the drive's absolute power above which it is not rounding
_REACH, _SPACING = 42.0, 0.1
"""Largest time along the separatrix, and step: the trapezoidal rule has the error
``exp(-pi^2/spacing)`` for analytic integrands; friction's integrand falls only as ``exp(-|t|)``."""
_NODES = 16  # Number of Gauss nodes on a panel of the loop
_HALVED, _WIDTH, _END = 12, 0.5, 20.0
"""Panels of the loop's parameter: halvings toward the turning point, near which a small torque
leaves the other upright rest; width of further panels; end, where the angle is rounding."""


SCHEMA = Schema(
    "melnikov",
    result.UNITS,
    Found("p_melnikov", "1", "threshold at the model's frequency", variable="own_p_melnikov"),
    Found("p_tangency", "1", "amplitude of the tangency itself; not computed"),
    Found("p_forward", "1", "threshold on the separatrix, forward"),
    Found("p_backward", "1", "threshold on the separatrix, backward"),
    Found("p_loop", "1", "threshold on the loop that a torque makes"),
    result.SIMD,
    *result.END,
    *result.OWN,
    *result.VERSIONS,
    references="Koch & Leven (1985), Physica D 16, 1",
)


def melnikov(pendulum: Pendulum | Rig, omega: ArrayLike | None = None) -> xr.Dataset:
    """Return the amplitude of the drive at which homoclinic tangles begin, to first order.

    Along an orbit of the pendulum without losses that leaves upright rest and comes back to it, all
    other terms of the model do the work

    ``M(t0) = W + p D(t0)``,

    ``W`` that of damping, friction and effects, ``p D`` that of a drive with phase ``t0``.
    Manifolds of upright rest cross where ``M`` has simple zeros: for ``p`` above ``|W| / max D``.

    *Without a torque* the orbits are the separatrix ``th = 2 atan(sinh t)``, ``th' = 2/cosh t`` of
    ``th'' + sin th = 0`` and its mirror image, forward (+) and backward (-). A torque weaker than
    the losses is a perturbation like them. With viscous damping and Coulomb friction

    ``p = |4 gamma + pi theta_r -/+ pi torque| sinh(pi omega/2) / (pi omega^2)``.

    *A torque that keeps up a rotation*, as it gives more in a turn than the losses take, belongs to
    the pendulum without losses: in the tilted potential the orbit is the loop from upright rest
    ``pi - asin(torque)`` into the well and back. At the amplitude of the formula above manifolds of
    neighbouring upright rests cross then (heteroclinic), to first order in the torque.

    All integrals are computed from the model's own acceleration, so that effects are included. The
    true tangency differs at the second order in damping.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; variables without dimensions give the threshold at its ``omega``.
    omega : array_like, optional
        Frequencies ``Omega/w0`` of the curve, by default 191 from 0.2 to 4.

    Returns
    -------
    xarray.Dataset
        ``p_melnikov`` over ``omega`` and ``branch`` (forward, backward, before them loop where the
        torque keeps up a rotation); nan where the drive's work is not above rounding. Without
        dimensions are the values at the model's own frequency: ``p_forward``, ``p_backward``,
        ``p_loop`` (nan without a torque) and ``own_p_melnikov``, that of the loop where the torque
        keeps up a rotation, else the lower of the others. ``p_tangency`` is nan.

    Raises
    ------
    InputError
        If a value is outside its range, an effect cannot be in a map, the work of the drive is not
        proportional to ``p``, or a torque of 1 or more leaves no rest.

    References
    ----------
    Guckenheimer & Holmes (1983), Nonlinear Oscillations, section 4.5; Koch & Leven (1985), Physica
    D 16, 1 for the parametrically excited pendulum.

    Examples
    --------
    >>> import pendmap
    >>> result = pendmap.melnikov(pendmap.Pendulum(gamma=0.1, p=1.0, omega=2.0))
    >>> round(float(result["own_p_melnikov"]), 6)
    0.367608
    """
    bare, _ = without_dimensions(pendulum)
    if bare.counts_turns:
        raise InputError(
            "effects: an effect counts turns: no orbit leads from one upright position to the next"
        )
    frequencies = grid.frequencies(np.linspace(*_RANGE) if omega is None else omega)
    none = np.zeros(0)
    with core_errors():
        _core.advance(bare, none, none, 0, 1, 1)  # refuses effects that no map has
        orbits, sense = _orbits(bare)
        at = {name: _threshold(bare, bare.omega, orbit) for name, orbit in orbits.items()}
        if not sense:
            orbits.pop("loop", None)
        every = orbits.values()
        curve = [[_threshold(bare, float(w), orbit) for orbit in every] for w in frequencies]
    known = [at[name] for name in orbits if math.isfinite(at[name])]
    first = at["loop"] if sense else min(known, default=math.nan)
    texts = ("1", "amplitude of the drive over gravity")
    dataset = xr.Dataset(
        {"p_melnikov": variable(("omega", "branch"), np.array(curve), *texts)},
        coords={
            "omega": variable("omega", frequencies, "1", "Omega/w0"),
            "branch": variable("branch", np.array(list(orbits)), long_name="orbit of upright rest"),
        },
    )
    values = {
        **Numerics().provenance(),
        "own_p": bare.p,
        "own_omega": bare.omega,
        "p_melnikov": first,
        "p_forward": at["forward"],
        "p_backward": at["backward"],
        "p_loop": at.get("loop", math.nan),
        "p_tangency": math.nan,
    }
    SCHEMA.complete(dataset, pendulum, values)
    summarised(dataset, _summary(bare, at, first, sense), pendulum, "the threshold is")
    return dataset


def _orbits(pendulum: Pendulum) -> tuple[dict[str, Orbit], str]:
    """Return the orbits by name, and the sense of the rotation that a torque keeps up, or none."""
    still = dataclasses.replace(pendulum, p=0.0)
    forward = separatrix()
    orbits = {"forward": forward, "backward": forward.mirrored()}
    once = np.zeros(1)
    won = {name: float(_power(still, one, once)[0] @ one.weight) for name, one in orbits.items()}
    # The work of a torque is 2 pi times the torque on one branch, its negative on the other.
    torque = (won["forward"] - won["backward"]) / (4 * math.pi)
    if abs(torque) >= 1 - _ROUNDING:
        raise InputError(
            f"torque must be above -1 and below 1 for Melnikov's criterion, got {torque:.6g}: "
            "a larger one leaves no upright rest"
        )
    if abs(torque) <= _ROUNDING:
        return orbits, ""
    sense = max(won, key=lambda name: won[name])
    return {"loop": loop(torque), **orbits}, sense if won[sense] > _ROUNDING else ""


def _power(pendulum: Pendulum, orbit: Orbit, at: Floats) -> Floats:
    """Return the power of all terms that the orbit's equation lacks, one row for each phase."""
    theta, speed = (np.tile(column, at.size) for column in (orbit.theta, orbit.speed))
    tau = (orbit.time + at[:, None]).ravel()
    acceleration = _core.acceleration(pendulum, tau, theta, speed)
    return (speed * (acceleration + np.sin(theta) - orbit.torque)).reshape(at.size, -1)


def _threshold(pendulum: Pendulum, omega: float, orbit: Orbit) -> float:
    """Return the ``p`` at which ``W + p D`` first has a zero for some phase; nan if unresolved."""
    amplitudes = 0.0, 1.0, 2.0
    still, driven, twice = (dataclasses.replace(pendulum, p=p, omega=omega) for p in amplitudes)
    starts = driven.period * np.arange(_PHASES) / _PHASES
    passive = _power(still, orbit, np.zeros(1))
    power = _power(driven, orbit, starts) - passive
    won, work = float((passive @ orbit.weight)[0]), power @ orbit.weight
    scale = float((np.abs(power) @ orbit.weight).max())
    again = _power(twice, orbit, starts[:2]) @ orbit.weight - won
    if np.abs(again - 2 * work[:2]).max() > _LINEAR * scale:
        raise InputError(
            "effects: the work of the drive along the separatrix is not proportional to p; "
            "Melnikov's criterion to first order needs that"
        )
    if abs(won) <= _ROUNDING:
        return 0.0
    if omega > _FASTEST * orbit.rate:
        return math.nan
    greatest = _greatest(-math.copysign(1.0, won) * work)
    return abs(won) / greatest if greatest > _RESOLVED * scale else math.nan


def _greatest(work: Floats) -> float:
    """Return the greatest value of a function given at evenly spaced phases."""
    dense = np.fft.irfft(np.fft.rfft(work), _FINE) * (_FINE / work.size)
    k = int(np.argmax(dense))
    before, top, after = dense[k - 1], dense[k], dense[(k + 1) % _FINE]
    bend = before - 2 * top + after
    return float(top - (after - before) ** 2 / (8 * bend) if bend else top)


def _summary(
    pendulum: Pendulum, thresholds: dict[str, float], first: float, sense: str
) -> list[str]:
    where = f"at omega = {pendulum.omega:g}"
    lines = []
    if sense:
        lines.append(
            f"The torque sustains the rotation {sense} and is included in the potential: the "
            "threshold is that of the loop (homoclinic); on the others manifolds of neighbouring "
            "upright rests cross (heteroclinic)."
        )
    elif "loop" in thresholds:
        lines.append("The torque does not exceed the losses of a turn: both are perturbations.")
    names: dict[str, list[str]] = {}
    for name, p in thresholds.items():
        names.setdefault(f"{p:.9g}" if math.isfinite(p) else "", []).append(name)
    for text, alike in names.items():
        what = f"{where} ({' and '.join(alike)})"
        if text:
            lines.append(f"Manifolds cross from p = {text} on, {what}: Melnikov, first order.")
        else:
            lines.append(f"No threshold {what}: the drive's work is below rounding errors.")
    if thresholds.get("loop", first) == 0:
        return [*lines, "Without damping there are no attractors and no basins."]
    if first > 0 and pendulum.p:
        ratio = abs(pendulum.p) / first
        side = "above" if ratio > 1 else "below"
        lines.append(
            f"The pendulum's own p = {pendulum.p:g} is {side} p_melnikov: {ratio:.3g} times it."
        )
    lines.append("Tangles make basin boundaries fractal; they do not imply a chaotic attractor.")
    return lines


@dataclass(frozen=True)
class Orbit:
    """Points along an orbit of ``th'' + sin th = torque``, with quadrature weights in time."""

    time: Floats
    theta: Floats
    speed: Floats
    weight: Floats
    torque: float = 0.0
    rate: float = 1.0  # of growth of deviations from upright rest

    def mirrored(self) -> Orbit:
        """Return the image under ``th -> -th``, an orbit of the opposite torque."""
        return Orbit(self.time, -self.theta, -self.speed, self.weight, -self.torque, self.rate)


def separatrix() -> Orbit:
    """Return the orbit ``th = 2 atan(sinh t)`` from one upright rest forward to the next."""
    t = np.arange(-_REACH, _REACH + _SPACING / 2, _SPACING)
    return Orbit(t, 2 * np.arctan(np.sinh(t)), 2 / np.cosh(t), np.full_like(t, _SPACING))


def loop(torque: float) -> Orbit:
    """Return the orbit that leaves upright rest ``pi - asin(torque)`` and comes back to it.

    At a distance ``u`` from there ``th'^2 / 2 = G(u) = c (1 - cos u) - torque (u - sin u)``, ``c =
    sqrt(1 - torque^2)``, up to its zero ``u_t``, where the orbit turns. With ``u = u_t /
    cosh(y)^2`` time is ``dt / dy = 2 / sqrt(2 h)``, ``h = G / (u tanh y)^2``, which is smooth and
    positive from the turning point, ``y = 0``, on to upright rest.
    """
    if torque < 0:
        return loop(-torque).mirrored()
    c = math.sqrt((1 - torque) * (1 + torque))
    turn = _turning_point(torque, c)
    ends = np.concatenate(
        [[0.0], 0.5 ** np.arange(_HALVED, 1, -1), np.arange(_WIDTH, _END + _WIDTH / 2, _WIDTH)]
    )
    x, weight = legendre.leggauss(_NODES)
    half = np.diff(ends)[:, None] / 2
    y = ends[:-1, None] + half * (1 + x)
    u, beyond = turn / np.cosh(y) ** 2, turn * np.tanh(y) ** 2
    # G is expanded about its nearer zero, u = 0 or the turning point.
    middle = turn - beyond / 2
    from_rest = 2 * c * np.sin(u / 2) ** 2 - torque * _less_sine(u)
    from_turn = torque * (
        2 * _less_sine(beyond / 2) + 4 * np.sin(beyond / 2) * np.sin(middle / 2) ** 2
    ) - 2 * c * np.sin(beyond / 2) * np.sin(middle)
    energy = np.where(u < beyond, from_rest, from_turn)
    rate = 2 * u * np.tanh(y) / np.sqrt(2 * energy)
    whole = (half * rate) @ weight
    time = (np.cumsum(whole) - whole)[:, None] + half * rate @ _integrals(x).T
    time, theta = time.ravel(), (math.atan2(torque, -c) - u).ravel()
    speed, weights = np.sqrt(2 * energy).ravel(), (half * rate * weight).ravel()
    return Orbit(
        np.concatenate([-time, time]),
        np.tile(theta, 2),
        np.concatenate([-speed, speed]),
        np.tile(weights, 2),
        torque,
        math.sqrt(c),
    )


def _turning_point(torque: float, c: float) -> float:
    """Return the distance from upright rest at which the loop turns."""
    from scipy.optimize import brentq  # noqa: PLC0415 (heavy; only a torque needs it)

    def energy(u: float) -> float:
        return 2 * c * math.sin(u / 2) ** 2 - torque * float(_less_sine(np.array(u)))

    # Beyond the bottom of the well, where G is greatest, it falls.
    return float(brentq(energy, 2 * math.atan2(c, torque), math.tau, xtol=1e-300))


def _less_sine(x: Floats) -> Floats:
    """Return ``x - sin x`` without loss of digits where ``x`` is small."""
    square = x * x
    series = x * square / 6 * (1 - square / 20 * (1 - square / 42 * (1 - square / 72)))
    return np.where(x < 0.1, series, x - np.sin(x))  # noqa: PLR2004 (the series errs by 1e-15)


def _integrals(x: Floats) -> Floats:
    """Return the matrix from values at Gauss nodes to integrals from -1 to each node."""
    p = legendre.legvander(x, x.size)
    k = np.arange(1, x.size)
    of_each = np.concatenate([p[:, :1] + p[:, 1:2], (p[:, 2:] - p[:, :-2]) / (2 * k + 1)], axis=1)
    return np.asarray(of_each @ np.linalg.inv(p[:, :-1]))
