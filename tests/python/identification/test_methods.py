"""Methods of peaks: exact formulas of the paper, the recipe, what each assumes, and table 1."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from decays import Decay, decay, record
from fits import methods_of, run_of
from pendmap import Rig
from pendmap.comparison import compare
from pendmap.identification import (
    METHODS,
    Estimate,
    Identification,
    Peaks,
    find_peaks,
    identify,
    table1,
)
from pendmap.identification.methods import combined, lines, repaired
from pendmap.identification.methods.registry import identify_peaks, scatter
from pendmap.identification.period import frequency, mean_period, viscous_work

WIDE = decay()
SMALL = decay(release=0.2, c_over_m=0.0496, tr=0.03, until=40.0)
VISCOUS = decay(release=0.2, c_over_m=0.12, tr=0.0, until=40.0)
DRY = decay(release=0.2, c_over_m=0.0, tr=0.03, until=60.0)
BOTH = {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.08}
TRUE = {
    id(WIDE): BOTH,
    id(SMALL): {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.03},
    id(VISCOUS): {"w0": 6.2, "c_over_m": 0.12},
}


@given(
    delta=st.floats(0.0005, 0.02),
    theta_r=st.floats(2e-4, 1e-2),
    first=st.floats(0.1, 0.3),
    parity=st.integers(0, 1),
)
@settings(max_examples=200)
def test_eqs_2_7_and_2_10_invert_2_4_to_2_6(
    delta: float, theta_r: float, first: float, parity: int
) -> None:
    made = combined.recursion(first, delta, theta_r, 100)
    below = np.flatnonzero(made <= 0)
    made = made[: below[0]] if below.size else made
    if made.size < 6:
        return
    assert combined.decrement(made) == pytest.approx(delta, abs=1e-12)
    assert combined.coulomb(made) == pytest.approx(theta_r, abs=1e-12)
    # All triplets agree, and so do both readings of "odd half cycles alone".
    deltas, thetas = combined.triplets(made)
    assert deltas == pytest.approx(delta, abs=1e-10)
    assert thetas == pytest.approx(theta_r, abs=1e-10)
    for reading in ("odd_ends", "odd_triplets"):
        result = combined.from_amplitudes(made, np.arange(made.size) * 0.5, reading, parity)
        assert result.delta == pytest.approx(delta, abs=1e-10)
        assert result.theta_r == pytest.approx(theta_r, abs=1e-10)


@given(zero=st.floats(-3e-3, 3e-3), theta_r=st.floats(5e-4, 5e-3), delta=st.floats(0.001, 0.01))
@settings(max_examples=50)
def test_the_repaired_method_finds_the_zero_error(
    zero: float, theta_r: float, delta: float
) -> None:
    made = combined.recursion(0.2, delta, theta_r, 60)
    made = made[made > 0]
    w0, zeta = 6.2, delta / math.sqrt(1 + delta**2)
    quarter = np.array([_quarter(a) for a in made])
    times = np.concatenate(([0.0], np.cumsum(quarter[1:] + quarter[:-1])))
    times /= w0 * math.sqrt(1 - zeta**2)
    peaks = Peaks.of(times, made * (-1.0) ** np.arange(made.size) + zero)
    found = repaired.from_peaks(peaks)
    assert found["offset"] == pytest.approx(zero, abs=1e-9)
    assert found["w0"] == pytest.approx(w0, rel=1e-8)
    assert found["Tr"] == pytest.approx(theta_r * w0**2, rel=1e-6)
    assert found["c_over_m"] == pytest.approx(2 * zeta * w0, rel=1e-5)


def _quarter(amplitude: float) -> float:
    """Return a quarter period by the arithmetic-geometric mean, not by an elliptic integral."""
    a, b = 1.0, math.cos(amplitude / 2)
    for _ in range(8):
        a, b = (a + b) / 2, math.sqrt(a * b)
    return math.pi / (2 * a)


def exact_peaks(truths: dict[str, Any]) -> Peaks:
    """Return the peaks of the reference decay without the final stop."""
    exact = truths["free_decay"]["nonlinear"][0]
    return Peaks.of(np.array(exact["times"], float)[:-1], np.array(exact["thetas"], float)[:-1])


def test_the_recipe_on_the_exact_peaks(truths: dict[str, Any]) -> None:
    wanted = truths["decrement_recipe"][0]
    small, warnings = combined.small_peaks(exact_peaks(truths), wanted["cut"])
    assert not warnings
    assert small.index[[0, -1]].tolist() == [wanted["i0"], wanted["i0"] + wanted["k"]]
    result = combined.from_amplitudes(np.abs(small.amplitude), small.time, "all", 0)
    for name in ("delta", "zeta", "theta_r", "mean_period", "w0", "Tr"):
        assert getattr(result, name) == pytest.approx(wanted[name], rel=1e-9), name
    deltas, _ = combined.triplets(np.abs(small.amplitude))
    assert deltas.mean() == pytest.approx(wanted["delta_triplet_mean"], rel=1e-9)
    result = combined.from_peaks(exact_peaks(truths))
    assert result["w0"] == pytest.approx(wanted["w0"], rel=1e-9)
    assert result["Tr"] == pytest.approx(wanted["Tr"], rel=1e-9)
    assert result.derived["zeta"].value == pytest.approx(wanted["zeta"], rel=1e-9)
    assert result.derived["theta_r"].value == pytest.approx(wanted["theta_r"], rel=1e-9)


def test_exact_linear_peaks_give_the_reference_numbers(truths: dict[str, Any]) -> None:
    for made in truths["free_decay"]["linear"]:
        peaks = np.array(made["peaks_abs"], float)[:-1]
        w0, zeta = float(made["w0"]), float(made["zeta"])
        assert combined.decrement(peaks) == pytest.approx(float(made["eq27_delta"]), abs=1e-12)
        assert combined.coulomb(peaks) * w0**2 == pytest.approx(float(made["eq210_Tr"]), abs=1e-12)
        times = np.array(made["times"], float)[:-1]
        period = 2 * math.pi / (w0 * math.sqrt(1 - zeta**2))
        assert mean_period(times) == pytest.approx(period, rel=1e-12)


def test_the_period_over_amplitude_is_the_reference_one(truths: dict[str, Any]) -> None:
    for amplitude, wanted in truths["free_decay"]["period_vs_amplitude"].items():
        half = float(wanted["T_tau"]) / 2
        peaks = Peaks.of(half * np.arange(6), np.full(6, float(amplitude)))
        assert frequency(peaks).w0 == pytest.approx(1, rel=1e-12)


def test_mean_periods_of_wide_swings_give_a_low_w0(truths: dict[str, Any]) -> None:
    peaks = exact_peaks(truths)
    assert 2 * math.pi / mean_period(peaks.time) == pytest.approx(6.2 * 0.93, rel=0.01)
    assert frequency(peaks, zeta=0.004).w0 == pytest.approx(6.2, rel=1e-4)


@pytest.mark.parametrize(
    ("name", "made", "wanted"),
    [
        ("combined", SMALL, {"w0": 2e-3, "c_over_m": 0.03, "Tr": 0.03}),
        ("combined_odd_ends", SMALL, {"w0": 2e-3, "c_over_m": 0.03, "Tr": 0.03}),
        ("combined_odd_triplets", SMALL, {"w0": 2e-3, "c_over_m": 0.05, "Tr": 0.05}),
        ("combined_repaired", SMALL, {"w0": 1e-5, "c_over_m": 0.02, "Tr": 0.02}),
        ("combined_repaired", VISCOUS, {"w0": 1e-5, "c_over_m": 0.01}),
        ("log_decrement", VISCOUS, {"w0": 2e-3, "c_over_m": 0.01}),
        ("energy_balance", WIDE, {"w0": 2e-5, "c_over_m": 2e-3, "Tr": 2e-3}),
        ("energy_balance", SMALL, {"w0": 1e-5, "c_over_m": 5e-3, "Tr": 5e-3}),
        ("energy_balance", VISCOUS, {"w0": 1e-5, "c_over_m": 2e-3}),
    ],
)
def test_a_method_finds_what_it_assumes(name: str, made: Decay, wanted: dict[str, float]) -> None:
    time, angle = record(made, seconds=30 if made is not WIDE else 85, noise_deg=1e-4)
    result = methods_of(time, angle, name)[name]
    assert result.method == name
    assert result.applicable, result.warnings
    for key, close in wanted.items():
        assert result[key] == pytest.approx(TRUE[id(made)][key], rel=close), key


def test_every_method_has_the_common_result() -> None:
    time, angle = record(WIDE, counts=4096)
    everything = methods_of(time, angle)
    assert list(everything) == list(METHODS)
    for name, result in everything.items():
        assert result.method == name
        assert result.used
        assert result.covariance is not None
        names, matrix = result.covariance
        assert matrix.shape == (len(names),) * 2
        assert np.all(np.linalg.eigvalsh(matrix) > -1e-12 * np.trace(matrix))
        for key, estimate in result.estimates.items():
            assert estimate.stderr
            place = names.index(key)
            assert matrix[place, place] ** 0.5 == pytest.approx(estimate.stderr)
            assert estimate.ci95 is not None
            assert estimate.ci95[0] < estimate.ci95[1]
    assert "Tr" not in everything["log_decrement"].estimates
    assert everything["energy_balance"]["w0"] == pytest.approx(6.2, rel=1e-4)


@pytest.mark.parametrize(
    ("name", "made", "seconds", "truth"),
    [
        ("energy_balance", WIDE, 85, {**BOTH, "offset": 2e-3}),
        ("combined_repaired", SMALL, 25, TRUE[id(SMALL)] | {"offset": 2e-3}),
    ],
)
def test_errors_match_the_scatter(
    name: str, made: Decay, seconds: float, truth: dict[str, float]
) -> None:
    off = []
    for seed in range(25):
        noise = 0.2 if made is WIDE else 0.1
        time, angle = record(made, seconds=seconds, noise_deg=noise, offset=2e-3, seed=seed)
        result = methods_of(time, angle, name)[name]
        off.append([(result[n] - v) / (result.estimates[n].stderr or 0) for n, v in truth.items()])
    deviation = np.std(off, axis=0)
    assert np.all((deviation > 0.65) & (deviation < 1.35)), deviation
    assert np.all(np.abs(np.mean(off, axis=0)) < 0.8)


@pytest.mark.parametrize("offset_deg", [0.05, -0.3])
def test_the_repaired_method_on_a_noisy_record(offset_deg: float) -> None:
    time, angle = record(WIDE, counts=4096, offset=math.radians(offset_deg), seed=5)
    result = methods_of(time, angle, "combined_repaired")["combined_repaired"]
    assert result["offset"] == pytest.approx(math.radians(offset_deg), abs=5e-4)
    assert result["w0"] == pytest.approx(6.2, rel=3e-4)
    assert result["Tr"] == pytest.approx(0.08, rel=0.04)
    assert result["c_over_m"] == pytest.approx(0.0496, rel=0.1)


def test_an_offset_makes_triplets_alternate_and_readings_differ() -> None:
    small = decay(c_over_m=0.05, tr=0.05, release=0.2)
    peaks = small.peak[:-1] + 1e-3
    deltas, _ = combined.triplets(np.abs(peaks))
    about = deltas - np.median(deltas)
    assert np.all(np.sign(about[1:-2]) == -np.sign(about[2:-1]))
    made = Peaks.of(small.peak_time[:-1], peaks)
    ends = combined.from_peaks(made, reading="odd_ends")
    triplets = combined.from_peaks(made, reading="odd_triplets")
    assert abs(triplets["c_over_m"] - ends["c_over_m"]) > 0.5 * abs(ends["c_over_m"])
    assert repaired.from_peaks(made)["offset"] == pytest.approx(1e-3, abs=1e-5)


def test_negative_damping_is_reported_and_kept() -> None:
    time, angle = record(WIDE, offset=math.radians(0.05), counts=4096)
    result = methods_of(time, angle, "combined_odd_triplets")["combined_odd_triplets"]
    assert result["c_over_m"] < 0
    assert any(text.startswith("unphysical: c_over_m") for text in result.warnings)
    assert result.rig.c_over_m == 0


def test_a_missing_peak_is_not_bridged() -> None:
    time, angle = record(WIDE)
    gap = (time < 70) | (time > 71.2)
    for trusted, missing in ((gap, True), (None, False)):
        result = methods_of(time, angle, "combined", trusted=trusted)["combined"]
        assert any("peaks are missing" in text for text in result.warnings) == missing


def test_friction_is_taken_for_viscous_by_the_logarithmic_decrement() -> None:
    result = lines.log_decrement(find_peaks(*record(WIDE)))
    assert result["c_over_m"] > 4 * 0.0496
    assert any("not exponential" in text for text in result.warnings)


def test_de_paula_finds_each_damping_alone() -> None:
    time, angle = record(DRY, seconds=30, noise_deg=1e-3)
    result = lines.de_paula(find_peaks(time, angle), fast=(0.1, 0.3), slow=(0.0, 0.2))
    assert result["Tr"] == pytest.approx(0.03, rel=5e-3)
    time, angle = record(VISCOUS, seconds=30, noise_deg=1e-3)
    result = lines.de_paula(find_peaks(time, angle), fast=(0.05, 0.3), slow=(0.0, 0.05))
    assert result["c_over_m"] == pytest.approx(0.12, rel=5e-3)
    assert "between 2.86 and 17.2 degrees" in result.used
    result = lines.de_paula(find_peaks(*record(WIDE)))
    assert result["c_over_m"] > 1.2 * 0.0496
    assert result["Tr"] > 1.2 * 0.08
    assert len(result.warnings) == 2


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_a_short_record_gives_the_numbers_of_peaks_found_and_needed(count: int) -> None:
    """Two peaks lie between 12 and 90 degrees, ``count`` below 12."""
    small = math.radians(11.0) * 0.9 ** np.arange(count)
    size = np.concatenate(([1.4, 0.4], small)) * (-1.0) ** np.arange(count + 2)
    made = Peaks.of(np.arange(count + 2) * 0.5, size)
    below = f"{count} of {count + 2} peaks under 12 degrees"
    for method, least in ((combined.from_peaks, 4), (repaired.from_peaks, 6)):
        result = method(made)
        assert not result.applicable
        assert result.warnings[-1].startswith(f"not applicable: {below}, {least} are needed")
    ends_above = combined.from_peaks(made).warnings[-1].endswith("needed: the record ends above it")
    assert ends_above == (count == 0)
    if count < 3:
        assert f"{below}, 3 are needed" in lines.log_decrement(made).warnings[-1]
    warnings = lines.de_paula(made).warnings
    assert f"2 of {count + 2} peaks between 12 and 90 degrees, 3 are needed" in warnings[0]
    assert len(warnings) == (2 if count < 3 else 1)


def test_errors_of_bare_peaks_follow_from_their_scatter() -> None:
    made = decay(release=2.5)
    time, peak = made.peak_time[30:140], made.peak[30:140]
    rng = np.random.default_rng(4)
    noisy = Peaks.of(
        time + 2e-3 * rng.standard_normal(time.size), peak + 5e-3 * rng.standard_normal(time.size)
    )
    assert scatter(noisy.time) == pytest.approx(2e-3, rel=0.5)
    assert scatter(np.abs(noisy.amplitude)) == pytest.approx(5e-3, rel=0.5)
    w0 = identify_peaks(noisy, ["combined_repaired"])["combined_repaired"].estimates["w0"]
    assert w0.stderr is not None
    assert abs(w0.value - 6.2) < 4 * w0.stderr
    # Too few for a scatter: no intervals of width 0.
    few = identify_peaks(Peaks.of(time[-12:], peak[-12:]), ["log_decrement"])["log_decrement"]
    assert all(each.ci95 is None and each.stderr is None for each in few.estimates.values())
    assert not any("chi^2" in warning for warning in few.warnings)


def test_the_work_of_viscous_damping_is_that_of_the_equation_of_motion() -> None:
    assert viscous_work(np.array([1e-3])) == pytest.approx(math.pi * 1e-6 / 2, rel=1e-5)
    angles = np.linspace(0.1, 3.0, 5)
    for angle, work in zip(angles, viscous_work(angles), strict=True):
        area, _ = quad(
            lambda x, a=angle: math.sqrt(max(2 * (math.cos(x) - math.cos(a)), 0)), -angle, angle
        )
        assert work == pytest.approx(area, rel=1e-6)


@pytest.mark.parametrize("name", METHODS)
def test_a_record_without_a_swing_is_not_applicable(name: str) -> None:
    time = np.arange(300) / 100
    result = identify(time, 0.5 * np.exp(-time), methods=[name]).methods[name]
    assert not result.applicable
    assert result.warnings


def test_table_1_of_the_true_model_has_no_errors() -> None:
    true = Identification("true", {name: Estimate(value) for name, value in BOTH.items()})
    wrong = Identification("wrong", true.estimates | {"w0": Estimate(6.2 * 1.05)})
    peaks = find_peaks(*record(WIDE, noise_deg=0.02))
    table = table1(peaks, {"true": true, "wrong": wrong})
    rows = [(row.what, row.asked) for row in table.rows]
    assert rows == [("period", 0.26), ("period", 1.54), ("peak", 1.2), ("peak", 2.53)]
    for row in table.rows:
        assert row.errors["true"] < 0.15
    assert table.rows[0].measured == pytest.approx(1.014, abs=0.01)
    assert table.rows[1].measured == pytest.approx(1.54, abs=0.05)
    assert table.rows[1].errors["wrong"] == pytest.approx(100 * (1 - 1 / 1.05), abs=1.0)
    errors = table.errors["true"]
    assert errors.peak_error.shape == errors.peak.shape == errors.peak_index.shape
    assert errors.period_error.shape == errors.period_time.shape
    assert np.abs(errors.peak_error[:130]).max() < 0.5
    assert errors.peak_rms < table.errors["wrong"].peak_rms


@pytest.mark.parametrize("begin", [1, 60, 620])
def test_a_record_that_begins_in_motion_is_compared_peak_by_peak(begin: int) -> None:
    time, angle = record(WIDE, noise_deg=0.02)
    true = Identification("true", {name: Estimate(value) for name, value in BOTH.items()})
    errors = table1(find_peaks(time[begin:], angle[begin:]), {"true": true}).errors["true"]
    assert np.abs(errors.peak_error[:100]).max() < 2
    assert np.abs(errors.period_error[:100]).max() < 1


def test_rows_of_table_1_do_not_repeat_and_leave_out_the_start() -> None:
    true = Identification("true", {"w0": Estimate(6.2), "c_over_m": Estimate(0.05)})
    time, angle = record(decay(release=1.0, until=40.0), seconds=20)
    peaks = find_peaks(time, angle)
    rows = table1(peaks, {"true": true}).rows
    assert [row.what for row in rows] == ["period", "period"]
    assert rows[0].measured != rows[1].measured
    rows = table1(peaks, {"true": true}, periods=(1.1, 1.1), peaks=(0.5, 0.5, 1.0, 2.0)).rows
    assert [(row.what, row.asked) for row in rows] == [("period", 1.1), ("peak", 0.5)]
    # The model rests after a swing: an error that does not exist is no nan.
    result = compare(Rig(w0=6.2, Tr=30.0), run_of(time, angle))
    ((_, shown),), lines = result.text_parts()
    assert {row[0].strip(): row[2] for row in shown}["periods, rms"] == ""
    assert not any("nan" in line for line in lines)
