"""Peaks and crossings: their positions, standard errors, and disturbances; few samples a period."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from decays import Decay, decay, record
from fits import joint_fit, methods_of, written
from pendmap import InputError, read_experiment
from pendmap.identification import Peaks, find_peaks
from pendmap.identification.readings import reading_of
from pendmap.records.noise import noise_of
from pendmap.records.resolution import step_of
from pendmap.records.samples import measured

if TYPE_CHECKING:
    from pathlib import Path

    from decays import Floats

WIDE = decay()
DRY = decay(c_over_m=0.01, tr=0.15, release=2.0)
SMALL_PERIOD = math.tau / 6.2


def test_the_decays_of_these_tests_are_the_reference_ones(truths: dict) -> None:
    exact = truths["free_decay"]["nonlinear"][0]
    assert np.abs(WIDE.peak_time - np.array(exact["times"], float)).max() < 1e-6
    assert np.abs(WIDE.peak - np.array(exact["thetas"], float)).max() < 1e-8


def test_peaks_of_a_clean_record_are_the_true_ones(truths: dict) -> None:
    time, angle = record(WIDE, noise_deg=0.0)
    peaks = find_peaks(time, angle)
    assert peaks.kind[0] == "release"
    turned = peaks.turned
    assert np.abs(turned.amplitude - WIDE.peak[turned.index]).max() < 2e-5
    assert np.abs(turned.time - WIDE.peak_time[turned.index])[:140].max() < 2e-3
    crossings = np.array(truths["free_decay"]["nonlinear"][0]["zero_cross"], float)
    assert peaks.crossing_time.size >= 148
    assert np.abs(peaks.crossing_time - crossings[peaks.crossing_index]).max() < 2e-4


@pytest.mark.parametrize(
    ("made", "noise_deg", "samples", "counts"),
    [
        (WIDE, 0.1, 101.0, 4096),
        (WIDE, 0.5, 101.0, 4096),
        (WIDE, 0.2, 30.0, 0),
        (WIDE, 0.5, 1013.0, 0),
        (DRY, 0.05, 25.0, 4096),
    ],
)
def test_standard_errors_of_peaks_match_the_scatter(
    made: Decay, noise_deg: float, samples: float, counts: int
) -> None:
    scores: dict[str, list[float]] = {"amplitude": [], "time": [], "crossing": []}
    seconds = min(float(made.peak_time[-1]), 60.0)
    for seed in range(4 if samples > 500 else 6):
        time, angle = record(
            made, seconds=seconds, rate=samples / SMALL_PERIOD, noise_deg=noise_deg,
            counts=counts, seed=seed,
        )  # fmt: skip
        peaks = find_peaks(time, angle)
        turned = peaks.turned
        # Below twenty times the noise friction makes a peak too asymmetric.
        turned = turned.select((np.abs(turned.amplitude) > 0.1) & (turned.index > 0))
        wrong = turned.amplitude - made.peak[turned.index]
        scores["amplitude"] += list(wrong / turned.stderr_amplitude)
        wrong = turned.time - made.peak_time[turned.index]
        scores["time"] += list(wrong / turned.stderr_time)
        passed = peaks.crossing_index < turned.index[-1]
        at = peaks.crossing_time[passed]
        speed = (made.angle(at + 1e-4) - made.angle(at - 1e-4)) / 2e-4
        scores["crossing"] += list(made.angle(at) / speed / peaks.crossing_stderr[passed])
    for what, ratios in scores.items():
        assert 0.8 < np.std(ratios) < 1.2, what
        assert abs(np.mean(ratios)) < 0.35, what


@pytest.mark.parametrize("rate", [30.0, 1000.0])
def test_coarse_counts_leave_the_numbers_of_the_peaks_right(rate: float) -> None:
    time, angle = record(WIDE, rate=rate, noise_deg=0.05, counts=512)
    turned = find_peaks(time, angle).turned
    assert turned.index.tolist() == list(range(len(turned)))
    assert len(turned) > 135
    off = np.abs(turned.amplitude - WIDE.peak[turned.index])
    assert off.max() < math.tau / 512
    assert (off / turned.stderr_amplitude).max() < 5


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
    # The clipped release is no peak: the first one is a turn.
    first = int(np.argmin(np.abs(WIDE.peak_time - peaks.time[0])))
    assert np.abs(turned.amplitude - WIDE.peak[first + turned.index]).max() < 3e-3


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


@pytest.mark.parametrize("samples", [6.3, 8.0, 15.0])
def test_few_samples_a_period_have_a_noise_and_no_peaks(samples: float) -> None:
    time, angle = record(WIDE, seconds=60, rate=samples / SMALL_PERIOD, noise_deg=0.1)
    assert reading_of(time, angle).sigma == pytest.approx(math.radians(0.1), rel=0.05)
    peaks = find_peaks(time, angle)
    assert len(peaks) == 0
    count, text = peaks.lacking.split(" ", 1)
    assert float(count) == pytest.approx(samples, rel=0.1)
    assert text == "samples a period, 20 are needed for peaks"
    methods = methods_of(time, angle)
    for name, true in {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.08}.items():
        estimate = methods["trajectory"].estimates[name]
        assert abs(estimate.value - true) < 3 * (estimate.stderr or 0.0)
    assert methods["combined"].warnings == (f"not applicable: {peaks.lacking}",)


@pytest.mark.parametrize("samples", [8.0, 25.0])
def test_a_run_that_goes_over_the_top_first(samples: float) -> None:
    def rate(_: float, y: Floats) -> list[float]:
        friction = 0.0496 * y[1] + 0.08 * math.tanh(y[1] / 1e-3)
        return [y[1], -friction - 6.2**2 * math.sin(y[0])]

    def turn(_: float, y: Floats) -> float:
        return float(y[1])

    made = solve_ivp(
        rate, (0, 30), [0.0, 20.0], rtol=1e-9, atol=1e-11, events=turn, dense_output=True,
        max_step=0.02,
    )  # fmt: skip
    at, true = made.t_events[0], made.y_events[0][:, 0]
    away = math.tau * round(true[-1] / math.tau)
    assert away > 2 * math.tau
    time = np.arange(0, 30, SMALL_PERIOD / samples)
    noise = math.radians(0.1) * np.random.default_rng(2).standard_normal(time.size)
    angle = made.sol(time)[0] + noise
    fit = joint_fit(time, angle).fit
    assert fit.converged
    for name, truth in {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.08}.items():
        assert abs(fit[name] - truth) < 4 * (fit.estimates[name].stderr or 0.0)
    if samples < 20:
        return
    peaks = find_peaks(time, angle)
    count = np.count_nonzero(at < 29.5)
    assert peaks.kind[0] == "turn"
    times, sizes = peaks.time[:count] - at[:count], peaks.amplitude[:count] - (true[:count] - away)
    assert np.mean(np.abs(times) < 2.5 * peaks.stderr_time[:count]) > 0.85
    assert np.mean(np.abs(sizes) < 2.5 * peaks.stderr_amplitude[:count]) > 0.85


@pytest.mark.parametrize(("noise_deg", "counts"), [(0.0, 128), (0.3, 256)])
def test_the_noise_of_coarse_counts_in_a_quick_rotation(counts: int, noise_deg: float) -> None:
    # Three counts a sample at 128 samples a period: rounding errors of neighbours are correlated.
    made = solve_ivp(
        lambda _, y: [y[1], 1.5 - 0.1 * y[1] - 6.3**2 * math.sin(y[0])],
        (0, 60), [0.0, 19.0], rtol=1e-9, atol=1e-10, dense_output=True,
    )  # fmt: skip
    time = np.arange(6000) / 100.0
    count, sigma, ratios = math.tau / counts, math.radians(noise_deg), []
    for seed in range(5):
        rng = np.random.default_rng([seed, counts])
        place = count * rng.random()
        moved = made.sol(time)[0] + sigma * rng.standard_normal(time.size)
        floor = noise_of(time, count * np.round((moved + place) / count) - place, count=count)
        ratios.append(floor.sigma / math.hypot(sigma, count / math.sqrt(12)))
    assert np.median(ratios) == pytest.approx(1, abs=0.05)


def drawn(time: Floats, angle: Floats, ratio: int, made: str) -> tuple[Floats, Floats]:
    """Return samples interpolated between the readings, as some exports have them."""
    dense = np.arange((time.size - 1) * ratio + 1) * (time[1] - time[0]) / ratio
    if made == "held":
        return dense, angle[np.arange(dense.size) // ratio]
    if made == "straight lines":
        return dense, np.interp(dense, time, angle)
    return dense, np.asarray(CubicSpline(time, angle)(dense))


@pytest.mark.parametrize(("made", "ratio"), [("held", 3), ("straight lines", 100), ("cubics", 10)])
def test_samples_between_readings_make_no_peaks(made: str, ratio: int) -> None:
    time, angle = record(WIDE, seconds=84, noise_deg=0.1, counts=4096)
    read = find_peaks(time, angle)
    dense, more = drawn(time, angle, ratio, made)
    peaks = find_peaks(dense, np.round(more, 7))
    assert len(peaks) == len(read)
    assert np.abs(peaks.amplitude).max() < 1.01 * np.abs(angle).max()
    for before, after in zip(peaks.crossing_time, peaks.crossing_time[1:], strict=False):
        assert np.count_nonzero((peaks.time > before) & (peaks.time < after)) == 1
    turned = peaks.turned
    off = turned.time - WIDE.peak_time[turned.index]
    assert np.mean(np.abs(off) < 1.96 * turned.stderr_time + (0.01 / ratio)) > 0.89


def test_measured_samples_are_not_thinned() -> None:
    for noise_deg, counts, rate in ((0.1, 4096, 100), (0.0, 0, 1000), (0.05, 1024, 1000)):
        time, angle = record(WIDE, seconds=40, noise_deg=noise_deg, counts=counts, rate=rate)
        assert measured(time, angle) is None


def test_look_reports_the_rate_of_the_measurement(tmp_path: Path) -> None:
    time, angle = record(WIDE, seconds=40, noise_deg=0.1)
    dense = drawn(time, angle, 100, "straight lines")
    run = read_experiment(written(tmp_path / "dense.csv", *dense, form="%.6f")).runs[0]
    (finding,) = [f for f in run.findings if f.what == "interpolated"]
    assert "100 Hz at 10000 Hz, straight lines between" in finding.text
    assert finding.mended
    assert run.time == pytest.approx(time, abs=1e-6)
    assert run.theta == pytest.approx(angle, abs=2e-6)


@pytest.mark.parametrize("noise_deg", [0.05, 0.5])
def test_the_noise_floor_and_the_count_are_detected(noise_deg: float) -> None:
    time, angle = record(WIDE, noise_deg=noise_deg)
    assert reading_of(time, angle).sigma == pytest.approx(math.radians(noise_deg), rel=0.03)
    assert step_of(angle) == 0
    time, angle = record(WIDE, noise_deg=noise_deg, counts=4096)
    assert step_of(angle) == pytest.approx(math.tau / 4096, rel=1e-6)


@pytest.mark.parametrize(
    ("time", "theta"),
    [
        ([0.0, 1.0], [0.0]),
        ([0.0, math.nan], [0.0, 1.0]),
        ([0.0, 1.0], [0.0, math.inf]),
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
