"""Peaks and crossings: their positions, standard errors, and disturbances."""

from __future__ import annotations

import math

import numpy as np
import pytest

from decays import decay, record
from pendmap import InputError
from pendmap.identification import Peaks, find_peaks
from pendmap.identification.readings import reading_of
from pendmap.records.resolution import step_of

WIDE = decay()


def test_the_decays_of_these_tests_are_the_reference_ones(truths: dict) -> None:
    exact = truths["free_decay"]["nonlinear"][0]
    assert np.abs(WIDE.peak_time - np.array(exact["times"], float)).max() < 1e-6
    assert np.abs(WIDE.peak - np.array(exact["thetas"], float)).max() < 1e-8


def test_peaks_of_a_clean_record_are_the_true_ones(truths: dict) -> None:
    time, angle = record(WIDE, noise_deg=0.0)
    peaks = find_peaks(time, angle)
    assert peaks.kind[0] == "release"
    assert peaks.kind[-1] == "stop"
    turned = peaks.turned
    assert np.abs(turned.amplitude - WIDE.peak[turned.index]).max() < 2e-5
    assert np.abs(turned.time - WIDE.peak_time[turned.index])[:140].max() < 2e-3
    crossings = np.array(truths["free_decay"]["nonlinear"][0]["zero_cross"], float)
    assert peaks.crossing_time.size >= 148
    assert np.abs(peaks.crossing_time - crossings[peaks.crossing_index]).max() < 2e-4


@pytest.mark.parametrize(
    ("noise_deg", "rate", "counts"),
    [(0.05, 100.0, 0), (0.1, 100.0, 4096), (0.5, 100.0, 4096), (0.2, 30.0, 0), (0.5, 1000.0, 0)],
)
def test_standard_errors_of_peaks_match_the_scatter(
    noise_deg: float, rate: float, counts: int
) -> None:
    off: dict[str, list[float]] = {"amplitude": [], "time": [], "crossing": []}
    for seed in range(5 if rate > 500 else 10):
        time, angle = record(WIDE, rate=rate, noise_deg=noise_deg, counts=counts, seed=seed)
        peaks = find_peaks(time, angle)
        turned = peaks.turned
        # Below twenty times the noise friction makes a peak too asymmetric.
        turned = turned.select(np.abs(turned.amplitude) > 0.1)
        wrong = turned.amplitude - WIDE.peak[turned.index]
        off["amplitude"] += list(wrong / turned.stderr_amplitude)
        moved = turned.index > 0
        wrong = turned.time - WIDE.peak_time[turned.index]
        off["time"] += list((wrong / turned.stderr_time)[moved])
        wide = peaks.crossing_index < 120
        at = peaks.crossing_index[wide]
        true = np.array([_zero(k) for k in at])
        off["crossing"] += list((peaks.crossing_time[wide] - true) / peaks.crossing_stderr[wide])
    for what, ratios in off.items():
        assert 0.85 < np.std(ratios) < 1.15, what
        assert abs(np.mean(ratios)) < 0.3, what


def _zero(k: int) -> float:
    """Return the true crossing of half cycle `k`, by bisection."""
    low, high = WIDE.peak_time[k], WIDE.peak_time[k + 1]
    for _ in range(50):
        middle = (low + high) / 2
        same = WIDE.angle(np.array([middle]))[0] * WIDE.peak[k] > 0
        low, high = (middle, high) if same else (low, middle)
    return float(low)


@pytest.mark.parametrize("rate", [30.0, 100.0, 1000.0])
def test_coarse_counts_leave_the_numbers_of_the_peaks_right(rate: float) -> None:
    time, angle = record(WIDE, rate=rate, noise_deg=0.05, counts=512)
    turned = find_peaks(time, angle).turned
    assert turned.index.tolist() == list(range(len(turned)))
    assert len(turned) > 135
    off = np.abs(turned.amplitude - WIDE.peak[turned.index])
    assert off.max() < math.tau / 512
    assert (off / turned.stderr_amplitude).max() < 5


def test_the_last_half_cycle_that_stops_is_marked() -> None:
    # It stops at 0.006 rad on the side it came from, far above the noise.
    stuck = decay(c_over_m=0.05, tr=1.0, release=1.0)
    time, angle = record(stuck, seconds=12, noise_deg=0.02)
    peaks = find_peaks(time, angle)
    assert peaks.kind[-1] == "stop"
    assert peaks.index[-1] == stuck.peak.size - 1
    assert peaks.amplitude[-1] == pytest.approx(stuck.peak[-1], abs=1e-4)
    assert peaks.time[-1] == pytest.approx(stuck.peak_time[-1], abs=0.03)
    assert peaks.turned.index[-1] == stuck.peak.size - 2


