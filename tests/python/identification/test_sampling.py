"""Peaks of records with few samples a period, and of samples interpolated between readings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from decays import Decay, decay, record
from pendmap import read_experiment
from pendmap.identification import find_peaks
from pendmap.identification.readings import reading_of
from pendmap.records.noise import noise_of
from pendmap.records.samples import measured

if TYPE_CHECKING:
    from pathlib import Path

    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]

WIDE = decay()
VISCOUS = decay(c_over_m=0.1, tr=0.0, release=1.5, until=60.0)
DRY = decay(c_over_m=0.01, tr=0.15, release=2.0)
SMALL_PERIOD = math.tau / 6.2
SENSORS = ((0.05, 4096), (0.1, 0), (0.2, 1024), (0.5, 1024))


def resolved(made: Decay, noise_deg: float, counts: int, seconds: float) -> int:
    """Return the number of peaks that differ from the next by more than ten times the noise."""
    count = math.tau / counts / math.sqrt(12) if counts else 0.0
    sigma = math.hypot(math.radians(noise_deg), count)
    clear = np.abs(np.diff(made.peak)) > 10 * sigma
    clear &= made.peak_time[:-1] < seconds - 0.5
    return int(np.argmin(clear)) if not clear.all() else clear.size


@pytest.mark.parametrize("made", [WIDE, VISCOUS, DRY], ids=["wide", "viscous", "dry"])
@pytest.mark.parametrize("samples", [6.3, 8.0, 10.0, 15.0, 25.0, 100.0])
def test_all_peaks_are_found_at_any_rate_with_errors_that_match_the_scatter(
    made: Decay, samples: float
) -> None:
    times, sizes, crossings = [], [], []
    seconds = min(float(made.peak_time[-1]), 60.0)
    for seed, (noise_deg, counts) in enumerate(SENSORS):
        time, angle = record(
            made, seconds=seconds, rate=samples / SMALL_PERIOD,
            noise_deg=noise_deg, counts=counts, seed=seed,
        )  # fmt: skip
        peaks = find_peaks(time, angle)
        count = resolved(made, noise_deg, counts, seconds)
        assert peaks.index[:count].tolist() == list(range(count))
        which = slice(1, count)
        times += list((peaks.time - made.peak_time[peaks.index])[which] / peaks.stderr_time[which])
        wrong = peaks.amplitude - made.peak[peaks.index]
        sizes += list(wrong[which] / peaks.stderr_amplitude[which])
        passed = peaks.crossing_index < count - 1
        at = peaks.crossing_time[passed]
        speed = (made.angle(at + 1e-4) - made.angle(at - 1e-4)) / 2e-4
        crossings += list(made.angle(at) / speed / peaks.crossing_stderr[passed])
    for what, ratios in (("times", times), ("sizes", sizes), ("crossings", crossings)):
        # About a hundred ratios, with errors partly shared within blocks of swings.
        assert 0.89 < np.mean(np.abs(ratios) < 1.96) <= 1.0, what
        assert 0.6 < np.std(ratios) < 1.15, what


@pytest.mark.parametrize("samples", [8.0, 10.0, 15.0, 25.0])
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
    found = find_peaks(time, made.sol(time)[0] + noise)
    count = np.count_nonzero(at < 29.5)
    assert found.kind[0] == "turn"
    times, sizes = found.time[:count] - at[:count], found.amplitude[:count] - (true[:count] - away)
    assert np.mean(np.abs(times) < 2.5 * found.stderr_time[:count]) > 0.85
    assert np.mean(np.abs(sizes) < 2.5 * found.stderr_amplitude[:count]) > 0.85


@pytest.mark.parametrize("samples", [6.3, 8.0, 10.0])
def test_the_noise_of_few_samples_a_period_is_not_their_motion(samples: float) -> None:
    time, angle = record(WIDE, seconds=60, rate=samples / SMALL_PERIOD, noise_deg=0.1)
    assert reading_of(time, angle).sigma == pytest.approx(math.radians(0.1), rel=0.15)


@pytest.mark.parametrize("noise_deg", [0.0, 0.3])
@pytest.mark.parametrize("counts", [128, 256])
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


@pytest.mark.parametrize("made", ["held", "straight lines", "cubics"])
@pytest.mark.parametrize("ratio", [3, 10, 100])
def test_samples_between_readings_make_no_peaks(made: str, ratio: int) -> None:
    time, angle = record(WIDE, seconds=84, noise_deg=0.1, counts=4096)
    read = find_peaks(time, angle)
    dense, more = drawn(time, angle, ratio, made)
    found = find_peaks(dense, np.round(more, 7))
    assert len(found) == len(read)
    for before, after in zip(found.crossing_time, found.crossing_time[1:], strict=False):
        assert np.count_nonzero((found.time > before) & (found.time < after)) == 1
    turned = found.turned
    off = turned.time - WIDE.peak_time[turned.index]
    assert np.mean(np.abs(off) < 1.96 * turned.stderr_time + (0.01 / ratio)) > 0.89


def test_measured_samples_are_not_thinned() -> None:
    for noise_deg, counts, rate in ((0.1, 4096, 100), (0.0, 0, 1000), (0.05, 1024, 1000)):
        time, angle = record(WIDE, seconds=40, noise_deg=noise_deg, counts=counts, rate=rate)
        assert measured(time, angle) is None


def test_look_reports_the_rate_of_the_measurement(tmp_path: Path) -> None:
    time, angle = record(WIDE, seconds=40, noise_deg=0.1)
    table = np.column_stack(drawn(time, angle, 100, "straight lines"))
    file = tmp_path / "dense.csv"
    np.savetxt(file, table, fmt="%.6f", delimiter=",", header="time (s),angle (rad)", comments="")
    run = read_experiment(file).runs[0]
    (said,) = [f for f in run.findings if f.what == "interpolated"]
    assert "100 Hz at 10 kHz, straight lines between" in said.text
    assert said.mended
    assert run.time == pytest.approx(time, abs=1e-6)
    assert run.theta == pytest.approx(angle, abs=2e-6)
