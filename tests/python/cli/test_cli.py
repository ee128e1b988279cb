"""The command line from the point of view of a user: every command, option and output."""

from __future__ import annotations

import importlib.util
import json
import math
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click
import cloup
import pytest
from matplotlib.figure import Figure

import pendmap
from pendmap import InputError, render, viewer
from pendmap.cli.main import command
from pendmap.model import effects_of

if TYPE_CHECKING:
    from conftest import Run

COMMANDS = command.list_commands(click.Context(command))
MODELS = {
    "friction, an effect and a formula": """gamma = 0.05\np = 0.6\nomega = 2.0\ntheta_r = 0.05
[[formula]]\nname = "own_drag"\nterm = "-q*v*abs(v)"\nparameters = { q = 0 }
[[effect]]\nname = "own_drag"\nparameters = { q = 0.02 }
[[effect]]\nname = "drive_second_harmonic"\nparameters = { e = 0.05, phase = 0.3 }
""",
    "a rig in SI": """w0 = 6.2\nc_over_m = 0.6\nstroke_mm = 20\nfrequency_hz = 1.9
[[formula]]\nname = "own_power"\nterm = "-q*abs(v)^n*sign(v)"
[formula.parameters]\nq = { power = "2 - n" }\nn = { power = 0 }
[[effect]]\nname = "own_power"\nparameters = { q = 0.01, n = 1.5 }
""",
}
SMALL = {
    "simulate": "--until 20",
    "basins": "--grid 6 --max-periods 300",
    "map": "--vary gamma 0.3:0.6:3 --p 0.3:0.6:2 --starts 2",
    "sweep": "--vary gamma 0.3:0.6:3 --grid 6 --max-periods 300",
    "bifurcation": "--vary p 0.3:0.6:4 --starts 2",
    "continue": "--vary gamma 0.3:0.6 --n 1 --w 1 --longest 1",
    "orbit": "--grid 5",
    "lyapunov": "--max-periods 300",
    "lifetime": "--starts 100 --max-periods 300",
    "tongues": "--omega 1.5:2.5:4 --p-max 2",
    "melnikov": "--omega 1.5",
}
ROWS = {
    "basins": {"attractors": {"id", "name", "kind", "n", "w", "multipliers", "fraction"}},
    "map": {"regimes": {"kinds", "share"}},
    "sweep": {"maps": {"attractors", "undecided"}},
    "bifurcation": {"branches": {"name", "kind", "n", "w", "first", "last"}},
    "continue": {
        "branches": {"n", "w", "ends", "from", "to"},
        "events": {"kind", "value", "theta", "velocity", "n", "w", "multipliers", "supercritical"},
    },
    "orbit": {"orbits": {"n", "w", "theta", "velocity", "multipliers", "stable"}},
    "tongues": {"curves": {"omega", "p", "multiplier", "stable_above"}},
}
"""Lists in the JSON of a command, and keys of their rows."""


@pytest.mark.parametrize("name", SMALL)
@pytest.mark.parametrize("model", MODELS)
def test_every_output_of_every_command_takes_every_model(
    model: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pendmap_command: Run
) -> None:
    # The figure is built but not rasterised, which would take longer than the rest.
    monkeypatch.setattr(Figure, "savefig", lambda figure, part, **_: part.write_text(str(figure)))
    file = tmp_path / "model.toml"
    file.write_text(f"[pendulum]\n{MODELS[model]}", encoding="utf-8")
    files = "--out a.nc --plot a.png --rerun a.rrd --json --model model.toml"
    run = pendmap_command(name, *SMALL[name].split(), *files.split())
    if "theta_r" in MODELS[model] and name == "tongues":
        assert run.returncode == 2
        assert "friction holds hanging rest whatever the drive" in run.stderr
        return
    assert run.returncode == 0, run.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"a.nc", "a.png", "a.rrd", file.name}
    content = json.loads(run.stdout, parse_constant=pytest.fail)  # nulls, no NaN
    for rows, keys in ROWS.get(name, {}).items():
        assert all(keys <= row.keys() for row in content[rows])
    assert name != "map" or (content["columns"], content["rows"]) == ("gamma", "p")
    result = pendmap.load(tmp_path / "a.nc")
    assert effects_of(result.attrs) == pendmap.load_model(file).effects
    render.draw(result, tmp_path / "again.png")


def test_refused_files_leave_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pendmap_command: Run
) -> None:
    def refused(*_: object) -> None:
        raise InputError("time must be up to 9e9, got 1e12")

    monkeypatch.setattr(viewer, "view", refused)
    run = pendmap_command("simulate", "--until", "20")
    assert (run.returncode, len(run.stderr.splitlines())) == (2, 1)
    assert not list(tmp_path.iterdir())


def test_the_man_pages_are_those_of_the_help() -> None:
    place = Path(__file__).resolve().parents[3] / "docs" / "man_pages.py"
    spec = importlib.util.spec_from_file_location("man_pages", place)
    assert spec is not None
    assert spec.loader is not None
    man_pages = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(man_pages)
    stored = {path.name: path.read_text(encoding="utf-8") for path in man_pages.FOLDER.iterdir()}
    assert stored == man_pages.pages()
    groff = shutil.which("groff")
    for path in man_pages.FOLDER.iterdir() if groff else ():
        words = [groff, "-man", "-Tutf8", "-k", "-ww", "-rLL=80n", "-P-c", str(path)]
        run = subprocess.run(words, capture_output=True, text=True, check=True)
        assert run.stderr == ""
        assert max(map(len, run.stdout.splitlines())) <= 80 + run.stdout.count("\b")


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys\n"
        "from pendmap.cli.main import command\n"
        "command.main(['--help'], standalone_mode=False)\n"
        "heavy = {'numpy', 'scipy', 'xarray', 'pandas', 'matplotlib', 'rerun', 'pendmap._core'}\n"
        "sys.exit(', '.join(heavy & set(sys.modules)) or 0)\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert all(f"\n  {name} " in run.stdout for name in COMMANDS)


