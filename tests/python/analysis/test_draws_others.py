"""Maps, orbits, lifetimes and critical curves over draws; models that miss their records."""

from __future__ import annotations

import json
import math
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import pendmap
from pendmap import Grid, InputError, Pendulum, Rig, cli, render, viewer
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


def damped(p: float, spread: float) -> Pendulum:
    """Return a driven pendulum whose damping has the given standard error."""
    notes = {"covariance": {"names": ["gamma"], "matrix": [[spread**2]]}}
    return Pendulum(gamma=0.1, p=p, omega=2.0, notes=notes)


def growth(gamma: float, p: float, omega: float = 2.0) -> float:
    """Return the largest modulus of the multipliers of hanging rest, by scipy."""

    def equation(tau: float, x: np.ndarray) -> list[float]:
        pull = 1 + p * math.cos(omega * tau)
        return [x[1], -gamma * x[1] - pull * x[0], x[3], -gamma * x[3] - pull * x[2]]

    run = solve_ivp(
        equation, (0, math.tau / omega), [1, 0, 0, 1], method="DOP853", rtol=1e-12, atol=1e-12
    )
    return float(np.abs(np.linalg.eigvals(run.y[:, -1].reshape(2, 2))).max())


def test_the_probability_of_a_regime_is_its_share_of_the_draws() -> None:
    """Hanging rest attracts if its multipliers, by scipy, lie within the unit circle."""
    model = damped(0.2, 0.02)
    ranges = {"p": (0.14, 0.26, 7), "omega": (2.0, 2.0, 1)}
    result = pendmap.parameter_map(model, ranges, draws=16, seed=SEED)
    rests = result["outcome_has"].sel(outcome_kind="rest").values.astype(bool)
    probability = result.probability.values[rests].sum(axis=0)[0]
    gammas = result.drawn.values[:, 0]
    exact = [np.mean([growth(g, p) < 1 for g in gammas]) for p in result.p.values]
    assert probability == pytest.approx(exact)
    assert 0 < min(exact[2:5]) < 1
    assert result.probability.values.sum(axis=0) == pytest.approx(1)
    counted = result.drawn_share.values.mean(axis=1)
    assert result.share_mean.values == pytest.approx(counted)
    assert result["sure_cells"].item() == pytest.approx((result.certainty.values >= 0.95).mean())


def test_orbits_over_draws_have_the_multipliers_of_each_draw() -> None:
    model = damped(0.2, 0.02)
    result = pendmap.orbit(model, 1, 0, draws=20, seed=SEED)
    gammas = result.drawn.values[:, 0]
    rest = [str(name) for name in result.orbit.values].index("rest")
    pairs = result.drawn_multipliers.values[rest]
    product = (pairs[0, 0] + 1j * pairs[0, 1]) * (pairs[1, 0] + 1j * pairs[1, 1])
    assert np.abs(product - np.exp(-gammas * math.pi)).max() < 1e-10
    stable = [growth(g, 0.2) < 1 for g in gammas]
    assert 0 < np.mean(stable) < 1
    assert float(result.stable_share[rest]) == pytest.approx(np.mean(stable))
    assert result.exists.values == pytest.approx(1)
    assert float(result.theta_spread[rest]) == 0
    spread = np.hypot(*np.moveaxis(pairs, 1, 0)).std(axis=1, ddof=1)
    assert result.multipliers_spread.values[rest, :, 0] == pytest.approx(spread, rel=1e-6)


def test_an_orbit_is_missing_for_draws_beyond_its_bifurcation() -> None:
    """The oscillation of period 2 exists only if rest is unstable, here above p = 0.2."""
    result = pendmap.orbit(damped(0.21, 0.02), 2, 0, draws=20, seed=SEED)
    assert result.sizes["orbit"] == 1
    gammas = result.drawn.values[:, 0]
    # At omega = 2 rest loses stability toward larger p: the oscillation exists if rest is unstable.
    there = np.array([growth(g, 0.21) > 1 for g in gammas])
    assert 0 < there.mean() < 1
    assert float(result.exists[0]) == pytest.approx(there.mean())
    assert np.array_equal(np.isfinite(result.drawn_theta.values[0]), there)


def test_the_band_of_a_critical_curve_has_the_quantiles_of_the_draws() -> None:
    result = pendmap.tongues(damped(0.2, 0.02), [1.9, 2.0, 2.2], 1.0, draws=12, seed=SEED)
    gammas = result.drawn.values[:, 0]
    k = int(np.flatnonzero(result.critical_omega.values == 2.0)[0])
    exact = [brentq(lambda p, g=g: growth(g, p) - 1, 0.05, 0.5, xtol=1e-11) for g in gammas]
    assert result.drawn_p.values[k] == pytest.approx(exact, abs=1e-8)
    low, high = np.quantile(exact, [0.025, 0.975])
    assert [float(result.p_low[k]), float(result.p_high[k])] == pytest.approx([low, high])
    assert result.exists.values == pytest.approx(1)


def test_a_lifetime_has_the_interval_of_its_draws() -> None:
    model = damped(1.2, 0.005)
    result = pendmap.lifetime(model, starts=1500, draws=4, seed=SEED)
    means = [
        pendmap.lifetime(Pendulum(gamma=g, p=1.2), starts=1500, seed=SEED)["mean_periods"].item()
        for g in result.drawn.values[:, 0]
    ]
    assert result.drawn_mean_periods.values == pytest.approx(means)
    assert len(set(means)) == 4
    ends = [result[f"mean_periods_{end}"].item() for end in ("low", "high")]
    assert ends == pytest.approx(np.quantile(means, [0.025, 0.975]))
    assert result["transient_share"].item() == 1


COMMANDS = {
    "basins": ("--grid", "10"),
    "map": ("--p", "0.3:0.6:2", "--omega", "1.8:2.0:2", "--starts", "2"),
    "orbit": ("--n", "2", "--grid", "40"),
    "lifetime": ("--starts", "100"),
    "tongues": ("--omega", "1.8:2.2:3", "--p-max", "1"),
    "bifurcation": ("--vary", "c_over_m", "0.3:0.6:3", "--starts", "2"),
    "lyapunov": (),
}
WITHOUT = ("bifurcation", "lyapunov")


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
    result = pendmap.basins(damped(0.6, 0.01), Grid.square(12), draws=3, seed=SEED)
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
