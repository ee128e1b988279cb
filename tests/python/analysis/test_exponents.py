"""Lyapunov exponents against reference values and scipy; in files, figures and recordings."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
from drawn import made, named, titles
from pendmap import Effect, Pendulum, Rig, render
from pendmap.files import facts
from recordings import recorded

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr

    from conftest import Run

CHAOS = Pendulum(gamma=0.1, p=2.0, omega=2.0)


@pytest.fixture(scope="module")
def chaos() -> xr.Dataset:
    return pendmap.lyapunov(CHAOS)


@pytest.fixture(scope="module")
def settled() -> xr.Dataset:
    """Return a start that is chaotic for some time."""
    return pendmap.lyapunov(Pendulum(gamma=0.1, p=1.8, omega=2.0), 0.6, 0.2)


def test_chaos_against_the_reference(chaos: xr.Dataset, truths: dict[str, Any]) -> None:
    entry = truths["lyapunov"]["w2.0_p2.0"]
    a = facts(chaos)
    assert a["end"] == "chaotic"
    assert 0 < a["largest_exponent_stderr"] < 0.002 * a["largest_exponent"]
    assert abs(a["largest_exponent"] - entry["lle_per_tau"]) < 3 * math.hypot(
        a["largest_exponent_stderr"], entry["se"]
    )
    assert a["per_period"] == pytest.approx(a["largest_exponent"] * math.pi)
    assert a["second_exponent"] + a["largest_exponent"] == pytest.approx(-0.1)
    assert abs(a["kaplan_yorke_dimension"] - entry["D_KY_map"]) < 2e-3
    assert float(chaos["exponent"][0]) == a["largest_exponent"]


def test_the_error_is_that_of_independent_trajectories(chaos: xr.Dataset) -> None:
    each = chaos["finite_time_exponent"].values.mean(axis=1)
    assert chaos["largest_exponent"].item() == pytest.approx(each.mean(), rel=1e-9)
    assert chaos["largest_exponent_stderr"].item() == pytest.approx(
        each.std(ddof=1) / math.sqrt(each.size)
    )
    # Blocks of one trajectory scatter as independent ones: correlations are shorter than a block.
    blocks = chaos["finite_time_exponent"].values[:, :200].reshape(each.size, 10, -1).mean(axis=2)
    within = blocks.std(axis=1, ddof=1).mean() / math.sqrt(10)
    assert within == pytest.approx(blocks.mean(axis=1).std(ddof=1), rel=0.25)


def test_growth_along_the_start_is_the_tangents_of_scipy(settled: xr.Dataset) -> None:
    model = Pendulum(gamma=0.1, p=1.8, omega=2.0)

    def slope(tau: float, y: Any) -> list[float]:  # noqa: ANN401
        pull = 1 + model.p * math.cos(model.omega * tau)
        bend = -pull * math.cos(y[0])
        return [y[1], -model.gamma * y[1] - pull * math.sin(y[0]), y[3], bend * y[2] - 0.1 * y[3]]

    periods = 8
    run = solve_ivp(
        slope,
        (0.0, periods * model.period),
        (0.6, 0.2, math.sqrt(0.5), math.sqrt(0.5)),
        method="DOP853",
        rtol=1e-12,
        atol=1e-12,
        t_eval=model.period * np.arange(periods + 1),
    )
    expected = np.log(np.hypot(run.y[2], run.y[3]))
    assert np.allclose(settled["growth"].values[: periods + 1], expected, atol=2e-3)


def test_transient_chaos_has_the_exponent_of_the_attractor_that_captures_it(
    settled: xr.Dataset,
) -> None:
    a = facts(settled)
    assert a["end"] == "captured"
    assert a["transient_periods"] > 30
    assert settled["growth"].values.max() > 15
    assert a["largest_exponent"] == pytest.approx(-0.05, abs=1e-9)
    assert (a["largest_exponent_stderr"], a["trajectories"]) == (0.0, 0)
    assert a["second_exponent"] == pytest.approx(-0.05, abs=1e-9)
    assert "reached after" in a["summary"]
    assert "rounding decides" in a["summary"]


def test_the_transient_agrees_with_the_growth_of_its_trajectory(settled: xr.Dataset) -> None:
    a, growth = facts(settled), settled["growth"].values
    at = a["transient_periods"]
    assert growth.size == at + 101
    # After the capture deviations shrink at the attractor's rate; before it they grow.
    assert (growth[-1] - growth[at + 16]) / 84 == pytest.approx(a["per_period"], abs=0.05)
    assert growth[at] > growth[: at // 2].max() > 10
    near = pendmap.lyapunov(Pendulum(p=0.6), 0.3, 0.0)
    assert "rounding" not in near.attrs["summary"]


def test_regular_motion_without_damping_has_the_growth_of_tau_and_no_error() -> None:
    # In a free pendulum the distance of neighbours grows in proportion to time.
    a = facts(pendmap.lyapunov(Pendulum(gamma=0.0, p=0.0), 2.0))
    assert a["largest_exponent"] == pytest.approx(a["regular"], rel=0.1)
    assert math.isnan(a["largest_exponent_stderr"])
    assert "not significantly different from 0" in a["summary"]
    chaotic = facts(pendmap.lyapunov(Pendulum(gamma=0.0, p=1.0), 2.0))
    assert chaotic["largest_exponent"] > 50 * chaotic["regular"]
    assert 0 < chaotic["largest_exponent_stderr"] < 0.01 * chaotic["largest_exponent"]


@pytest.mark.parametrize("name", ["fig2a", "fig2b", "fig2c"])
def test_the_points_of_figure_2_are_tumbling_chaos(name: str) -> None:
    found = pendmap.lyapunov(pendmap.PRESETS[name], precision=0.01)
    assert [str(kind) for kind in found["kind"].values] == ["tumbling_chaos"]
    assert found["largest_exponent"].item() > 20 * found["largest_exponent_stderr"].item()


def test_the_seed_changes_the_sample_and_threads_do_not(chaos: xr.Dataset) -> None:
    few = pendmap.lyapunov(CHAOS, precision=0.01, threads=1)
    same = pendmap.lyapunov(CHAOS, precision=0.01, threads=2)
    other = pendmap.lyapunov(CHAOS, precision=0.01, seed=1)
    assert few["largest_exponent"].item() == same["largest_exponent"].item()
    assert few["largest_exponent"].item() != other["largest_exponent"].item()
    apart = few["largest_exponent"].item() - other["largest_exponent"].item()
    assert abs(apart) < 4 * math.hypot(
        few["largest_exponent_stderr"].item(), other["largest_exponent_stderr"].item()
    )
    assert few["largest_exponent_stderr"].item() > chaos["largest_exponent_stderr"].item()


def test_a_pendulum_held_by_friction_has_no_exponent() -> None:
    found = pendmap.lyapunov(Pendulum(gamma=0.1, p=1.5, omega=0.87, theta_r=0.2))
    assert found["end"].item() == "captured"
    assert str(found["attractor"].values[0]) == "rest"
    assert math.isnan(found["largest_exponent"].item())
    assert "Friction holds it permanently" in found.attrs["summary"]


def test_a_cycle_with_turns_under_friction_has_the_sum_of_its_turns() -> None:
    found = pendmap.lyapunov(Pendulum(gamma=0.1, p=1.0, omega=0.87, theta_r=0.01))
    a = facts(found)
    assert str(found["kind"].values[0]) == "oscillation"
    # Each turning point shrinks phase area in addition to viscous damping.
    assert -0.12 < a["exponent_sum"] < -0.101


def test_exponents_of_a_rig_are_per_second(chaos: xr.Dataset) -> None:
    rig = Rig(w0=5.0, c_over_m=0.5, p=2.0, Omega=10.0)
    si = pendmap.lyapunov(rig)
    assert si["largest_exponent"].item() == pytest.approx(
        5 * chaos["largest_exponent"].item(), rel=1e-9
    )
    assert si["per_period"].item() == pytest.approx(chaos["per_period"].item(), rel=1e-9)
    assert "per second" in si.attrs["summary"]
    assert si["running_exponent"].attrs["units"] == "1/s"


def test_without_damping_or_drive() -> None:
    found = pendmap.lyapunov(Pendulum(gamma=0.0, p=0.0), 0.5)
    assert found["end"].item() == "undamped"
    assert abs(found["largest_exponent"].item()) < 5e-3
    found = pendmap.lyapunov(Pendulum(p=0.0))
    assert (str(found["kind"].values[0]), found["end"].item()) == ("rest", "captured")
    assert found["largest_exponent"].item() == pytest.approx(-0.05)


def test_effects_act_and_unmappable_ones_are_refused() -> None:
    drag = Effect("quadratic_drag", {"q": 0.3})
    found = pendmap.lyapunov(Pendulum(p=1.0, effects=(drag,)))
    assert found["end"].item() == "captured"
    assert found["exponent_sum"].item() < -0.101
    ever = Pendulum(p=1.0, effects=(Effect("drive_chirp", {"r": 0.001}),))
    with pytest.raises(pendmap.InputError, match="drive_chirp"):
        pendmap.lyapunov(ever)


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"precision": 0.0}, "precision must be a number above 0, up to 0.5, got 0"),
        ({"precision": math.nan}, "precision must be .*, got nan"),
        ({"theta": math.inf}, "theta must be .*, got inf"),
        ({"tol": 1.0}, "tol must be .*, got 1"),
        ({"max_periods": 0}, "max_periods must be .*, got 0"),
        ({"threads": 0}, "threads must be .*, got 0"),
        ({"seed": -1}, "seed must be .*, got -1"),
    ],
)
def test_invalid_arguments_are_refused(given: dict[str, Any], match: str) -> None:
    with pytest.raises(pendmap.InputError, match=match):
        pendmap.lyapunov(CHAOS, **given)


def test_the_command(pendmap_command: Run, tmp_path: Path) -> None:
    run = pendmap_command("lyapunov", "--p", 2, "--precision", 0.01)
    assert run.returncode == 0, run.stderr
    assert "Largest Lyapunov exponent 0.27" in run.stdout
    assert {p.name for p in tmp_path.iterdir()} == {"lyapunov.nc", "lyapunov.png", "lyapunov.rrd"}
    run = pendmap_command("lyapunov", "--p", 1, "--theta-r", 0.5, "--json")
    said = json.loads(run.stdout)
    assert {"exponent", "stderr", "per_period", "attractor", "transient_periods"} <= said.keys()
    assert said["attractor"]["name"] == "rest"
    assert said["exponent"] is None
    again = pendmap_command("plot", "lyapunov.nc", "--layer", "distribution", "--plot", "again.pdf")
    assert again.returncode == 0, again.stderr
    refused = pendmap_command("lyapunov", "--precision", 1)
    assert refused.returncode == 2
    assert "up to 0.5" in refused.stderr


def test_figures_say_what_they_show(chaos: xr.Dataset, settled: xr.Dataset) -> None:
    figure = made(chaos)
    assert titles(figure)[1:] == ["mean over 256 trajectories", "exponents over 20 periods"]
    assert any("0.2736" in text or "0.2735" in text for text in named(figure))
    figure = made(settled)
    assert titles(figure)[1:] == ["exponent over 20 periods"]
    assert any("transient" in text for text in named(figure))
    with pytest.raises(pendmap.InputError, match="no layer 'labels'"):
        made(chaos, layer="labels")


@pytest.mark.usefixtures("strict_recordings")
def test_recordings_hold_the_result(chaos: xr.Dataset, settled: xr.Dataset, tmp_path: Path) -> None:
    back = recorded(chaos, tmp_path)
    wanted = {"/average/data/own", "/average/data/band", "/distribution/data/density"}
    assert wanted | {"/growth/data/own", "/attractor/data/points", "/summary"} <= set(back.columns)
    back = recorded(settled, tmp_path)
    assert {"/exponent/data/own", "/exponent/data/value"} <= set(back.columns)


def test_files_hold_the_result(chaos: xr.Dataset, settled: xr.Dataset, tmp_path: Path) -> None:
    for number, dataset in enumerate((chaos, settled)):
        path = pendmap.save(dataset, tmp_path / f"{number}.nc")
        assert pendmap.load(path).equals(dataset)


def test_a_model_in_si_with_an_effect_has_a_figure(tmp_path: Path) -> None:
    """The title of a model with long parameters is on two lines."""
    drag = Effect("quadratic_drag", {"q": 0.01})
    rig = Rig(w0=6.2, c_over_m=0.05, Tr=0.08, p=0.29, Omega=11.9381, effects=(drag,))
    found = pendmap.lyapunov(rig, 1.0, 0.0)
    assert render.draw(found, tmp_path / "a.png").stat().st_size > 20_000
