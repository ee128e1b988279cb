"""Drag of unknown power: the unit of its size depends on a fitted number."""

from __future__ import annotations

import math
import tomllib
from typing import TYPE_CHECKING

import numpy as np
import pytest

from driven_decays import motion
from hidden import diagnosed, recorded
from pendmap.comparison.data import split_records
from pendmap.diagnosis import diagnosed_model
from pendmap.diagnosis.baseline import fit_baseline
from pendmap.diagnosis.candidates import list_candidates
from pendmap.diagnosis.fitted_model import fit_with_candidates
from pendmap.identification.fit import fit_runs
from pendmap.identification.runs import FitRun
from pendmap.identification.sensitivity import window_slopes
from pendmap.model import Effect, Formula, Rig, load_model, save_model

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.diagnosis.fitted_model import FittedModel

Q, N = "power_law_drag.q", "power_law_drag.n"
BASE = ("w0", "c_over_m", "Tr")
TIME = np.arange(1500) * 0.02
SIGMA = 1e-3
WINDOW = [(0, 0, TIME.size, 2.0, 0.0)]


def rig(q: float, n: float) -> Rig:
    effect = Effect("power_law_drag", {"q": q, "n": n})
    return Rig(w0=6.2, c_over_m=0.05, Tr=0.09, effects=(effect,))


@pytest.fixture(scope="module")
def run() -> FitRun:
    """Return a decay with quadratic drag, a power law of 2, made by scipy."""
    theta = motion(TIME, (2.0, 0.0), w0=6.2, c_over_m=0.05, friction=0.09, drag=0.02)
    return FitRun(TIME, theta + np.random.default_rng(1).normal(0, SIGMA, TIME.shape), SIGMA)


def test_derivatives_by_a_power_are_at_a_fixed_size_in_si(run: FitRun) -> None:
    q, n = 0.02, 1.4
    held = fit_runs([run], rig(q, n), [*BASE, Q, N], windows=WINDOW, hold=True, steps=0)
    names, (window,) = window_slopes(held, [run], (), held.model)

    def readings(*values: float) -> np.ndarray:
        return fit_runs([run], rig(*values), BASE, windows=WINDOW, hold=True, steps=0).curves[0][0]

    step = 1e-4
    differences = {
        Q: (readings(q * (1 + step), n) - readings(q * (1 - step), n)) / (2 * step * q),
        N: (readings(q, n + step) - readings(q, n - step)) / (2 * step),
    }
    for name, difference in differences.items():
        column = window.columns[:, names.index(name)] * SIGMA
        assert column == pytest.approx(difference, abs=1e-3 * np.abs(difference).max())


@pytest.mark.parametrize("n", [1.1, 1.4, 2.4, 3.0])
def test_every_power_leads_to_the_same_fit(run: FitRun, n: float) -> None:
    """The size of a start is in the unit of the start's power."""
    size = 0.02 * 4.0 ** (2 - n)  # equal drag at 4 rad/s
    fit = fit_runs([run], rig(1.0, 1.7), [*BASE, Q, N], start={Q: size, N: n})
    assert fit.converged
    for name, truth in ((Q, 0.02), (N, 2.0)):
        estimate = fit.estimates[name]
        assert abs(estimate.value - truth) < 3 * estimate.stderr
        assert estimate.ci95[0] < truth < estimate.ci95[1]
    assert fit.model.effects[0].parameters == {"q": fit[Q], "n": fit[N]}
    # The records determine the drag at their velocities: size and power are correlated.
    places = [fit.names.index(Q), fit.names.index(N)]
    (a, ab), (_, b) = fit.covariance[np.ix_(places, places)]
    assert ab / math.sqrt(a * b) < -0.8


