"""The command line from the point of view of a user."""

from __future__ import annotations

import json
import math
import os
import shlex
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import click
import cloup
import pytest

import pendmap
from conftest import COMMAND
from interrupted import any_file, started, until
from pendmap.cli.main import command
from pendmap.cli.parse.types import NUMBER

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

COMMANDS = command.list_commands(click.Context(command))
FILES = ["basins.nc", "basins.png", "basins.rrd"]


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys\n"
        "from pendmap.cli.main import command\n"
        "command.main(['--help'], standalone_mode=False)\n"
        "heavy = {'numpy', 'scipy', 'xarray', 'pandas', 'matplotlib', 'rerun', 'rich'}\n"
        "heavy |= {'pendmap._core'}\n"
        "sys.exit(', '.join(heavy & set(sys.modules)) or 0)\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    for name in ("info", "effects", "simulate", "basins", "look", "rig", "plot", "view"):
        assert name in run.stdout


def test_info(pendmap_command: Run) -> None:
    facts = json.loads(pendmap_command("info", "--json").stdout)
    assert facts["threads"] >= 1
    assert facts["simd"] in facts["simd_available"]
    assert pendmap_command("info").stdout.startswith(f"pendmap {facts['version']}")
    forced = pendmap_command("info", "--json", env={"PENDMAP_SIMD": "portable"})
    assert json.loads(forced.stdout)["simd"] == "portable"


def test_files_of_another_run_are_kept(pendmap_command: Run, tmp_path: Path) -> None:
    for name in (FILES[0], FILES[2]):
        (tmp_path / name).write_bytes(b"old")
    words = ("basins", "--p", 0.6, "--grid", 20)
    run = pendmap_command(*words)
    assert (
        "Written: basins-2.nc, basins-2.png, basins-2.rrd\nKept: basins.nc, basins.rrd"
        in run.stdout
    )
    assert pendmap_command(*words, "--json", "--plot", "a.png").returncode == 0
    for option, name in (("--out", "basins.nc"), ("--out", "basins.rrd"), ("--plot", "a.png")):
        run = pendmap_command(*words, option, name)
        assert run.returncode == 2
        assert f"Invalid value for '{option}': '{name}': must be a new file" in run.stderr
    assert (tmp_path / "basins.nc").read_bytes() == b"old"
    assert pendmap_command(*words, "--overwrite").returncode == 0
    assert pendmap.load(tmp_path / "basins.nc").sizes["theta"] == 20
    assert len([*tmp_path.iterdir()]) == 7


def test_a_suffix_says_what_is_written(pendmap_command: Run, tmp_path: Path) -> None:
    words = ("melnikov", "--out", "m.nc", "--out", "m.svg", "--out", "m.rrd")
    assert pendmap_command(*words).returncode == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["m.nc", "m.rrd", "m.svg"]
    run = pendmap_command("plot", "m.nc", "--out", "n.rrd", "--out", "n.pdf")
    assert "Written: n.pdf, n.rrd" in run.stdout
    run = pendmap_command("melnikov", "--out", "a.png", "--out", "b.svg", "--plot", "c.pdf")
    assert "Written: c.pdf, a.png, b.svg" in run.stdout


@pytest.mark.parametrize("name", COMMANDS)
def test_options_stand_in_groups_with_examples_that_they_have(name: str) -> None:
    whole = click.Context(command, **command.context_settings)
    called = command.get_command(whole, name)
    assert isinstance(called, cloup.Command)
    examples = (called.epilog or "").splitlines()[2:]
    assert examples
    for group in called.option_groups:
        said = (group.help or "").removeprefix("Example: ")
        words = shlex.split(said)
        assert words, group.title
        own = {option for one in called.params for option in one.opts}
        assert {word.partition("=")[0] for word in words if word.startswith("--")} <= own, said
    for line in examples:
        words = shlex.split(line)
        assert words[:2] == ["pendmap", name]
        with called.make_context(name, words[2:], whole, resilient_parsing=True) as context:
            assert not context.args
        known = {option for one in called.params for option in one.opts}
        assert {w.partition("=")[0] for w in words if w.startswith("--")} <= known, line


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_help_fits_80_columns(name: str, pendmap_command: Run) -> None:
    run = pendmap_command(*name.split(), "--help")
    assert max(map(len, run.stdout.splitlines())) <= 80


