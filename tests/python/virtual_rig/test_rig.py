"""`pendmap rig`: experiments, their sensor and effects, their files."""

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
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from conftest import COMMAND
from interrupted import any_file, started
from pendmap import InputError
from pendmap.virtual_rig import EFFECTS, PRESETS, Experiment, Request, held_out, make
from pendmap.virtual_rig.sensor import Sensor

if TYPE_CHECKING:
    from conftest import Run


def short(**given: Any) -> Experiment:  # noqa: ANN401 (parameters of a request)
    """Return a small experiment, by default without hidden effects."""
    settings = {"effects": ("none",), "free": 2, "forced": 1, "duration": 5.0, "noise": 0.0}
    return make(Request("hidden", **(settings | given)))  # type: ignore[arg-type]


def test_a_free_decay_rests_where_dry_friction_holds_it() -> None:
    experiment = make(Request("free_decay", seed=2, noise=0.0, counts=0))
    (run,) = experiment.runs
    assert abs(run.plan.theta) > 2.9
    last = run.path.events[-1]
    assert last.what == "stick"
    assert abs(math.sin(last.theta)) <= experiment.parameters.friction / experiment.parameters.w0**2
    assert run.time[-1] - last.time > 3


def test_noise_and_counts_are_as_requested() -> None:
    clean = short(counts=0)
    for noise, counts in ((0.3, 0), (0.1, 4096), (0.0, 1024)):
        noisy = short(noise=noise, counts=counts)
        steps = math.tau / counts if counts else 0.0
        expected = math.hypot(math.radians(noise), steps / math.sqrt(12))
        for run, plain in zip(noisy.runs, clean.runs, strict=True):
            assert run.plan == plain.plan
            assert (run.path.angle(run.time) == plain.path.angle(run.time)).all()
            assert np.std(run.angle - plain.angle) == pytest.approx(expected, rel=0.1)
            if counts:
                assert run.angle / steps == pytest.approx(np.round(run.angle / steps), abs=1e-8)


def test_coloured_noise_dropouts_outliers_and_jitter_are_as_requested() -> None:
    angle, rng = np.linspace(0.0, 3.0, 20001), np.random.default_rng(3)
    red, _ = Sensor(counts=0, noise=0.01, correlation=0.7).write_down(angle, rng)
    error = red - angle
    assert np.std(error) == pytest.approx(0.01, rel=0.1)
    assert np.corrcoef(error[:-1], error[1:])[0, 1] == pytest.approx(0.7, abs=0.05)
    far, _ = Sensor(counts=0, outliers=0.02).write_down(angle, rng)
    false = np.abs(far - angle) > 0.1
    assert np.mean(false) == pytest.approx(0.02, abs=0.004)
    assert (far == angle)[~false].all()
    late = Sensor(jitter=0.002).instants(100 * angle, rng) - 100 * angle
    assert np.std(late) == pytest.approx(0.002, rel=0.05)
    lossy = short(free=1, forced=0, dropouts=0.1).runs[0]
    assert 0 < lossy.lost == 501 - lossy.time.size < 100


@pytest.mark.parametrize("name", list(EFFECTS))
def test_each_effect_changes_the_record_and_has_bounds(name: str) -> None:
    given = {"free": 4, "forced": 3, "duration": 1.0, "counts": 0, "seed": 11}
    soon = {"added_mass:late": ",t0=20", "impulses": ",t0=0.3", "impulses:train": ",every=0.2"}
    changed = short(effects=(name + soon.get(name, ""),), **given)
    pairs = zip(changed.runs, short(**given).runs, strict=True)
    squares = np.concatenate([(one.angle - plain.angle) ** 2 for one, plain in pairs])
    assert 1e-7 < math.sqrt(float(np.mean(squares))) < 0.1
    for field in dataclasses.fields(EFFECTS[name]):
        with pytest.raises(InputError, match=rf"{field.name} must be .*, got 1e\+300"):
            short(effects=(f"{name},{field.name}=1e300",))


