"""Experiments of the virtual rig: what is written, what is hidden, what is refused."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import signal
import subprocess
import sys
import time
import tomllib
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from conftest import COMMAND
from pendmap import InputError, cli
from pendmap.virtual_rig import EFFECTS, PRESETS, Experiment, Request, make

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

COUNT = math.tau / 4096


def read_toml(path: Path) -> dict[str, Any]:
    """Parse a TOML file."""
    return tomllib.loads(path.read_text(encoding="utf-8"))


def record(path: Path) -> np.ndarray:
    """Read a run: columns of time and angle."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["t_s", "theta_rad"]
    return np.array(rows[1:], float)


def short(**given: Any) -> Experiment:  # noqa: ANN401 (of a request)
    """A small experiment without hidden effects, if nothing else is said."""
    settings = {"effects": ("none",), "free": 2, "forced": 1, "duration": 5.0, "noise": 0.0}
    return make(Request("hidden", **(settings | given)))  # type: ignore[arg-type]


@pytest.fixture
def rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """`pendmap rig` with these words in `tmp_path`, within this process: a start costs most."""
    monkeypatch.chdir(tmp_path)

    def run(*words: object, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
        assert env is None
        monkeypatch.setattr(sys, "argv", ["pendmap", "rig", *map(str, words)])
        with pytest.raises(SystemExit) as end:
            cli.run()
        out, err = capsys.readouterr()
        return subprocess.CompletedProcess(words, int(end.value.code or 0), out, err)

    return run


def test_an_experiment_is_a_folder_with_its_truth_beside(
    pendmap_command: Run, tmp_path: Path
) -> None:
    run = pendmap_command("rig", "hidden", "--seed", 1, "--out", "lab", "--json")
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout) == {"experiment": "lab", "truth": "lab.truth.toml"}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["lab", "lab.truth.toml"]
    description = read_toml(tmp_path / "lab" / "experiment.toml")
    files = {entry["file"] for entry in description["run"]}
    assert {path.name for path in (tmp_path / "lab").iterdir()} == {*files, "experiment.toml"}
    kinds = [entry["kind"] for entry in description["run"]]
    assert (kinds.count("free"), kinds.count("forced")) == (5, 4)
    assert description["rig"]["encoder_counts"] == 4096
    begins = [entry["lab_time_s"] for entry in description["run"]]
    for entry, begin, later in zip(
        description["run"], begins, [*begins[1:], math.inf], strict=True
    ):
        rows = record(tmp_path / "lab" / entry["file"])
        assert 15 <= rows[-1, 0] <= 30
        assert np.diff(rows[:, 0]) == pytest.approx(0.01, abs=1e-9)
        assert begin + rows[-1, 0] < later
        assert ("drive" in entry) == (entry["kind"] == "forced")
        if "drive" in entry:
            assert set(entry["drive"]) == {"p", "Omega", "phi"}
    truth = read_toml(tmp_path / "lab.truth.toml")
    (effect,) = truth["effect"]
    hidden = (tmp_path / "lab" / "experiment.toml").read_text(encoding="utf-8")
    assert effect["name"] not in hidden
    assert effect["name"] in {name.split(":")[0] for name in EFFECTS}
    assert 0.05 <= truth["sensor"]["noise_deg"] <= 0.5
    assert {"w0", "c_over_m", "Tr"} <= set(truth["pendulum"])


def test_what_is_hidden_is_not_said(rig: Run, tmp_path: Path) -> None:
    run = rig("hidden", "--seed", 4, "--out", "lab")
    (effect,) = read_toml(tmp_path / "lab.truth.toml")["effect"]
    assert effect["name"] not in run.stdout + run.stderr
    assert rig("forced", "--duration", 2, "--out", "f", "--quiet").stdout == ""


def test_files_have_a_table_for_each_run_and_effect(rig: Run, tmp_path: Path) -> None:
    effects = ("--effect", "magnet", "--effect", "pivot_compliance:two_modes")
    rig("hidden", *effects, "--duration", 2, "--out", "lab")
    text = (tmp_path / "lab" / "experiment.toml").read_text(encoding="utf-8")
    assert text.count("\n[[run]]\nfile = ") == 9
    assert text.count("\ndrive = { p = ") == 4
    text = (tmp_path / "lab.truth.toml").read_text(encoding="utf-8")
    assert text.count("\n[[run]]\n") == 9
    assert text.count("\n[[effect]]\nname = ") == 2
    magnet, pivot = read_toml(tmp_path / "lab.truth.toml")["effect"]
    assert set(magnet["parameters"]) == {"amplitude", "width"}
    assert len(pivot["parameters"]) == len(pivot["units"]) == 6


