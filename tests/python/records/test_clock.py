"""Findings about the clock, and the times after their correction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest

import pendmap
from decays import decay
from pendmap.records.summary import as_text
from recorded import COUNT, clean, experiment, found, motion, read, text

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@pytest.mark.parametrize("late", [False, True])
def test_a_pause_longer_than_all_the_rest_cuts_the_record(tmp_path: Path, *, late: bool) -> None:
    time, theta = clean()
    first = time.size // 3 if late else 2 * time.size // 3
    jumped = np.where(np.arange(time.size) < first, time, time + 1e6)
    run = read(tmp_path, text((jumped, theta)))
    assert found(run)["time-pause"].text.startswith("a pause of 1e+06 s")
    assert run.time.size == max(first, time.size - first)
    assert np.ptp(run.time) < np.ptp(time)
    limits = "from_s = 5e5" if not late else "to_s = 5e5"
    other = f'[[run]]\nfile = "a.csv"\n{limits}\n'
    (part,) = experiment(tmp_path, other, a=text((jumped, theta))).runs
    assert part.time.size == min(first, time.size - first)
    assert "time-pause" not in found(part)


def test_a_false_stamp_costs_one_sample(tmp_path: Path) -> None:
    time, theta = clean()
    for value in (1e9, -1e9, 0.0):
        time[700] = value
        run = read(tmp_path, text((time, theta)))
        assert run.time.size == time.size - 1
        assert run.trusted.all()


def test_jitter_is_measured(tmp_path: Path) -> None:
    time, theta = clean()
    late = time + np.random.default_rng(2).normal(0, 5e-4, time.size)
    said = found(read(tmp_path, text((late, theta))))["time-jitter"].text
    assert float(said.split("by ")[1].split()[0]) == pytest.approx(5e-4 * 2**0.5, rel=0.1)


def test_a_clock_whose_stamps_hide_its_jitter_is_found(tmp_path: Path) -> None:
    time, _, _ = motion()
    fine, angle, _ = motion(rate=2000.0)
    late = time + np.random.default_rng(2).normal(0, 1e-3, time.size)
    run = read(tmp_path, text((time, np.interp(late, fine, angle))))
    said = found(run)["noise-grows-with-speed"].text
    assert float(said.split("stamps by ")[1].split()[0]) == pytest.approx(1.0, rel=0.1)  # ms


@pytest.mark.parametrize("rate", [30.0, 1000.0])
@pytest.mark.parametrize("counts", [0, 128, 8192])
def test_noise_is_estimated_within_a_few_per_cent(rate: float, counts: int) -> None:
    time, theta, _ = motion(rate=rate)
    for noise in (0.0005, 0.003):
        count = 2 * np.pi / counts if counts else 0.0
        readings = theta + np.random.default_rng(4).normal(0, noise, theta.size)
        readings = count * np.round(readings / count) if counts else readings
        run = pendmap.Run(
            "a", "a", "free", time, readings, np.ones(time.size, bool), count_rad=count
        )
        floor = pendmap.noise_floor(run)
        truth = float(np.std(readings - theta))
        assert abs(floor.sigma / truth - 1) < 0.05 + 3 * 0.8 / np.sqrt(time.size)


@pytest.mark.parametrize("scatter", [0.0, 5e-4, 1e-3, 2e-3])
@pytest.mark.parametrize("lost", [np.r_[:0], np.r_[300:302, 700:706, 1200:1350]])
def test_missing_samples_are_told_from_stamps_that_scatter(
    tmp_path: Path, lost: np.ndarray, scatter: float
) -> None:
    time, theta = clean()
    stamps = time + scatter * np.random.default_rng(4).standard_normal(time.size)
    run = read(tmp_path, text((np.delete(stamps, lost), np.delete(theta, lost))))
    gap = found(run).get("time-gap")
    assert (gap is None) == (lost.size == 0)
    assert gap is None or gap.text.startswith(f"3 gaps, about {lost.size} samples missing")
    assert gap is None or scatter or "1.51 s at 11.99 s" in gap.text
    assert run.rate_hz == pytest.approx(100, rel=1e-3 if lost.size else 1e-5 + scatter / 10)


def test_times_of_an_epoch_clock_are_printed_to_a_millisecond(tmp_path: Path) -> None:
    time, theta = clean()
    path = tmp_path / "a.csv"
    path.write_text(text((time + 1732209590.125, theta)), encoding="utf-8")
    said = as_text(pendmap.read_experiment(path))
    assert "1732209590.125 to 1732209610.125 s" in said


def test_the_last_digit_of_a_file_is_no_counter(tmp_path: Path) -> None:
    time, theta, _ = motion(start=0.002)
    path = tmp_path / "a.csv"
    path.write_text(text((time, np.round(theta, 6))), encoding="utf-8")
    (run,) = pendmap.read_experiment(path).runs
    assert run.count_rad == pytest.approx(1e-6)
    assert "a turn" not in as_text(pendmap.read_experiment(path))


@pytest.mark.parametrize("seed", range(2))
def test_stamps_that_differ_by_rounding_are_one(tmp_path: Path, seed: int) -> None:
    # A clock set back by seconds repeats its stamps up to rounding.
    rng = np.random.default_rng(seed)
    time, theta = clean()
    again = rng.choice(np.arange(1, time.size - 1), 20, replace=False)
    ulps = rng.choice([-2, -1, 1, 2], again.size) * np.spacing(time[-1])
    stamps = np.concatenate([time, time[again] + ulps])
    order = np.argsort(stamps) if seed % 2 else np.arange(stamps.size)
    run = read(tmp_path, text((stamps[order], np.r_[theta, theta[again]][order]), form="%.17g"))
    np.testing.assert_allclose(run.time, time, atol=1e-9)
    np.testing.assert_allclose(run.theta, theta, atol=1e-9)


@pytest.mark.parametrize("stamp", ["last", "zero"])
@pytest.mark.parametrize("tick", [0.01, 0.1])
def test_readings_after_a_clock_stops_are_left_out(tmp_path: Path, stamp: str, tick: float) -> None:
    time, theta = clean(duration=40.0)
    stamps = np.floor(time / tick + 1e-6) * tick
    stamps[2203:] = stamps[2202] if stamp == "last" else 0.0
    run = read(tmp_path, text((stamps, theta)))
    assert found(run)["time-stops"].mended
    assert abs(run.time.size - 2203) < 10
    assert run.trusted.all()
    assert run.rate_hz == pytest.approx(100, rel=1e-3)
    assert "time-duplicate" not in found(run)


def test_a_clock_that_stops_for_a_while_leaves_a_gap(tmp_path: Path) -> None:
    time, theta = clean(duration=40.0)
    stamps = time.copy()
    stamps[1200:1500] = stamps[1199]
    run = read(tmp_path, text((stamps, theta)))
    assert "12.99" not in found(run)["time-stops"].text
    assert "11.99" in found(run)["time-stops"].text
    np.testing.assert_allclose(run.time, np.delete(time, slice(1200, 1500)), atol=1e-6)


TICKS = (0.01, 1 / 60, 0.015625, 0.03, 0.1, 0.3, 1.0)


def stamped(seed: int, tick: float, lost: int = 0, cut: str = "floor") -> tuple[float, pendmap.Run]:
    """Return the sampling interval of a random decay, and its record with stamps in ticks."""
    rng = np.random.default_rng(seed)
    interval = 0.02 * rng.uniform(0.95, 1.05)
    time = interval * np.arange(rng.integers(1000, 2500))
    theta = decay().angle(time) + rng.normal(0, 2e-3, time.size)
    kept = np.ones(time.size, bool)
    kept[rng.choice(np.arange(50, time.size - 50), lost, replace=False)] = False
    stamps = tick * getattr(np, cut)((time[kept] + rng.uniform(0, 10)) / tick)
    frame = pd.DataFrame({"t_s": stamps, "theta_rad": theta[kept]})
    return interval, pendmap.read_experiment(frame).runs[0]


@pytest.mark.parametrize("cut", ["floor", "round", "ceil"])
def test_the_error_of_the_rate_is_a_standard_error(cut: str) -> None:
    off = []
    for seed in range(28):
        interval, run = stamped(seed, TICKS[seed % len(TICKS)], cut=cut)
        mean = float(run.time[-1] - run.time[0]) / (run.time.size - 1)
        assert np.ptp(np.diff(run.time)) < 1e-9
        off.append((mean / interval - 1) / run.clock_stderr)
    assert np.max(np.abs(off)) < 3.5
    assert 0.6 < np.sqrt(np.mean(np.square(off))) < 1.4


@pytest.mark.parametrize("rate", [30, 60, 120])
def test_written_digits_round_the_ticks(rate: int) -> None:
    # Of a clock of `rate` ticks a second nearly each has one reading; stamps are in ms.
    for seed in range(4):
        rng = np.random.default_rng(seed)
        interval = rng.uniform(1.001, 1.006) / rate
        time = interval * np.arange(int(30 / interval))
        theta = decay().angle(time) + rng.normal(0, 2e-3, time.size)
        stamps = np.round(np.floor((time + rng.uniform(0, 1)) * rate) / rate, 3)
        frame = pd.DataFrame({"t_s": stamps, "theta_rad": theta})
        run = pendmap.read_experiment(frame).runs[0]
        assert run.clock_stderr > 0
        mean = float(run.time[-1] - run.time[0]) / (run.time.size - 1)
        assert abs(mean / interval - 1) < 3.5 * run.clock_stderr


@pytest.mark.parametrize(("tick", "lost"), [(0.03, 5), (0.1, 5), (1.0, 1)])
def test_lost_readings_do_not_change_the_frequency(tick: float, lost: int) -> None:
    for seed in range(2):
        _, run = stamped(seed, tick, lost)
        best = pendmap.identify(run, methods=["trajectory"]).best
        assert abs(best["w0"] - 6.2) < 4 * (best.estimates["w0"].stderr or 0.0)


def test_stamps_that_scatter_or_are_exact_are_no_ticks() -> None:
    rng = np.random.default_rng(1)
    time = 0.02 * np.arange(1500)
    theta = decay().angle(time) + rng.normal(0, 2e-3, time.size)
    for late in (0.0, 2e-3):
        stamps = time + late * rng.uniform(-1, 1, time.size)
        frame = pd.DataFrame({"t_s": stamps, "theta_rad": theta})
        run = pendmap.read_experiment(frame).runs[0]
        assert run.clock_stderr == 0
        assert np.array_equal(run.time, stamps)


@pytest.mark.parametrize("tick", [0.1, 1.0])
def test_the_frequency_is_within_its_errors(tick: float) -> None:
    for seed in range(2):
        _, run = stamped(seed, tick)
        for name, fit in pendmap.identify(run).methods.items():
            if name in {"trajectory", "energy_balance"}:
                error = fit.estimates["w0"].stderr
                assert error is not None
                assert error > 0.9 * 6.2 * run.clock_stderr
                assert abs(fit["w0"] - 6.2) < 4 * error


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


@pytest.mark.parametrize("seed", [1])
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
