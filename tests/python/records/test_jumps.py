"""False readings, jumps that stay and slips of the clock, in records with few samples a swing."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest

import pendmap
from decays import decay
from recorded import found

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

W0, NOISE = 5.0, 0.003
AT = {"turning point": 20.0, "bottom": 20.25}  # periods


def record(
    samples: int, *, jump: float = 0.0, false: int = 0, frames: float = 0.0, at: str = "bottom"
) -> tuple[int, Floats, Floats, pendmap.Run]:
    """Return the place of a fault, times, readings without it, and the run."""
    rng = np.random.default_rng(samples)
    interval = 1.01 * math.tau / W0 / samples
    stamps = interval * np.arange(40 * samples)
    place = round(AT[at] * samples)
    after = np.arange(stamps.size) >= place
    time = stamps + frames * interval * after
    swing = decay(W0, 0.02, 0.005, release=0.4, until=60.0).angle(time)
    theta = swing + rng.normal(0, NOISE, time.size)
    if frames == -1:
        theta[place] = theta[place - 1]  # the frame comes twice
    ends = place + false if false else stamps.size
    theta[place:ends] += jump
    frame = pd.DataFrame({"t_s": stamps, "theta_rad": theta})
    return place, time, swing, pendmap.read_experiment(frame).runs[0]


@pytest.mark.parametrize("at", AT)
@pytest.mark.parametrize("false", [1, 3])
@pytest.mark.parametrize("samples", [10, 16, 30])
def test_false_readings_are_no_jump(samples: int, false: int, at: str) -> None:
    place, _, _, run = record(samples, jump=0.1, false=false, at=at)
    np.testing.assert_array_equal(np.flatnonzero(~run.trusted), np.arange(place, place + false))
    assert "missed-counts" not in found(run)


@pytest.mark.parametrize("samples", [8, 12, 30])
def test_a_jump_that_stays_is_undone_by_its_size(samples: int) -> None:
    _, _, swing, run = record(samples, jump=0.1)
    assert found(run)["missed-counts"].mended
    assert run.trusted.mean() > 0.98
    assert abs(np.mean((run.theta - swing)[30 * samples :])) < NOISE


@pytest.mark.parametrize("frames", [1.0, 0.5, -0.5, -1.0, 2.0])
@pytest.mark.parametrize("samples", [10, 16])
def test_a_slip_of_frames_moves_the_times_after_it(samples: int, frames: float) -> None:
    place, time, _, run = record(samples, frames=frames)
    assert found(run)["time-slips"].mended
    true = np.delete(time, place) if run.time.size < time.size else time
    off = np.abs(run.time - true) / np.median(np.diff(time))
    assert np.mean(off > 0.1) < 0.01


@pytest.mark.parametrize("samples", [8, 12, 30, 60])
def test_a_record_without_faults_keeps_its_times_and_readings(samples: int) -> None:
    _, time, _, run = record(samples)
    np.testing.assert_array_equal(run.time, time)
    assert run.trusted.all()
    assert not {"missed-counts", "time-slips", "outliers"} & set(found(run))
