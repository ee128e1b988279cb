"""Models drawn from a covariance, and results over them, against known distributions."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq
from scipy.stats import norm, truncnorm

import pendmap
from by_scipy import decays, motion
from pendmap import Axis, Effect, Grid, InputError, Pendulum, Rig, RunOptions
from pendmap._core import Attractor
from pendmap.analysis.draws import Draws, basins_over, drawn
from pendmap.analysis.orbit_table import described
from pendmap.identification.experiment import identified_model

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

SEED = 3


def noted(names: Sequence[str], matrix: Any, **more: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return notes with a covariance, as in a model file."""
    return {"covariance": {"names": [*names], "matrix": np.asarray(matrix).tolist(), **more}}


def test_draws_have_the_mean_and_covariance_of_the_file() -> None:
    matrix = np.array([[4e-4, 3e-5, 0.0], [3e-5, 9e-6, 0.0], [0.0, 0.0, 1.0]])
    notes = noted(["w0", "torque", "phi[2]"], matrix)
    found = drawn(Rig(w0=6.2, torque=0.1, notes=notes), 4000, RunOptions(seed=SEED))
    assert found.names == ("w0", "torque")
    assert found.values.mean(axis=0) == pytest.approx([6.2, 0.1], abs=4 * 0.02 / math.sqrt(4000))
    assert np.cov(found.values.T) == pytest.approx(matrix[:2, :2], rel=0.1)
    assert [one.w0 for one in found.models] == found.values[:, 0].tolist()
    assert all(one.phi == 0 for one in found.models)
    # The spread between runs adds to the variance.
    notes = noted(["w0"], [[9e-6]], between_runs={"w0": 0.004})
    found = drawn(Rig(w0=6.2, notes=notes), 4000, RunOptions(seed=SEED))
    assert found.values.std() == pytest.approx(0.005, rel=0.05)
    # A few draws are the first of many.
    few = drawn(Rig(w0=6.2, notes=notes), 5, RunOptions(seed=SEED))
    assert np.array_equal(few.values, found.values[:5])
    other = drawn(Rig(w0=6.2, notes=notes), 5, RunOptions(seed=SEED + 1))
    assert not np.array_equal(few.values, other.values)


@pytest.mark.parametrize("name", ["c_over_m", "Tr", "quadratic_drag.q"])
def test_damping_and_friction_are_drawn_from_a_gaussian_cut_off_at_0(name: str) -> None:
    own = {"c_over_m": 0.01, "Tr": 0.01} | noted([name], [[4e-4]])
    notes = {"covariance": own.pop("covariance")}
    drag = Effect("quadratic_drag", {"q": 0.01})
    rig = Rig(w0=6.2, effects=(drag,), notes=notes, **own)
    values = drawn(rig, 4000, RunOptions(seed=SEED)).values[:, 0]
    assert values.min() >= 0
    expected = truncnorm(-0.5, math.inf, loc=0.01, scale=0.02)
    assert values.mean() == pytest.approx(expected.mean(), abs=4 * expected.std() / math.sqrt(4000))
    assert values.std() == pytest.approx(expected.std(), rel=0.08)


