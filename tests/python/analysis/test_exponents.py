"""Lyapunov exponents against reference values and scipy; in files, figures and recordings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
from drawn import made, named, titles
from pendmap import Pendulum
from pendmap.files import facts

if TYPE_CHECKING:
    import xarray as xr


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


def test_the_seed_changes_the_sample(chaos: xr.Dataset) -> None:
    few = pendmap.lyapunov(CHAOS, precision=0.01)
    other = pendmap.lyapunov(CHAOS, precision=0.01, run=pendmap.RunOptions(seed=1))
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


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"precision": 0.0}, "precision must be a number above 0, up to 0.5, got 0"),
        ({"precision": math.nan}, "precision must be .*, got nan"),
        ({"theta": math.inf}, "theta must be .*, got inf"),
    ],
)
def test_invalid_arguments_are_refused(given: dict[str, Any], match: str) -> None:
    with pytest.raises(pendmap.InputError, match=match):
        pendmap.lyapunov(CHAOS, **given)


def test_figures_say_what_they_show(chaos: xr.Dataset, settled: xr.Dataset) -> None:
    figure = made(chaos)
    assert titles(figure)[1:] == ["mean over 256 trajectories", "exponents over 20 periods"]
    assert any("0.2736" in text or "0.2735" in text for text in named(figure))
    figure = made(settled)
    assert titles(figure) == ["growth along the start's own trajectory"]
    assert any("transient" in text for text in named(figure))
    with pytest.raises(pendmap.InputError, match="no layer 'labels'"):
        made(chaos, layer="labels")
