"""Recordings of trajectories, read back: state, pendulum, phase plane, trail."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import motions
import pendmap
import synthetic
from pendmap import InputError
from pendmap.viewer import trajectory
from recordings import ReadBack, recorded

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr

pytestmark = pytest.mark.usefixtures("strict_recordings")


@pytest.fixture(scope="module")
def swing() -> xr.Dataset:
    return motions.swing(periods=12, steps=200, p=1.7, omega=0.87)


@pytest.fixture(scope="module")
def back(swing: xr.Dataset, tmp_path_factory: pytest.TempPathFactory) -> ReadBack:
    return recorded(swing, tmp_path_factory.mktemp("swing"))


def test_a_trajectory_is_read_back(back: ReadBack, swing: xr.Dataset) -> None:
    theta, velocity = swing["theta"].values, swing["velocity"].values
    assert np.allclose(back.rows("/state/theta", "Scalars:scalars"), theta)
    assert np.allclose(back.rows("/state/omega", "Scalars:scalars"), velocity)
    energy = back.rows("/state/energy", "Scalars:scalars")
    assert np.allclose(energy, velocity**2 / 2 + 1 - np.cos(theta))
    assert np.allclose(back.seconds("/state/theta"), swing["time"].values, atol=1e-5)
    now = back.rows("/phase/data/now", "Points2D:positions")
    assert np.allclose(now[:, 0], synthetic.wrap(theta), atol=1e-6)
    assert np.allclose(now[:, 1], velocity, atol=1e-6)
    points = back.rows("/poincare/data/points", "Points2D:positions")
    assert np.allclose(points[:, 0], swing["section_theta"].values, atol=1e-6)
    assert back.columns["/poincare/data/points"]["period"] == list(range(13))
    curve = np.array(back.one("/phase/data/curve", "LineStrips2D:strips"))
    assert np.isnan(curve[:, 0]).any(), "this trajectory tumbles"
    assert np.nanmax(np.abs(np.diff(curve[:, 0]))) < 1.0, "no line crosses the plane"


def test_the_pendulum_hangs_on_its_pivot(back: ReadBack, swing: xr.Dataset) -> None:
    bob = back.rows("/pendulum/data/bob", "Points2D:positions")
    pivot = back.rows("/pendulum/data/pivot", "Points2D:positions")
    arm = back.rows("/pendulum/data/arm", "LineStrips2D:strips")
    assert np.allclose(arm, np.stack([pivot, bob], axis=1))
    trail = back.rows("/pendulum/data/trail", "LineStrips2D:strips")
    assert np.allclose(trail[:, -1], bob)
    assert np.allclose(trail[150, -2], bob[145]), "every fifth of 200 samples of a period"
    theta = swing["theta"].values
    assert np.allclose(bob - pivot, np.stack([np.sin(theta), -np.cos(theta)], axis=1), atol=1e-5)


def test_the_pivot_s_acceleration_is_that_of_the_equation(
    back: ReadBack, swing: xr.Dataset
) -> None:
    height = back.rows("/pendulum/data/pivot", "Points2D:positions")[:, 1]
    h = float(swing["time"][1] - swing["time"][0])
    every = 20  # the positions have single precision
    acceleration = np.diff(height[::every], 2) / (every * h) ** 2
    drive = 1.7 * np.cos(0.87 * swing["time"].values[::every][1:-1])
    assert np.allclose(acceleration, drive, atol=0.06)


@pytest.mark.parametrize(
    "run",
    [
        motions.swing(periods=0, steps=3, p=0.0),
        motions.swing(periods=1, steps=3, p=0.0),
        pendmap.simulate(pendmap.Pendulum(), 1e16, 0.0, 9.0),
        pendmap.simulate(pendmap.Pendulum(), -1.7e308, 0.0, 9.0),
    ],
    ids=["one sample", "one period", "many turns", "the last angles"],
)
def test_any_trajectory_is_recorded(tmp_path: Path, run: xr.Dataset) -> None:
    back = recorded(run, tmp_path)
    assert len(back.rows("/state/theta", "Scalars:scalars")) == run.sizes["time"]
    now = back.rows("/phase/data/now", "Points2D:positions")
    assert np.abs(now[:, 0]).max() <= math.pi + 1e-6


def test_a_trajectory_that_no_recording_can_hold_is_refused(tmp_path: Path) -> None:
    run = motions.swing(periods=1, steps=3)
    run["velocity"][1] = 1e40
    with pytest.raises(InputError, match=r"velocity reaches 1e\+40: a recording holds"):
        recorded(run, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_long_run_moves_in_larger_steps_and_has_every_section_point(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trajectory, "MOVING", 1000)
    monkeypatch.setattr(trajectory, "BINS", 500)
    run = motions.swing(periods=100, steps=60, p=1.7, omega=0.87)
    back = recorded(run, tmp_path)
    assert np.allclose(back.seconds("/pendulum/data/bob"), run["time"].values[::7])
    shown, theta = back.rows("/state/theta", "Scalars:scalars"), run["theta"].values
    assert 500 < shown.size <= 1002
    assert (shown.min(), shown.max()) == (theta.min(), theta.max())
    assert len(back.rows("/poincare/data/points", "Points2D:positions")) == 101
    assert "long run" in back.one("/summary", "TextDocument:text")
