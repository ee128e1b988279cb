"""An accelerometer alone: holds and releases, and checks that a reconstructed angle omits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import pendmap
from accelerations import SENSORS, TRUTH, column, experiment, handled, readings
from drawn import written
from pendmap.comparison import compare
from pendmap.comparison import experiment as compared
from pendmap.identification import identify
from pendmap.identification import report as summary

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.records import Experiment

ONCE_A_PERIOD, LATE = 1.6, 1.1
"""Part of the swings, s, that may be lost before a hand stops it, and after it lets go."""


def spans(read: Experiment) -> list[tuple[float, float]]:
    """Return the interval of each run that is used for fitting."""
    ends = [run.time[run.trusted][[0, -1]] for run in read.runs]
    return [(float(low), float(high)) for low, high in ends]


ONE, THREE = ((1.2, 30.0),), ((1.2, 12.0), (0.9, 10.0), (1.2, 14.0))


@pytest.mark.parametrize(
    ("sensor", "releases", "hold", "tremble"),
    [
        *((sensor, ONE, hold, 0.0) for sensor in SENSORS for hold in (0.4, 1.5)),
        ("near", ONE, 1.5, 0.003),
        ("near", THREE, 1.5, 0.0),
    ],
)
def test_releases_begin_after_the_hand(
    tmp_path: Path,
    sensor: str,
    releases: tuple[tuple[float, float], ...],
    hold: float,
    tremble: float,
) -> None:
    time, force, free = handled(sensor, releases, hold=hold, tremble=tremble)
    read = pendmap.read_experiment(experiment(tmp_path, column(sensor), time, force))
    used = spans(read)
    assert len(used) == len(free)
    for (low, high), (begin, end) in zip(used, free, strict=True):
        assert begin - 1e-9 <= low <= begin + LATE
        assert end - ONCE_A_PERIOD < high < end
    said = {finding.what for finding in (*read.findings, *read.runs[0].findings)}
    assert "outliers" not in said  # the jumps at the release are none


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
    assert run["peaks"] == run["periods"] == []
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