def test_a_record_that_begins_held_by_hand() -> None:
    time, angle = record(WIDE, seconds=30)
    held = np.full(150, 3.0) + math.radians(0.1) * np.random.default_rng(1).standard_normal(150)
    time = np.arange(angle.size + 150) / 100
    peaks = find_peaks(time, np.concatenate((held, angle)))
    assert peaks.kind[0] == "release"
    assert peaks.time[0] == pytest.approx(1.5, abs=0.03)
    assert peaks.amplitude[0] == pytest.approx(3.0, abs=5e-4)
    assert np.abs(peaks.amplitude[1:] - WIDE.peak[1 : len(peaks)]).max() < 4e-3


def test_a_record_that_begins_in_motion_has_no_release() -> None:
    time, angle = record(WIDE, seconds=40)
    peaks = find_peaks(time[620:], angle[620:])
    assert peaks.kind[0] == "turn"
    first = int(np.argmin(np.abs(WIDE.peak_time - peaks.time[0])))
    assert WIDE.peak_time[first] - 6.2 < 0.6
    assert np.abs(peaks.amplitude - WIDE.peak[first + peaks.index]).max() < 4e-3


def test_numbers_of_peaks_count_across_a_gap() -> None:
    time, angle = record(WIDE)
    trusted = (time < 20) | (time > 24.3)
    peaks = find_peaks(time, angle, trusted=trusted)
    assert np.diff(peaks.index).max() > 5
    turned = peaks.turned
    good = (turned.time < 19.5) | (turned.time > 24.8)
    assert np.abs(turned.amplitude - WIDE.peak[turned.index])[good].max() < 4e-3


def test_the_top_of_a_clipped_reading_is_no_peak() -> None:
    time, angle = record(WIDE, noise_deg=0.05, counts=4096)
    peaks = find_peaks(time, np.clip(angle, -2.0, 2.0))
    clipped = np.array([kind == "clipped" for kind in peaks.kind])
    assert clipped[1:5].all()
    assert np.isinf(peaks.stderr_amplitude[clipped]).all()
    turned = peaks.turned
    turned = turned.select(turned.index > 0)
    assert np.abs(turned.amplitude).max() < 2.0
    assert np.abs(turned.amplitude - WIDE.peak[turned.index]).max() < 3e-3


def test_outliers_do_not_turn_a_peak() -> None:
    time, angle = record(WIDE)
    rng = np.random.default_rng(3)
    false = rng.choice(np.arange(200, angle.size), 40, replace=False)
    angle[false] += rng.choice((-1.0, 1.0), 40) * rng.uniform(0.2, 3.0, 40)
    turned = find_peaks(time, angle).turned
    assert len(turned) > 145
    assert np.abs(turned.amplitude - WIDE.peak[turned.index]).max() < 5e-3


def test_an_angle_that_rests_several_turns_from_0_has_its_peaks() -> None:
    time, angle = record(WIDE, seconds=30)
    there, away = find_peaks(time, angle), find_peaks(time, angle + 2 * math.tau)
    assert away.amplitude == pytest.approx(there.amplitude, abs=1e-9)


def test_a_record_without_swings_has_no_peaks() -> None:
    time = np.arange(500) / 100
    noise = 1e-3 * np.random.default_rng(0).standard_normal(500)
    for angle in (np.zeros(500), noise, 1.0 + noise, np.exp(-time) + noise):
        assert len(find_peaks(time, angle)) == 0
    assert len(find_peaks(time[:3], noise[:3])) == 0


def test_the_noise_floor_and_the_count_are_detected() -> None:
    for noise_deg in (0.05, 0.1, 0.5):
        time, angle = record(WIDE, noise_deg=noise_deg)
        assert reading_of(time, angle).sigma == pytest.approx(math.radians(noise_deg), rel=0.03)
        assert step_of(angle) == 0
    time, angle = record(WIDE, noise_deg=0.1, counts=4096)
    assert step_of(angle) == pytest.approx(math.tau / 4096, rel=1e-6)


@pytest.mark.parametrize(
    ("time", "theta"),
    [
        ([0.0, 1.0], [0.0]),
        ([0.0, math.nan], [0.0, 1.0]),
        ([0.0, 1.0], [0.0, math.inf]),
        ([1.0, 0.0], [0.0, 1.0]),
        ([0.0, 0.0], [0.0, 1.0]),
    ],
)
def test_bad_records_are_refused(time: list[float], theta: list[float]) -> None:
    with pytest.raises(InputError, match=r"must be (rows|finite)|must increase"):
        find_peaks(time, theta)


def test_absolute_peaks_get_alternating_signs() -> None:
    peaks = Peaks.of([0, 1, 2], [0.3, 0.2, 0.1])
    assert peaks.amplitude.tolist() == [0.3, -0.2, 0.1]
    assert peaks.odd.tolist() == [False, True, False]
    with pytest.raises(InputError, match="times and peaks must be as many"):
        Peaks.of([0, 1], [0.3])