def test_size_scales_and_given_parameters_are_used() -> None:
    plain, twice = (short(effects=("quadratic_drag",), size=size) for size in (1.0, 2.0))
    (small,), (large,) = plain.effects, twice.effects
    assert large.q == pytest.approx(2 * small.q)  # type: ignore[attr-defined]
    typed = short(w0=5.0, effects=("magnet:dipole,amplitude=0.25,d=0.3",))
    assert [dataclasses.asdict(effect) for effect in typed.effects] == [
        {"amplitude": 0.25, "d": 0.3}
    ]
    assert typed.parameters.w0 == 5.0


def test_seeds_draw_many_effects_and_only_visible_ones() -> None:
    settings = {"effects": ("any",), "forced": 0, "duration": 1.0}
    drawn = {short(seed=seed, **settings).effects[0] for seed in range(40)}
    assert len({effect.name for effect in drawn}) > 12
    assert "forced" not in {effect.needs for effect in drawn}


def test_one_run_is_held_out_of_each_kind_with_three() -> None:
    for counts, held in {(5, 4): (1, 1), (3, 2): (1, 0), (2, 2): (0, 0), (0, 3): (0, 1)}.items():
        experiment = short(free=counts[0], forced=counts[1], duration=1.0)
        kinds = [experiment.runs[k].plan.kind for k in held_out(experiment)]
        assert (kinds.count("free"), kinds.count("forced")) == held


def test_parameters_have_the_names_and_units_that_model_files_have() -> None:
    library = {effect.name: effect for effect in pendmap.effects()}
    for name in library.keys() & EFFECTS.keys():
        ours = {f.name: f.metadata["unit"] or "1" for f in dataclasses.fields(EFFECTS[name])}
        assert ours == {p.name: p.unit for p in library[name].parameters}, name


def test_the_rig_shares_no_code_with_what_is_fitted() -> None:
    code = (
        "import sys\n"
        "from pendmap.virtual_rig import Request, make\n"
        "make(Request('forced', duration=1.0, forced=1))\n"
        "heavy = {'pendmap._core', 'pendmap.analysis.basins', 'xarray'} & set(sys.modules)\n"
        "sys.exit(', '.join(heavy) or 0)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


def test_an_experiment_is_a_folder_and_a_separate_file_of_its_truth(rig: Run) -> None:
    words = ("--duration", 3, "--out", "lab", "--plot", "runs.svg", "--json")
    run = rig("hidden", "--seed", 1, *words)
    assert run.returncode == 0, run.stderr
    written = {"experiment": "lab", "truth": "lab.truth.toml", "plot": "runs.svg"}
    assert json.loads(run.stdout) == written
    assert {path.name for path in Path().iterdir()} == set(written.values())
    assert Path("runs.svg").read_bytes().startswith(b"<?xml")
    hidden, truth = (
        Path(name).read_text(encoding="utf-8") for name in ("lab/experiment.toml", "lab.truth.toml")
    )
    description, truth = tomllib.loads(hidden), tomllib.loads(truth)
    entries, runs = description["run"], make(Request("hidden", 1, duration=3.0)).runs
    assert [entry["kind"] for entry in entries].count("free") == 5
    assert len(entries) == 9
    assert description["rig"]["encoder_counts"] == 4096
    ends = [entry["lab_time_s"] for entry in entries[1:]] + [math.inf]
    for entry, simulated, end in zip(entries, runs, ends, strict=True):
        with Path("lab", entry["file"]).open(encoding="utf-8", newline="") as file:
            head, *rows = csv.reader(file)
        assert head == ["t_s", "theta_rad"]
        times, angles = np.array(rows, float).T
        assert times == pytest.approx(simulated.time, abs=1e-6)
        assert angles == pytest.approx(simulated.angle, rel=1e-11)
        assert entry["lab_time_s"] + times[-1] < end
        drive = {"p", "Omega", "phi"} if entry["kind"] == "forced" else set()
        assert set(entry.get("drive", ())) == drive
    (effect,) = truth["effect"]
    assert effect["name"] not in hidden + run.stdout + run.stderr
    assert effect["name"] in {name.split(":")[0] for name in EFFECTS}
    assert 0.05 <= truth["sensor"]["noise_deg"] <= 0.5
    assert {"w0", "c_over_m", "Tr"} <= set(truth["pendulum"])


def test_the_same_seed_gives_the_same_bytes(rig: Run) -> None:
    made = []
    for seed, out in ((3, "a"), (3, "b"), (4, "c")):
        run = rig("hidden", "--seed", seed, "--duration", 3, "--out", out)
        assert run.returncode == 0, run.stderr
        paths = [*sorted(Path(out).iterdir()), Path(f"{out}.truth.toml")]
        made.append([path.read_bytes() for path in paths])
    assert made[0] == made[1] != made[2]


def test_the_list_names_every_effect(rig: Run) -> None:
    text = rig("--list").stdout
    listed = json.loads(rig("--list", "--json").stdout)["effects"]
    assert [effect["name"] for effect in listed] == list(EFFECTS)
    assert all(effect["name"] in text and effect["formula"] in text for effect in listed)
    assert all(preset in rig("--help").stdout for preset in PRESETS)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("", "NAME"),
        ("hidden", "--out"),
        ("hiden --out x", "hiden"),
        ("hidden --out x --effect quadratic_drga", "quadratic_drag"),
        ("hidden --out x --effect magnet,A=1", "amplitude, width"),
        ("hidden --out x --effect magnet,amplitude=nan", "finite"),
        ("hidden --out x --effect pivot_compliance,mu=2", "0 to 0.3"),
        ("hidden --out x --effect magnet --effect magnet:dipole", "twice"),
        ("free_decay --out x --effect drive_phase", "forced"),
        ("hidden --out x --effect load_dependent_friction --size 100", "Tr"),
        ("hidden --out x --size 0", "0"),
        ("forced --out x --size 1e6", "must be 1 where no size of an effect is drawn, got"),
        ("hidden --out x --effect impulses,J=0.02 --size 2", "no size of an effect is drawn"),
        ("hidden --out x --noise 0 --correlation 0.5", "without noise"),
        ("hidden --out x --free 0 --forced 0", "1 to 99"),
        ("hidden --out x --w0 0", "0.1 to 100"),
        ("hidden --out x --rate 1e5 --duration 3600", "up to"),
        ("hidden --out x --tr=-1", "-1"),
        ("hidden --out no/such/x", "no/such"),
        ("hidden --out x --plot runs.jpg", "runs.jpg"),
    ],
)
def test_bad_input_gets_one_line_and_leaves_nothing(rig: Run, words: str, complaint: str) -> None:
    run = rig(*words.split())
    assert (run.returncode, run.stdout) == (2, "")
    assert len(run.stderr.strip().splitlines()) == 1, run.stderr
    assert complaint in run.stderr
    assert list(Path().iterdir()) == []