@pytest.mark.parametrize(
    "words", [("basins", "--grid", 20), ("tongues", "--omega", 2), ("effects", "--verbose")]
)
def test_output_fits_80_columns(words: tuple[str, ...], pendmap_command: Run) -> None:
    run = pendmap_command(*words)
    assert max(map(len, run.stdout.splitlines())) <= 80


@pytest.mark.parametrize(
    ("typed", "found"),
    [
        ("diagnose --without quad", "quadratic_drag"),
        ("plot a.nc --layer set", "settle"),
        ("identify --method log", "log_decrement"),
    ],
)
def test_a_shell_completes_names(typed: str, found: str, tmp_path: Path) -> None:
    words = ["pendmap", *typed.split()]
    shell = {"_PENDMAP_COMPLETE": "bash_complete", "COMP_WORDS": " ".join(words)}
    environment = os.environ | shell | {"COMP_CWORD": str(len(words) - 1)}
    run = subprocess.run(
        [str(COMMAND)], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert f"plain,{found}" in run.stdout.split()


def test_friction_is_given_with_or_without_dimensions(pendmap_command: Run, tmp_path: Path) -> None:
    pendmap.save_model(pendmap.Rig(w0=2.0, c_over_m=0.1), tmp_path / "m.toml")
    words = ("simulate", "--model", "m.toml", "--until", 20, "--json")
    one, other = (pendmap_command(*words, *given) for given in (("--tr", 0.2), ("--theta-r", 0.05)))
    assert one.stdout == other.stdout
    assert pendmap_command(*words, "--tr", 0.2, "--theta-r", 0.05).returncode == 2
    assert "--tr must have --model" in pendmap_command("simulate", "--tr", 0.2).stderr
    rig = ("rig", "free_decay", "--duration", 5, "--w0", 2)
    pendmap_command(*rig, "--tr", 0.2, "--out", "a")
    pendmap_command(*rig, "--theta-r", 0.05, "--out", "b")
    assert (tmp_path / "a/run_00.csv").read_bytes() == (tmp_path / "b/run_00.csv").read_bytes()


def test_a_stored_map_is_drawn_again(pendmap_command: Run, tmp_path: Path) -> None:
    pendmap_command("basins", "--p", 0.6, "--grid", 20, "--out", "map.nc")
    for words in ((), ("--out", "other.svg", "--layer", "settle", "--size", "5x4")):
        run = pendmap_command("plot", "map.nc", *words)
        assert run.returncode == 0, run.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map.nc", "map.png", "other.svg"]
    for words, complaint in (
        (("map.nc", "--layer", "colour"), "colour"),
        (("map.nc", "--size", "wide"), "wide"),
        (("absent.nc",), "absent.nc"),
        (("map.png",), "suffix"),
    ):
        run = pendmap_command("plot", *words)
        assert run.returncode == 2
        assert complaint in run.stderr


def test_simulate(pendmap_command: Run, tmp_path: Path) -> None:
    run = pendmap_command("simulate", "--theta", "pi/2", "--until", 30, "--json", "--lyapunov")
    result = json.loads(run.stdout)
    assert {"t", "theta", "velocity", "stuck", "exponent", "stderr"} <= set(result)
    expected = pendmap.simulate(pendmap.Pendulum(), math.pi / 2, 0, 30)
    assert result["theta"] == float(expected.theta[-1])
    assert result["tol_reached"] is True
    run = pendmap_command("simulate", "--until", 30)
    assert run.returncode == 0, run.stderr
    names = sorted(p.name for p in tmp_path.iterdir())
    assert names == ["simulate.nc", "simulate.png", "simulate.rrd"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("basins --p nan", "nan"),
        ("basins --gamma=-1", "Invalid value for '--gamma': must be 0 or more, got -1"),
        ("basins --omega 0", "Invalid value for '--omega': must be a number above 0, got 0"),
        ("basins --grid 0", "0"),
        ("basins --theta 1:2", "A:B:N"),
        ("basins --theta 2:1:9", "lower one first"),
        ("basins --theta 0:1:0", "must have 1 to 100000 cells, got 0: '0:1:0'"),
        ("basins --grid 5 --theta 0:1:5", "--grid"),
        ("basins --tol 1e-30", "'--tol'"),
        ("basins --max-periods 99999999999999", "from 1 to 2147483647"),
        ("basins --seed -1", "from 0 to 9223372036854775807"),
        ("simulate --samples 10001", "from 1 to 10000"),
        ("basins --theta=-1e308:1e308:9", "finite distance"),
        ("basins --view", "--view: there is no display"),
        ("basins --plot .", "'--plot'"),
        ("plot .", "'.': must be a result, .nc or .zarr, it is a folder"),
        ("basins --pp 1", "--pp"),
        ("basins --out x.docx", ".docx"),
        ("basins --plot x.nc", ".png"),
        ("basins --out no/such/x.nc", "no/such"),
        ("basins --out /proc/x.nc", "/proc"),
        ("basins --preset fig9", "fig9"),
        ("basins --threads 100000", "1 to 256"),
        ("bifurcation", "--p 0.5:2:100; got nothing"),
        ("bifurcation --p 0:1:3 --omega 1:2:3", "--p 0.5:2:100; got p, omega"),
        ("bifurcation --p 0:1:3 --theta 1", "both or neither of --theta and --velocity"),
        ("map --p 1", "--p 0.5:2:100 --omega 0.5:3:100; got nothing"),
        ("map --p 0:1:3 --vary p 0:1:4", "--vary p must be given once, got it twice"),
        ("lyapunov --precision 1", "up to 0.5"),
        ("lifetime --starts 3", "100"),
        ("tongues --theta-r 0.1", "friction"),
        ("simulate --until 0", "until"),
        ("view absent.rrd", "absent.rrd"),
        ("viw", "viw"),
    ],
)
def test_bad_input_gets_one_line_and_leaves_nothing(
    pendmap_command: Run, tmp_path: Path, words: str, complaint: str
) -> None:
    run = pendmap_command(*shlex.split(words))
    assert run.returncode == 2
    assert run.stdout == ""
    assert len(run.stderr.strip().splitlines()) == 1
    assert complaint in run.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_recording_needs_a_display_to_be_seen(pendmap_command: Run, tmp_path: Path) -> None:
    pendmap_command("simulate", "--until", 5, "--rerun", "run.rrd")
    run = pendmap_command("view", "run.rrd")
    assert run.returncode == 2
    assert "display" in run.stderr
    (tmp_path / "not.rrd").write_text("text", encoding="utf-8")
    assert pendmap_command("view", "not.rrd").returncode == 2