def test_info(pendmap_command: Run) -> None:
    facts = json.loads(pendmap_command("info", "--json").stdout)
    assert facts["threads"] >= 1
    assert facts["simd"] in facts["simd_available"]
    forced = pendmap_command("info", env={"PENDMAP_SIMD": "portable"}).stdout
    assert forced.startswith(f"pendmap {facts['version']}\ninstruction set  portable")


def test_files_of_another_run_are_kept(pendmap_command: Run, tmp_path: Path) -> None:
    for name in ("basins.nc", "basins.rrd"):
        (tmp_path / name).write_bytes(b"old")
    words = ("basins", "--p", 0.6, "--grid", 20)
    written = "Written: basins-2.nc, basins-2.png, basins-2.rrd\nKept: basins.nc, basins.rrd"
    assert written in pendmap_command(*words).stdout
    assert pendmap_command(*words, "--json", "--plot", "a.png").returncode == 0
    for option, name in (("--out", "basins.nc"), ("--out", "basins.rrd"), ("--plot", "a.png")):
        run = pendmap_command(*words, option, name)
        assert run.returncode == 2
        assert f"Invalid value for '{option}': '{name}': must be a new file" in run.stderr
    assert (tmp_path / "basins.nc").read_bytes() == b"old"
    assert pendmap_command(*words, "--overwrite").returncode == 0
    assert pendmap.load(tmp_path / "basins.nc").sizes["theta"] == 20
    assert len([*tmp_path.iterdir()]) == 7


def test_a_suffix_says_what_is_written(pendmap_command: Run) -> None:
    run = pendmap_command("melnikov", "--out", "m.nc", "--out", "b.svg", "--plot", "c.pdf")
    assert "Written: m.nc, c.pdf, b.svg" in run.stdout
    run = pendmap_command("plot", "m.nc", "--out", "n.rrd", "--out", "n.pdf", "--size", "5x4")
    assert "Written: n.pdf, n.rrd" in run.stdout
    assert "Written: m.png" in pendmap_command("plot", "m.nc").stdout


@pytest.mark.parametrize("name", COMMANDS)
def test_options_stand_in_groups_with_examples_that_they_have(name: str) -> None:
    whole = click.Context(command, **command.context_settings)
    called = command.get_command(whole, name)
    assert isinstance(called, cloup.Command)
    known = {option for one in called.params for option in one.opts}
    examples = (called.epilog or "").splitlines()[2:]
    of_groups = [(group.help or "").removeprefix("Example: ") for group in called.option_groups]
    assert examples
    assert all(of_groups)
    for line in examples + of_groups:
        typed = {word.partition("=")[0] for word in shlex.split(line) if word.startswith("--")}
        assert typed <= known, line
    for line in examples:
        words = shlex.split(line)
        assert words[:2] == ["pendmap", name]
        with called.make_context(name, words[2:], whole, resilient_parsing=True) as context:
            assert not context.args


@pytest.mark.parametrize(
    "words",
    [f"{name} --help" for name in ["", *COMMANDS]]
    + ["basins --grid 20", "tongues --omega 2", "effects --verbose"],
)
def test_what_is_printed_fits_80_columns(words: str, pendmap_command: Run) -> None:
    assert max(map(len, pendmap_command(*words.split()).stdout.splitlines())) <= 80


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("diagnose --without quad", "quadratic_drag"),
        ("plot a.nc --layer set", "settle"),
        ("identify --method log", "log_decrement"),
    ],
)
def test_a_shell_completes_names(
    typed: str, completed: str, pendmap_command: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("_PENDMAP_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", f"pendmap {typed}")
    monkeypatch.setenv("COMP_CWORD", str(len(typed.split())))
    assert f"plain,{completed}" in pendmap_command().stdout.split()


def test_friction_is_given_with_or_without_dimensions(pendmap_command: Run, tmp_path: Path) -> None:
    pendmap.save_model(pendmap.Rig(w0=2.0, c_over_m=0.1), tmp_path / "m.toml")
    words = ("simulate", "--model", "m.toml", "--until", 20, "--json")
    one, other = (pendmap_command(*words, *more) for more in (("--tr", 0.2), ("--theta-r", 0.05)))
    assert one.stdout == other.stdout
    assert pendmap_command(*words, "--tr", 0.2, "--theta-r", 0.05).returncode == 2
    rig = ("rig", "free_decay", "--duration", 5, "--w0", 2)
    pendmap_command(*rig, "--tr", 0.2, "--out", "a")
    pendmap_command(*rig, "--theta-r", 0.05, "--out", "b")
    assert (tmp_path / "a/run_00.csv").read_bytes() == (tmp_path / "b/run_00.csv").read_bytes()


def test_simulate_returns_the_end_of_the_function(pendmap_command: Run) -> None:
    run = pendmap_command("simulate", "--theta", "pi/2", "--until", 30, "--json", "--lyapunov")
    result = json.loads(run.stdout)
    assert {"t", "theta", "velocity", "stuck", "exponent", "stderr"} <= set(result)
    expected = pendmap.simulate(pendmap.Pendulum(), math.pi / 2, 0, 30)
    assert result["theta"] == float(expected.theta[-1])
    assert result["tol_reached"] is True