def test_the_ends_of_the_size_s_interval_are_those_of_its_profile() -> None:
    theta = motion(TIME, (2.0, 0.0), w0=6.2, c_over_m=0.05, friction=0.09, drag=0.02)
    sigma = 8 * SIGMA
    noisy = theta + np.random.default_rng(2).normal(0, sigma, TIME.shape)
    run = FitRun(TIME, noisy, sigma)
    fit = fit_runs([run], rig(0.02, 2.0), [*BASE, Q, N], profiled=[Q])
    size = fit.estimates[Q]
    assert size.stderr > 0.2 * size.value
    places = [fit.names.index(Q), fit.names.index(N)]
    (a, ab), (_, b) = fit.covariance[np.ix_(places, places)]
    for end in size.ci95:
        # All others fitted at powers near the best one there, at the minimum of a parabola.
        middle = fit[N] + ab / a * size.value * math.log(end / size.value)
        offsets = math.sqrt(b - ab**2 / a) * np.linspace(-3, 3, 5)
        fits = [fit_runs([run], rig(end, middle + d), BASE, profiled=()) for d in offsets]
        bend, slope, least = np.polyfit(offsets, [held.chi2 - fit.chi2 for held in fits], 2)
        assert least - slope**2 / (4 * bend) == pytest.approx(3.84, rel=0.15)


def test_a_formula_with_a_power_is_fitted_alike(run: FitRun) -> None:
    own = Formula(
        "own_power",
        "-q*abs(v)^n*sign(v)",
        {"q": {"power": "2 - n"}, "n": {"power": 0, "typical": [1.1, 3], "range": [0.5, 4]}},
    )
    model = Rig(w0=6.2, c_over_m=0.05, Tr=0.09, effects=(own(q=0.02, n=1.9),))
    found = fit_runs([run], model, [*BASE, "own_power.q", "own_power.n"], profiled=())
    known = fit_runs([run], rig(0.02, 1.9), [*BASE, Q, N], profiled=())
    for mine, its in (("own_power.q", Q), ("own_power.n", N)):
        a, b = found.estimates[mine], known.estimates[its]
        assert a.value == pytest.approx(b.value, abs=0.05 * b.stderr)
        assert a.stderr == pytest.approx(b.stderr, rel=0.02)


def hidden(seed: int) -> tuple[dict[str, float], list[FittedModel]]:
    """Hide a power law; return its truth and the fits from neighbouring powers of the scan."""
    given = {"seed": seed, "size": 6.0, "free": 3, "noise": 0.05, "rate": 50.0}
    records, truth = recorded("power_law_drag", **given)
    data = split_records(records)
    base, _ = fit_baseline(data)
    (shapes,) = (
        each for each in list_candidates((), driven=False) if each[0].name == "power_law_drag"
    )
    trials = [
        fit_with_candidates(data, base, [shape], {Q: 1e-5}, level=1.0) for shape in shapes[1:3]
    ]
    return truth["power_law_drag"], trials


@pytest.mark.thorough
def test_errors_are_as_large_as_stated() -> None:
    scaled = []
    for seed in range(1, 17):
        truth, trials = hidden(seed)
        one, other = (fitted.fit for fitted in trials)
        # Fits of candidates end 0.05 above the least sum of squares at most.
        assert abs(one[N] - other[N]) < 2 * math.sqrt(0.05) * one.estimates[N].stderr
        size, power = one.estimates[Q], one.estimates[N]
        # The size's error is one of its logarithm.
        scaled.append(
            [
                math.log(size.value / truth["q"]) * size.value / size.stderr,
                (power.value - truth["n"]) / power.stderr,
            ]
        )
    assert np.abs(scaled).max() < 3
    rms = np.sqrt(np.mean(np.square(scaled), axis=0))
    assert ((rms > 0.7) & (rms < 1.4)).all()


@pytest.mark.thorough
def test_a_diagnosis_gives_an_interval_of_the_power(tmp_path: Path) -> None:
    found, truth = diagnosed("power_law_drag", size=4.0, free=3, forced=0, noise=0.05, rate=50.0)
    (drag,) = (effect for effect in found.effects if effect.name == "power_law_drag")
    for name, (low, high) in drag.ci95.items():
        wide = high - low
        assert low - wide / 2 < truth["power_law_drag"][name] < high + wide / 2
    assert set(drag.ci95) == {"q", "n"}
    assert {Q, N} <= set(found.runs.coefficients)
    path = save_model(diagnosed_model(found), tmp_path / "model.toml")
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    names, matrix = content["covariance"]["names"], np.array(content["covariance"]["matrix"])
    size, power = matrix[names.index(Q)], matrix[names.index(N)]
    assert size[names.index(N)] ** 2 > 0.8**2 * size[names.index(Q)] * power[names.index(N)]
    (again,) = (effect for effect in load_model(path).effects if effect.name == drag.name)
    assert again.ci95 == drag.ci95
