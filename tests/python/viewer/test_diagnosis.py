"""Recordings of diagnoses, read back: the record and both models, residuals, the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from hidden import once
from pendmap import viewer
from pendmap.charts.diagnosis import forecast
from pendmap.diagnosis.result import as_text
from recordings import ReadBack, hanging, scalars

if TYPE_CHECKING:
    from pathlib import Path

    import numpy.typing as npt

    from pendmap.diagnosis import Discrepancy

    Floats = npt.NDArray[np.float64]

pytestmark = pytest.mark.usefixtures("strict_recordings")


@pytest.fixture(scope="module")
def found() -> Discrepancy:
    return once("quadratic_drag")


@pytest.fixture(scope="module")
def back(found: Discrepancy, tmp_path_factory: pytest.TempPathFactory) -> ReadBack:
    return ReadBack(viewer.record(found, tmp_path_factory.mktemp("recording") / "a.rrd"))


def test_residuals_are_those_of_the_gap(found: Discrepancy, back: ReadBack) -> None:
    """All runs are shown, held-out ones last, in mrad with two standard deviations of the noise."""
    for number, row in enumerate(found.gap.by_run, 1):
        root = f"/run_{number}/residual"
        for name, rms in (("before", row.before), ("after", row.after)):
            left = scalars(back, f"{root}/{name}")
            assert np.sqrt(np.nanmean(left**2)) == pytest.approx(1e3 * rms, rel=1e-6)
        assert scalars(back, f"{root}/above") == pytest.approx(2e3 * row.noise_floor)
        assert scalars(back, f"{root}/below") == pytest.approx(-2e3 * row.noise_floor)
    assert f"/run_{len(found.gap.by_run) + 1}/angle/record" not in back.columns


def test_three_pendulums_hang_side_by_side(found: Discrepancy, back: ReadBack) -> None:
    run = found.data.fitted[0]
    record = scalars(back, "/run_1/angle/record")
    np.testing.assert_allclose(back.seconds("/run_1/angle/record"), run.time, atol=2e-9)
    np.testing.assert_allclose(record, run.theta)
    root = "/run_1/pendulum/data"
    assert hanging(back, f"{root}/record/bob", 0.0) == pytest.approx(turned(record), abs=1e-5)
    for place, name in enumerate(("before", "after"), 1):
        model = scalars(back, f"/run_1/angle/{name}")
        left = scalars(back, f"/run_1/residual/{name}") / 1e3
        assert record - model == pytest.approx(left, abs=1e-9)
        shown = hanging(back, f"{root}/{name}/bob", 2.5 * place)
        assert turned(shown - model) == pytest.approx(0.0, abs=1e-5)


def turned(angle: Floats) -> Floats:
    """Wrap an angle to the turn about 0."""
    return np.angle(np.exp(1j * angle))


def test_torque_and_forecasts_have_their_coordinates(found: Discrepancy, back: ReadBack) -> None:
    for over in ("angle", "velocity"):
        for name, torque in (("before", found.torque_before), ("after", found.torque_after)):
            line = np.array(back.one(f"/torque/{over}/data/{name}", "LineStrips2D:strips"))
            rows = torque.rows[over]
            expected = [(row[end], row["torque"]) for row in rows for end in ("from", "to")]
            np.testing.assert_allclose(line.reshape(-1, 2), expected, rtol=1e-6, atol=1e-7)
    shown = max(found.forecasts, key=lambda one: one.starts)
    line = np.array(back.one(f"/forecast/{shown.kind}/data/after", "LineStrips2D:strips"))
    error = 1e3 * shown.after
    drawn = line.reshape(-1, 2)[:, 1]
    logarithmic = forecast(found, shown).y.scale == "log"
    np.testing.assert_allclose(10.0**drawn if logarithmic else drawn, error, rtol=1e-5)


def test_no_view_is_empty(found: Discrepancy, back: ReadBack) -> None:
    runs = len(found.gap.by_run)
    for number in range(1, runs + 1):
        for view in ("pendulum", "angle", "residual"):
            assert f"/run_{number}/{view}" in back.views
    assert {"/torque/angle", "/forecast/free", "/summary"} <= set(back.views)
    for origin in back.views:
        assert any(entity.startswith(origin) for entity in back.columns), origin


def test_the_report_is_in_the_recording(found: Discrepancy, back: ReadBack) -> None:
    text = back.one("/summary", "TextDocument:text")
    assert text.split("\n\n") == [line.strip() for line in as_text(found)]


def test_a_diagnosis_without_effects_has_a_recording(tmp_path: Path) -> None:
    back = ReadBack(viewer.record(once("none"), tmp_path / "a.rrd"))
    before, after = (scalars(back, f"/run_1/residual/{name}") for name in ("before", "after"))
    np.testing.assert_array_equal(before, after)
