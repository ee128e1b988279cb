"""Draws of fitted models in commands and figures; models that miss their records."""

from __future__ import annotations

import json
import math
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp

import pendmap
from pendmap import InputError, Pendulum, Rig, cli, render, viewer
from pendmap.identification import identify
from pendmap.identification.experiment import identified_model, provenance

if TYPE_CHECKING:
    from pathlib import Path

SEED = 5
DRIVEN = """
[pendulum]
w0 = 6.2
c_over_m = 0.62
p = 0.6
Omega = 12.4
[covariance]
names = ["w0", "c_over_m"]
matrix = [[1e-4, 0.0], [0.0, 1e-3]]
[provenance]
rms = 0.0271
noise = 0.001
"""


COMMANDS = {
    "basins": ("--grid", "10"),
    "map": ("--p", "0.3:0.6:2", "--omega", "1.8:2.0:2", "--starts", "2"),
    "lifetime": ("--starts", "100"),
    "lyapunov": (),
}
WITHOUT = ("lyapunov",)


@pytest.mark.parametrize("command", COMMANDS)
def test_results_report_a_model_that_misses_its_record(
    command: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Figure, "savefig", lambda figure, part, **_: part.write_text(str(figure)))
    (tmp_path / "model.toml").write_text(DRIVEN, encoding="utf-8")
    draws = () if command in WITHOUT else ("--draws", "3")
    files = ("--out", "a.nc", "--plot", "a.png", "--rerun", "a.rrd")
    words = [command, "--model", "model.toml", *COMMANDS[command], *draws, *files, "--json"]
    monkeypatch.setattr(sys, "argv", ["pendmap", *words])
    with pytest.raises(SystemExit) as end:
        cli.run()
    out, err = capsys.readouterr()
    assert not end.value.code, err
    said = json.loads(out)
    assert said["misses_record"] == pytest.approx(27.1)
    assert said["summary"].count("This model misses its record by 27.1 times the noise.") == 1
    result = pendmap.load(tmp_path / "a.nc")
    assert result.attrs["misses_record"] == pytest.approx(27.1)
    if draws:
        assert said["draws"]["count"] == 3
        assert said["draws"]["parameters"] == ["w0", "c_over_m"]
        assert result.drawn.shape == (3, 2)
    render.draw(result, tmp_path / "again.png")
    viewer.record(result, tmp_path / "again.rrd")


@pytest.mark.parametrize("layer", ["probability", "entropy"])
def test_the_layers_over_draws_are_drawn(layer: str, tmp_path: Path) -> None:
    notes = {"covariance": {"names": ["gamma"], "matrix": [[1e-4]]}}
    result = pendmap.basins(Pendulum(gamma=0.1, p=0.6, notes=notes), 12, draws=3)
    render.draw(result, tmp_path / "a.png", layer=layer, dpi=50)
    render.draw(result.isel(theta=slice(2, 9)), tmp_path / "b.png", layer=layer, dpi=50)
    with pytest.raises(InputError, match="no layer"):
        render.draw(pendmap.basins(Pendulum(), 8), tmp_path / "c.png", layer=layer)


@pytest.mark.parametrize("command", [one for one in COMMANDS if one not in WITHOUT])
def test_a_model_without_a_covariance_is_refused_in_one_line(
    command: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    words = [command, "--gamma", "0.2", *COMMANDS[command], "--draws", "3"]
    monkeypatch.setattr(sys, "argv", ["pendmap", *words])
    with pytest.raises(SystemExit) as end:
        cli.run()
    err = capsys.readouterr().err
    assert end.value.code == 2
    assert err.startswith("pendmap: draws: the model must have a [covariance]")
    assert err.count("\n") == 1
    assert not [*tmp_path.iterdir()]


def test_a_record_counts_as_missed_from_one_and_a_half_times_the_noise() -> None:
    for rms, said in ((1.49e-3, None), (1.51e-3, 1.51)):
        rig = Rig(w0=6.0, c_over_m=0.6, notes={"provenance": {"rms": rms, "noise": 1e-3}})
        run = pendmap.simulate(rig, 1.0, 0.0, 1.0)
        assert run.attrs.get("misses_record") == (None if said is None else pytest.approx(said))
        assert ("misses its record" in run.attrs["summary"]) == (said is not None)


def test_identify_writes_the_residual_of_its_model_and_the_noise(tmp_path: Path) -> None:
    assert "rms" not in provenance({}, "")
    assert provenance({}, "", rms=2.0, noise=1.0).items() >= {"rms": 2.0, "noise": 1.0}.items()
    time = np.arange(0, 40, 0.01)
    swing = solve_ivp(
        lambda _, x: [x[1], -0.2 * x[1] - 6.2**2 * math.sin(x[0])],
        (0, 40),
        [2.0, 0.0],
        method="DOP853",
        t_eval=time,
        rtol=1e-10,
        atol=1e-10,
    )
    noise = np.random.default_rng(SEED).normal(0, 1e-3, time.size)
    table = np.c_[time, swing.y[0] + noise]
    path = tmp_path / "run.csv"
    np.savetxt(path, table, delimiter=",", header="t_s,theta_rad", comments="")
    report = identify(pendmap.read_experiment(path), methods=["trajectory"])
    said = identified_model(report).notes["provenance"]
    assert said["rms"] == pytest.approx(1e-3, rel=0.05)
    assert said["noise"] == pytest.approx(1e-3, rel=0.1)


@pytest.mark.parametrize(
    ("name", "own", "factor"),
    [("stroke_mm", "p", 1e-3 * 12.4**2 / 9.81), ("frequency_hz", "Omega", math.tau)],
)
def test_quantities_of_the_laboratory_vary_the_rigs_numbers(
    name: str, own: str, factor: float
) -> None:
    rig = Rig(w0=6.2, c_over_m=1.0, p=0.9, Omega=12.4)
    low, high = (30.0, 60.0) if name == "stroke_mm" else (1.8, 2.2)
    result = pendmap.bifurcation(rig, {name: (low, high, 3)})
    other = pendmap.bifurcation(rig, {own: (factor * low, factor * high, 3)})
    assert result[name].values == pytest.approx(other[own].values / factor)
    assert result.entry_theta.values == pytest.approx(other.entry_theta.values)
    assert result.entry_n.values.tolist() == other.entry_n.values.tolist()
    assert result.sizes["entry"] >= 3


@pytest.mark.parametrize(
    ("ranges", "said"),
    [
        ({"stroke_mm": (-1, 20, 2), "c_over_m": (1, 2, 2)}, "stroke_mm must be 0 or more, got -1"),
        (
            {"stroke_mm": (10, 20, 2), "p": (0.1, 0.2, 2)},
            "stroke_mm and p must be two parameters, they are one",
        ),
        (
            {"p": (0.1, 0.2, 2), "Tr": (-1, 1, 2)},
            "Tr = -1: theta_r must be 0 or more, got -0.0260146 (without dimensions, w0 is 6.2)",
        ),
    ],
)
def test_invalid_laboratory_ranges_are_refused(ranges: Any, said: str) -> None:  # noqa: ANN401
    with pytest.raises(InputError) as error:
        pendmap.parameter_map(Rig(w0=6.2, c_over_m=1.0, p=0.9, Omega=12.4), ranges)
    assert said in str(error.value)
