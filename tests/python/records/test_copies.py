"""Copies of a run are found in any format; separate recordings of one motion are not copies."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
import recorded
from pendmap.comparison import compare
from pendmap.identification import identify

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from pendmap.records import Experiment

    Floats = NDArray[np.float64]


def experiment(folder: Path, files: dict[str, str], **keys: str) -> Experiment:
    """Write runs and their description, and read them."""
    folder.mkdir(exist_ok=True)
    lines = []
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
        lines += ["[[run]]", f'file = "{name}"', keys.get(name.partition(".")[0], "")]
    (folder / "experiment.toml").write_text("\n".join(lines), encoding="utf-8")
    return pendmap.read_experiment(folder)


def copied(read: Experiment) -> list[str]:
    return [r.name for r in read.runs for f in r.findings if f.what == "same-record"]


def rewritten(time: Floats, theta: Floats, draw: np.random.Generator) -> str:
    """Return a part of a record as text, on another clock, in another unit, with other digits."""
    size = theta.size
    first = int(draw.integers(0, size // 3))
    part = slice(first, first + int(draw.integers(size // 2, size - first + 1)))
    degrees = bool(draw.integers(0, 2))
    digits = int(draw.integers(3, 7)) - 2 * degrees
    angle = np.degrees(theta[part]) if degrees else theta[part]
    clock = time[part] + float(draw.uniform(-50, 50))
    names = "t_s,theta_deg" if degrees else "t_s,theta_rad"
    rows = (f"{t:.4f},{a:.{digits}f}" for t, a in zip(clock, angle, strict=True))
    return "\n".join([names, *rows]) + "\n"


@pytest.mark.parametrize("seed", range(4))
def test_a_copy_is_used_once_in_any_format(seed: int, tmp_path: Path) -> None:
    draw = np.random.default_rng(seed)
    start = float(draw.uniform(0.3, 2.5))
    time, theta, _ = recorded.motion(start, rate=float(draw.choice([50.0, 100.0])))
    count = float(draw.choice([0.0, recorded.COUNT]))
    noise = float(draw.choice([1e-4, 1e-3, 5e-3]))
    reading = recorded.noisy(theta, noise, count, seed)
    other = recorded.noisy(theta, noise, count, seed + 100)
    files = {
        "one.csv": recorded.text((time, reading)),
        "copy.csv": rewritten(time, reading, draw),
        "again.csv": recorded.text((time, other)),
    }
    read = experiment(tmp_path, files)
    assert copied(read) == ["copy"]
    one, copy, again = read.runs
    assert one.moves
    assert not copy.moves
    assert again.moves


@pytest.mark.parametrize("seed", range(2))
def test_recordings_of_one_decay_are_no_copies(seed: int, tmp_path: Path) -> None:
    """A release from a smaller angle follows the end of a larger one, for any pendulum."""
    draw = np.random.default_rng(seed)
    files = {}
    for k, start in enumerate((2.0, 1.9, 1.2, 1.2)):
        # The last two begin alike, to the count; the third equals a later part of the first.
        time, theta, _ = recorded.motion(start, duration=30.0, rate=200.0)
        reading = recorded.noisy(theta, 3e-4, recorded.COUNT, int(draw.integers(1e6)))
        files[f"run_{k}.csv"] = recorded.text((time, reading))
    assert copied(experiment(tmp_path, files)) == []


def test_parts_of_a_file_that_overlap_count_once(tmp_path: Path) -> None:
    time, theta, _ = recorded.motion()
    (tmp_path / "run.csv").write_text(recorded.text((time, recorded.noisy(theta))))
    lines = ["[[run]]", 'file = "run.csv"', "to_s = 15.0"]
    lines += ["[[run]]", 'file = "run.csv"', "from_s = 8.0"]
    (tmp_path / "experiment.toml").write_text("\n".join(lines))
    read = pendmap.read_experiment(tmp_path)
    own = [set(run.time[run.trusted].tolist()) for run in read.runs]
    assert not own[0] & own[1]
    assert len(copied(read)) == 1


def test_a_copy_held_out_tests_nothing(tmp_path: Path) -> None:
    time, theta, _ = recorded.motion(duration=30.0)
    other = recorded.motion(0.9, duration=30.0)[1]
    files = {
        "copy.csv": recorded.text((time + 3, np.degrees(recorded.noisy(theta))), "t_s,theta_deg"),
        "one.csv": recorded.text((time, recorded.noisy(theta))),
        "two.csv": recorded.text((time, recorded.noisy(other, seed=2))),
    }
    read = experiment(tmp_path, files, copy="hold_out = true")
    (found,) = (f for r in read.runs for f in r.findings if f.what == "same-record")
    assert found.mended
    assert "copy is a copy of one" in found.text
    assert "is no independent test" in found.text
    report = identify(read)
    assert [run.name for run in report.runs] == ["one", "two"]
    assert any("copies another" in line for line in report.text_parts()[1])
    model = pendmap.Rig(w0=recorded.W0, c_over_m=recorded.C, Tr=recorded.TR)
    compared = compare(model, read)
    assert compared.left_out == (("copy", "it is a copy of another run"),)


def test_runs_of_several_pendulums_are_reported_first(tmp_path: Path) -> None:
    time, theta, _ = recorded.motion(duration=30.0)
    files = {
        f"run_{k}.csv": recorded.text((scale * time, recorded.noisy(theta, seed=k)))
        for k, scale in enumerate((1.0, 1.3, 0.7))
    }
    read = experiment(tmp_path, files)
    assert [found.what for found in read.findings] == ["rigs-differ"]
    with pytest.raises(pendmap.InputError, match="no model can be fitted to these records"):
        identify(read)
    # Runs of one pendulum give no finding; periods are those of the small swing.
    same = experiment(
        tmp_path / "same",
        {
            f"run_{k}.csv": recorded.text(
                (time, recorded.noisy(recorded.motion(a, duration=30)[1]))
            )
            for k, a in enumerate((2.9, 1.0, 0.2))
        },
    )
    assert same.findings == ()


@pytest.mark.parametrize("rate", [3.0, 3.4, 3.6, 25.0])
def test_a_drive_is_resolved_by_two_readings_a_period(rate: float, tmp_path: Path) -> None:
    hertz = 1.75
    omega = math.tau * hertz
    time, theta, _ = recorded.motion(0.5, duration=120.0, rate=rate, drive=(0.2, omega, 0.0))
    files = {"run.csv": recorded.text((time, recorded.noisy(theta)))}
    drive = f'kind = "forced"\ndrive = {{ p = 0.2, Omega = {omega}, phi = 0.0 }}'
    (run,) = experiment(tmp_path, files, run=drive).runs
    said = [f.text for f in run.findings if f.what == "drive-unresolved"]
    assert bool(said) == (rate < 2 * hertz)
    if rate == 3.0:
        assert "1.75 Hz is read at 3 Hz" in said[0]
        assert "1.25 Hz" in said[0]


def test_a_record_with_few_usable_readings_is_reported_first(tmp_path: Path) -> None:
    """A motion that gains energy all the time is driven."""
    time = np.arange(0, 30, 0.01)
    growing = 0.1 * np.exp(0.05 * time) * np.cos(6 * time)
    path = tmp_path / "run.csv"
    path.write_text(recorded.text((time, recorded.noisy(growing))))
    (run,) = pendmap.read_experiment(path).runs
    (said,) = (f.text for f in run.findings if f.what == "few-used")
    assert f"only {run.trusted.sum()} of 3000 readings" in said
    # A long rest does not trigger the finding.
    time, theta, _ = recorded.motion(1.0, duration=20.0)
    long = np.arange(0, 500, 0.01)
    rest = np.interp(long, time, theta * np.maximum(1 - time / 18, 0))
    path.write_text(recorded.text((long, recorded.noisy(rest, 0.0002, 0.0))))
    (run,) = pendmap.read_experiment(path).runs
    assert run.trusted.sum() < 0.1 * long.size
    assert "few-used" not in {f.what for f in run.findings}
