"""All methods on the same decays: each finds what its assumptions allow."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from decays import decay, record
from pendmap import InputError
from pendmap.identification import (
    METHODS,
    Estimate,
    Identification,
    Peaks,
    find_peaks,
    identify,
    table1,
)
from pendmap.identification.methods import de_paula, log_decrement
from pendmap.identification.methods.start import global_start, starting_values
from pendmap.identification.period import envelope, viscous_work

WIDE = decay()
BOTH = {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.08}
SMALL = decay(release=0.2, c_over_m=0.0496, tr=0.03, until=40.0)
VISCOUS = decay(release=0.2, c_over_m=0.12, tr=0.0, until=40.0)
DRY = decay(release=0.2, c_over_m=0.0, tr=0.03, until=60.0)

# Expected result and tolerance of each method on a clean decay that meets its assumptions.
ASSUMED = [
    ("combined", SMALL, {"w0": 2e-3, "c_over_m": 0.03, "Tr": 0.03}),
    ("combined_odd_ends", SMALL, {"w0": 2e-3, "c_over_m": 0.03, "Tr": 0.03}),
    ("combined_odd_triplets", SMALL, {"w0": 2e-3, "c_over_m": 0.05, "Tr": 0.05}),
    ("combined_repaired", SMALL, {"w0": 1e-5, "c_over_m": 0.02, "Tr": 0.02}),
    ("combined_repaired", VISCOUS, {"w0": 1e-5, "c_over_m": 0.01}),
    ("log_decrement", VISCOUS, {"w0": 2e-3, "c_over_m": 0.01}),
    ("energy_balance", WIDE, {"w0": 2e-5, "c_over_m": 2e-3, "Tr": 2e-3}),
    ("energy_balance", SMALL, {"w0": 1e-5, "c_over_m": 5e-3, "Tr": 5e-3}),
    ("energy_balance", VISCOUS, {"w0": 1e-5, "c_over_m": 2e-3}),
]
TRUE = {
    id(WIDE): BOTH,
    id(SMALL): {"w0": 6.2, "c_over_m": 0.0496, "Tr": 0.03},
    id(VISCOUS): {"w0": 6.2, "c_over_m": 0.12},
}


@pytest.mark.parametrize(("name", "made", "wanted"), ASSUMED)
def test_a_method_finds_what_it_assumes(name: str, made: object, wanted: dict[str, float]) -> None:
    time, angle = record(made, seconds=30 if made is not WIDE else 85, noise_deg=1e-4)  # type: ignore[arg-type]
    found = identify(time, angle, methods=[name]).methods[name]
    assert found.method == name
    assert found.applicable, found.warnings
    for key, close in wanted.items():
        assert found[key] == pytest.approx(TRUE[id(made)][key], rel=close), key


def test_every_method_has_the_common_result() -> None:
    time, angle = record(WIDE, counts=4096)
    everything = identify(time, angle, methods=METHODS).methods
    assert list(everything) == list(METHODS)
    for name, found in everything.items():
        assert found.method == name
        assert found.used
        assert found.covariance is not None
        names, matrix = found.covariance
        assert matrix.shape == (len(names),) * 2
        assert np.all(np.linalg.eigvalsh(matrix) > -1e-12 * np.trace(matrix))
        for key, estimate in found.estimates.items():
            assert estimate.stderr is not None
            assert estimate.stderr > 0
            assert matrix[names.index(key), names.index(key)] ** 0.5 == pytest.approx(
                estimate.stderr
            )
            assert estimate.ci95 is not None
            assert estimate.ci95[0] < estimate.ci95[1]
    assert "Tr" not in everything["log_decrement"].estimates
    assert everything["energy_balance"]["w0"] == pytest.approx(6.2, rel=1e-4)


def test_errors_of_the_energy_balance_match_the_scatter() -> None:
    off = []
    for seed in range(30):
        time, angle = record(WIDE, noise_deg=0.2, offset=2e-3, seed=seed)
        found = identify(time, angle, methods=["energy_balance"]).methods["energy_balance"]
        assert found.misfit == pytest.approx(1, abs=0.5)
        true = {**BOTH, "offset": 2e-3}
        off.append([(found[n] - v) / (found.estimates[n].stderr or 0) for n, v in true.items()])
    scatter = np.std(off, axis=0)
    assert np.all((scatter > 0.65) & (scatter < 1.35)), scatter
    assert np.all(np.abs(np.mean(off, axis=0)) < 0.8)


def test_friction_is_taken_for_viscous_by_the_logarithmic_decrement() -> None:
    time, angle = record(WIDE)
    peaks = find_peaks(time, angle)
    found = log_decrement.from_peaks(peaks)
    assert found["c_over_m"] > 4 * 0.0496
    assert any("not exponential" in text for text in found.warnings)
    line = log_decrement.from_peaks(peaks, reading="line")
    assert 0.0496 < line["c_over_m"] < found["c_over_m"]


def test_de_paula_finds_each_damping_alone() -> None:
    time, angle = record(DRY, seconds=30, noise_deg=1e-3)
    found = de_paula.from_peaks(find_peaks(time, angle), fast=(0.1, 0.3), slow=(0.0, 0.2))
    assert found["Tr"] == pytest.approx(0.03, rel=5e-3)
    time, angle = record(VISCOUS, seconds=30, noise_deg=1e-3)
    found = de_paula.from_peaks(find_peaks(time, angle), fast=(0.05, 0.3), slow=(0.0, 0.05))
    assert found["c_over_m"] == pytest.approx(0.12, rel=5e-3)
    assert "between 2.86 and 17.2 degrees" in found.used


def test_de_paula_overestimates_both_dampings() -> None:
    time, angle = record(WIDE)
    found = de_paula.from_peaks(find_peaks(time, angle))
    assert found["c_over_m"] > 1.2 * 0.0496
    assert found["Tr"] > 1.2 * 0.08
    assert len(found.warnings) == 2
    short = de_paula.from_peaks(find_peaks(time[:3000], angle[:3000]))
    assert not short.applicable


def test_the_envelope_is_that_of_the_equation_of_motion() -> None:
    made = envelope(np.array(3.0), np.array(0.0496 / 6.2), np.array(0.08 / 6.2**2), 148)
    assert np.abs(made - np.abs(WIDE.peak[:148])).max() < 2e-3
    angles = np.linspace(0.1, 3.0, 5)
    small = viscous_work(np.array([1e-3]))
    assert small == pytest.approx(math.pi * 1e-6 / 2, rel=1e-5)
    from scipy.integrate import quad  # noqa: PLC0415 (an oracle for one line)

    for angle, work in zip(angles, viscous_work(angles), strict=True):
        area, _ = quad(
            lambda x, a=angle: math.sqrt(max(2 * (math.cos(x) - math.cos(a)), 0)), -angle, angle
        )
        assert work == pytest.approx(area, rel=1e-6)


@pytest.mark.parametrize("seconds", [4.0, 10.0, 40.0, 85.0])
def test_starting_values_are_near_enough(seconds: float) -> None:
    time, angle = record(WIDE, seconds=seconds, noise_deg=0.2, offset=1e-3)
    start = starting_values(time, angle)
    assert start["w0"] == pytest.approx(6.2, rel=0.02)
    assert start["c_over_m"] >= 0
    assert start["Tr"] >= 0
    if seconds >= 40:
        assert start["c_over_m"] == pytest.approx(0.0496, rel=0.1)
        assert start["Tr"] == pytest.approx(0.08, rel=0.1)


def test_three_half_swings_are_needed_for_starting_values() -> None:
    with pytest.raises(InputError, match="three half swings or more"):
        starting_values(*record(WIDE, seconds=3.0, noise_deg=0.2))


def test_a_global_search_is_not_led_away_by_false_peaks() -> None:
    time, angle = record(WIDE)
    peaks = find_peaks(time, angle)
    false = peaks.amplitude.copy()
    false[[20, 60, 100]] *= (0.5, 1.5, 2.0)
    start = global_start(dataclasses.replace(peaks, amplitude=false))
    assert start["w0"] == pytest.approx(6.2, rel=2e-3)
    assert start["c_over_m"] == pytest.approx(0.0496, rel=0.05)
    assert start["Tr"] == pytest.approx(0.08, rel=0.05)
    with pytest.raises(InputError, match="three half swings or more"):
        global_start(Peaks.of([0.0, 1.0], [0.3, 0.2]))


def test_table_1_of_the_true_model_has_no_errors() -> None:
    time, angle = record(WIDE, noise_deg=0.02)
    true = Identification("true", {name: Estimate(value) for name, value in BOTH.items()})
    wrong = Identification("wrong", true.estimates | {"w0": Estimate(6.2 * 1.05)})
    table = table1(time, angle, {"true": true, "wrong": wrong})
    assert [(row.what, row.asked) for row in table.rows] == [
        ("period", 0.26),
        ("period", 1.54),
        ("peak", 1.2),
        ("peak", 2.53),
    ]
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


@pytest.mark.parametrize("begin", [1, 4, 60, 150, 620])
def test_a_record_that_begins_in_motion_is_compared_peak_by_peak(begin: int) -> None:
    time, angle = record(WIDE, noise_deg=0.02)
    true = Identification("true", {name: Estimate(value) for name, value in BOTH.items()})
    errors = table1(time[begin:], angle[begin:], {"true": true}).errors["true"]
    assert np.abs(errors.peak_error[:100]).max() < 2
    assert np.abs(errors.period_error[:100]).max() < 1


@pytest.mark.parametrize("name", METHODS)
def test_a_record_without_a_swing_is_not_applicable(name: str) -> None:
    time = np.arange(300) / 100
    found = identify(time, 0.5 * np.exp(-time), methods=[name]).methods[name]
    assert not found.applicable
    assert found.warnings
    with pytest.raises(InputError, match="swing"):
        starting_values(time, 0.5 * np.exp(-time))
