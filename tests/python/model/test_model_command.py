"""Model files on the command line."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import pytest

import pendmap
from models import EXAMPLE, written
from pendmap import Rig, load_model
from pendmap.files import facts

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run


def test_the_command_takes_and_returns_si(tmp_path: Path, pendmap_command: Run) -> None:
    rig = load_model(written(tmp_path, EXAMPLE))
    end = pendmap.simulate(rig, 1.2, 2.0, 12.5)
    words = ("--theta", 1.2, "--velocity", 2, "--until", 12.5, "--json", "--out", "run.nc")
    run = pendmap_command("simulate", "--model", "model.toml", *words)
    assert run.returncode == 0, run.stderr
    got = json.loads(run.stdout)
    assert (got["units"], got["t"]) == ("SI", 12.5)
    assert got["theta"] == float(end.theta[-1])
    assert got["velocity"] == float(end.velocity[-1])
    assert pendmap.load(tmp_path / "run.nc").velocity.attrs["units"] == "rad/s"


@pytest.mark.parametrize(
    ("words", "numbers"),
    [
        ((), {}),
        (("--gamma", 0.1), {"c_over_m": 0.62}),
        (("--theta-r", 0.01), {"Tr": 0.01 * 6.2**2}),
        (("--p", 0.5), {"p": 0.5}),
        (("--omega", 2), {"Omega": 12.4, "p": 0.02 * 12.4**2 / 9.81}),
        (("--stroke-mm", 10, "--frequency-hz", 2), {"p": 0.01 * (4 * math.pi) ** 2 / 9.81}),
    ],
)
def test_typed_parameters_replace_those_of_the_file(
    tmp_path: Path, pendmap_command: Run, words: tuple[Any, ...], numbers: dict[str, float]
) -> None:
    rig = load_model(written(tmp_path, EXAMPLE))
    run = pendmap_command(
        "simulate", "--model", "model.toml", *words, "--until", 1, "--json", "--out", "run.nc"
    )
    assert run.returncode == 0, run.stderr
    attrs = facts(pendmap.load(tmp_path / "run.nc"))
    if "--frequency-hz" in words:
        numbers |= {"Omega": 4 * math.pi}
    for name in Rig.numbers():
        wanted = numbers.get(name, getattr(rig, name))
        assert attrs[name] == pytest.approx(wanted, rel=1e-14), name
    assert "quadratic_drag" in attrs["model"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("model.toml --stroke-mm 2 --p 1", "one of --stroke-mm and --p must be left out"),
        ("model.toml --frequency-hz 2 --omega 1", "one of --frequency-hz and --omega must be left"),
        ("model.toml --stroke-mm=-2", "'--stroke-mm': must be 0 or more, got -2"),
        ("model.toml --gamma=-2", "'--gamma': must be 0 or more, got -2"),
        ("model.toml --preset fig2a", "one of --model and --preset must be left out"),
        ("bare.toml --stroke-mm 2", "bare.toml: has no dimensions: stroke_mm must be"),
        ("bare.toml --p 2", "bare.toml: p without omega"),
        ("model.nc --out model.nc", "'--out': 'model.nc': is an input, which"),
        ("a.zarr/model.toml --out a.zarr", "a.zarr: must be a new folder, or a result of pendmap"),
    ],
)
def test_the_command_refuses_on_one_line(
    tmp_path: Path, pendmap_command: Run, words: str, complaint: str
) -> None:
    written(tmp_path, EXAMPLE)
    (tmp_path / "bare.toml").write_text("[pendulum]\ngamma = 0.1\n", encoding="utf-8")
    (tmp_path / "a.zarr").mkdir()
    for copy in ("model.nc", "a.zarr/model.toml"):
        (tmp_path / copy).write_bytes((tmp_path / "model.toml").read_bytes())
    before = sorted(tmp_path.rglob("*"))
    run = pendmap_command("simulate", "--model", *words.split())
    assert (run.returncode, run.stderr.count("\n")) == (2, 1), run.stderr
    assert complaint in run.stderr
    assert sorted(tmp_path.rglob("*")) == before
    assert (tmp_path / "model.nc").read_bytes() == (tmp_path / "model.toml").read_bytes()
