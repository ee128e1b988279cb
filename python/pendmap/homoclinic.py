"""Melnikov's criterion: where stable and unstable manifolds of the upright rest first touch."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from pendmap import _core, grid
from pendmap.errors import InputError
from pendmap.model import without_dimensions
from pendmap.store import FORMAT_VERSION
from pendmap.summary import of_motion

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from pendmap.model import Pendulum, Rig

    Floats = NDArray[np.float64]

__all__ = ["melnikov"]

_REACH, _SPACING = 42.0, 0.2
"""Times along the separatrix: the trapezoidal rule on an analytic integrand without ends errs by
``exp(-pi^2/spacing)``; friction's integrand falls as ``exp(-|t|)`` alone."""

_PHASES, _FINE = 32, 4096
"""Phases of the drive at which its work is computed, and to which its Fourier series goes on."""

_RANGE = (0.2, 4.0, 191)
"""Frequencies of the curve in the figure, where none are given."""

_ROUNDING = 1e-13
"""A threshold below this is that of a motion that loses nothing."""
_LINEAR = 1e-9


def melnikov(pendulum: Pendulum | Rig, omega: ArrayLike | None = None) -> xr.Dataset:
    """Return the amplitude of the drive at which homoclinic tangles begin, to first order.

    Along the separatrix ``th = 2 atan(sinh t)``, ``th' = 2/cosh t`` of ``th'' + sin th = 0``, and
    its mirror image, all that the model has besides gravity does the work

    ``M(t0) = W + p D(t0)``,

    ``W`` that of damping, friction, torque and effects, ``p D`` that of a drive with phase ``t0``.
    Manifolds of the upright rest cross where ``M`` has simple zeros: for ``p`` above
    ``-W / max D``. With viscous damping, Coulomb friction and a torque, forward (+) and backward
    (-),

    ``p = (4 gamma + pi theta_r -/+ pi torque) sinh(pi omega/2) / (pi omega^2)``.

    Both integrals are computed from the model's own acceleration, so that effects count too. The
    true tangency differs at the second order in damping.

    Parameters
    ----------
    pendulum : Pendulum or Rig
        The model; its ``omega`` is where the threshold is asked for.
    omega : array_like, optional
        Frequencies ``Omega/w0`` of the curve, by default 191 from 0.2 to 4.

    Returns
    -------
    xarray.Dataset
        ``p_melnikov`` over ``omega`` and ``branch`` (forward, backward); nan where a torque keeps
        up the rotation on that branch, so that no drive is needed. The attributes
        ``p_melnikov``, ``p_forward`` and ``p_backward`` hold the values at the model's own
        frequency, ``p_tangency`` is nan: to be computed by following manifolds.

    Raises
    ------
    InputError
        If a value is outside its range, an effect cannot be in a map, or the work of the drive is
        not proportional to ``p``.

    References
    ----------
    Guckenheimer & Holmes (1983), Nonlinear Oscillations, section 4.5; Koch & Leven (1985), Physica
    D 16, 1 for the parametrically excited pendulum.
    """
    model = pendulum
    pendulum, _ = without_dimensions(model)
    if omega is None:
        omega = np.linspace(*_RANGE)
    frequencies = grid.frequencies(omega)
    try:
        own = _thresholds(pendulum, pendulum.omega)
        curve = np.array([_thresholds(pendulum, float(w)) for w in frequencies])
    except ValueError as error:
        raise InputError(str(error)) from None
    first = float(np.nanmin(own)) if np.isfinite(own).any() else math.nan
    dataset = xr.Dataset(
        {
            "p_melnikov": (
                ("omega", "branch"),
                curve,
                {"units": "1", "long_name": "amplitude of the drive over gravity"},
            )
        },
        coords={
            "omega": ("omega", frequencies, {"units": "1", "long_name": "Omega/w0"}),
            "branch": ("branch", np.array(["forward", "backward"])),
        },
    )
    dataset.attrs = {
        "kind": "melnikov",
        "title": model.title,
        **model.attributes,
        "own_p": pendulum.p,
        "own_omega": pendulum.omega,
        "p_melnikov": first,
        "p_forward": float(own[0]),
        "p_backward": float(own[1]),
        "p_tangency": math.nan,
        "pendmap_version": _core.__version__,
        "format_version": FORMAT_VERSION,
    }
    lines = [*_summary(pendulum, own), *of_motion(model.effects, "the threshold is")]
    dataset.attrs["summary"] = "\n".join(lines)
    return dataset


