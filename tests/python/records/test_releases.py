"""Several releases in one file: each is a run, and all are fitted together."""

from __future__ import annotations

import dataclasses
import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from decays import decay, record
from pendmap.comparison import compare
from pendmap.comparison.data import split_records
from pendmap.comparison.experiment import as_json as compared
from pendmap.errors import InputError
from pendmap.identification import identified_model, identify
from pendmap.identification.readings import as_fit_run, reading_of
from pendmap.identification.report import as_json, as_text
from pendmap.records import Experiment, Finding, Run
from recorded import TR, W0, C, clean, experiment, found, motion, noisy, text
from released import Released, released

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run as Command

THREE = (1.2, -0.6, 2.4), (20.03, 15.04, 25.02)
TRUTH = {"w0": W0, "c_over_m": C, "Tr": TR}


def write(folder: Path, made: Released, name: str = "decay.csv") -> Path:
    path = folder / name
    path.write_text(text((made.time, made.theta)), encoding="utf-8")
    return path


def length(run: Run) -> float:
    return float(np.ptp(run.time[run.trusted]))


@pytest.mark.parametrize(
    ("starts", "seconds", "hand"),
    [
        ((1.2, 2.0), (20.03, 25.02), {}),
        (*THREE, {}),
        ((1.0, -1.0, 1.2, 1.5), (15.3, 12.6, 10.2, 18.0), {"tremor": 0.02}),
        ((0.5, 2.0), (12.0, 15.0), {"tremor": 0.0, "hold": 3.0, "carry": 2.0}),
    ],
)
def test_each_release_is_a_run(
    tmp_path: Path, starts: tuple[float, ...], seconds: tuple[float, ...], hand: dict[str, float]
) -> None:
    made = released(starts, seconds, **hand)
    there = pendmap.read_experiment(write(tmp_path, made))
    count = len(starts)
    assert [run.name for run in there.runs] == [f"decay {k}/{count}" for k in range(1, count + 1)]
    (said,) = (f for f in there.findings if f.what == "several-releases")
    assert f"{count} releases" in said.text
    for run, (low, high) in zip(there.runs, made.spans, strict=True):
        used = run.time[run.trusted]
        assert low <= used[0] < low + 0.45  # no reading of the hand, a quarter swing is lost
        assert high - 1.1 < used[-1] <= high
        at = np.searchsorted(made.time, run.time)
        np.testing.assert_allclose(run.theta, made.theta[at], atol=1e-6)


def test_all_releases_together_are_more_precise_than_the_longest(tmp_path: Path) -> None:
    together, alone = [], []
    for seed in range(4):
        there = pendmap.read_experiment(write(tmp_path, released(*THREE, seed=seed)))
        longest = dataclasses.replace(there, runs=(max(there.runs, key=length),))
        for errors, which in ((together, there), (alone, longest)):
            best = identify(which, methods=["trajectory"]).best
            for name, true in TRUTH.items():
                estimate = best.estimates[name]
                assert estimate.stderr is not None
                assert abs(estimate.value - true) < 4 * estimate.stderr
                errors.append((estimate.value - true, estimate.stderr))
    both, one = (np.array(errors).reshape(4, 3, 2) for errors in (together, alone))
    assert np.all(both[..., 1] < 0.75 * one[..., 1])
    # The errors of the estimates, over the standard errors from the longest alone.
    size = one[..., 1].mean(axis=0)
    assert np.sum((both[..., 0] / size) ** 2) < np.sum((one[..., 0] / size) ** 2)


def test_every_command_reports_the_releases(tmp_path: Path, pendmap_command: Command) -> None:
    path = write(tmp_path, released((1.2, 2.0), (12.03, 15.02)))
    there = pendmap.read_experiment(path)
    report = identify(there, methods=["trajectory"])
    assert {run["name"] for run in as_json(report)["runs"]} == {"decay 1/2", "decay 2/2"}
    assert all(run["rms"] < 1.2 * run["noise"] for run in as_json(report)["runs"])
    model = identified_model(report)
    records = model.notes["provenance"]["records"]
    assert [record["file"] for record in records] == ["decay.csv"]
    assert [record["sha256"] for record in records] == [there.runs[0].sha256]
    beside = compare(model, there)
    assert [run["name"] for run in compared(beside)["runs"]] == ["decay 1/2", "decay 2/2"]
    for lines in (as_text(report), beside.text_parts()[1]):
        assert any("2 releases" in line for line in lines)
    looked = json.loads(pendmap_command("look", path, "--json").stdout)
    assert "several-releases" in {finding["what"] for finding in looked["findings"]}
    assert [run["name"] for run in looked["runs"]] == ["decay 1/2", "decay 2/2"]
    assert "2 releases" in pendmap_command("look", path).stdout
    data = split_records(there)
    assert [run.name for run in data.fitted] == ["decay 1/2", "decay 2/2"]