def test_the_same_seed_gives_the_same_bytes(rig: Run, tmp_path: Path) -> None:
    for seed, out in ((3, "a"), (3, "b"), (4, "c")):
        run = rig("hidden", "--seed", seed, "--duration", 3, "--out", out)
        assert run.returncode == 0, run.stderr
    one, same, other = (
        [p.read_bytes() for p in sorted((tmp_path / name).iterdir())] for name in "abc"
    )
    assert one == same
    assert one != other
    truths = [(tmp_path / f"{name}.truth.toml").read_bytes() for name in "abc"]
    assert truths[0] == truths[1] != truths[2]


def test_a_free_decay_rests_where_dry_friction_holds_it() -> None:
    experiment = make(Request("free_decay", seed=2, noise=0.0, counts=0))
    (run,) = experiment.runs
    assert abs(run.plan.theta) > 2.9
    parameters = experiment.parameters
    last = run.path.events[-1]
    assert last.what == "stick"
    assert abs(math.sin(last.theta)) <= parameters.friction / parameters.w0**2
    resting = run.angle[run.time > last.time]
    assert run.time[-1] - last.time > 3
    assert np.ptp(resting) == 0.0
    # Each half swing is shorter than the last: eq. 2.6 for large angles.
    peaks = np.abs([event.theta for event in run.path.events])
    assert (np.diff(peaks) < 0).all()


def test_rotations_and_oscillations_are_both_among_forced_runs() -> None:
    turns = [
        abs(run.angle[-1] - run.angle[0]) / math.tau
        for seed in range(2)
        for run in make(Request("forced", seed=seed, duration=15.0)).runs
    ]
    assert min(turns) < 1
    assert max(turns) > 10


def test_noise_and_counts_are_as_asked() -> None:
    clean = short(counts=0)
    for noise, counts in ((0.3, 0), (0.1, 4096), (0.0, 1024)):
        noisy = short(noise=noise, counts=counts)
        steps = math.tau / counts if counts else 0.0
        expected = math.hypot(math.radians(noise), steps / math.sqrt(12))
        for run, plain in zip(noisy.runs, clean.runs, strict=True):
            assert np.std(run.angle - plain.angle) == pytest.approx(expected, rel=0.1)
            if counts:
                assert run.angle / steps == pytest.approx(np.round(run.angle / steps), abs=1e-8)


def test_a_record_keeps_full_precision(rig: Run, tmp_path: Path) -> None:
    words = ("--duration", 2, "--seed", 5, "--effect", "none", "--free", 1, "--forced", 0)
    for counts in (0, 4096):
        rig("hidden", *words, "--counts", counts, "--out", f"lab{counts}")
        (run,) = make(
            Request("hidden", 5, ("none",), free=1, forced=0, duration=2.0, counts=counts)
        ).runs
        rows = record(tmp_path / f"lab{counts}" / "run_00.csv")
        assert rows[:, 0] == pytest.approx(run.time, abs=1e-6)
        assert rows[:, 1] == pytest.approx(run.angle, rel=1e-11)


def test_coloured_noise_dropouts_outliers_and_jitter() -> None:
    settings = {"counts": 0, "duration": 60.0, "free": 1, "forced": 0}
    clean = short(**settings).runs[0]
    red = short(**settings, noise=0.2, correlation=0.7).runs[0].angle - clean.angle
    assert np.std(red) == pytest.approx(math.radians(0.2), rel=0.1)
    assert np.corrcoef(red[:-1], red[1:])[0, 1] == pytest.approx(0.7, abs=0.05)
    lossy = short(**settings, dropouts=0.1).runs[0]
    assert lossy.lost / 6001 == pytest.approx(0.1, abs=0.04)
    assert lossy.time.size == 6001 - lossy.lost
    far = short(**settings, outliers=0.02).runs[0].angle - clean.angle
    assert np.mean(np.abs(far) > 0.1) == pytest.approx(0.02, abs=0.008)
    assert np.max(np.abs(far[np.abs(far) <= 0.1])) < 1e-9
    shaken = short(**settings, jitter=0.002).runs[0]
    speed = clean.path.velocity(clean.time)
    error = (shaken.angle - clean.angle)[np.abs(speed) > 1] / speed[np.abs(speed) > 1]
    assert np.std(error) == pytest.approx(0.002, rel=0.15)


