"""Encoders that write a line at each edge: all lines are kept, as precise as their time stamps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.optimize import brentq

import pendmap
from decays import Decay, decay
from pendmap.identification import identify
from pendmap.identification.report import as_json
from recorded import found, read, text

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

W0, C_OVER_M, TR = 6.2, 0.05, 0.08


def motion_of(release: float) -> Decay:
    return decay(w0=W0, c_over_m=C_OVER_M, tr=TR, release=release, until=40.0)


def edges(motion: Decay, counts: int) -> tuple[Floats, NDArray[np.int64], NDArray[np.int64]]:
    """Return times and numbers of the edges, and the count after each; by root finding."""
    step = math.tau / counts
    grid = np.arange(0.0, 40.0, 2e-4)
    count = np.floor(motion.angle(grid) / step).astype(int)
    time, edge, shown = [], [], []
    for k in np.flatnonzero(np.diff(count)):
        low, high = int(count[k]), int(count[k + 1])
        way = 1 if high > low else -1
        for number in range(low + 1, high + 1) if way > 0 else range(low, high, -1):

            def off(t: float, angle: float = number * step) -> float:
                return float(motion.angle(np.array([t]))[0]) - angle

            time.append(brentq(off, grid[k], grid[k + 1], xtol=1e-11))
            edge.append(number)
            shown.append(number if way > 0 else number - 1)
    return np.array(time), np.array(edge), np.array(shown)


@pytest.mark.parametrize("written", ["count", "edge"])
@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_each_edge_is_kept_with_its_angle(tmp_path: Path, written: str, unit: str) -> None:
    motion = motion_of(0.8)
    time, edge, shown = edges(motion, 1200)
    step = math.tau / 1200
    values = step * (shown if written == "count" else edge)
    values = np.degrees(values) if unit == "deg" else values
    run = read(tmp_path, text((time, values), f"t_s,theta_{unit}", "%.8f"))
    assert run.time.size == time.size
    assert run.trusted.sum() > 0.999 * time.size
    assert "1200 counts a turn" in found(run)["edges-logged"].text
    assert not {"time-gap", "time-jitter", "time-uneven", "counts-seen"} & set(found(run))
    # A count is offset by half a step, which the zero of the counter absorbs.
    off = run.theta - motion.angle(run.time)
    assert np.ptp(off) < 1e-3 * step
    assert abs(np.median(off)) < 0.51 * step


@pytest.mark.parametrize(
    ("release", "counts", "jitter", "digits"),
    [(1.5, 600, 1e-4, 6), (0.8, 1200, 0.0, 4)],
)
def test_a_decay_is_identified_from_edges(
    tmp_path: Path, release: float, counts: int, jitter: float, digits: int
) -> None:
    time, _, shown = edges(motion_of(release), counts)
    time = time + jitter * np.random.default_rng(3).standard_normal(time.size)
    order = np.argsort(time, kind="stable")
    path = tmp_path / "edges.csv"
    values = shown[order] * math.tau / counts
    path.write_text(text((time[order], values), form=f"%.{digits}f"), encoding="utf-8")
    experiment = pendmap.read_experiment(path)
    report = identify(experiment, methods=("trajectory",))
    intervals = as_json(report)["methods"]["trajectory"]["ci95"]
    for name, true in (("w0", W0), ("c_over_m", C_OVER_M), ("Tr", TR)):
        low, high = intervals[name]
        half = (high - low) / 2
        assert low - half < true < high + half, name  # within three standard errors
        assert half < 0.01 * true, name


def test_edges_that_share_a_stamp_are_kept(tmp_path: Path) -> None:
    motion = motion_of(1.5)
    time, _, shown = edges(motion, 1200)
    stamps = np.floor(500 * time) / 500
    run = read(tmp_path, text((stamps, shown * math.tau / 1200)))
    assert np.count_nonzero(np.diff(stamps) == 0) > 0.1 * time.size
    assert run.time.size == time.size
    assert np.all(np.diff(run.time) > 0)
    assert "time-duplicate" not in found(run)
    off = run.time - time
    assert np.ptp(off) < 2.1e-3
