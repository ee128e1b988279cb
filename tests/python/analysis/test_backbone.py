"""Motions without losses against elliptic integrals and runs of scipy."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import pendmap
from pendmap import Effect, Formula, InputError, Pendulum, Rig

if TYPE_CHECKING:
    import xarray as xr

DRAG = Effect("quadratic_drag", {"q": 0.1})
LOSSY = Pendulum(gamma=0.2, p=1.3, theta_r=0.1, effects=(DRAG,))
EVEN = Formula("even", "k*v^2*sin(theta)", {"k": 0})
REST = math.asin(0.3)


def family(result: xr.Dataset, kind: str, *names: str) -> list[np.ndarray]:
    """Return columns of the one family of a kind."""
    (number,) = np.flatnonzero(result.family_kind.values == kind)
    mine = result.motion_family.values == number
    return [result[f"motion_{name}"].values[mine] for name in names]


def test_periods_are_those_of_elliptic_integrals() -> None:
    result = pendmap.backbone(LOSSY)
    amplitude, period, energy = family(result, "oscillation", "amplitude", "period", "energy")
    np.testing.assert_allclose(period, 4 * ellipk(np.sin(amplitude / 2) ** 2), rtol=1e-12)
    np.testing.assert_allclose(energy, 1 - np.cos(amplitude), rtol=1e-12)
    energy, period = family(result, "rotation", "energy", "period")
    m = 2 / energy
    np.testing.assert_allclose(period, 2 * np.sqrt(m) * ellipk(m), rtol=1e-11)


def test_a_torque_tilts_the_swing_and_leaves_no_rotation_that_closes() -> None:
    result = pendmap.backbone(Pendulum(torque=0.3), count=4)
    assert result.family_kind.values.tolist() == ["oscillation"]
    assert float(result.family_theta[0]) == pytest.approx(REST, abs=1e-14)

    def rates(_: float, y: np.ndarray) -> list[float]:
        return [y[1], 0.3 - math.sin(y[0])]

    def back(_: float, y: np.ndarray) -> float:
        return float(y[0] - REST)

    speed, period = family(result, "oscillation", "velocity", "period")
    for v, expected in zip(speed, period, strict=True):
        run = solve_ivp(rates, (0, 20), [REST, v], "DOP853", rtol=1e-12, atol=1e-12, events=back)
        times = [t for t in run.t_events[0] if t > 1e-3]
        assert times[1] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"effects": (EVEN(k=0.1),)}, "odd in the velocity, or forces of the angle alone"),
        ({"torque": 1.2}, "no rest"),
    ],
)
def test_what_has_no_backbone_is_refused(changed: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        pendmap.backbone(Pendulum(**changed))


def test_energies_of_rotations_are_above_the_top() -> None:
    with pytest.raises(InputError, match=r"energy_max must be above 2, .*, got 1\.5"):
        pendmap.backbone(Pendulum(), energy_max=1.5)


def test_a_rig_has_times_in_seconds() -> None:
    result = pendmap.backbone(Rig(w0=4.0), count=5)
    period, rate = family(result, "oscillation", "period", "rate")
    np.testing.assert_allclose(period * rate, 2 * math.pi)
    assert rate[0] == pytest.approx(4.0, rel=1e-2)


def test_resonance_curves_lie_around_the_backbone() -> None:
    pendulum = Pendulum(gamma=0.02, p=0.1)
    result = pendmap.continuation(pendulum, {"omega": (1.5, 1.9)}, n=2, w=0, longest=2)
    rate, free = (result[f"backbone_{name}"].values[::-1] for name in ("value", "amplitude"))
    away = result.orbit_amplitude.values - np.interp(result.orbit_value.values / 2, rate, free)
    assert set(result.orbit_swings.values.tolist()) == {1}
    assert away[result.orbit_stable.values == 1].min() > 0.05
    assert away[result.orbit_stable.values == 0].max() < -0.05
    assert np.abs(away).max() < 0.6