@pytest.mark.parametrize(
    ("notes", "text"),
    [
        ({}, r"draws: the model must have a \[covariance\]"),
        (noted(["w0"], [[1.0, 0.0]]), "matrix must be 1 x 1 finite numbers"),
        (noted(["w0", "Tr"], [[1.0, 2.0], [2.0, 1.0]]), "must be positive semidefinite"),
        (noted(["w0", "Tr"], [[1.0, 0.5], [0.4, 1.0]]), "must be symmetric"),
        (noted(["friction"], [[1.0]]), "'friction' must be a parameter of the model"),
        (noted(["w0"], [[1.0]], between_runs={"Tr": 1.0}), "must be a table of names among w0"),
        (noted(["w0"], [[1e20]]), "must leave room for allowed values"),
    ],
)
def test_invalid_covariances_are_refused(notes: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        drawn(Rig(w0=1e-3, notes=notes), 200, RunOptions(seed=SEED))


def test_typed_parameters_are_not_drawn(tmp_path: Path) -> None:
    notes = noted(["w0", "c_over_m", "p", "Omega"], np.diag([1.0, 2.0, 3.0, 4.0]) * 1e-6)
    path = tmp_path / "model.toml"
    pendmap.save_model(Rig(w0=6.2, c_over_m=0.1, p=0.5, Omega=12.0, notes=notes), path)
    known = drawn(pendmap.load_model(path), 2, RunOptions())
    assert known.names == ("w0", "c_over_m", "p", "Omega")
    typed = pendmap.load_model(path, {"gamma": 0.1, "stroke_mm": 30.0})
    assert drawn(typed, 2, RunOptions()).names == ("w0", "Omega")


def boundary(model: Pendulum, velocity: float) -> float:
    """Return the angle at which starts with this velocity begin to rotate for ever, by scipy."""

    def turns(theta: float) -> float:
        end = motion(model, theta, velocity, [60.0])[0, 0, 0]
        return 1.0 if end - theta > 8 * math.pi else -1.0

    return float(brentq(turns, 1.0, 2.7, xtol=1e-9))


def test_a_boundary_that_shifts_with_a_normal_parameter_has_a_normal_distribution() -> None:
    """A tilt by d shifts the plane of an undriven pendulum, and the boundary in it, by -d."""
    gamma, torque, velocity, sigma, count = 0.3, 0.6, 0.4, 0.04, 60
    edge = boundary(Pendulum(gamma=gamma, p=0.0, torque=torque), velocity)
    tilt = Effect("rig_tilt", {"d": 0.0})
    notes = noted(["rig_tilt.d"], [[sigma**2]])
    pendulum = Pendulum(gamma=gamma, p=0.0, torque=torque, effects=(tilt,), notes=notes)
    half = 0.2
    grid = Grid(Axis(edge - half, edge + half, 101), Axis(velocity - 1e-9, velocity + 1e-9, 1))
    result = pendmap.basins(pendulum, grid, draws=count, run=RunOptions(seed=SEED))
    names = [str(name) for name in result.outcome.values]
    assert names == ["rest", "rotation 1:+1"]
    rests = result.probability.values[0, 0]
    theta, tilts = result.theta.values, result.drawn.values[:, 0]
    # For each draw:
    exact = np.array([(x + tilts < edge).mean() for x in theta])
    near = np.abs(theta[:, None] + tilts - edge).min(axis=1) < 1e-5
    assert np.array_equal(rests[~near], exact[~near].astype(np.float32))
    # The normal distribution function, within four standard errors.
    law = norm.cdf((edge - theta) / sigma)
    assert np.abs(rests - law).max() < 4 * 0.5 / math.sqrt(count)
    assert np.abs(rests - law).max() > 0
    assert result.certainty.values[0] == pytest.approx(np.maximum(rests, 1 - rests))
    # The share is the boundary's position over the window; its interval is slope times stderr.
    low, high = float(result.share_low[0]), float(result.share_high[0])
    assert high - low == pytest.approx(2 * 1.96 * sigma / (2 * half), rel=0.25)
    assert float(result.share_mean[0]) == pytest.approx(0.5, abs=4 * sigma / 0.4 / math.sqrt(60))
    assert result.attrs["summary"].count("60 draws of rig_tilt.d") == 1


ATTRACTORS = {
    "rest": Attractor("rest", 1),
    "rotation 1:+1": Attractor("rotation", 1, 1),
    "oscillation 2:0": Attractor("oscillation", 2),
}


def painted(label: np.ndarray, names: Sequence[str]) -> xr.Dataset:
    """Return a map with the given labels."""
    rows, columns = label.shape
    count = len(names)
    types = [ATTRACTORS[name.partition(" at ")[0]] for name in names]
    return xr.Dataset(
        {
            "label": (("velocity", "theta"), label.astype(np.int16)),
            "id": ("attractor", np.arange(1, count + 1)),
            **described(types, "attractor"),
            "point_attractor": ("point", np.arange(1, count + 1)),
            "point_theta": ("point", np.arange(count, dtype=float)),
            "point_velocity": ("point", np.zeros(count)),
        },
        coords={
            "attractor": [*names],
            "theta": np.arange(columns, dtype=float),
            "velocity": np.arange(rows, dtype=float),
        },
        attrs={"summary": "", "kind": "basins"},
    )


def gathered(maps: Sequence[xr.Dataset]) -> xr.Dataset:
    """Return the map over draws of these maps, one for each draw."""
    models = tuple(Pendulum(gamma=0.1 + 0.001 * k) for k in range(len(maps)))
    values = np.array([[one.gamma] for one in models])
    draws = Draws(("gamma",), values, models, RunOptions())
    own = dict(zip(models, maps, strict=True))
    return basins_over(maps[0], draws, lambda model, **_: own[model])


def test_doubt_from_fractal_boundaries_and_from_parameters_is_separate() -> None:
    random = np.random.default_rng(SEED)
    still = np.where(np.arange(50) < 23, 1, 2)[None].repeat(50, axis=0)
    names = ["rest", "rotation 1:+1"]
    fixed = gathered([painted(still, names)] * 8)
    entropy = pendmap.basin_entropy(still).value
    assert entropy > 0.05
    assert fixed["doubt_start_mean"].item() == pytest.approx(entropy)
    assert fixed["doubt_parameters_mean"].item() == pytest.approx(0, abs=1e-12)
    assert fixed["sure_cells"].item() == 1
    assert float(fixed.label_entropy.max()) == 0
    # All starts of a draw end on one attractor; the draw decides which.
    flips = gathered([painted(np.full((50, 50), 1 + k % 2), names) for k in range(8)])
    assert flips["doubt_start_mean"].item() == 0
    assert flips["doubt_parameters_mean"].item() == pytest.approx(math.log(2))
    assert flips.label_entropy.values == pytest.approx(math.log(2))
    # Every cell varies between draws and between cells: a draw does not determine a box's labels.
    mixed = [random.integers(1, 3, (50, 50)) for _ in range(200)]
    fractal = gathered([painted(label, names) for label in mixed])
    each = np.mean([pendmap.basin_entropy(label).value for label in mixed])
    assert fractal["doubt_start_mean"].item() == pytest.approx(each)
    assert fractal["doubt_parameters_mean"].item() == pytest.approx(1 / 50, rel=0.15)
    assert fractal["sure_cells"].item() == 0


def test_attractors_of_draws_are_matched_by_name_and_those_of_one_name_by_position() -> None:
    left = np.where(np.arange(10) < 4, 1, 2)[None].repeat(10, axis=0)
    one = painted(left, ["rest", "rotation 1:+1"])
    other = painted(3 - left, ["rotation 1:+1", "oscillation 2:0"])
    none = painted(np.zeros((10, 10)), [])
    found = gathered([one, one, other, none])
    assert [*found.outcome.values] == ["rest", "rotation 1:+1", "oscillation 2:0", "undecided"]
    assert found.share_mean.values == pytest.approx([0.2, 0.45, 0.1, 0.25])
    assert found.exists.values == pytest.approx([0.5, 0.75, 0.25, 0.25])
    assert found.probability.values.sum(axis=0) == pytest.approx(1)
    names = ["oscillation 2:0 at +0.1000", "oscillation 2:0 at +0.9000"]
    own = painted(left, names)
    moved = painted(3 - left, ["oscillation 2:0 at -0.2000", "oscillation 2:0 at +1.1000"])
    moved["point_theta"] = ("point", np.array([1.1, -0.2]))
    found = gathered([own, own, moved])
    assert [*found.outcome.values] == names
    assert found.share_mean.values == pytest.approx([0.4, 0.6])


def damped(p: float, spread: float) -> Pendulum:
    """Return a driven pendulum whose damping has the given standard error."""
    return Pendulum(gamma=0.1, p=p, omega=2.0, notes=noted(["gamma"], [[spread**2]]))


def test_the_probability_of_a_regime_is_its_share_of_the_draws() -> None:
    """Hanging rest attracts if its multipliers, by scipy, lie within the unit circle."""
    model = damped(0.2, 0.02)
    ranges = {"p": (0.14, 0.26, 7), "omega": (2.0, 2.0, 1)}
    result = pendmap.parameter_map(model, ranges, draws=16, run=RunOptions(seed=SEED))
    rests = result["outcome_has"].sel(outcome_kind="rest").values.astype(bool)
    probability = result.probability.values[rests].sum(axis=0)[0]
    gammas = result.drawn.values[:, 0]
    exact = [np.mean([decays(Pendulum(g, p, 2.0)) for g in gammas]) for p in result.p.values]
    assert probability == pytest.approx(exact)
    assert 0 < min(exact[2:5]) < 1
    assert result.probability.values.sum(axis=0) == pytest.approx(1)
    counted = result.drawn_share.values.mean(axis=1)
    assert result.share_mean.values == pytest.approx(counted)
    assert result["sure_cells"].item() == pytest.approx((result.certainty.values >= 0.95).mean())


def test_a_lifetime_has_the_interval_of_its_draws() -> None:
    model = damped(1.2, 0.005)
    result = pendmap.lifetime(model, starts=1500, draws=4, run=RunOptions(seed=SEED))
    models = [Pendulum(gamma=gamma, p=1.2) for gamma in result.drawn.values[:, 0]]
    alone = [pendmap.lifetime(one, starts=1500, run=RunOptions(seed=SEED)) for one in models]
    means = [one["mean_periods"].item() for one in alone]
    assert result.drawn_mean_periods.values == pytest.approx(means)
    assert len(set(means)) == 4
    ends = [result[f"mean_periods_{end}"].item() for end in ("low", "high")]
    assert ends == pytest.approx(np.quantile(means, [0.025, 0.975]))
    assert result["transient_share"].item() == 1


def test_a_record_counts_as_missed_from_one_and_a_half_times_the_noise() -> None:
    for rms, misses in ((1.49e-3, None), (1.51e-3, pytest.approx(1.51))):
        rig = Rig(w0=6.0, c_over_m=0.6, notes={"provenance": {"rms": rms, "noise": 1e-3}})
        run = pendmap.simulate(rig, 1.0, 0.0, 1.0)
        assert run.attrs.get("misses_record") == misses
        assert ("misses its record" in run.attrs["summary"]) == (misses is not None)


def test_identify_writes_the_residual_of_its_model_and_the_noise() -> None:
    time = np.arange(0, 40, 0.01)
    theta = motion(Pendulum(gamma=0.2 / 6.2, p=0.0), 2.0, 0.0, 6.2 * time)[0, 0]
    noise = np.random.default_rng(SEED).normal(0, 1e-3, time.size)
    report = pendmap.identify(time, theta + noise, methods=["trajectory"])
    known = identified_model(report).notes["provenance"]
    assert known["rms"] == pytest.approx(1e-3, rel=0.05)
    assert known["noise"] == pytest.approx(1e-3, rel=0.1)
