"""Pendulums symmetric under reflection and a shift by half a period of the drive."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
from pendmap import Formula, Grid, Pendulum

PUSH = Formula("push", "f*cos(phase)", {"f": 2})
FAMOUS = {"gamma": 0.5, "p": 0.0, "omega": 2 / 3}


def driven(f: float, **own: float) -> Pendulum:
    return Pendulum(**(FAMOUS | own), effects=(PUSH(f=f),))


def half_a_period_on(x: Pendulum, f: float, state: np.ndarray) -> np.ndarray:
    def slope(t: float, y: np.ndarray) -> list[float]:
        return [y[1], -x.gamma * y[1] - math.sin(y[0]) + f * math.cos(x.omega * t)]

    span = (0.0, math.pi / x.omega)
    run = solve_ivp(slope, span, state, method="DOP853", rtol=1e-12, atol=1e-12)
    return np.asarray(run.y[:, -1])


def test_two_attractors_of_a_direct_drive_are_each_other_s_image() -> None:
    pendulum = driven(1.07)
    found = pendmap.basins(pendulum, Grid.square(12))
    names = [str(name) for name in found["attractor"].values]
    assert sorted(names) == ["oscillation 2:0 (+)", "oscillation 2:0 (-)"]
    assert list(found["twin"].values) == [2, 1]
    which = found["point_attractor"].values
    points = np.stack([found["point_theta"].values, found["point_velocity"].values], axis=1)
    own, other = points[which == 1], points[which == 2]
    for point in own:
        image = -half_a_period_on(pendulum, 1.07, point)
        image[0] = math.remainder(image[0], math.tau)
        assert np.abs(other - image).max(axis=1).min() < 1e-8
    assert found["unreliable_mirror"].item() < 0.05
    # By symmetry their mean angles over a period are opposite: (+) is at positive angles.
    positive = own if names[0].endswith("(+)") else other
    images = np.array([half_a_period_on(pendulum, 1.07, point) for point in positive])
    assert (positive[:, 0] + images[:, 0]).mean() > 0


@pytest.mark.parametrize(
    ("term", "seen"),
    [
        ("f*cos(phase)", True),
        ("f*cos(3*phase)*cos(theta)", True),
        ("f*cos(2*phase)", False),
        ("f*cos(2*phase)*sin(theta)", True),
        ("f*cos(phase)*sin(theta)", True),
        ("f*(cos(phase) + 0.5)", False),
        ("f*cos(2*phase)*cos(theta)", False),
    ],
)
def test_the_symmetry_is_detected_if_and_only_if_it_exists(term: str, seen: bool) -> None:  # noqa: FBT001
    push = Formula("push", term, {"f": 2})
    pendulum = Pendulum(**FAMOUS, effects=(push(f=0.4),))
    found = pendmap.basins(pendulum, Grid.square(6))
    assert ("unreliable_mirror" in found) is seen


def test_orbits_of_a_direct_drive_come_with_their_images() -> None:
    alone = pendmap.basins(driven(0.5), Grid.square(8), check=False)
    assert [*alone["attractor"].values] == ["oscillation 1:0"]
    assert list(alone["twin"].values) == [1]
    found = pendmap.orbit(driven(1.07), 2, 0, Grid.square(24))
    stable = found["stable"].values.astype(bool)
    assert stable.sum() == 2
    assert sorted(found["twin"].values[stable]) == sorted(found["id"].values[stable])
    found = pendmap.bifurcation(driven(1.07), {"push.f": (1.06, 1.075, 4)})
    assert (np.bincount(found["entry_cell"].values, minlength=4) >= 2).all()
