"""Several releases in one file: each is a run, and all are fitted together."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from decays import decay, record
from fits import trajectory_of
from pendmap.comparison import compare
from pendmap.comparison.data import split_records
from pendmap.comparison.experiment import as_json as compared
from pendmap.errors import InputError
from pendmap.identification import identified_model, identify
from pendmap.identification.readings import as_fit_run, reading_of
from pendmap.identification.report import as_json, as_text
from pendmap.records import Experiment, Finding, Run
from pendmap.records.releases import edges_of
from recorded import TR, W0, C, clean, experiment, found, motion, noisy, read, text
from released import Released, released

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from conftest import Run as Command

    Floats = NDArray[np.float64]


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
        ((2.0, -1.0, 0.4, 1.5), (15.3, 12.6, 10.2, 18.0), {"tremor": 0.02}),
        # The amplitude never grows, and no hold lasts for a period.
        ((1.5, 0.3, 0.3), (10.03, 8.02, 9.1), {"tremor": 0.0, "hold": 0.3, "carry": 0.6}),
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
        assert high - 1.4 < used[-1] <= high
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


ANGLES = (0.3, 1.3, 2.8)
HOLDS = (0.3, 1.5, 20.0)
LOST = 0.25
"""Free swing that may be lost, s."""


def held(folder: Path, angle: float, hold: float, degrees: float, seed: int) -> tuple[Run, int]:
    """Return the run of a pendulum held, then released at rest, and the index of the release."""
    free = motion(start=angle, duration=15.0)[1]
    count = round(100 * hold)
    noise, step = math.radians(degrees), (0.0, 2 * math.pi / 4096, 2 * math.pi / 1024)[seed % 3]
    theta = noisy(np.concatenate((np.full(count, angle), free)), noise, step, seed)
    return read(folder, text((np.arange(theta.size) / 100, theta))), count


@pytest.mark.parametrize("angle", ANGLES)
def test_the_end_of_a_hold_is_late_rather_than_early(tmp_path: Path, angle: float) -> None:
    for seed, (hold, degrees) in enumerate(itertools.product(HOLDS, (0.05, 0.2, 0.5))):
        run, release = held(tmp_path, angle, hold, degrees, seed)
        assert not run.trusted[:release].any(), (hold, degrees)
        first = int(np.argmax(run.trusted))
        assert run.time[first] - run.time[release] < LOST, (hold, degrees)
        assert f"used from {run.time[first]:.6g} s" in found(run)["held-start"].text


@pytest.mark.parametrize(("angle", "hold"), [(1.3, 1.5), (2.8, 0.4), (0.5, 12.0)])
def test_a_fit_after_a_hold_has_residuals_of_noise_alone(
    tmp_path: Path, angle: float, hold: float
) -> None:
    run, _ = held(tmp_path, angle, hold, 0.1, 4)
    fit = trajectory_of(run.time, run.theta, trusted=run.trusted)
    assert fit.misfit == pytest.approx(1.0, abs=0.15)
    assert not any("does not fit" in warning for warning in fit.warnings)
    w0 = fit.estimates["w0"]
    assert w0.stderr is not None
    assert abs(w0.value - W0) < 4 * w0.stderr


NAMES = "t_s,theta_rad,sync"


def pulses(time: Floats, at: Floats, width: float = 0.05) -> Floats:
    """Return 1 for a while from each instant on, otherwise 0."""
    after = np.searchsorted(at, time, side="right") - 1
    return np.where((after >= 0) & (time - at[np.maximum(after, 0)] < width), 1.0, 0.0)


def test_edges_between_two_levels_are_found() -> None:
    rng = np.random.default_rng(1)
    level = np.repeat([0.2, 3.4, 0.2, 3.4, 0.2], [50, 3, 100, 40, 30])
    values = level + 0.1 * rng.standard_normal(level.size)
    values[60] = np.nan
    for edge, places in (("rising", [50, 153]), ("falling", [53, 193]), (None, [50, 153])):
        np.testing.assert_array_equal(edges_of(values, edge)[0], places)
    falls, edge = edges_of(np.repeat([1.0, 0.0], [40, 60]))
    assert (falls.tolist(), edge) == ([40], "falling")
    for without in (np.ones(50), rng.standard_normal(2000)):
        assert not edges_of(without)[0].size


@pytest.mark.parametrize("edge", ["rising", "falling"])
@pytest.mark.parametrize("form", ["ttl", "bool", "voltage", "bouncing"])
def test_an_edge_marks_the_release(tmp_path: Path, edge: str, form: str) -> None:
    # The pendulum swings in the hand before; only the trigger distinguishes this from a release.
    made = released((1.2, 2.0), (12.0, 15.0), tremor=0.02)
    held = np.ones(made.time.size, bool)
    for low, high in made.spans:
        held[(made.time >= low) & (made.time <= high)] = False
    high = held if edge == "falling" else ~held
    # Before the first release there is only a hold of 0.1 s.
    column = high.astype(float)
    lead = np.full(10, float(edge == "falling"))
    theta = np.r_[np.full(10, made.theta[0]), made.theta]
    column = np.r_[lead, column]
    starts = [0.1 + low for low, _ in made.spans]
    time = np.arange(theta.size) / 100
    rows = text((time, theta), "t_s,theta_rad").splitlines()
    if form == "bouncing":
        for start in starts:
            k = round(100 * start)
            column[[k + 1, k + 3]] = lead[0]
    if form == "bool":
        words = ["True" if value else "False" for value in column]
    else:
        noise = 0.05 * np.random.default_rng(2).standard_normal(column.size)
        volts = 0.3 + 4.5 * column + noise if form == "voltage" else column
        words = [f"{value:.3f}" for value in volts]
    content = "\n".join([NAMES, *(f"{r},{w}" for r, w in zip(rows[1:], words, strict=True))]) + "\n"
    described = (
        f'[columns]\ntrigger = {{ name = "sync", edge = "{edge}" }}\n[[run]]\nfile = "a.csv"\n'
    )
    there = experiment(tmp_path, described, a=content)
    assert [run.name for run in there.runs] == ["a 1/2", "a 2/2"]
    for run, start, (_, end) in zip(there.runs, starts, made.spans, strict=True):
        used = run.time[run.trusted]
        assert used[0] == pytest.approx(start, abs=1e-9)
        assert used[-1] <= 0.1 + end
    (said,) = (f for f in there.findings if f.what == "trigger-release")
    assert "2 releases" in said.text
    assert ("bounce" in said.text) == (form == "bouncing")


def test_nothing_before_the_edge_is_used(tmp_path: Path) -> None:
    time, theta = clean()
    (run,) = experiment(
        tmp_path,
        '[[run]]\nfile = "a.csv"\n',
        a=text((time, theta, (time > 4.005).astype(float)), NAMES),
    ).runs
    assert run.time[run.trusted][0] == pytest.approx(4.01)
    assert "4.01 s" in found(run)["trigger-release"].text


@pytest.mark.parametrize(
    ("trigger", "says"),
    [
        (lambda t: 0 * t, "of two levels"),
        (lambda t: np.sin(40 * t), "of two levels"),
        (lambda t: pulses(t, np.arange(0.3, 20, 0.5)), "three swings and less"),
        (lambda t: pulses(t, np.sort(np.random.default_rng(1).uniform(0, 20, 30)), 0.02), "three"),
    ],
)
def test_a_trigger_that_marks_no_release_is_reported(
    tmp_path: Path, trigger: object, says: str
) -> None:
    time, theta = clean()
    path = tmp_path / "a.csv"
    path.write_text(text((time, theta, trigger(time)), NAMES), encoding="utf-8")  # type: ignore[operator]
    (run,) = pendmap.read_experiment(path).runs
    assert run.trusted.all()
    assert [f.what for f in run.findings].count("trigger-unlike") == 1
    assert says in found(run)["trigger-unlike"].text