@pytest.mark.parametrize("name", list(EFFECTS))
def test_each_effect_changes_the_record_by_what_the_truth_states(name: str) -> None:
    # Runs of a second are not set back on the true motion: the gap is the plain difference.
    given = {"free": 4, "forced": 3, "duration": 1.0, "counts": 0, "seed": 11}
    seen_so_soon = {"added_mass:late": ",t0=20", "impulses": ",every=0.2"}
    changed = short(effects=(name + seen_so_soon.get(name, ""),), **given)
    clean = short(**given)
    rms = [
        math.sqrt(float(np.mean((a.angle - b.angle) ** 2)))
        for a, b in zip(changed.runs, clean.runs, strict=True)
    ]
    assert [run.gap for run in changed.runs] == pytest.approx(rms, rel=1e-3, abs=1e-9)
    assert changed.gap == pytest.approx(math.sqrt(float(np.mean(np.square(rms)))), rel=1e-3)
    assert 1e-7 < changed.gap < 0.1
    assert clean.gap == 0


def test_size_scales_and_parameters_are_taken() -> None:
    plain, twice = (short(effects=("quadratic_drag",), size=size) for size in (1.0, 2.0))
    (small,), (large,) = plain.effects, twice.effects
    assert large.q == pytest.approx(2 * small.q)  # type: ignore[attr-defined]
    (typed,) = short(effects=("magnet:dipole,amplitude=0.25,d=0.3",)).effects
    assert dataclasses.asdict(typed) == {"amplitude": 0.25, "d": 0.3}
    assert short(w0=5.0, c_over_m=0.0, friction=0.0).parameters.w0 == 5.0


def test_noise_does_not_change_what_happens() -> None:
    quiet, loud = short(noise=0.0), short(noise=0.5)
    for a, b in zip(quiet.runs, loud.runs, strict=True):
        assert a.plan == b.plan
        assert (a.path.angle(a.time) == b.path.angle(b.time)).all()


def test_seeds_draw_many_effects_and_only_visible_ones() -> None:
    names = {short(seed=seed, effects=("any",), duration=1.0).effects[0].name for seed in range(40)}
    assert len(names) > 15
    for seed in range(20):
        (effect,) = short(seed=seed, effects=("any",), forced=0, duration=1.0).effects
        assert effect.needs != "forced"


def test_the_list_names_every_effect(rig: Run) -> None:
    text = rig("--list").stdout
    listed = json.loads(rig("--list", "--json").stdout)["effects"]
    assert [effect["name"] for effect in listed] == list(EFFECTS)
    for effect in listed:
        assert effect["name"] in text
        assert effect["formula"] in text
    for preset in PRESETS:
        assert preset in rig("--help").stdout


def test_parameters_have_the_names_and_units_that_model_files_have() -> None:
    relative = {"drive_second_harmonic", "lateral_drive"}  # the rig's e is a share of p
    library = {effect.name: effect for effect in pendmap.effects()}
    for name in library.keys() & EFFECTS.keys() - relative:
        ours = {f.name: f.metadata["unit"] or "1" for f in dataclasses.fields(EFFECTS[name])}
        assert ours == {p.name: p.unit for p in library[name].parameters}, name
    for name in relative:
        assert {f.name for f in dataclasses.fields(EFFECTS[name])} == {"e", "phase"}