def test_ctrl_c_leaves_nothing_half_written(tmp_path: Path) -> None:
    words = [str(COMMAND), "basins", "--p", "1.7", "--grid", "9000"]
    with started(words, cwd=tmp_path, stderr=subprocess.PIPE) as process:
        time.sleep(2)
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=20)
    assert process.returncode == 130
    assert "Traceback" not in stderr
    assert "nothing was written" in stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("option", "file"), [("--out", "map.nc"), ("--plot", "map.png"), ("--rerun", "map.rrd")]
)
def test_ctrl_c_waits_for_the_file_being_written(tmp_path: Path, option: str, file: str) -> None:
    words = [str(COMMAND), "basins", "--p", "0.6", "--grid", "1500", option, file]
    with started(words, cwd=tmp_path, stderr=subprocess.PIPE) as process:
        until(process, lambda: any_file(tmp_path, ".pendmap-*.part/map.*"), step=0.001)
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=30)
    assert process.returncode == 130
    assert f"interrupted, {file} written" in stderr
    assert [path.name for path in tmp_path.iterdir()] == [file]
    if option == "--out":
        assert pendmap.load(tmp_path / file).sizes["theta"] == 1500


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("pi", math.pi),
        ("0.5*pi", math.pi / 2),
        ("pi/4", math.pi / 4),
        ("-1.5e-3", -1.5e-3),
    ],
)
def test_pi_is_understood(text: str, value: float) -> None:
    assert NUMBER.convert(text, None, None) == pytest.approx(value, rel=1e-15)
