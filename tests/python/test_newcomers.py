"""The how-tos of CONTRIBUTING.md: an effect and an analysis take four files, a chart one.

The test of the chart is in test_charts.py.
"""

from __future__ import annotations

import ast
import filecmp
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
EFFECTS = {effect.name: effect for effect in pendmap.effects()}
LIBRARY, TWINS = "src/model/effects", "python/pendmap/virtual_rig/effects"
RUST_TEST = "tests/rust/effects.rs"


def how_to(title: str) -> str:
    """Return a section of CONTRIBUTING.md."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    return text.split(f"## {title}\n")[1].split("\n## ")[0]


@pytest.mark.parametrize(
    ("title", "example"),
    [
        ("Add an effect", "cubic_damping"),
        ("Add an analysis", "lyapunov"),
        ("Add a chart", "basins"),
    ],
)
def test_the_files_that_a_how_to_names_exist(title: str, example: str) -> None:
    for path in re.findall(r"`((?:src|python|tests)/\S+)`", how_to(title)):
        name = "exponents" if path == "tests/python/analysis/test_NAME.py" else example
        assert (ROOT / path.replace("NAME", name)).exists(), path


# An effect. The core is not built again here: the effects that there are show which files name one.

OWN_TERM = "a parameter of every pendulum is this term"
OF_THE_SENSOR = "a fit has the zero and the scale of every sensor"
PHASE = "a residual torque cannot be told from the phase of the drive"
NAMED_ELSEWHERE = {
    "viscous_damping": OWN_TERM,
    "coulomb_friction": OWN_TERM,
    "bias_torque": OWN_TERM,
    "bearing_harmonic": "a pendulum may have several",
    "encoder_offset": OF_THE_SENSOR,
    "encoder_gain": OF_THE_SENSOR,
    "drive_phase": PHASE,
    "quadratic_drag": "identify tries it unasked",
    "stribeck_friction": "a summary says that it lowers the friction at rest",
}
"""Effects named by code outside the library, with reasons; a new effect is not among them."""


def named(path: Path) -> set[str]:
    """Return the effects that a file names in its code, comments and documentation excluded."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".rs":
        words = set(re.findall(r"\w+", re.sub(r"//.*", "", text)))
        return {n for n in EFFECTS if n in words or n.title().replace("_", "") in words}
    found = {getattr(node, "name", None) for node in ast.walk(ast.parse(text))}
    found |= {node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant)}
    return {name for name in EFFECTS if name in found}


def place(path: Path) -> str:
    """Return the key of a file; files of the virtual rig's effects share one."""
    name = path.relative_to(ROOT).as_posix()
    return TWINS if name.startswith(TWINS) else name


@pytest.fixture(scope="module")
def places() -> dict[str, set[str]]:
    """Return the effects named in each place."""
    found: dict[str, set[str]] = {}
    for folder in ("src", "python/pendmap", "tests"):
        for path in ROOT.joinpath(folder).rglob("*.*"):
            if path.suffix in {".rs", ".py"} and path != Path(__file__):
                found.setdefault(place(path), set()).update(named(path))
    return found


def test_an_effect_is_written_in_four_files(places: dict[str, set[str]]) -> None:
    groups = [{n for n, e in EFFECTS.items() if e.group == g} for g in ("damping", "torque")]
    lists = {place for place, names in places.items() if any(group <= names for group in groups)}
    assert lists == {f"{LIBRARY}/mod.rs", TWINS, RUST_TEST}
    text = how_to("Add an effect")
    for path in (f"{LIBRARY}/NAME.rs", *lists):
        assert path in text, path


@pytest.mark.parametrize("name", sorted(EFFECTS.keys() - NAMED_ELSEWHERE.keys()))
def test_no_other_code_names_an_effect(name: str, places: dict[str, set[str]]) -> None:
    code = {place for place, names in places.items() if name in names and "tests/" not in place}
    # The law of an effect may use a function of another.
    code -= {f"{LIBRARY}/{other}.rs" for other in EFFECTS if other != name}
    assert code == {f"{LIBRARY}/{name}.rs", f"{LIBRARY}/mod.rs", TWINS}


# An analysis, written into a copy of the package.

ANALYSIS = '''
"""Period of free swings against their amplitude."""

import math

import numpy as np
import xarray as xr
from scipy.special import ellipk

from pendmap.analysis import result
from pendmap.analysis.run import Numerics
from pendmap.analysis.result import Field, Schema, summarised
from pendmap.files.variables import variable
from pendmap.errors import InputError, check_number

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
    largest = check_number("largest", largest)
    if not 0 < largest < math.pi:
        raise InputError(f"largest must be a number above 0 and below pi, got {largest:g}")
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
TEST = """
import math

import pytest

import pendmap


def test_small_swings_take_two_pi():
    result = pendmap.swing(pendmap.Pendulum(), 1e-6)
    assert result.attrs["kind"] == "swing"
    assert result.attrs["longest"] == pytest.approx(math.tau, rel=1e-9)


def test_a_dataset_is_saved_and_read():
    path = pendmap.save(pendmap.swing(pendmap.Rig(w0=2.0)), "saved.nc")
    assert pendmap.load(path)["period"].attrs["units"] == "s"
"""


def test_an_analysis_is_four_files(tmp_path: Path) -> None:
    copy = tmp_path / "python" / "pendmap"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    front = (PACKAGE / "__init__.py").read_text(encoding="utf-8")
    files = {
        "python/pendmap/analysis/swing.py": ANALYSIS,
        "python/pendmap/__init__.py": front.replace("ANALYSES = {", TABLE),
        "python/pendmap/charts/swing.py": CHART,
        "tests/python/analysis/test_swing.py": TEST,
    }
    (tmp_path / "tests" / "python" / "analysis").mkdir(parents=True)
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    asked = {
        path.replace("NAME", "swing")
        for path in re.findall(r"`(\S+\.py)`", how_to("Add an analysis"))
    }
    assert set(files) <= asked
    changed = [
        path
        for path in copy.rglob("*.py")
        if not (old := PACKAGE / path.relative_to(copy)).exists()
        or not filecmp.cmp(path, old, shallow=False)
    ]
    assert len(changed) + 1 == len(files) == 4
    core = how_to("Add an analysis").split("With a core in Rust")[1]
    assert len(files) + len(re.findall(r"`\S+`", core)) == 8

    def run(*words: str) -> str:
        environment = os.environ | {"PYTHONPATH": str(copy.parent)}
        done = subprocess.run(
            [sys.executable, "-m", *words],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    assert "Compute the period of free swings." in run("pendmap", "--help")
    said = run(
        "pendmap", "swing", "--largest", "2", "--plot", "a.svg", "--rerun", "a.rrd", "--out", "a.nc"
    )
    assert "The period at 2 rad is 8.34975." in said
    for name in ("a.nc", "a.svg", "a.rrd"):
        assert (tmp_path / name).stat().st_size > 3000, name
    run("pendmap", "plot", "a.nc", "--out", "b.png")
    found = json.loads(run("pendmap", "swing", "--json"))
    assert found["largest"] == 3.0
    # The tests of all analyses include the new one without a change.
    every = str(ROOT / "tests" / "python" / "analysis" / "test_every_result.py")
    run(
        "pytest",
        "-q",
        "-p",
        "no:xdist",
        "-p",
        "no:cacheprovider",
        "tests/python/analysis/test_swing.py",
    )
    assert "5 passed" in run(
        "pytest", "-q", "-p", "no:xdist", "-p", "no:cacheprovider", "-k", "swing", every
    )
