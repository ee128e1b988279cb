"""Time slips: readings lost without a gap in the stamps; distinguished from missed counts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from decays import decay
from recorded import COUNT, found, read, text

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    import pendmap

    Floats = NDArray[np.float64]

DECAY = decay(w0=6.2, c_over_m=0.05, tr=0.06, release=1.6, until=50.0)


def readings(time: Floats, seed: int) -> Floats:
    theta = DECAY.angle(time) + 3e-4 * np.random.default_rng(seed).standard_normal(time.size)
    return COUNT * np.round(theta / COUNT)


def late(rate: float, seed: int, length: int = 1) -> tuple[Floats, Floats]:
    """Return stamps without gaps, and the true times of the readings."""
    stamps = np.arange(round(40 * rate)) / rate
    missing = np.zeros(stamps.size)
    # One every five seconds, and none after the pendulum has come to rest.
    at = np.arange(2, 33, 5) * rate + np.random.default_rng(seed).integers(0, 3 * rate, 7)
    missing[at.astype(int)] = length / rate
    return stamps, stamps + np.cumsum(missing)


def taken(run: pendmap.Run, true: Floats) -> Floats:
    """Return the distance of each time from the true time of the reading, s."""
    return np.abs((run.time - run.time[0]) - (true - true[0]))


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(("rate", "length"), [(100.0, 1), (100.0, 2), (60.0, 1)])
def test_time_slips_are_corrected(tmp_path: Path, rate: float, length: int, seed: int) -> None:
    stamps, true = late(rate, seed, length)
    run = read(tmp_path, text((stamps, readings(true, seed))))
    slips = found(run)["time-slips"]
    assert slips.mended
    assert "missed-counts" not in found(run)
    assert run.trusted.sum() > 0.9 * run.time.size
    off = taken(run, true)[run.trusted]
    # A slip near rest cannot be located; all large swings are right.
    assert np.mean(off > 0.1 / rate) < 0.25
    assert off[np.abs(np.gradient(run.theta, run.time))[run.trusted] > 2.0].max() < 0.1 / rate


@pytest.mark.parametrize("size", [1, 25, 60])
def test_missed_counts_are_no_time_slips(tmp_path: Path, size: int) -> None:
    stamps, _ = late(100.0, 1)
    theta = readings(stamps, 1)
    at = (120, 431, 777, 1115, 1490)
    for k, way in zip(at, (1, -1, 1, 1, -1), strict=True):
        theta[k:] += way * size * COUNT
    run = read(tmp_path, text((stamps, theta)))
    assert "time-slips" not in found(run)
    np.testing.assert_allclose(run.time, stamps, atol=1e-9)
    assert size == 1 or "missed-counts" in found(run)


def test_a_missed_count_is_found_in_a_record_with_slips(tmp_path: Path) -> None:
    stamps, true = late(100.0, 2)
    theta = readings(true, 2)
    theta[550:] += 30 * COUNT
    run = read(tmp_path, text((stamps, theta)))
    assert found(run)["time-slips"].mended
    assert found(run)["missed-counts"].text.startswith("1 jump of the reading (+0.046")


def test_a_regular_clock_has_no_slips(tmp_path: Path) -> None:
    stamps, _ = late(100.0, 1)
    run = read(tmp_path, text((stamps, readings(stamps, 1))))
    assert not {"time-slips", "missed-counts"} & set(found(run))
