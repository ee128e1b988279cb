"""The combined decrement as printed, and its correction: exact formulas, the recipe, records."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decays import decay, record
from pendmap.identification import Peaks
from pendmap.identification.methods import combined, de_paula, log_decrement, repaired
from pendmap.identification.methods.registry import identify_peaks, identify_record, scatter
from pendmap.identification.period import frequency, mean_period

WIDE = decay()


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
        found = combined.from_amplitudes(made, np.arange(made.size) * 0.5, reading, parity)
        assert found.delta == pytest.approx(delta, abs=1e-10)
        assert found.theta_r == pytest.approx(theta_r, abs=1e-10)


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
    found = combined.from_amplitudes(np.abs(small.amplitude), small.time, "all", 0)
    for name in ("delta", "zeta", "theta_r", "mean_period", "w0", "Tr"):
        assert getattr(found, name) == pytest.approx(wanted[name], rel=1e-9), name
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
        peaks = Peaks.of(half * np.arange(6), np.full(6, float(amplitude)), stderr_time=1e-9)
        assert frequency(peaks).w0 == pytest.approx(1, rel=1e-12)


def test_mean_periods_of_wide_swings_give_a_low_w0(truths: dict[str, Any]) -> None:
    peaks = exact_peaks(truths)
    assert 2 * math.pi / mean_period(peaks.time) == pytest.approx(6.2 * 0.93, rel=0.01)
    assert frequency(peaks, zeta=0.004).w0 == pytest.approx(6.2, rel=1e-4)


@pytest.mark.parametrize("offset_deg", [0.0, 0.05, -0.3])
def test_the_repaired_method_on_a_noisy_record(offset_deg: float) -> None:
    time, angle = record(WIDE, counts=4096, offset=math.radians(offset_deg), seed=5)
    found = identify_record(time, angle, methods=["combined_repaired"])["combined_repaired"]
    assert found.applicable
    assert found["offset"] == pytest.approx(math.radians(offset_deg), abs=5e-4)
    assert found["w0"] == pytest.approx(6.2, rel=3e-4)
    assert found["Tr"] == pytest.approx(0.08, rel=0.04)
    assert found["c_over_m"] == pytest.approx(0.0496, rel=0.1)
    for name in ("w0", "c_over_m", "Tr", "offset"):
        low, high = found.estimates[name].ci95 or (0.0, 0.0)
        assert low < found[name] < high


def test_errors_of_the_repaired_method_match_the_scatter() -> None:
    small = decay(c_over_m=0.05, tr=0.05, release=0.2)
    off = []
    for seed in range(60):
        time, angle = record(small, seconds=25, noise_deg=0.1, seed=seed)
        found = identify_record(time, angle, methods=["combined_repaired"])["combined_repaired"]
        true = {"w0": 6.2, "c_over_m": 0.05, "Tr": 0.05, "offset": 0.0}
        off.append([(found[n] - v) / (found.estimates[n].stderr or 0) for n, v in true.items()])
    scatter = np.std(off, axis=0)
    assert np.all((scatter > 0.75) & (scatter < 1.25)), scatter
    assert np.all(np.abs(np.mean(off, axis=0)) < 0.8)


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


def test_a_record_that_ends_above_12_degrees_is_not_for_the_printed_method() -> None:
    time, angle = record(WIDE, seconds=30)
    for name in ("combined", "combined_odd_ends", "combined_repaired"):
        found = identify_record(time, angle, methods=[name])[name]
        assert not found.applicable
        assert not found.estimates
        assert "not applicable" in found.warnings[-1]
        assert "12 degrees" in found.warnings[-1]
    assert (
        "ends above" in identify_record(time, angle, methods=["combined"])["combined"].warnings[-1]
    )


def test_negative_damping_is_reported_and_kept() -> None:
    time, angle = record(WIDE, offset=math.radians(0.05), counts=4096)
    found = identify_record(time, angle, methods=["combined_odd_triplets"])["combined_odd_triplets"]
    assert found["c_over_m"] < 0
    assert any(text.startswith("unphysical: c_over_m") for text in found.warnings)
    assert found.rig.c_over_m == 0


def test_a_missing_peak_is_not_bridged() -> None:
    time, angle = record(WIDE)
    trusted = (time < 70) | (time > 71.2)
    found = identify_record(time, angle, trusted=trusted, methods=["combined"])["combined"]
    assert any("peaks are missing" in text for text in found.warnings)
    whole = identify_record(time, angle, methods=["combined"])["combined"]
    assert not any("peaks are missing" in text for text in whole.warnings)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_short_record_gives_the_numbers_of_peaks_found_and_needed(count: int) -> None:
    """Two peaks lie between 12 and 90 degrees, ``count`` below 12."""
    small = math.radians(11.0) * 0.9 ** np.arange(count)
    size = np.concatenate(([1.4, 0.4], small)) * (-1.0) ** np.arange(count + 2)
    made = Peaks.of(np.arange(count + 2) * 0.5, size)
    total = count + 2
    for method, least in ((combined.from_peaks, 4), (repaired.from_peaks, 6)):
        said = method(made).warnings[-1]
        assert f"{count} of {total} peaks under 12 degrees, {least} are needed" in said
    if count < 3:
        said = log_decrement.from_peaks(made).warnings[-1]
        assert f"{count} of {total} peaks under 12 degrees, 3 are needed" in said
    found = de_paula.from_peaks(made).warnings
    assert f"2 of {total} peaks between 12 and 90 degrees, 3 are needed" in found[0]
    assert len(found) == (2 if count < 3 else 1)


def test_errors_of_bare_peaks_follow_from_their_scatter() -> None:
    made = decay(release=2.5)
    time, peak = made.peak_time[30:140], made.peak[30:140]
    rng = np.random.default_rng(4)
    noisy = Peaks.of(
        time + 2e-3 * rng.standard_normal(time.size), peak + 5e-3 * rng.standard_normal(time.size)
    )
    assert scatter(noisy.time) == pytest.approx(2e-3, rel=0.5)
    assert scatter(np.abs(noisy.amplitude)) == pytest.approx(5e-3, rel=0.5)
    found = identify_peaks(noisy, ["combined_repaired", "log_decrement"])
    w0 = found["combined_repaired"].estimates["w0"]
    assert w0.stderr is not None
    assert abs(w0.value - 6.2) < 4 * w0.stderr
    # Too few for a scatter: no intervals of width 0.
    few = identify_peaks(Peaks.of(time[-12:], peak[-12:]), ["log_decrement"])["log_decrement"]
    assert all(each.ci95 is None and each.stderr is None for each in few.estimates.values())
    assert not any("chi^2" in warning for warning in few.warnings)