def test_the_rig_shares_no_code_with_what_is_fitted() -> None:
    code = (
        "import sys\n"
        "from pendmap.virtual_rig import Request, make\n"
        "make(Request('forced', duration=1.0, forced=1))\n"
        "sys.exit(', '.join({'pendmap._core', 'pendmap.maps', 'xarray'} & set(sys.modules)) or 0)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("rig", "NAME"),
        ("rig hidden", "--out"),
        ("rig hiden --out x", "hiden"),
        ("rig hidden --out x --effect quadratic_drga", "quadratic_drag"),
        ("rig hidden --out x --effect magnet,A=1", "amplitude, width"),
        ("rig hidden --out x --effect magnet,A", "NAME=VALUE"),
        ("rig hidden --out x --effect magnet,amplitude=nan", "finite"),
        ("rig hidden --out x --effect pivot_compliance,mu=2", "0 to 0.3"),
        ("rig hidden --out x --effect magnet --effect magnet:dipole", "twice"),
        ("rig hidden --out x --effect none --effect magnet", "none"),
        ("rig free_decay --out x --effect drive_phase", "forced"),
        ("rig hidden --out x --effect load_dependent_friction --size 100", "Tr"),
        ("rig hidden --out x --noise=-0.1", "-0.1"),
        ("rig hidden --out x --noise nan", "nan"),
        ("rig hidden --out x --counts=-4", "-4"),
        ("rig hidden --out x --rate 0", "0"),
        ("rig hidden --out x --size 0", "0"),
        ("rig forced --out x --size 1e6", "no size of an effect is drawn here"),
        ("rig hidden --out x --effect none --size 2", "no size of an effect is drawn here"),
        ("rig hidden --out x --effect impulses,J=0.02 --size 2", "no size of an effect is drawn"),
        ("rig hidden --out x --noise 0 --correlation 0.5", "without noise"),
        ("rig hidden --out x --dropouts 0.9", "0.5"),
        ("rig hidden --out x --free 0 --forced 0", "1 to 99"),
        ("rig hidden --out x --duration 0", "3600"),
        ("rig hidden --out x --w0 0", "0.1 to 100"),
        ("rig hidden --out x --c-over-m nan", "nan"),
        ("rig hidden --out x --rate 1e5 --duration 3600", "up to"),
        ("rig hidden --out x --tr=-1", "-1"),
        ("rig hidden --out x --seed=-1", "-1"),
        ("rig hidden --out no/such/x", "no/such"),
        ("rig hidden --out /proc/x", "/proc"),
    ],
)
def test_bad_input_gets_one_line_and_leaves_nothing(
    rig: Run, tmp_path: Path, words: str, complaint: str
) -> None:
    run = rig(*words.split()[1:])
    assert run.returncode == 2
    assert run.stdout == ""
    assert len(run.stderr.strip().splitlines()) == 1, run.stderr
    assert complaint in run.stderr
    assert list(tmp_path.iterdir()) == []


def test_what_is_there_is_replaced_only_if_asked(rig: Run, tmp_path: Path) -> None:
    words = ("hidden", "--duration", 1, "--out", "lab")
    (tmp_path / "lab").mkdir()
    assert rig(*words).returncode == 0  # an empty folder is free
    before = {p: p.read_bytes() for p in (tmp_path / "lab").iterdir()}
    refused = rig(*words, "--seed", 2)
    assert refused.returncode == 2
    assert "--replace" in refused.stderr
    assert len(refused.stderr.strip().splitlines()) == 1
    assert {p: p.read_bytes() for p in (tmp_path / "lab").iterdir()} == before
    assert rig(*words, "--seed", 2, "--replace").returncode == 0
    assert {p: p.read_bytes() for p in (tmp_path / "lab").iterdir()} != before
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "thesis.txt").write_text("text", encoding="utf-8")
    kept = rig("hidden", "--out", "home", "--replace")
    assert kept.returncode == 2
    assert "not an experiment" in kept.stderr
    assert (tmp_path / "home" / "thesis.txt").exists()
    (tmp_path / "file").write_text("text", encoding="utf-8")
    assert rig("hidden", "--out", "file").returncode == 2


@pytest.mark.parametrize("moment", ["computing", "writing"])
def test_ctrl_c_leaves_nothing_half_written(tmp_path: Path, moment: str) -> None:
    runs = ["--free", "60"] if moment == "computing" else ["--rate", "2000"]
    words = [str(COMMAND), "rig", "hidden", *runs, "--out", "lab"]
    process = subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    if moment == "computing":
        time.sleep(1.2)
    while moment == "writing" and process.poll() is None and not list(tmp_path.glob(".lab*")):
        time.sleep(0.001)
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "Traceback" not in stderr
    if moment == "computing":
        assert "nothing was written" in stderr
        assert list(tmp_path.iterdir()) == []
    else:
        assert "lab, lab.truth.toml written" in stderr
        assert sorted(p.name for p in tmp_path.iterdir()) == ["lab", "lab.truth.toml"]
        assert len(list((tmp_path / "lab").iterdir())) == 10


def test_requests_are_checked_in_python_too() -> None:
    with pytest.raises(InputError, match="size is nan"):
        Request("hidden", size=math.nan)
    with pytest.raises(InputError, match="noise is inf"):
        make(Request("hidden", noise=math.inf))