def test_each_release_inherits_the_description_of_its_run(tmp_path: Path) -> None:
    made = released(*THREE)
    described = (
        '[[run]]\nfile = "decay.csv"\nlab_time_s = 300\nhold_out = true\n'
        '[[run]]\nfile = "decay.csv"\nto_s = 35\n[[run]]\nfile = "a.csv"\n'
    )
    content = text((made.time, made.theta))
    there = experiment(tmp_path, described, decay=content, a=text(clean(start=0.9)))
    names = [run.name for run in there.runs]
    assert names == [
        *("decay (1) 1/3", "decay (1) 2/3", "decay (1) 3/3"),
        *("decay (2) 1/2", "decay (2) 2/2", "a"),
    ]
    assert [run.hold_out for run in there.runs] == [True] * 3 + [False] * 3
    assert set(there.sha256) == {"decay.csv", "a.csv"}
    assert there.runs[4].time[-1] <= 35
    report = identify(there, methods=["trajectory"])
    assert report.joint is not None
    assert [run.name for run in report.runs] == ["a", "decay (2) 1/2", "decay (2) 2/2"]
    # Drifts refer to the laboratory's clock: a release begins at its time in the file.
    second = there.runs[1]
    given = as_fit_run(second, reading_of(second.time, second.theta))
    assert given.lab_time_s + given.time[0] == pytest.approx(300 + second.time[0])
    assert second.time[0] == pytest.approx(made.spans[1][0], abs=0.3)


def test_a_release_of_few_swings_is_left_out(tmp_path: Path) -> None:
    made = released((1.2, 0.8, 2.0), (12.0, 2.2, 15.0))
    there = pendmap.read_experiment(write(tmp_path, made))
    assert [run.name for run in there.runs] == ["decay 1/2", "decay 2/2"]
    (said,) = (f for f in there.findings if f.what == "several-releases")
    assert "3 releases" in said.text
    assert "1 of fewer than three swings left out" in said.text
    made = released((0.8, 2.0), (2.2, 15.0))
    (run,) = pendmap.read_experiment(write(tmp_path, made)).runs
    assert run.name == "decay"
    assert run.time[run.trusted][0] >= made.spans[1][0]
    assert "one is used" in found(run)["several-releases"].text


@pytest.mark.parametrize("friction", [0.06, 0.8])
def test_friction_is_not_taken_for_a_hand(tmp_path: Path, friction: float) -> None:
    # Tr is 0.02 of w0^2 at most: the last swings are damped almost by friction alone.
    time, theta = record(decay(release=0.8, c_over_m=0.05, tr=friction, until=80.0), seconds=60)
    rest = np.flatnonzero(np.abs(np.diff(theta[::20])) > 0.01)[-1] / 5
    (run,) = pendmap.read_experiment(write(tmp_path, Released(time, theta, []))).runs
    assert "several-releases" not in found(run)
    assert run.time[run.trusted][0] == time[0]
    assert run.time[run.trusted][-1] > rest - 1.5


def test_noise_alone_is_refused_in_one_line(tmp_path: Path, pendmap_command: Command) -> None:
    time = np.arange(2000) / 100
    path = tmp_path / "still.csv"
    path.write_text(text((time, noisy(0 * time, 1e-3, 0))), encoding="utf-8")
    (run,) = pendmap.read_experiment(path).runs
    assert not run.trusted.any()
    assert json.loads(pendmap_command("look", path, "--json").stdout)["runs"][0]["trusted"] == 0
    assert pendmap.noise_floor(run).sigma == pytest.approx(1e-3, rel=0.1)
    for command in ("identify", "diagnose"):
        ran = pendmap_command(command, path)
        assert ran.returncode == 2
        assert ran.stderr.count("\n") == 1
        assert "nothing moves" in ran.stderr


def test_a_refusal_gives_the_reason_of_the_runs_asked_for(tmp_path: Path) -> None:
    time = np.arange(20.0)
    still = [
        Run(name, f"{name}.csv", "free", time, 0 * time, time < 0, findings=(reason,))
        for name, reason in (
            ("a", Finding("no-motion", "nothing moves: within 1 rad")),
            ("b", Finding("no-motion", "nothing moves: within 2 rad")),
        )
    ]
    with pytest.raises(InputError, match="within 2 rad"):
        Experiment(tmp_path, tuple(still)).refuse_still(still[1:])


def test_a_still_run_is_left_out(tmp_path: Path) -> None:
    time, theta, _ = motion()
    still = Run("b", "b.csv", "free", time, 0 * theta, np.zeros(time.size, bool))
    moving = Run("a", "a.csv", "free", time, noisy(theta), np.ones(time.size, bool))
    report = identify(Experiment(tmp_path, (still, moving)), methods=["trajectory"])
    assert [run.name for run in report.runs] == ["a"]
    assert "1 run read; 1 run in which nothing moves is not used" in list(as_text(report))
