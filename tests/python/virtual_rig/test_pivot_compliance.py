"""A horizontally compliant pivot, against scipy and the virtual rig."""

from __future__ import annotations

import dataclasses

import pytest

import pendmap
from pendmap import InputError
from pendmap.virtual_rig import Request, Run, RunPlan, make

W0 = 6.2


@dataclasses.dataclass(frozen=True)
class Case:
    """A pendulum on a compliant pivot, SI, and a start."""

    theta: float
    velocity: float
    mu: float = 0.05
    wx: float = 40.0
    z: float = 0.02
    c: float = 0.05
    friction: float = 0.0
    drive: tuple[float, float] = (0.0, 1.0)

    def simulated(self, until: float) -> pendmap.Trajectory:
        """Return the motion by the library, in its own units."""
        values = {"mu": self.mu, "wx": self.wx / W0, "z": self.z}
        model = pendmap.Pendulum(
            gamma=self.c / W0,
            theta_r=self.friction / W0**2,
            p=self.drive[0],
            omega=self.drive[1] / W0,
            effects=(pendmap.Effect("pivot_compliance", values),),
        )
        return pendmap.simulate(model, self.theta, self.velocity / W0, until * W0, tol=1e-12)

    def rig(self, until: float) -> Run:
        """Return the run by the virtual rig."""
        plan = RunPlan("forced", self.theta, self.velocity, until, *self.drive)
        request = Request(
            "hidden",
            effects=(f"pivot_compliance,mu={self.mu},wx={self.wx},z={self.z}",),
            w0=W0,
            c_over_m=self.c,
            friction=self.friction,
            plans=(plan,),
        )
        return make(request).runs[0]


CASES = {
    "whirling": (Case(0.5, 21.0, wx=60.0), set()),
    "swinging": (Case(2.8, 0.0, c=0.1), {"turn"}),
    "rubbing to a rest": (Case(2.5, 0.0, friction=3.5), {"turn", "stick"}),
    "driven, with sticks": (
        Case(1.2, 0.0, mu=0.1, friction=4.0, drive=(0.9, 5.4)),
        {"turn", "stick", "release"},
    ),
    "released by the mode": (
        Case(0.3, 8.0, mu=0.3, wx=20.0, z=0.01, friction=3.0),
        {"turn", "stick", "release"},
    ),
    "a mode that creeps back": (Case(2.0, 5.0, z=1.6, friction=3.5), {"turn", "stick"}),
}


@pytest.mark.parametrize("name", CASES)
def test_a_compliant_pivot_agrees_with_the_virtual_rig(name: str) -> None:
    case, events = CASES[name]
    until = 10.0
    found, path = case.simulated(until), case.rig(until).path
    assert {event.what for event in path.events} >= events
    time = found.time.values / W0
    assert found.theta.values == pytest.approx(path.angle(time), abs=1e-8)
    assert found.velocity.values * W0 == pytest.approx(path.velocity(time), abs=1e-7)


def test_maps_refuse_a_compliant_pivot() -> None:
    values = {"mu": 0.05, "wx": 6.0, "z": 0.02}
    effect = pendmap.Effect("pivot_compliance", values)
    model = pendmap.Pendulum(p=0.6, effects=(effect,))
    with pytest.raises(InputError, match="not in maps: its sideways mode has a motion of its own"):
        pendmap.basins(model, pendmap.Grid.square(4))
