"""Names that stand for something simpler, or are less sure than they look."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import pendmap
from driven_decays import motion
from pendmap.comparison.data import split_records
from pendmap.diagnosis.candidates import Candidate, list_candidates
from pendmap.diagnosis.fitted_model import fit_model
from pendmap.diagnosis.named import NamedEffect
from pendmap.diagnosis.refit import try_mirrored_places
from pendmap.diagnosis.search import disguises
from pendmap.model import Effect, Rig
from pendmap.records import Experiment, Run
from pendmap.residuals.times import instants

if TYPE_CHECKING:
    from collections.abc import Sequence

TIME = np.arange(0, 20, 0.02)
W0, KNOCK, JUMP = 6.2, 9.0, 0.5


def record(theta: np.ndarray, name: str = "a") -> Run:
    noisy = theta + np.random.default_rng(1).normal(0, 1e-3, theta.size)
    return Run(name, f"{name}.csv", "free", TIME, noisy, np.ones(theta.size, bool))


def decay(start: float, name: str = "a", w0: float = W0) -> Run:
    return record(motion(TIME, (start, 0.0), w0=w0, c_over_m=0.05, friction=0.05), name)


@pytest.mark.parametrize(
    ("reach", "orders"), [(0.13, []), (0.6, [11, 12]), (3.2, [*range(2, 13)]), (99.0, None)]
)
def test_a_wave_over_the_angle_has_its_length_within_the_swing(
    reach: float, orders: list[int] | None
) -> None:
    pool = {c.name: [c, *more] for c, *more in list_candidates((), driven=False, reach=reach)}
    listed = [c.shape["n"] for c in pool.get("bearing_harmonic", [])]
    assert listed == (list(range(1, 13)) if orders is None else orders)
    assert ("inertia_ripple" in pool) is (reach > np.pi * 2 / 3)
    assert "magnet" in pool


def model(w0: float, chi2: float, *names: str, **shape: float) -> Any:  # noqa: ANN401 (a stub)
    chosen = tuple(Candidate(name, shape) for name in names)
    return SimpleNamespace(fit={"w0": w0}, chi2=chi2, level=1.0, chosen=chosen, names=names)


@pytest.mark.parametrize(
    ("full", "readings", "places"),
    [
        (model(6.0, 500.0, "magnet", width=0.2), 2000.0, None),
        (model(6.3, 500.0, "magnet", width=0.2), 2000.0, []),
        # Zero and scale together do as much; a single size is compared with them elsewhere.
        (model(6.0, 500.0, "magnet", width=0.2), 505.0, [0, 2]),
        (model(6.0, 500.0, "elastic_restoring"), 505.0, None),
        (model(6.3, 500.0, "rough_spot", th0=0.2, w=0.2), 2000.0, None),
    ],
)
def test_an_effect_that_stands_for_a_spring_or_for_the_readings_is_seen(
    full: Any,  # noqa: ANN401 (a stub)
    readings: float,
    places: Sequence[int] | None,
) -> None:
    names = ["encoder_gain", "magnet", "encoder_offset", "timebase"]
    listed = [
        SimpleNamespace(candidate=Candidate(n), information=float(n[0] != "t")) for n in names
    ]
    scores = SimpleNamespace(best=lambda: range(4), scores=listed)
    state: Any = SimpleNamespace(
        scores=lambda _: scores,
        refit=lambda _, at: model(6.0, readings if len(at) == 2 else 0.0),
        thresholds=pendmap.diagnosis.Thresholds(),
    )
    assert disguises(state, model(6.0, 3000.0), full) == places


def test_the_instants_are_one_for_each_tenth_of_the_records() -> None:
    def response(first: float) -> Any:  # noqa: ANN401 (a stub)
        time = first + np.arange(50) * 0.1
        pull = np.exp(-(((time - 3.0) / 0.8) ** 2))
        return SimpleNamespace(
            time=time, residual=pull, pull=lambda r: r, information=lambda: np.ones(50)
        )

    times = instants([response(0.0), response(60.0)])
    assert len(times) == 10
    assert [int(t) for t in times[:3]] == [0, 1, 2]
    assert sum(t >= 60 for t in times) == 5


def test_a_knock_is_found_from_half_a_swing_beside_it() -> None:
    before = motion(TIME, (2.2, 0.0), w0=W0, c_over_m=0.1)
    k = round(KNOCK / 0.02)
    slope = (before[k + 1] - before[k - 1]) / 0.04
    after = motion(TIME[k:] - KNOCK, (before[k], slope + JUMP), w0=W0, c_over_m=0.1)
    data = split_records(Experiment(Path("there"), (record(np.append(before[:k], after)),)))
    beside = KNOCK + np.pi / W0
    rig = Rig(W0, c_over_m=0.1, effects=(Effect("impulses", {"J": -JUMP, "t0": beside}),))
    knock = Candidate("impulses", {"t0": beside})
    free = ["w0", "c_over_m", *knock.free, *knock.adapted]
    fitted = fit_model(data, rig, free, [knock], steps=0)
    better = try_mirrored_places(data, fitted)
    assert better.fit["impulses.t0"] == pytest.approx(KNOCK, abs=0.02)
    assert better.fit["impulses.J"] == pytest.approx(JUMP, rel=0.05)


def test_an_instant_moves_on_only_while_that_gains(monkeypatch: pytest.MonkeyPatch) -> None:
    gains = iter([*[2.0] * 5, *[0.5] * 50])

    def nearer(_data: object, fitted: Any, *_: object) -> Any:  # noqa: ANN401 (a stub)
        return SimpleNamespace(**vars(fitted) | {"chi2": fitted.chi2 - next(gains)})

    monkeypatch.setattr("pendmap.diagnosis.refit._fit_from", nearer)
    fit = {"w0": W0, "impulses.J": 0.1, "impulses.t0": 3.0}
    knock = Candidate("impulses", {"t0": 3.0})
    model: Any = SimpleNamespace(fit=fit, chosen=(knock,), chi2=99.0, level=1.0)
    assert try_mirrored_places(None, model).chi2 == 99.0 - 5 * 2.0 - 2 * 0.5  # type: ignore[arg-type]


def test_a_hand_at_the_release_is_cut_and_gets_no_name() -> None:
    slow = motion(TIME[TIME < 0.4], (1.2, 0.0), w0=W0, c_over_m=0.05, friction=0.05)
    slope = (slow[-1] - slow[-2]) / 0.02
    after = motion(
        TIME[TIME >= 0.4] - 0.4, (slow[-1], slope - 0.8), w0=W0, c_over_m=0.05, friction=0.05
    )
    result = pendmap.diagnose(record(np.append(slow, after)))
    assert result.effects == ()
    assert result.verdict == "none"
    (run,) = result.data.runs
    assert [one.what for one in run.findings] == ["hand-at-end"]
    assert TIME[run.trusted][0] > 0.4


def test_no_effect_is_named_in_runs_of_two_rods() -> None:
    runs = [decay(1.5, "a"), decay(1.2, "b"), decay(1.4, "c", 0.97 * W0)]
    result = pendmap.diagnose(runs)
    assert result.effects == ()
    assert result.verdict == "unknown"
    assert "rigs-differ" in {one.what for one in result.data.experiment.findings}


@pytest.mark.parametrize(("approximate", "says"), [(True, "with reserve"), (False, "")])
def test_the_reserve_stands_beside_the_probability(*, approximate: bool, says: str) -> None:
    effect = NamedEffect("quadratic_drag", {"q": 0.01}, {}, 0.95, approximate, 1.0)
    assert says in effect.reserve
    assert bool(effect.reserve) is approximate
    # Without an interval the size is unknown: it may be 0.
    assert effect.reaches_0
    assert not dataclasses.replace(effect, ci95={"q": (0.009, 0.011)}).reaches_0
