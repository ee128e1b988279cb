"""Peaks of records, and the methods that read them: the recipe, what each assumes, and table 1."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from decays import Decay, decay, record
from fits import TRUTH, agrees, methods_of, run_of, scores, written
from pendmap import Rig, read_experiment
from pendmap.comparison import compare
from pendmap.identification import METHODS, Estimate, Identification, Peaks, find_peaks, table1
from pendmap.identification.methods import combined, lines
from pendmap.identification.methods.registry import identify_peaks
from pendmap.identification.peaks import frequency, mean_period
from pendmap.identification.readings import reading_of
from pendmap.records.noise import noise_of

if TYPE_CHECKING:
    from pathlib import Path

    from decays import Floats

WIDE = decay()
SMALL = decay(release=0.2, c_over_m=0.0496, tr=0.03, until=40.0)
VISCOUS = decay(release=0.2, c_over_m=0.12, tr=0.0, until=40.0)
DRY = decay(release=0.2, c_over_m=0.0, tr=0.03, until=60.0)
TRUE = {
    id(WIDE): TRUTH,
    id(SMALL): {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.03},
    id(VISCOUS): {"w0": 6.2, "c_over_m": 0.12},
}
COULOMB = decay(c_over_m=0.01, tr=0.15, release=2.0)
SMALL_PERIOD = math.tau / 6.2


def test_peaks_of_a_clean_record_are_the_true_ones(truths: dict) -> None:
    exact = truths["free_decay"]["nonlinear"][0]
    assert np.abs(WIDE.peak_time - np.array(exact["times"], float)).max() < 1e-6
    assert np.abs(WIDE.peak - np.array(exact["thetas"], float)).max() < 1e-8
    peaks = find_peaks(*record(WIDE, noise_deg=0.0))
    assert peaks.kind[0] == "release"
    turned = peaks.turned
    assert np.abs(turned.amplitude - WIDE.peak[turned.index]).max() < 2e-5
    assert np.abs(turned.time - WIDE.peak_time[turned.index])[:140].max() < 2e-3
    crossings = np.array(exact["zero_cross"], float)
    assert peaks.crossing_time.size >= 148
    assert np.abs(peaks.crossing_time - crossings[peaks.crossing_index]).max() < 2e-4


@pytest.mark.parametrize(
    ("made", "noise_deg", "samples", "counts"),
    [
        (WIDE, 0.1, 101.0, 4096),
        (WIDE, 0.5, 101.0, 4096),
        (WIDE, 0.2, 30.0, 0),
        (WIDE, 0.5, 1013.0, 0),
        (COULOMB, 0.05, 25.0, 4096),
    ],
)
def test_standard_errors_of_peaks_match_the_scatter(
    made: Decay, noise_deg: float, samples: float, counts: int
) -> None:
    ratios: dict[str, list[float]] = {"amplitude": [], "time": [], "crossing": []}
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
        ratios["amplitude"] += list(wrong / turned.stderr_amplitude)
        wrong = turned.time - made.peak_time[turned.index]
        ratios["time"] += list(wrong / turned.stderr_time)
        passed = peaks.crossing_index < turned.index[-1]
        at = peaks.crossing_time[passed]
        speed = (made.angle(at + 1e-4) - made.angle(at - 1e-4)) / 2e-4
        ratios["crossing"] += list(made.angle(at) / speed / peaks.crossing_stderr[passed])
    for what, values in ratios.items():
        assert 0.8 < np.std(values) < 1.2, what
        assert abs(np.mean(values)) < 0.35, what


def with_outliers(angle: Floats) -> Floats:
    rng, changed = np.random.default_rng(3), angle.copy()
    false = rng.choice(np.arange(200, angle.size), 40, replace=False)
    changed[false] += rng.choice((-1.0, 1.0), 40) * rng.uniform(0.2, 3.0, 40)
    return changed


TIME, ANGLE = record(WIDE)
COARSE: Any = {"noise_deg": 0.05, "counts": 512}
GAP = (TIME < 20) | (TIME > 24.3)
# Times, angles, what is trusted, fewest peaks, largest error of an amplitude
DISTURBED: dict[str, tuple[Floats, Floats, Any, int, float]] = {
    "coarse counts": (*record(WIDE, rate=1000.0, **COARSE), None, 136, math.tau / 512),
    "few coarse counts": (*record(WIDE, rate=30.0, **COARSE), None, 136, math.tau / 512),
    "begun in motion": (TIME[620:], ANGLE[620:], None, 130, 4e-3),
    "a gap": (TIME, ANGLE, GAP, 135, 4e-3),
    "clipped": (TIME, np.clip(ANGLE, -2.0, 2.0), None, 130, 5e-3),
    "outliers": (TIME, with_outliers(ANGLE), None, 146, 5e-3),
    "some turns away": (TIME, ANGLE + 2 * math.tau, None, 146, 5e-3),
}


@pytest.mark.parametrize("case", DISTURBED)
def test_peaks_of_a_disturbed_record(case: str) -> None:
    time, angle, trusted, fewest, largest = DISTURBED[case]
    peaks = find_peaks(time, angle, trusted=trusted)
    turned = peaks.turned
    assert len(turned) >= fewest
    first = int(np.argmin(np.abs(WIDE.peak_time - turned.time[0]))) - turned.index[0]
    off = np.abs(turned.amplitude - WIDE.peak[first + turned.index])
    assert off.max() < largest
    assert (off / turned.stderr_amplitude).max() < 5
    begun = "turn" if case in {"begun in motion", "clipped"} else "release"
    assert turned.kind[0] == begun
    assert (np.diff(turned.index).max() > 5) == (case == "a gap")
    clipped = [kind == "clipped" for kind in peaks.kind]
    assert all(clipped[1:5]) == (case == "clipped")
    assert np.isinf(peaks.stderr_amplitude[clipped]).all()


def test_a_record_without_swings_has_no_peaks() -> None:
    time = np.arange(500) / 100
    noise = 1e-3 * np.random.default_rng(0).standard_normal(500)
    for angle in (np.zeros(500), noise, 1.0 + noise, np.exp(-time) + noise):
        assert len(find_peaks(time, angle)) == 0
    assert len(find_peaks(time[:3], noise[:3])) == 0


@pytest.mark.parametrize("samples", [6.3, 15.0])
def test_few_samples_a_period_have_a_noise_and_no_peaks(samples: float) -> None:
    time, angle = record(WIDE, seconds=60, rate=samples / SMALL_PERIOD, noise_deg=0.1)
    assert reading_of(time, angle).sigma == pytest.approx(math.radians(0.1), rel=0.05)
    peaks = find_peaks(time, angle)
    assert len(peaks) == 0
    count, text = peaks.lacking.split(" ", 1)
    assert float(count) == pytest.approx(samples, rel=0.1)
    assert text == "samples a period, 20 are needed for peaks"
    methods = methods_of(time, angle)
    agrees(methods["trajectory"], TRUTH, 3)
    assert methods["combined"].warnings == (f"not applicable: {peaks.lacking}",)


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


def test_a_file_of_samples_between_readings_is_thinned(tmp_path: Path) -> None:
    time, angle = record(WIDE, seconds=15, noise_deg=0.1)
    dense = drawn(time, angle, 100, "straight lines")
    run = read_experiment(written(tmp_path / "dense.csv", *dense, form="%.6f")).runs[0]
    (finding,) = [f for f in run.findings if f.what == "interpolated"]
    assert "100 Hz at 10000 Hz, straight lines between" in finding.text
    assert finding.mended
    assert run.time == pytest.approx(time, abs=1e-6)
    assert run.theta == pytest.approx(angle, abs=2e-6)


@pytest.fixture(scope="module")
def exact(truths: dict[str, Any]) -> Peaks:
    """Return the peaks of the reference decay without the final stop."""
    made = truths["free_decay"]["nonlinear"][0]
    return Peaks.of(np.array(made["times"], float)[:-1], np.array(made["thetas"], float)[:-1])


def test_the_recipe_on_the_exact_peaks(exact: Peaks, truths: dict[str, Any]) -> None:
    wanted = truths["decrement_recipe"][0]
    small, warnings = combined.small_peaks(exact, wanted["cut"])
    assert not warnings
    assert small.index[[0, -1]].tolist() == [wanted["i0"], wanted["i0"] + wanted["k"]]
    size = np.abs(small.amplitude)
    w0, _, friction = combined.from_amplitudes(np.concatenate((size, small.time)))
    made = {"delta": combined.decrement(size), "theta_r": combined.coulomb(size)}
    made |= {"mean_period": mean_period(small.time), "w0": w0, "Tr": friction}
    for name, value in made.items():
        assert value == pytest.approx(wanted[name], rel=1e-9), name
    deltas, _ = combined.triplets(np.abs(small.amplitude))
    assert deltas.mean() == pytest.approx(wanted["delta_triplet_mean"], rel=1e-9)
    parameters = combined.from_peaks(exact).parameters
    for name in ("w0", "Tr", "zeta", "theta_r"):
        assert parameters[name].value == pytest.approx(wanted[name], rel=1e-9), name
    # The mean period of wide swings would give a low w0.
    assert math.tau / mean_period(exact.time) == pytest.approx(6.2 * 0.93, rel=0.01)
    assert frequency(exact, zeta=0.004).w0 == pytest.approx(6.2, rel=1e-4)


def test_eqs_2_7_and_2_10_give_the_reference_numbers(truths: dict[str, Any]) -> None:
    for made in truths["free_decay"]["linear"]:
        peaks, times = (np.array(made[key], float)[:-1] for key in ("peaks_abs", "times"))
        w0, zeta = float(made["w0"]), float(made["zeta"])
        delta, theta_r = float(made["eq27_delta"]), float(made["eq210_Tr"]) / w0**2
        assert combined.decrement(peaks) == pytest.approx(delta, abs=1e-12)
        assert combined.coulomb(peaks) * w0**2 == pytest.approx(theta_r * w0**2, abs=1e-12)
        period = 2 * math.pi / (w0 * math.sqrt(1 - zeta**2))
        assert mean_period(times) == pytest.approx(period, rel=1e-12)
        # All triplets agree.
        for values, wanted in zip(combined.triplets(peaks), (delta, theta_r), strict=True):
            assert values == pytest.approx(wanted, abs=1e-10)


def test_the_period_over_amplitude_is_the_reference_one(truths: dict[str, Any]) -> None:
    for amplitude, wanted in truths["free_decay"]["period_vs_amplitude"].items():
        half = float(wanted["T_tau"]) / 2
        peaks = Peaks.of(half * np.arange(6), np.full(6, float(amplitude)))
        assert frequency(peaks).w0 == pytest.approx(1, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "made", "wanted"),
    [
        ("combined", SMALL, {"w0": 2e-3, "c_over_m": 0.03, "Tr": 0.03}),
        ("combined_repaired", SMALL, {"w0": 1e-5, "c_over_m": 0.02, "Tr": 0.02, "offset": 5e-3}),
        ("combined_repaired", VISCOUS, {"w0": 1e-5, "c_over_m": 0.01, "offset": 5e-3}),
        ("log_decrement", VISCOUS, {"w0": 2e-3, "c_over_m": 0.01}),
        ("energy_balance", WIDE, {"w0": 2e-5, "c_over_m": 2e-3, "Tr": 2e-3, "offset": 5e-3}),
        ("energy_balance", SMALL, {"w0": 1e-5, "c_over_m": 5e-3, "Tr": 5e-3, "offset": 5e-3}),
        ("energy_balance", VISCOUS, {"w0": 1e-5, "c_over_m": 2e-3}),
    ],
)
def test_a_method_finds_what_it_assumes(name: str, made: Decay, wanted: dict[str, float]) -> None:
    truth = TRUE[id(made)] | {"offset": 2e-3 if "offset" in wanted else 0.0}
    seconds = 30 if made is not WIDE else 85
    time, angle = record(made, seconds=seconds, noise_deg=1e-4, offset=truth["offset"])
    result = methods_of(time, angle, name)[name]
    assert result.method == name
    assert result.applicable, result.warnings
    for key, close in wanted.items():
        assert result[key] == pytest.approx(truth[key], rel=close), key


def test_every_method_has_errors_intervals_and_a_covariance() -> None:
    everything = methods_of(*record(WIDE, counts=4096))
    assert list(everything) == list(METHODS)
    for name, result in everything.items():
        assert result.covariance is not None, name
        names, matrix = result.covariance
        assert np.all(np.linalg.eigvalsh(matrix) > -1e-12 * np.trace(matrix))
        for key, estimate in result.estimates.items():
            place = names.index(key)
            assert matrix[place, place] ** 0.5 == pytest.approx(estimate.stderr)
            low, high = estimate.ci95 or (math.nan, math.nan)
            assert low < estimate.value < high
    assert "Tr" not in everything["log_decrement"].estimates


@pytest.mark.parametrize(
    ("name", "made", "seconds", "noise"),
    [("energy_balance", WIDE, 85, 0.2), ("combined_repaired", SMALL, 25, 0.1)],
)
def test_errors_match_the_scatter(name: str, made: Decay, seconds: float, noise: float) -> None:
    off = []
    for seed in range(25):
        time, angle = record(made, seconds=seconds, noise_deg=noise, offset=2e-3, seed=seed)
        result = methods_of(time, angle, name)[name]
        off.append(scores(result, TRUE[id(made)] | {"offset": 2e-3}))
    deviation = np.std(off, axis=0)
    assert np.all((deviation > 0.65) & (deviation < 1.35)), deviation
    assert np.all(np.abs(np.mean(off, axis=0)) < 0.8)


def test_what_a_method_cannot_hold_is_a_warning() -> None:
    offset = record(WIDE, offset=math.radians(0.05), counts=4096)
    result = methods_of(*offset, "combined")["combined"]
    assert result["c_over_m"] < 0
    assert any(text.startswith("unphysical: c_over_m") for text in result.warnings)
    assert result.rig.c_over_m == 0
    # A missing peak is not bridged.
    time, angle = record(WIDE)
    gap = (time < 70) | (time > 71.2)
    for trusted, missing in ((gap, True), (None, False)):
        result = methods_of(time, angle, "combined", trusted=trusted)["combined"]
        assert any("peaks are missing" in text for text in result.warnings) == missing
    # Friction is taken for viscous damping.
    result = lines.log_decrement(find_peaks(time, angle))
    assert result["c_over_m"] > 4 * 0.0496
    assert any("not exponential" in text for text in result.warnings)
    for rate, few in ((22, True), (100, False)):
        warnings = methods_of(*record(WIDE, rate=rate), "energy_balance")["energy_balance"].warnings
        assert any("samples a period" in text for text in warnings) == few


def test_de_paula_finds_each_damping_alone() -> None:
    time, angle = record(DRY, seconds=30, noise_deg=1e-3)
    result = lines.de_paula(find_peaks(time, angle), fast=(0.1, 0.3), slow=(0.0, 0.2))
    assert result["Tr"] == pytest.approx(0.03, rel=5e-3)
    time, angle = record(VISCOUS, seconds=30, noise_deg=1e-3)
    result = lines.de_paula(find_peaks(time, angle), fast=(0.05, 0.3), slow=(0.0, 0.05))
    assert result["c_over_m"] == pytest.approx(0.12, rel=5e-3)
    result = lines.de_paula(find_peaks(*record(WIDE)))
    assert result["c_over_m"] > 1.2 * 0.0496
    assert result["Tr"] > 1.2 * 0.08
    assert len(result.warnings) == 2


@pytest.mark.parametrize("count", [0, 2])
def test_a_short_record_gives_the_numbers_of_peaks_found_and_needed(count: int) -> None:
    """Two peaks lie between 12 and 90 degrees, ``count`` below 12."""
    small = math.radians(11.0) * 0.9 ** np.arange(count)
    size = np.concatenate(([1.4, 0.4], small)) * (-1.0) ** np.arange(count + 2)
    made = Peaks.of(np.arange(count + 2) * 0.5, size)
    needed = {combined.from_peaks: 4, combined.repaired: 6, lines.log_decrement: 3}
    for method, least in needed.items():
        result = method(made)
        assert not result.applicable
        text = f"not applicable: {count} of {count + 2} peaks under 12 degrees, {least} are needed"
        assert result.warnings[-1].startswith(text)
    ends_above = combined.from_peaks(made).warnings[-1].endswith(": the record ends above it")
    assert ends_above == (count == 0)
    warnings = lines.de_paula(made).warnings
    assert f"2 of {count + 2} peaks between 12 and 90 degrees, 3 are needed" in warnings[0]


def test_errors_of_bare_peaks_follow_from_their_scatter() -> None:
    made = decay(release=2.5)
    time, peak = made.peak_time[30:140], made.peak[30:140]
    errors = np.random.default_rng(4).standard_normal((2, time.size))
    noisy = Peaks.of(time + 2e-3 * errors[0], peak + 5e-3 * errors[1])
    agrees(identify_peaks(noisy, ["combined_repaired"])["combined_repaired"], {"w0": 6.2})
    # Too few for a scatter: no intervals of width 0.
    few = identify_peaks(Peaks.of(time[-12:], peak[-12:]), ["log_decrement"])["log_decrement"]
    assert all(one.ci95 is None and one.stderr is None for one in few.estimates.values())
    assert not any("chi^2" in warning for warning in few.warnings)


def test_a_record_without_a_swing_suits_no_method() -> None:
    time = np.arange(300) / 100
    for result in methods_of(time, 0.5 * np.exp(-time)).values():
        assert not result.applicable
        assert result.warnings


def test_table_1_of_the_true_model_has_no_errors() -> None:
    true = Identification("true", {name: Estimate(value) for name, value in TRUTH.items()})
    wrong = Identification("wrong", true.estimates | {"w0": Estimate(6.2 * 1.05)})
    time, angle = record(WIDE, noise_deg=0.02)
    table = table1(find_peaks(time, angle), {"true": true, "wrong": wrong})
    rows = [(row.what, row.asked) for row in table.rows]
    assert rows == [("period", 0.26), ("period", 1.54), ("peak", 1.2), ("peak", 2.53)]
    assert all(row.errors["true"] < 0.15 for row in table.rows)
    assert table.rows[0].measured == pytest.approx(1.014, abs=0.01)
    assert table.rows[1].measured == pytest.approx(1.54, abs=0.05)
    assert table.rows[1].errors["wrong"] == pytest.approx(100 * (1 - 1 / 1.05), abs=1.0)
    errors = table.errors["true"]
    assert np.abs(errors.peak_error[:130]).max() < 0.5
    assert errors.peak_rms < table.errors["wrong"].peak_rms
    # A record that begins in motion is compared peak by peak too.
    for begin in (1, 60, 620):
        errors = table1(find_peaks(time[begin:], angle[begin:]), {"true": true}).errors["true"]
        assert np.abs(errors.peak_error[:100]).max() < 2
        assert np.abs(errors.period_error[:100]).max() < 1


def test_rows_of_table_1_do_not_repeat_and_leave_out_the_start() -> None:
    true = Identification("true", {"w0": Estimate(6.2), "c_over_m": Estimate(0.05)})
    time, angle = record(decay(release=1.0, until=40.0), seconds=20)
    rows = table1(find_peaks(time, angle), {"true": true}).rows
    assert [row.what for row in rows] == ["period", "period"]
    assert rows[0].measured != rows[1].measured
    # The model rests after a swing: an error that does not exist is no nan.
    assert "nan" not in str(compare(Rig(w0=6.2, Tr=30.0), run_of(time, angle)))
