"""Trajectories of many starts, and at chosen times."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from pendmap import InputError, Pendulum, Rig, render

if TYPE_CHECKING:
    from pathlib import Path

STICKING = Pendulum(gamma=0.1, p=0.6, omega=2.0, theta_r=0.05)


@pytest.mark.parametrize("model", [STICKING, Pendulum(p=1.7), Rig(w0=6.2, Tr=1.0, p=0.3, Omega=9)])
def test_states_at_chosen_times_are_those_of_trajectories_that_end_there(
    model: Pendulum | Rig,
) -> None:
    times = np.geomspace(0.1, 20.0, 12) / model.units.w0
    run = pendmap.simulate(model, 1.0, 0.0, until=30.0, t_eval=times, tol=1e-12)
    assert np.array_equal(run.time, times)
    for time, theta, velocity in zip(times, run.theta.values, run.velocity.values, strict=True):
        end = pendmap.simulate(model, 1.0, 0.0, float(time), tol=1e-12)
        assert theta == pytest.approx(float(end.theta[-1]), abs=1e-11)
        assert velocity == pytest.approx(float(end.velocity[-1]), abs=1e-11 * model.units.w0)
    whole = pendmap.simulate(model, 1.0, 0.0, float(times[-1]), tol=1e-12)
    for name in ("section_theta", "section_velocity", "section_time", "event_time"):
        assert run[name].values == pytest.approx(whole[name].values, abs=1e-9)


def test_each_start_moves_as_alone(tmp_path: Path) -> None:
    starts = np.array([1.0, 0.5, 0.01])
    every = pendmap.simulate(STICKING, starts, 0.0, 20.0, samples=64)
    assert every.theta.dims == ("start", "time")
    assert every.theta0.values == pytest.approx(starts)
    assert every.stuck.values.tolist() == [0, 0, 1]
    assert every.attrs["summary"].startswith("3 starts up to tau = 20; friction holds 1 of them")
    for k, start in enumerate(starts):
        one, alone = every.isel(start=k), pendmap.simulate(STICKING, start, 0.0, 20.0, samples=64)
        for name in ("theta", "velocity", "energy", "section_theta", "end_error", "turns"):
            assert np.array_equal(one[name], alone[name])
        events = alone.sizes["event"]
        assert one.event_kind.values.tolist()[:events] == alone.event_kind.values.tolist()
        assert set(one.event_kind.values.tolist()[events:]) <= {""}
    again = pendmap.load(pendmap.save(every, tmp_path / "every.nc"))
    assert again.drop_attrs().equals(every.drop_attrs())
    assert render.draw(every.isel(start=1), tmp_path / "one.png").exists()
    with pytest.raises(InputError, match=r"3 trajectories at once: .* dataset.isel\(start=0\)"):
        pendmap.view(every, tmp_path / "every.rrd")
    with pytest.raises(InputError, match="cannot draw 3 trajectories at once"):
        render.draw(every, tmp_path / "every.png")


def test_exponents_of_many_starts() -> None:
    model = pendmap.PRESETS["fig2b"]
    every = pendmap.simulate(model, 1.0, [0.0, 0.3], 300.0, samples=16, lyapunov=True, tol=1e-6)
    alone = pendmap.simulate(model, 1.0, 0.3, 300.0, samples=16, lyapunov=True, tol=1e-6)
    assert every.exponent.values[1] == float(alone.exponent)


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ({}, "until must be a time above 0 where t_eval is left out, got None"),
        ({"t_eval": [2, 1]}, r"t_eval must be ascending values, got \[2, 1\]"),
        ({"t_eval": [-1, 1]}, "t_eval must be times from 0, the last above 0"),
        ({"t_eval": [2.0], "until": 1}, "t_eval must end by until = 1, got 2"),
        ({"t_eval": [2.0], "samples": 4}, "samples must be left out with t_eval"),
        ({"t_eval": [2.0], "lyapunov": True}, "lyapunov must be left out with t_eval"),
        ({"theta": [0, 1], "until": 1, "live": print}, "live must be left out with several starts"),
        ({"theta": [0, 1], "velocity": [1], "until": 1}, "they must be as many"),
        ({"theta": [], "until": 1}, "theta must have one start or more, got none"),
    ],
)
def test_times_and_starts_that_make_no_sense(given: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        pendmap.simulate(**{"pendulum": STICKING, "theta": 1.0, "velocity": 0.0, **given})
