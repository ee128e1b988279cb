"""Every command that takes a model accepts every model and writes every kind of output."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

import pytest
from matplotlib.figure import Figure

import pendmap
from pendmap import InputError, cli, render, viewer
from pendmap.model import effects_of

if TYPE_CHECKING:
    from pathlib import Path

MODELS = {
    "effects and a formula": """gamma = 0.1\np = 0.6\nomega = 2.0
[[formula]]\nname = "own_drag"\nterm = "-q*v*abs(v)"\nparameters = { q = 0 }
[[effect]]\nname = "own_drag"\nparameters = { q = 0.02 }
[[effect]]\nname = "drive_second_harmonic"\nparameters = { e = 0.05, phase = 0.3 }
""",
    "a rig in SI": """w0 = 6.2\nc_over_m = 0.6\nstroke_mm = 20\nfrequency_hz = 1.9
[[formula]]\nname = "own_power"\nterm = "-q*abs(v)^n*sign(v)"
[formula.parameters]\nq = { power = "2 - n" }\nn = { power = 0 }
[[effect]]\nname = "own_power"\nparameters = { q = 0.01, n = 1.5 }
""",
    "Coulomb friction": "gamma = 0.05\np = 0.6\nomega = 2.0\ntheta_r = 0.05\n",
    "a direct drive": """gamma = 0.5\nomega = 0.6667
[[formula]]\nname = "drive"\nterm = "f*cos(phase)"\nparameters = { f = { power = 2 } }
[[effect]]\nname = "drive"\nparameters = { f = 0.3 }
""",
}
COMMANDS = {
    "simulate": ("--until", "20"),
    "basins": ("--grid", "6", "--max-periods", "300"),
    "map": ("--vary", "gamma", "0.3:0.6:3", "--p", "0.3:0.6:2", "--starts", "2"),
    "sweep": ("--vary", "gamma", "0.3:0.6:3", "--grid", "6", "--max-periods", "300"),
    "bifurcation": ("--vary", "p", "0.3:0.6:4", "--starts", "2"),
    "orbit": ("--grid", "5"),
    "lyapunov": ("--max-periods", "300"),
    "lifetime": ("--starts", "100", "--max-periods", "300"),
    "tongues": ("--omega", "1.5:2.5:4", "--p-max", "2"),
    "melnikov": ("--omega", "1.5"),
}
REFUSED = {
    ("Coulomb friction", "tongues"): "friction holds hanging rest whatever the drive",
    ("a direct drive", "tongues"): "a sideways drive or an effect moves it",
    ("a direct drive", "melnikov"): "not proportional to p",
}
"""Meaningless combinations, with the reason."""
ROWS = {
    "basins": {"attractors": {"id", "name", "kind", "n", "w", "multipliers", "fraction"}},
    "map": {"regimes": {"kinds", "share"}},
    "sweep": {"maps": {"attractors", "undecided"}},
    "bifurcation": {"branches": {"name", "kind", "n", "w", "first", "last"}},
    "orbit": {"orbits": {"n", "w", "theta", "velocity", "multipliers", "stable"}},
    "tongues": {"curves": {"omega", "p", "multiplier", "stable_above"}},
}
"""Lists in the JSON of a command, and keys of their rows."""


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("model", MODELS)
def test_every_output_of_every_command_takes_every_model(
    model: str,
    command: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    # The figure is built but not rasterised, which would take longer than the rest.
    monkeypatch.setattr(Figure, "savefig", lambda figure, part, **_: part.write_text(str(figure)))
    (tmp_path / "model.toml").write_text(f"[pendulum]\n{MODELS[model]}", encoding="utf-8")
    files = ("--out", "a.nc", "--plot", "a.png", "--rerun", "a.rrd")
    words = [command, "--model", "model.toml", *COMMANDS[command], *files, "--json"]
    monkeypatch.setattr(sys, "argv", ["pendmap", *words])
    with pytest.raises(SystemExit) as end:
        cli.run()
    out, err = capsys.readouterr()
    there = {path.name for path in tmp_path.iterdir()} - {"model.toml"}
    if (model, command) in REFUSED:
        assert (end.value.code, len(err.splitlines()), there) == (2, 1, set())
        assert REFUSED[model, command] in err
        return
    assert not end.value.code, err
    assert there == {"a.nc", "a.png", "a.rrd"}
    told = json.loads(out, parse_constant=pytest.fail)  # nulls, no NaN
    for name, keys in ROWS.get(command, {}).items():
        assert all(keys <= row.keys() for row in told[name])
    assert command != "map" or (told["columns"], told["rows"]) == ("gamma", "p")
    result = pendmap.load(tmp_path / "a.nc")
    known = pendmap.load_model(tmp_path / "model.toml")
    assert effects_of(result.attrs) == known.effects
    render.draw(result, tmp_path / "again.png")


@pytest.mark.parametrize("command", ["simulate", "basins", "tongues"])
def test_without_a_named_output_three_files_are_written(
    command: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Figure, "savefig", lambda figure, part, **_: part.write_text(str(figure)))
    monkeypatch.setattr(sys, "argv", ["pendmap", command, *COMMANDS[command]])
    with pytest.raises(SystemExit) as end:
        cli.run()
    assert not end.value.code
    files = [f"{command}.{suffix}" for suffix in ("nc", "png", "rrd")]
    assert sorted(path.name for path in tmp_path.iterdir()) == files
    assert f"Written: {', '.join(files)}" in " ".join(capsys.readouterr().out.split())


def test_refused_files_leave_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refused(*_: object) -> None:
        raise InputError("time must be up to 9e9, got 1e12")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(viewer, "record", refused)
    monkeypatch.setattr(sys, "argv", ["pendmap", "simulate", "--until", "20"])
    with pytest.raises(SystemExit) as end:
        cli.run()
    assert end.value.code == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert not list(tmp_path.iterdir())
