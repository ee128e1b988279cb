"""Findings about the angle, and the angle after their correction."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from recorded import COUNT, clean, experiment, found, motion, noisy, read, text

if TYPE_CHECKING:
    from pathlib import Path


def test_held_released_and_at_rest(tmp_path: Path) -> None:
    _, theta, _ = motion(start=0.6, duration=75.0)
    readings = noisy(np.concatenate([np.full(150, theta[0]), theta]))
    time = np.arange(readings.size) / 100
    run = read(tmp_path, text((time, readings)))
    assert [segment.what for segment in run.segments] == ["held", "motion", "rest"]
    held, _, rest = run.segments
    assert held.to_s == pytest.approx(1.5, abs=0.1)
    speed = np.gradient(theta, 0.01)
    stops = 1.5 + np.flatnonzero(np.abs(speed) > 0.01)[-1] / 100
    assert stops - 4 < rest.from_s < stops + 1
    used = time[run.trusted]
    assert held.to_s < used[0] < 1.7
    assert used[-1] < rest.from_s


def test_an_impossible_pivot_is_reported(tmp_path: Path) -> None:
    time, theta, _ = motion(drive=(0.3, 12.0, 0.4))
    described = '[[run]]\nfile = "a.csv"\npivot = { vertical = "y", unit = "mm" }\n'
    for size, wrong in ((20.0, False), (20e3, True)):
        columns = (time, noisy(theta), size * np.cos(12 * time + 0.4))
        (run,) = experiment(tmp_path, described, a=text(columns, "t_s,theta_rad,y")).runs
        assert ("pivot-unit" in found(run)) == wrong


@pytest.mark.parametrize("duration", [0.4, 1.0, 3.0])
def test_a_few_swings_do_not_determine_the_zero(tmp_path: Path, duration: float) -> None:
    time, theta = clean(start=2.4, duration=duration)
    run = read(tmp_path, text((time, theta)))
    np.testing.assert_allclose(run.theta, theta, atol=1e-6)
    assert not any(f.mended for f in run.findings if f.what.startswith(("zero", "gauge")))


def test_a_recorded_rest_determines_the_zero(tmp_path: Path) -> None:
    time, theta = clean(start=0.1, duration=20.0)
    run = read(tmp_path, text((time, theta + 0.5)))
    assert found(run)["zero-offset"].mended
    np.testing.assert_allclose(run.theta, theta, atol=0.01)


@pytest.mark.parametrize("off", [0.5, math.pi / 2])
def test_the_zero_of_a_forced_run_is_left_alone(tmp_path: Path, off: float) -> None:
    time, theta = clean(start=1.2, duration=40.0)
    described = '[[run]]\nfile = "run.csv"\nkind = "forced"\ndrive = { p = 0.3, Omega = 9.0 }\n'
    (run,) = experiment(tmp_path, described, run=text((time, theta + off))).runs
    np.testing.assert_allclose(run.theta, theta + off, atol=1e-6)
    assert not {f.what for f in run.findings} & {"zero-uncertain", "zero-offset", "gauge-turned"}


def test_angles_too_large_are_reported(tmp_path: Path) -> None:
    time, theta = clean()
    theta[-200:] = 0
    with pytest.raises(pendmap.InputError, match="too large"):
        read(tmp_path, text((time, 3e9 * theta)))


@pytest.mark.parametrize("known", ["", "[rig]\nencoder_counts = 4096\n"])
def test_steps_are_those_of_the_angle_in_radians(tmp_path: Path, known: str) -> None:
    time, theta = clean()
    described = known + '[[run]]\nfile = "run.csv"\n'
    (run,) = experiment(tmp_path, described, run=text((time, np.degrees(theta)))).runs
    assert run.count_rad == pytest.approx(COUNT, rel=1e-3)
    assert "counts-differ" not in found(run)
    assert known or "4096" in found(run)["counts-seen"].text


@pytest.mark.parametrize("velocity", [20.0, 30.0])
def test_swings_after_turns_are_counted(tmp_path: Path, velocity: float) -> None:
    time, theta = clean(start=0.0, velocity=velocity, duration=80.0)
    assert theta[-1] > 30
    run = read(tmp_path, text((time, theta)))
    assert "no-swing" not in found(run)
    np.testing.assert_allclose(run.theta, theta, atol=1e-5)
    assert run.trusted.mean() > 0.7


@pytest.mark.parametrize("form", ["%.6f", "%.4f"])
def test_slow_turns_between_lines_are_not_clipped(tmp_path: Path, form: str) -> None:
    time, theta, _ = motion(start=3.0, duration=12.0)
    dense = np.linspace(0.0, 12.0, 24001)
    readings = np.interp(dense, time, noisy(theta, 0.0))
    run = read(tmp_path, text((dense, readings), form=form))
    assert "clipped" not in found(run)


@pytest.mark.parametrize("limit", [0.3, 1.0, 2.0])
def test_one_end_of_a_sensor_is_reported_once(tmp_path: Path, limit: float) -> None:
    time, theta = clean(start=3.0, duration=12.0)
    run = read(tmp_path, text((time, np.minimum(theta, limit))))
    assert found(run)["clipped"].text.startswith(f"the sensor's range ends at {limit:.4g} rad: ")


@pytest.mark.parametrize("gain", [0.75, 1.5])
@pytest.mark.parametrize("gyroscope", [True, False])
def test_a_gain_that_the_period_disproves_is_reported_with_its_error(
    tmp_path: Path, gain: float, *, gyroscope: bool
) -> None:
    time, theta, speed = motion(start=1.4, duration=60.0)
    noise = np.random.default_rng(1).standard_normal((3, time.size))
    if gyroscope:
        columns = (time, 0.01 * noise[0], gain * speed + 0.01 * noise[1], 0.01 * noise[2])
        head = [f'"{name}"' for name in ("Time (s)", *(f"Gyroscope {k} (rad/s)" for k in "xyz"))]
        content = text(columns, ",".join(head)).replace(",", "\t")
    else:
        content = text((time, gain * theta + 1e-3 * noise[0]))
    said = found(read(tmp_path, content))["angle-scale"].text
    factor, error = re.search(r"angle is (\S+) \+- (\S+) times", said).groups()  # type: ignore[union-attr]
    assert abs(float(factor) - 1 / gain) < 3 * float(error)
    assert float(error) < 0.01
    channel = "velocity" if gyroscope else "angle"
    described = f'[columns]\n{channel} = {{ scale = {factor} }}\n[[run]]\nfile = "run.csv"\n'
    (run,) = experiment(tmp_path, described, run=content).runs
    assert "angle-scale" not in found(run)
