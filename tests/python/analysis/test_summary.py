"""Summaries of a model: effects on the reading alone, rotations without a limit."""

from __future__ import annotations

import pytest

import pendmap
from pendmap import Effect, Grid, Pendulum

READINGS = (Effect("encoder_offset", {"d": 0.1}), Effect("encoder_gain", {"e": 0.01}))


def test_effects_on_the_reading_alone_are_reported_as_such() -> None:
    model = Pendulum(p=0, effects=READINGS)
    plain = pendmap.simulate(Pendulum(p=0), 1.0, 0.0, 5.0)
    run = pendmap.simulate(model, 1.0, 0.0, 5.0)
    assert (run.theta.values == plain.theta.values).all()
    names = "encoder_offset, encoder_gain act on the sensor's reading alone: "
    assert names + "angle and velocity here are of the motion" in run.attrs["summary"]
    share = pendmap.basins(model, Grid.square(3), max_periods=200)
    assert names + "this map is of the motion" in share.attrs["summary"]
    assert "reading" not in plain.attrs["summary"]
    alone = pendmap.simulate(Pendulum(p=0, effects=READINGS[:1]), 1.0, 0.0, 5.0)
    assert "encoder_offset acts on" in alone.attrs["summary"]


DRAG = Effect("quadratic_drag", {"q": 0.1})


@pytest.mark.parametrize(
    ("model", "unlimited"),
    [
        (Pendulum(gamma=0, p=0, theta_r=0.1, torque=1.3), True),
        (Pendulum(gamma=0, p=0, theta_r=0.1, torque=-0.5), True),
        (Pendulum(gamma=0, p=0.3, theta_r=0.01), True),
        (Pendulum(gamma=0, p=0, theta_r=0.1, torque=0.05), False),
        (Pendulum(gamma=0.01, p=0, theta_r=0.1, torque=1.3), False),
        (Pendulum(gamma=0, p=0, theta_r=0.1, torque=1.3, effects=(DRAG,)), False),
    ],
)
def test_a_summary_explains_an_unlimited_rotation(model: Pendulum, *, unlimited: bool) -> None:
    summary = pendmap.basins(model, Grid.square(5), max_periods=20).attrs["summary"]
    assert ("nothing limits a rotation" in summary) == unlimited
    assert not unlimited or "raises this bound" not in summary
