"""Motions that are not free: a driven start, a braked end, a push; what is said of them."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest

import pendmap
from pendmap.identification.methods import trajectory
from pendmap.identification.report import as_text as as_lines
from pendmap.records.summary import as_text, doubts
from recorded import experiment, found, noisy, text

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

TIME = np.arange(0.0, 40.0, 0.02)
W0 = 6.0
PERIOD = 2 * np.pi / W0


def swinging(size: Floats, w0: Floats | float = W0) -> Floats:
    """Return readings of swings whose amplitude is given at each time of ``TIME``."""
    phase = np.concatenate(([0.0], np.cumsum(np.broadcast_to(w0, TIME.shape)[1:] * np.diff(TIME))))
    return noisy(size * np.cos(phase), 0.002)


def decay(rate: float = 0.05, friction: float = 0.0, begin: float = 0.0) -> Floats:
    """Return amplitudes that are constant before ``begin`` and fall after it."""
    after = np.maximum(TIME - begin, 0.0)
    return np.maximum(0.8 * np.exp(-rate * after) - friction * after, 0.0)


def read(theta: Floats) -> tuple[pendmap.Run, ...]:
    return pendmap.read_experiment(pd.DataFrame({"t_s": TIME, "theta_rad": theta})).runs


DRIVEN = {
    "at constant amplitude": (swinging(decay(begin=10.0)), 10.0),
    "with growing amplitude": (swinging(decay(begin=10) * (1 - 0.006 * (10 - TIME).clip(0))), 10.0),
    "off resonance": (swinging(decay(begin=8.0), np.where(TIME < 8, 5.0, W0)), 8.0),
    "against friction": (swinging(decay(0.0, 0.02, 12.0)), 12.0),
}


@pytest.mark.parametrize("kind", DRIVEN)
def test_a_driven_start_is_cut(kind: str) -> None:
    theta, begin = DRIVEN[kind]
    (run,) = read(theta)
    first = run.time[run.trusted][0]
    assert begin - 0.2 * PERIOD < first < begin + 0.5 * PERIOD
    assert f"after {first:.6g} s" in found(run)["driven-start"].text
    assert [(part.what, part.used) for part in run.segments][:2] == [
        ("driven", False),
        ("motion", True),
    ]


def test_a_braked_end_is_cut() -> None:
    (run,) = read(swinging(decay(0.03) * np.exp(-0.4 * np.maximum(TIME - 25, 0))))
    last = run.time[run.trusted][-1]
    assert 25 - 0.75 * PERIOD < last < 25 + 0.25 * PERIOD
    assert "braked-end" in found(run)


@pytest.mark.parametrize("factor", [0.6, 1.4])
def test_a_push_divides_a_decay(factor: float) -> None:
    push = 28.5 * np.pi / W0  # in the middle, where it changes the speed alone
    before, after = read(swinging(decay() * np.where(push > TIME, 1.0, factor)))
    assert push - PERIOD < before.time[before.trusted][-1] <= push
    assert push <= after.time[after.trusted][0] < push + PERIOD


CATCH = 31.3
HANDS = {
    "held": lambda theta, after: theta[0] * np.exp(-after / 0.2) + 0.2 * (1 - np.exp(-after)),
    "turned back": lambda theta, after: theta[0] + 0.4 * (1 - np.exp(-3 * after)),
    "moved": lambda theta, after: theta[0] * np.exp(-after) + 0.3 * np.sin(1.7 * after),
}


@pytest.mark.parametrize("way", HANDS)
@pytest.mark.parametrize("until", [33.0, 40.0])
def test_a_hand_ends_a_decay(way: str, until: float) -> None:
    theta, late = swinging(decay(0.02)), TIME >= CATCH
    theta[late] = noisy(HANDS[way](theta[late], TIME[late] - CATCH), 0.002)
    frame = pd.DataFrame({"t_s": TIME, "theta_rad": theta})[until > TIME]
    run = pendmap.read_experiment(frame).runs[0]
    assert CATCH - PERIOD < run.time[run.trusted][-1] <= CATCH
    assert run.segments[1].what in {"handled", "held"}


@pytest.mark.parametrize("lift", [0.02, 0.5])
def test_a_hold_by_a_trembling_hand_is_no_motion(lift: float) -> None:
    theta, release = np.roll(swinging(decay()), 70), TIME[70]
    early = release > TIME
    theta[early] = noisy(0.8 + 0.01 * np.sin(9 * TIME[early]), 0.002)
    theta[early] *= np.clip((TIME[early] + 0.02) / lift, 0, 1)
    (run,) = read(theta)
    assert release <= run.time[run.trusted][0] < release + 0.5 * PERIOD
    assert "held-start" in found(run)


FREE = {
    "light": decay(2e-4),
    "viscous": decay(0.1),
    "friction": decay(0.0, 0.018),
    "three swings": np.where(TIME < 3.2 * PERIOD, decay(0.2), np.nan),
    "drag": 0.8 / (1 + 0.2 * TIME),
    "load": np.sqrt(np.maximum(0.64 - 0.016 * TIME, 0.0)),
    "shallow beats": decay(0.01) * (1 + 0.03 * np.cos(0.3 * TIME)),
}


@pytest.mark.parametrize("kind", FREE)
def test_a_free_decay_is_whole(kind: str) -> None:
    (run,) = read(swinging(FREE[kind]))
    assert not {"driven-start", "braked-end", "several-releases", "few-used"} & set(found(run))
    assert run.time[run.trusted][0] == 0


def test_what_is_left_out_is_said_first_and_read_by_hand(tmp_path: Path) -> None:
    theta = swinging(decay(begin=10.0))
    there = experiment(tmp_path, '[[run]]\nfile = "driven.csv"\n', driven=text((TIME, theta)))
    doubt = next(line for line in doubts(there, *there.runs) if "driven at first" in line)
    assert "--from 0 --to 39.98" in doubt
    assert f"Warning: {doubt}" in as_text(there).splitlines()[:2]
    chosen = '[[run]]\nfile = "driven.csv"\nfrom_s = 0\nto_s = 39.98\n'
    (run,) = experiment(tmp_path, chosen, driven=text((TIME, theta))).runs
    assert run.trusted.all()


def test_a_fall_whose_fit_does_not_converge_is_used_from_where_it_left_upright(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = pendmap.Rig(w0=W0, c_over_m=0.05, Tr=0.05)
    time = TIME[:1000]
    fall = pendmap.simulate(rig, theta=3.12, velocity=0.0, t_eval=time).theta.to_numpy()
    there = pendmap.read_experiment(pd.DataFrame({"t_s": time, "theta_rad": noisy(fall, 0.002)}))
    fitted = trajectory.fit_trusted

    def astray(runs: tuple[pendmap.Run, ...], *choices: object) -> trajectory.JointFit:
        joint = fitted(runs, *choices)
        lost = dataclasses.replace(joint.fit, converged=not runs[0].trusted[0])
        return dataclasses.replace(joint, fit=lost)

    monkeypatch.setattr(trajectory, "fit_trusted", astray)
    report = pendmap.identify(there, methods=["trajectory"])
    (run,) = report.runs
    assert not run.trusted[np.abs(run.theta) > np.pi - 0.3].any()
    assert report.best["w0"] == pytest.approx(W0, rel=1e-3)
    assert "left the upright position" in report.warnings[0]
    assert not any("not used" in line for line in as_lines(report))


def test_quadratic_drag_is_fitted_where_damping_and_friction_do_not_converge() -> None:
    drag = pendmap.Effect("quadratic_drag", {"q": 0.05})
    rig = pendmap.Rig(w0=W0, c_over_m=0.003, effects=(drag,))
    time = TIME[::2]
    theta = noisy(pendmap.simulate(rig, theta=2.5, velocity=0.0, t_eval=time).theta, 0.002)
    report = pendmap.identify(time, theta, methods=["trajectory"])
    assert report.best["w0"] == pytest.approx(W0, rel=1e-4)
    assert report.best["quadratic_drag.q"] == pytest.approx(0.05, rel=0.01)
    assert "quadratic_drag.q" in report.text_parts()[1][0]
    assert "did not converge: quadratic_drag is fitted too" in report.warnings[0]
    with pytest.raises(pendmap.InputError, match="did not converge"):
        _ = pendmap.identify(time, theta, methods=["trajectory"], start=pendmap.Rig(w0=W0)).model


def test_a_turning_point_in_counts_is_not_clipped() -> None:
    time = np.arange(0, 6, 1e-4)
    size = np.maximum(0.066 - 0.0105 * time, 0)  # friction flattens each turning point
    theta = np.round(size * np.cos(8 * time) / 1.57e-4) * 1.57e-4
    (run,) = pendmap.read_experiment(pd.DataFrame({"t_s": time, "theta_rad": theta})).runs
    assert "clipped" not in found(run)
