"""Motions without losses against elliptic integrals and runs of scipy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import pendmap


def family(result, kind, *names):
    """Return columns of the one family of a kind."""
    (number,) = np.flatnonzero(result.family_kind.values == kind)
    mine = result.motion_family.values == number
    return [result[f"motion_{name}"].values[mine] for name in names]


def test_periods_are_those_of_elliptic_integrals():
    result = pendmap.backbone(pendmap.Pendulum(gamma=0.2, p=1.3, theta_r=0.1))
    amplitude, period, energy = family(result, "oscillation", "amplitude", "period", "energy")
    np.testing.assert_allclose(period, 4 * ellipk(np.sin(amplitude / 2) ** 2), rtol=1e-12)
    np.testing.assert_allclose(energy, 1 - np.cos(amplitude), rtol=1e-12)
    energy, period = family(result, "rotation", "energy", "period")
    m = 2 / energy
    np.testing.assert_allclose(period, 2 * np.sqrt(m) * ellipk(m), rtol=1e-11)


def test_a_torque_tilts_the_swing_and_leaves_no_rotation_that_closes():
    result = pendmap.backbone(pendmap.Pendulum(torque=0.3), count=4)
    assert result.family_kind.values.tolist() == ["oscillation"]
    rest = math.asin(0.3)
    assert float(result.family_theta[0]) == pytest.approx(rest, abs=1e-14)
    speed, period = family(result, "oscillation", "velocity", "period")

    def back(_, y):
        return y[0] - rest

    back.direction = 1
    for v, expected in zip(speed, period, strict=True):
        run = solve_ivp(
            lambda _, y: [y[1], 0.3 - math.sin(y[0])],
            (0, 20),
            [rest, v],
            "DOP853",
            rtol=1e-12,
            atol=1e-12,
            events=back,
        )
        first = next(t for t in run.t_events[0] if t > 1)
        assert first == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"effects": [pendmap.Effect("quadratic_drag", {"q": 0.1})]}, "forces of the angle alone"),
        ({"torque": 1.2}, "no rest"),
    ],
)
def test_what_has_no_backbone_is_refused(changed, text):
    with pytest.raises(pendmap.InputError, match=text):
        pendmap.backbone(pendmap.Pendulum(**changed))


def test_energies_of_rotations_are_above_the_top():
    with pytest.raises(pendmap.InputError, match="energy_max must be above 2, .*, got 1.5"):
        pendmap.backbone(pendmap.Pendulum(), energy_max=1.5)


def test_a_rig_has_times_in_seconds():
    rig = pendmap.Rig(w0=4.0)
    period, rate = family(pendmap.backbone(rig, count=5), "oscillation", "period", "rate")
    np.testing.assert_allclose(period * rate, 2 * math.pi)
    assert rate[0] == pytest.approx(4.0, rel=1e-2)


def test_resonance_curves_lie_around_the_backbone():
    pendulum = pendmap.Pendulum(gamma=0.02, p=0.1)
    result = pendmap.continuation(pendulum, {"omega": (1.5, 1.9)}, n=2, w=0, longest=2)
    at_once = result.orbit_amplitude.values, result.orbit_value.values / 2
    free = np.interp(
        at_once[1], result.backbone_value.values[::-1], result.backbone_amplitude.values[::-1]
    )
    assert set(result.orbit_swings.values.tolist()) == {1}
    away = at_once[0] - free
    assert 0.05 < away[result.orbit_stable.values == 1].min()
    assert away[result.orbit_stable.values == 0].max() < -0.05
    assert np.abs(away).max() < 0.6
