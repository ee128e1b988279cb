"""The how-tos of CONTRIBUTING.md: an effect and an analysis take four files, a chart one.

The test of the chart is in test_charts.py.
"""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import pendmap

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "python" / "pendmap"
EFFECTS = {effect.name for effect in pendmap.effects()}
LIBRARY, TWINS = "src/model/effects", "python/pendmap/virtual_rig/effects"
NAMED_ELSEWHERE = {
    *("viscous_damping", "coulomb_friction", "bias_torque"),  # parameters of every pendulum
    *("encoder_offset", "encoder_gain", "drive_phase"),  # of every sensor, of every drive
    "bearing_harmonic",  # a pendulum may have several
    "quadratic_drag",  # identify tries it unasked
    "stribeck_friction",  # a summary says that it lowers the friction at rest
}
"""Effects named by code outside the library; a new effect is not among them."""


def how_to(title: str) -> str:
    """Return a section of CONTRIBUTING.md."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    return text.split(f"## {title}\n")[1].split("\n## ")[0]


@pytest.mark.parametrize(
    ("title", "example"),
    [
        ("Add an effect", "cubic_damping"),
        ("Add an analysis", "tongues"),
        ("Add a chart", "basins"),
    ],
)
def test_the_files_that_a_how_to_names_exist(title: str, example: str) -> None:
    for path in re.findall(r"`((?:src|python|tests)/\S+)`", how_to(title)):
        assert (ROOT / path.replace("NAME", example)).exists(), path


def named(path: Path) -> set[str]:
    """Return the effects that a file names in its code, comments and documentation excluded."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".rs":
        words = set(re.findall(r"\w+", re.sub(r"//.*", "", text)))
        return {n for n in EFFECTS if n in words or n.title().replace("_", "") in words}
    nodes = list(ast.walk(ast.parse(text)))
    texts = {node.value for node in nodes if isinstance(node, ast.Constant)}
    return EFFECTS & ({getattr(node, "name", None) for node in nodes} | texts)


def test_an_effect_is_named_in_four_files() -> None:
    # The core is not built again here: the effects that there are show which files name one.
    places: dict[str, set[str]] = {name: set() for name in EFFECTS}
    for path in (p for f in ("src", "python/pendmap") for p in ROOT.joinpath(f).rglob("*.*")):
        if path.suffix in {".rs", ".py"}:
            place = path.relative_to(ROOT).as_posix()
            for name in named(path):
                places[name].add(TWINS if place.startswith(TWINS) else place)
    laws = {f"{LIBRARY}/{name}.rs" for name in EFFECTS}  # one may use a function of another
    for name in EFFECTS - NAMED_ELSEWHERE:
        law = f"{LIBRARY}/{name}.rs"
        assert places[name] - (laws - {law}) == {law, f"{LIBRARY}/mod.rs", TWINS}
    for path in (f"{LIBRARY}/NAME.rs", f"{LIBRARY}/mod.rs", TWINS, "tests/rust/effects.rs"):
        assert path in how_to("Add an effect")


# An analysis, written into a copy of the package.

ANALYSIS = '''
"""Period of free swings against their amplitude."""

import numpy as np
import xarray as xr
from scipy.special import ellipk

from pendmap.analysis import result
from pendmap.analysis.run import Numerics
from pendmap.analysis.result import Field, Schema, summarised
from pendmap.files.variables import variable

SCHEMA = Schema(
    "swing",
    result.UNITS,
    Field("largest", "rad", "largest amplitude"),
    Field("longest", result.OF_TIME, "period at the largest amplitude"),
    result.SIMD,
    *result.END,
    *result.VERSIONS,
)


def swing(pendulum, largest: float = 3.0):
    """Return the period ``4 K(sin(A/2)^2)`` of swings of the amplitude ``A`` without damping.

    Parameters
    ----------
    largest : float
        Largest amplitude, rad.
    """
    amplitude = np.linspace(0.0, largest, 50)
    period = pendulum.units.given(4 * ellipk(np.sin(amplitude / 2) ** 2), -1)
    dataset = xr.Dataset(
        {"period": variable("amplitude", period, pendulum.units.of_time, "period")},
        coords={"amplitude": variable("amplitude", amplitude, "rad", "amplitude")},
    )
    values = {**Numerics().provenance(), "largest": largest, "longest": float(period[-1])}
    SCHEMA.complete(dataset, pendulum, values)
    said = f"The period at {largest:g} rad is {period[-1]:.6g}."
    summarised(dataset, [said], pendulum, "the period is")
    return dataset
'''
CHART = '''
"""Period of free swings against their amplitude."""

from pendmap.charts.chart import Axis, Chart, Panel
from pendmap.charts.marks import Line


def chart(dataset, *, layer=None, cells=0):
    """Return the curve of the period."""
    line = Line(dataset["amplitude"].values, dataset["period"].values, path="period")
    panel = Panel("swing", "", Axis("amplitude (rad)"), Axis("period"), [line])
    return Chart("Period of free swings", dataset.attrs["title"], [[panel]]).only(layer)
'''
TABLE = 'ANALYSES = {\n    "swing": ("swing", ["swing"], "Compute the period of free swings."),'


def test_an_analysis_is_four_files(tmp_path: Path) -> None:
    copy = tmp_path / "python" / "pendmap"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    front = (PACKAGE / "__init__.py").read_text(encoding="utf-8")
    files = {
        "python/pendmap/analysis/swing.py": ANALYSIS,
        "python/pendmap/__init__.py": front.replace("ANALYSES = {", TABLE),
        "python/pendmap/charts/swing.py": CHART,
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    asked = re.findall(r"`(\S+\.py)`", how_to("Add an analysis"))
    named_there = {path.replace("NAME", "swing") for path in asked}
    assert {*files, "tests/python/analysis/test_swing.py"} <= named_there
    core = how_to("Add an analysis").split("With a core in Rust")[1]
    assert len(re.findall(r"`\S+`", core)) == 4

    def run(*words: str) -> str:
        done = subprocess.run(
            [sys.executable, "-m", *words],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(copy.parent)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    assert "Compute the period of free swings." in run("pendmap", "--help")
    words = ("swing", "--largest", "2", "--plot", "a.svg", "--rerun", "a.rrd", "--out", "a.nc")
    assert "The period at 2 rad is 8.34975." in run("pendmap", *words)
    for name in ("a.nc", "a.svg", "a.rrd"):
        assert (tmp_path / name).stat().st_size > 3000, name
    run("pendmap", "plot", "a.nc", "--out", "b.png")
    assert json.loads(run("pendmap", "swing", "--json"))["largest"] == 3.0
    # The tests of all analyses include the new one without a change.
    every = str(ROOT / "tests" / "python" / "analysis" / "test_every_result.py")
    words = ("-q", "-p", "no:xdist", "-p", "no:cacheprovider", "-k", "swing", every)
    assert " passed" in run("pytest", *words)