def _thresholds(pendulum: Pendulum, omega: float) -> Floats:
    """Return the threshold of the forward and of the backward branch at one frequency."""
    driven = [dataclasses.replace(pendulum, p=p, omega=omega) for p in (1.0, 2.0)]
    still = dataclasses.replace(pendulum, p=0.0, omega=omega)
    t = np.arange(-_REACH, _REACH + _SPACING / 2, _SPACING)
    theta, speed = 2 * np.arctan(np.sinh(t)), 2 / np.cosh(t)
    period = driven[0].period
    found = []
    for sense in (1.0, -1.0):
        way = (sense * theta, sense * speed)

        def power(of: Pendulum, at: float, way: tuple[Floats, Floats] = way) -> Floats:
            """The power of everything but gravity, integrated."""
            acceleration = _core.acceleration(of.parameters, t + at, *way)
            return way[1] * (acceleration + np.sin(way[0]))

        lost = _SPACING * float(power(still, 0.0).sum())
        starts = period * np.arange(_PHASES) / _PHASES
        work, twice = (
            np.array([_SPACING * float(power(one, at).sum()) - lost for at in starts])
            for one in driven
        )
        if np.abs(twice - 2 * work).max() > _LINEAR * np.abs(twice).max():
            raise InputError(
                "effects: the work of the drive along the separatrix is not proportional to p; "
                "Melnikov's criterion to first order needs that"
            )
        found.append(_threshold(lost, work))
    return np.array(found)


def _threshold(lost: float, work: Floats) -> float:
    """Return the ``p`` at which ``lost + p work`` first has a zero for some phase."""
    if lost > 0:
        return math.nan
    terms = np.fft.rfft(work)
    dense = np.fft.irfft(terms, _FINE) * (_FINE / work.size)
    k = int(np.argmax(dense))
    before, top, after = dense[k - 1], dense[k], dense[(k + 1) % _FINE]
    bend = before - 2 * top + after
    greatest = top - (after - before) ** 2 / (8 * bend) if bend else top
    if greatest <= 0:
        return math.nan
    found = -lost / float(greatest)
    return found if found > _ROUNDING else 0.0


def _summary(pendulum: Pendulum, own: Floats) -> list[str]:
    at = f"at omega = {pendulum.omega:g}"
    lines = []
    if np.isfinite(own).all() and abs(own[0] - own[1]) <= _LINEAR * abs(own[0]):
        lines.append(f"Homoclinic tangles from p = {own[0]:.9g} on, {at} (Melnikov, first order).")
    else:
        for value, name in zip(own, ("forward", "backward"), strict=True):
            lines.append(
                f"Homoclinic tangles {name} from p = {value:.9g} on, {at} (Melnikov, first order)."
                if math.isfinite(value)
                else f"The torque keeps up the rotation {name}: that branch has no threshold."
            )
    if not np.nanmax(own, initial=0.0):
        return [*lines, "Without damping nothing attracts, and there are no basins."]
    if np.isfinite(own).any() and pendulum.p and np.nanmin(own) > 0:
        ratio = abs(pendulum.p) / float(np.nanmin(own))
        side = "above" if ratio > 1 else "below"
        lines.append(f"The pendulum's own p = {pendulum.p:g} lies {side}: {ratio:.3g} of it.")
    lines.append("Tangles make boundaries of basins fractal; chaos that lasts needs more.")
    return lines
