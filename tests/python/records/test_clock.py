"""Findings about the clock, and the times after their correction; the noise of a record."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest

import pendmap
from decays import decay
from pendmap.identification.report import as_json
from pendmap.records.noise import noise_of
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
    limit = "to_s = 5e5" if late else "from_s = 5e5"
    (part,) = experiment(
        tmp_path, f'[[run]]\nfile = "a.csv"\n{limit}\n', a=text((jumped, theta))
    ).runs
    assert part.time.size == min(first, time.size - first)
    assert "time-pause" not in found(part)


def test_jitter_is_measured_also_where_stamps_hide_it(tmp_path: Path) -> None:
    time, _ = clean()
    off = np.random.default_rng(2).normal(0, 5e-4, time.size)
    fine, angle, _ = motion(rate=2000.0)
    true = text((time + off, np.interp(time + off, fine, angle)))
    said = found(read(tmp_path, true))["time-jitter"].text
    assert float(said.split("by ")[1].split()[0]) == pytest.approx(5e-4 * 2**0.5, rel=0.1)
    hidden = read(tmp_path, text((time, np.interp(time + 2 * off, fine, angle))))
    said = found(hidden)["noise-grows-with-speed"].text
    assert float(said.split("stamps by ")[1].split()[0]) == pytest.approx(1.0, rel=0.1)  # ms


@pytest.mark.parametrize("rate", [30.0, 1000.0])
@pytest.mark.parametrize("counts", [0, 128, 8192])
def test_noise_is_estimated_within_a_few_per_cent(rate: float, counts: int) -> None:
    time, theta, _ = motion(rate=rate)
    for noise in (0.0005, 0.003):
        count = 2 * np.pi / counts if counts else 0.0
        readings = theta + np.random.default_rng(4).normal(0, noise, theta.size)
        readings = count * np.round(readings / count) if counts else readings
        floor = noise_of(time, readings, count=count)
        truth = float(np.std(readings - theta))
        assert abs(floor.sigma / truth - 1) < 0.05 + 3 * 0.8 / np.sqrt(time.size)


@pytest.mark.parametrize("scatter", [0.0, 5e-4, 2e-3])
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


def test_times_and_steps_are_printed_with_their_digits(tmp_path: Path) -> None:
    time, theta, _ = motion(start=0.002)
    path = tmp_path / "a.csv"
    path.write_text(text((time + 1732209590.125, np.round(theta, 6))))
    there = pendmap.read_experiment(path)
    assert "0 to 20 s" in as_text(there)  # since the first of times since 1970
    # The last digit of a file is no counter.
    assert there.runs[0].count_rad == pytest.approx(1e-6)
    assert "a turn" not in as_text(there)


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


@pytest.mark.parametrize(("stamp", "tick"), [("last", 0.01), ("zero", 0.1), ("last", 0.1)])
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
    assert "at 11.99 s" in found(run)["time-stops"].text
    np.testing.assert_allclose(run.time, np.delete(time, slice(1200, 1500)), atol=1e-6)


TICKS = (0.01, 1 / 60, 0.015625, 0.03, 0.1, 0.3, 1.0)


def stamped(
    seed: int, tick: float, lost: int = 0, rate: float = 50.0, digits: int = 12
) -> tuple[float, pendmap.Run]:
    """Return the sampling interval of a random decay, and its record with stamps in ticks."""
    rng = np.random.default_rng(seed)
    interval = rng.uniform(0.95, 1.05) / rate if digits == 12 else rng.uniform(1.001, 1.006) / rate
    time = interval * np.arange(rng.integers(1000, 2500))
    theta = decay().angle(time) + rng.normal(0, 2e-3, time.size)
    kept = np.ones(time.size, bool)
    kept[rng.choice(np.arange(50, time.size - 50), lost, replace=False)] = False
    stamps = np.round(tick * np.floor((time[kept] + rng.uniform(0, 10)) / tick), digits)
    frame = pd.DataFrame({"t_s": stamps, "theta_rad": theta[kept]})
    return interval, pendmap.read_experiment(frame).runs[0]


def test_the_error_of_the_rate_is_a_standard_error() -> None:
    off = []
    for seed in range(28):
        interval, run = stamped(seed, TICKS[seed % len(TICKS)])
        mean = float(run.time[-1] - run.time[0]) / (run.time.size - 1)
        assert np.ptp(np.diff(run.time)) < 1e-9
        off.append((mean / interval - 1) / run.clock_stderr)
    assert np.max(np.abs(off)) < 3.5
    assert 0.6 < np.sqrt(np.mean(np.square(off))) < 1.4


@pytest.mark.parametrize("rate", [30, 60, 120])
def test_written_digits_round_the_ticks(rate: int) -> None:
    # Of a clock of `rate` ticks a second nearly each has one reading; stamps are in ms.
    for seed in range(4):
        interval, run = stamped(seed, 1 / rate, rate=rate, digits=3)
        assert run.clock_stderr > 0
        mean = float(run.time[-1] - run.time[0]) / (run.time.size - 1)
        assert abs(mean / interval - 1) < 3.5 * run.clock_stderr


@pytest.mark.parametrize(("tick", "lost"), [(0.03, 5), (0.1, 5), (1.0, 1), (0.1, 0), (1.0, 0)])
def test_the_frequency_is_within_its_errors(tick: float, lost: int) -> None:
    _, run = stamped(0, tick, lost)
    best = pendmap.identify(run, methods=["trajectory"]).best
    error = best.estimates["w0"].stderr
    assert error is not None
    assert lost or error > 0.9 * 6.2 * run.clock_stderr
    assert abs(best["w0"] - 6.2) < 4 * error


SCATTER = {
    "longer ticks": lambda time, _: np.floor(time / 0.0312) * 0.0312,
    "shorter ticks": lambda time, _: np.floor(time / 0.015625) * 0.015625,
    "noise": lambda time, rng: time + rng.normal(0, 2e-3, time.size),
}


@pytest.mark.parametrize(
    ("kind", "lost"), [(kind, n) for kind in SCATTER for n in (0, 4) if kind[0] != "l" or not n]
)
def test_readings_follow_even_times_or_their_stamps(kind: str, lost: int) -> None:
    rng = np.random.default_rng(1)
    time = np.delete(0.02 * np.arange(1500), np.arange(200, 200 + 250 * lost, 250))
    stamps = np.sort(SCATTER[kind](time, rng) + rng.uniform(0, 4e-4, time.size))
    for instants, even in ((time, True), (stamps, False)):
        theta = decay().angle(instants) + rng.normal(0, 2e-3, time.size)
        frame = pd.DataFrame({"t_s": stamps, "theta_rad": theta})
        run = pendmap.read_experiment(frame).runs[0]
        assert (run.clock_stderr > 0) == even
        assert even or np.array_equal(run.time, stamps)
        off = run.time - instants
        assert np.std(off) < 2e-4


DECAY = decay(w0=6.2, c_over_m=0.05, tr=0.06, release=1.6, until=50.0)


def late(rate: float, seed: int, length: int = 1) -> tuple[Floats, Floats, Floats]:
    """Return stamps without gaps, the true times of the readings, and the readings."""
    stamps = np.arange(round(40 * rate)) / rate
    missing = np.zeros(stamps.size)
    # One every five seconds, and none after the pendulum has come to rest.
    at = np.arange(2, 33, 5) * rate + np.random.default_rng(seed).integers(0, 3 * rate, 7)
    missing[at.astype(int)] = length / rate
    true = stamps + np.cumsum(missing)
    theta = DECAY.angle(true) + 3e-4 * np.random.default_rng(seed).standard_normal(true.size)
    return stamps, true, COUNT * np.round(theta / COUNT)


@pytest.mark.parametrize(("rate", "length"), [(100.0, 1), (100.0, 2), (60.0, 1)])
def test_time_slips_are_corrected(tmp_path: Path, rate: float, length: int) -> None:
    stamps, true, theta = late(rate, 1, length)
    run = read(tmp_path, text((stamps, theta)))
    assert found(run)["time-slips"].mended
    assert "missed-counts" not in found(run)
    assert run.trusted.sum() > 0.9 * run.time.size
    off = np.abs((run.time - run.time[0]) - (true - true[0]))[run.trusted]
    # A slip near rest cannot be located; all large swings are right.
    assert np.mean(off > 0.1 / rate) < 0.25
    assert off[np.abs(np.gradient(run.theta, run.time))[run.trusted] > 2.0].max() < 0.1 / rate


@pytest.mark.parametrize("size", [1, 25, 60])
def test_missed_counts_are_no_time_slips(tmp_path: Path, size: int) -> None:
    stamps, _, theta = late(100.0, 1, 0)
    for k, way in zip((120, 431, 777, 1115, 1490), (1, -1, 1, 1, -1), strict=True):
        theta[k:] += way * size * COUNT
    run = read(tmp_path, text((stamps, theta)))
    assert "time-slips" not in found(run)
    np.testing.assert_allclose(run.time, stamps, atol=1e-9)
    assert size == 1 or "missed-counts" in found(run)


# Encoders that write a line at each edge: all are kept, as precise as their stamps
TRUTH = {"w0": 6.2, "c_over_m": 0.05, "Tr": 0.08}
MOTION = decay(6.2, 0.05, 0.08, release=0.8, until=40.0)
STEP = math.tau / 1200


@functools.cache
def edges() -> tuple[Floats, NDArray[np.int64], NDArray[np.int64]]:
    """Return times and numbers of the edges, by bisection, and the count after each."""
    grid = np.arange(0.0, 40.0, 2e-4)
    count = np.floor(MOTION.angle(grid) / STEP).astype(int)
    at = np.flatnonzero(np.diff(count))
    low, high, edge = grid[at], grid[at + 1], np.maximum(count[at], count[at + 1])
    for _ in range(30):
        middle = (low + high) / 2
        before = (MOTION.angle(middle) < edge * STEP) == (count[at + 1] == edge)
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return low, edge, count[at + 1]


@pytest.mark.parametrize(("written", "unit"), [("count", "rad"), ("edge", "deg")])
def test_each_edge_is_kept_with_its_angle(tmp_path: Path, written: str, unit: str) -> None:
    time, edge, shown = edges()
    values = STEP * (shown if written == "count" else edge)
    values = np.degrees(values) if unit == "deg" else values
    run = read(tmp_path, text((time, values), f"t_s,theta_{unit}", "%.8f"))
    assert run.time.size == time.size
    assert run.trusted.sum() > 0.999 * time.size
    assert "1200 counts a turn" in found(run)["edges-logged"].text
    assert not {"time-gap", "time-jitter", "time-uneven", "counts-seen"} & set(found(run))
    # A count is offset by half a step, which the zero of the counter absorbs.
    off = run.theta - MOTION.angle(run.time)
    assert np.ptp(off) < 1e-3 * STEP
    assert abs(np.median(off)) < 0.51 * STEP


def test_a_decay_is_identified_from_edges(tmp_path: Path) -> None:
    time, _, shown = edges()
    time = time + 1e-4 * np.random.default_rng(3).standard_normal(time.size)
    order = np.argsort(time, kind="stable")
    path = tmp_path / "edges.csv"
    path.write_text(text((time[order], shown[order] * STEP), form="%.4f"), encoding="utf-8")
    report = pendmap.identify(pendmap.read_experiment(path), methods=("trajectory",))
    for name, (low, high) in as_json(report)["methods"]["trajectory"]["ci95"].items():
        if name in TRUTH:
            half = (high - low) / 2
            assert low - half < TRUTH[name] < high + half, name  # within three standard errors
            assert half < 0.01 * TRUTH[name], name


def test_edges_that_share_a_stamp_are_kept(tmp_path: Path) -> None:
    time, _, shown = edges()
    stamps = np.floor(500 * time) / 500
    run = read(tmp_path, text((stamps, shown * STEP)))
    assert np.count_nonzero(np.diff(stamps) == 0) > 0.09 * time.size
    assert run.time.size == time.size
    assert np.all(np.diff(run.time) > 0)
    assert "time-duplicate" not in found(run)
    assert np.ptp(run.time - time) < 2.1e-3
