"""An accelerometer alone: holds and releases, and checks that a reconstructed angle omits."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from accelerations import GRAVITY, SENSORS, TRUTH, column, experiment, handled, readings
from drawn import written
from pendmap import InputError
from pendmap.comparison import compare
from pendmap.comparison import experiment as compared
from pendmap.identification import identify
from pendmap.identification import report as summary

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.records import Experiment

ONCE_A_PERIOD = 1.1
"""Part of a swing, s, that may be lost before a hand stops it."""


def spans(read: Experiment) -> list[tuple[float, float]]:
    """Return the interval of each run that is used for fitting."""
    ends = [run.time[run.trusted][[0, -1]] for run in read.runs]
    return [(float(low), float(high)) for low, high in ends]


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("release", [1.5, 1.9, 2.5, 2.9])
def test_no_hold_is_found_beyond_a_quarter_turn(
    tmp_path: Path, sensor: str, release: float
) -> None:
    time, _, force = readings(**SENSORS[sensor][0], release=release, seconds=30)
    (run,) = pendmap.read_experiment(experiment(tmp_path, column(sensor), time, force)).runs
    assert run.trusted.all()
    assert [segment.what for segment in run.segments] == ["motion"]


def _free(read: Experiment, free: list[tuple[float, float]], late: float) -> None:
    found = spans(read)
    assert len(found) == len(free)
    for (low, high), (begin, end) in zip(found, free, strict=True):
        assert begin - 1e-9 <= low <= begin + late
        assert end - ONCE_A_PERIOD < high < end


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize(
    ("releases", "hold"),
    [
        (((1.2, 12.0), (0.9, 10.0), (1.4, 14.0)), 1.5),
        (((2.5, 15.0), (2.8, 20.0)), 1.5),
        (((1.2, 12.0), (0.9, 10.0)), 0.4),
    ],
)
def test_releases_begin_where_the_hand_lets_go(
    tmp_path: Path, sensor: str, releases: tuple[tuple[float, float], ...], hold: float
) -> None:
    time, force, free = handled(sensor, releases, hold=hold)
    read = pendmap.read_experiment(experiment(tmp_path, column(sensor), time, force))
    _free(read, free, 0.0)
    said = {finding.what for finding in (*read.findings, *read.runs[0].findings)}
    assert "outliers" not in said  # the jumps at the release are none


@pytest.mark.parametrize("sensor", ["near", "far"])
def test_a_trembling_hand_is_a_hold(tmp_path: Path, sensor: str) -> None:
    time, force, free = handled(sensor, ((1.2, 12.0), (0.9, 10.0)), tremble=0.003)
    read = pendmap.read_experiment(experiment(tmp_path, column(sensor), time, force))
    _free(read, free, 0.05)


def test_a_held_accelerometer_reads_all_of_gravity(tmp_path: Path) -> None:
    """Held at 1.2 rad it reads 9.14 m/s^2; any swing reads 5.97 there at most."""
    time, force, free = handled("near", ((1.2, 12.0), (0.9, 10.0)))
    held = (time > free[0][0] - 1.4) & (time < free[0][0])
    assert float(np.median(force[held])) == pytest.approx(GRAVITY * np.sin(1.2), rel=1e-3)
    run = pendmap.read_experiment(experiment(tmp_path, column("near"), time, force)).runs[0]
    assert np.allclose(run.theta[held[: run.theta.size]], 1.2, atol=0.05)
    force[held] *= 1.4
    with pytest.raises(InputError, match=r"is 12.8 m/s2 while .* held, and gravity gives at most"):
        pendmap.read_experiment(experiment(tmp_path, column("near"), time, force))


def test_the_releases_together_give_the_damping(tmp_path: Path) -> None:
    time, force, _ = handled("near", ((1.2, 12.0), (0.9, 10.0), (1.4, 14.0)))
    read = pendmap.read_experiment(experiment(tmp_path, column("near"), time, force))
    best = identify(read, methods=["trajectory"]).best
    for name, true in TRUTH.items():
        found = best.estimates[name]
        assert found.stderr is not None
        assert abs(found.value - true) < 4 * found.stderr


@pytest.mark.parametrize("sensor", ["far", "removed", "angular"])
def test_intervals_of_a_bias_are_in_order(tmp_path: Path, sensor: str) -> None:
    """The gain is negative beyond the centre of oscillation, and without gravity."""
    time, _, force = readings(**SENSORS[sensor][0], release=1.3, seconds=20)
    read = pendmap.read_experiment(experiment(tmp_path, column(sensor), time, force))
    report = identify(read, methods=["trajectory"])
    for name, estimate in report.best.estimates.items():
        assert estimate.ci95 is not None, name
        low, high = estimate.ci95
        assert low < estimate.value < high, name
    told = summary.as_json(report)["methods"]["trajectory"]["ci95"]["bias"]
    assert told[0] < told[1]


def test_a_reconstructed_angle_judges_no_model(tmp_path: Path) -> None:
    time, _, force = readings(release=1.3, seconds=20, tilt=0.03)
    read = pendmap.read_experiment(experiment(tmp_path, column("near"), time, force))
    report = identify(read)
    told = summary.as_json(report)
    assert told["table1"] == []
    assert "computed from an acceleration" in told["table1_left_out"]
    assert not summary.table1_table(report)[1]
    assert sum("no errors of periods and peaks" in line for line in summary.as_text(report)) == 1
    beside = compare(report.model, read)
    (one,) = beside.runs
    assert one.errors is None
    assert one.rms == pytest.approx(one.sigma, rel=0.1)
    run = compared.as_json(beside)["runs"][0]
    assert [row["quantity"] for row in run["quantities"]] == ["residual"]
    assert run["peak_rms_percent"] is None
    assert any("computed from an acceleration" in line for line in beside.text_parts()[1])


def test_figures_of_a_reconstructed_angle_explain_the_missing_judgement(tmp_path: Path) -> None:
    from pendmap.charts import comparison, identification  # noqa: PLC0415 (slow to import)
    from pendmap.render import drawing  # noqa: PLC0415 (likewise)

    time, _, force = readings(release=1.3, seconds=20)
    read = pendmap.read_experiment(experiment(tmp_path, column("near"), time, force))
    report = identify(read)
    for sheet in (identification.sheet(report), comparison.sheet(compare(report.model, read))):
        made = drawing.draw(sheet, dpi=50)
        words = written(made)
        assert "computed from an acceleration, too inaccurate to judge a model" in words
        assert not any("error of each" in axes.get_title() for axes in made.axes)


def test_no_wrong_centre_of_oscillation_is_reported(tmp_path: Path) -> None:
    centre = GRAVITY / TRUTH["w0"] ** 2
    time, _, force = readings(distance=centre, release=2.5)
    place = (
        f'{{ name = "acc", unit = "m/s2", direction = "tangential", distance_m = {centre:.4f} }}'
    )
    with pytest.raises(InputError, match="centre of oscillation") as error:
        pendmap.read_experiment(experiment(tmp_path, place, time, force))
    said = str(error.value).partition(": ")[2]
    assert re.findall(r"\d+\.\d+", said) == [f"{centre:.4f}"]
