"""Forecast errors against the horizon, and figure 7 for the given and the new model."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest

from hidden import once
from pendmap.comparison import compare
from pendmap.comparison.forecast import compare_forecasts, effect_strength
from pendmap.diagnosis import diagnosed_model

if TYPE_CHECKING:
    from pendmap.diagnosis import Discrepancy
    from pendmap.identification.runs import FitRun


@pytest.fixture
def found() -> Discrepancy:
    return once("quadratic_drag")


def test_the_error_at_horizon_0_is_the_noise(found: Discrepancy) -> None:
    assert {forecast.kind for forecast in found.forecasts} == {"free", "forced"}
    for forecast in found.forecasts:
        assert forecast.horizon[0] < 0.2
        assert forecast.after[0] == pytest.approx(forecast.noise_floor, rel=0.08)
        assert forecast.before[0] == pytest.approx(forecast.noise_floor, rel=0.1)


def test_the_new_model_forecasts_farther(found: Discrepancy) -> None:
    for forecast in found.forecasts:
        assert np.all(np.diff(forecast.horizon) > 0)
        far = forecast.horizon > 0.5 * forecast.horizon[-1]
        before, after = np.mean(forecast.before[far]), np.mean(forecast.after[far])
        # The new model's only error is that of the initial state, fitted to one swing of readings.
        assert forecast.noise_floor * 0.9 < after < 1.4 * forecast.noise_floor
        assert before > 1.2 * after


def test_periods_and_peaks_are_those_of_a_simulation(found: Discrepancy) -> None:
    """The turning points of a simulation give the periods and peaks of ``compare``."""
    model = dataclasses.replace(diagnosed_model(found), notes={})
    simulated = {one.run.name: one.errors for one in compare(model, found.data.experiment).runs}
    assert found.cycles[0].held_out
    assert {one.name for one in found.cycles} == set(simulated)
    for one in found.cycles:
        after, other = one.errors["after"], simulated[one.name]
        assert other is not None
        np.testing.assert_allclose(after.period_error, other.period_error, atol=1e-3)
        np.testing.assert_allclose(after.peak_error, other.peak_error, atol=1e-3)
    before, after = (
        np.mean([one.errors[name].peak_rms for one in found.cycles]) for name in ("before", "after")
    )
    assert after < 0.5 * before


def test_the_strength_of_a_drag_is_its_torque_on_the_motion(found: Discrepancy) -> None:
    strength = effect_strength(found.best.fitted.fit, found.data.fitted, "quadratic_drag")
    q = found.effects[0].parameters["q"]
    speeds = np.concatenate([curve[1] for curve in found.best.fitted.fit.curves])
    speeds = speeds[np.isfinite(speeds)]
    assert strength.torque == pytest.approx(q * np.sqrt(np.mean(speeds**4)), rel=0.25)
    assert strength.greatest_torque <= 1.001 * q * np.max(speeds**2)
    assert strength.reading == pytest.approx(0.0, abs=1e-9)


def test_forecasts_do_not_depend_on_where_clocks_begin(found: Discrepancy) -> None:
    for begin in np.random.default_rng(1).uniform(0.0, 1000.0, 3):
        held = tuple(_later(run, float(begin)) for run in found.data.held)
        data = dataclasses.replace(found.data, held=held)
        moved = compare_forecasts(data, found.base.fits, found.best.fits, {})
        for forecast, usual in zip(moved, found.forecasts, strict=True):
            np.testing.assert_allclose(forecast.after, usual.after, rtol=0.1)


def _later(run: FitRun, begin: float) -> FitRun:
    """Return a run on a clock that began earlier; the phase of the drive refers to its zero."""
    drive = run.drive
    if drive is not None:
        drive = {**drive, "phi": float(drive["phi"] or 0) - float(drive["Omega"] or 0) * begin}
    return dataclasses.replace(run, time=run.time + begin, drive=drive)