def test_an_experiment_is_replaced_only_on_request(rig: Run) -> None:
    words = ("hidden", "--duration", 1, "--out", "lab")
    Path("lab").mkdir()
    assert rig(*words).returncode == 0  # an empty folder is free
    before = {path: path.read_bytes() for path in Path("lab").iterdir()}
    refused = rig(*words, "--seed", 2)
    assert (refused.returncode, len(refused.stderr.splitlines())) == (2, 1)
    assert "--overwrite" in refused.stderr
    assert {path: path.read_bytes() for path in Path("lab").iterdir()} == before
    assert rig(*words, "--seed", 2, "--overwrite").returncode == 0
    assert {path: path.read_bytes() for path in Path("lab").iterdir()} != before
    Path("lab/thesis.txt").write_text("text", encoding="utf-8")
    refused = rig("hidden", "--out", "lab", "--overwrite")
    assert (refused.returncode, Path("lab/thesis.txt").exists()) == (2, True)
    assert "not an experiment" in refused.stderr
    assert rig("hidden", "--out", "lab/thesis.txt").returncode == 2


def test_an_interrupt_while_files_are_written_waits_for_both(tmp_path: Path) -> None:
    words = [str(COMMAND), "rig", "hidden", "--rate", "2000", "--out", "lab"]
    with started(words, cwd=tmp_path, stderr=subprocess.PIPE) as process:
        while process.poll() is None and not any_file(tmp_path, ".pendmap-*/new/*"):
            time.sleep(0.001)
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "lab written" in stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["lab", "lab.truth.toml"]
    assert len(list((tmp_path / "lab").iterdir())) == 10
