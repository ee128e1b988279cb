"""Basin maps: labels, shares, attractors and symmetries, against scipy; how a map is run."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import sys
import threading
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import scipy
from scipy.optimize import brentq

import pendmap
import tiled
from by_scipy import decays, motion
from interrupted import started
from pendmap import Effect, Formula, Grid, Pendulum, Rig, _core, cli
from pendmap.charts import basins
from pendmap.files import facts

if TYPE_CHECKING:
    import xarray as xr

SMOOTH = Pendulum(gamma=0.1, p=0.6, omega=2.0)


@pytest.fixture(scope="module")
def smooth() -> xr.Dataset:
    return pendmap.basins(SMOOTH, Grid.square(40))


def starts_of(found: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return angles and velocities of all starts of a map."""
    theta, velocity = np.meshgrid(found["theta"].values, found["velocity"].values)
    return theta.ravel(), velocity.ravel()


def test_labels_equal_those_of_scipy_cell_for_cell(smooth: xr.Dataset) -> None:
    turns = {"oscillation 2:0": 0, "rotation 1:-1": -2, "rotation 1:+1": 2}
    by_label = np.array([turns[str(name)] for name in smooth.attractor.values])
    theta, velocity = starts_of(smooth)
    angles = motion(SMOOTH, theta, velocity, [80 * math.pi, 82 * math.pi])[0]
    expected = np.round((angles[:, 1] - angles[:, 0]) / math.tau).astype(int)
    assert np.array_equal(by_label[smooth.label.values.ravel() - 1], expected)
    listed = pendmap.basins_of(SMOOTH, theta, velocity)
    assert np.array_equal(listed.label.values, smooth.label.values.ravel())


def test_a_map_has_its_model_numerics_and_shares(smooth: xr.Dataset) -> None:
    assert {"gamma", "p", "omega", "phase", "torque", "tol", "pendmap_version"} <= {*facts(smooth)}
    assert smooth["reached_error"].item() <= smooth.attrs["tol"]
    labels, counts = np.unique(smooth.label.values, return_counts=True)
    share = counts / 1600
    assert labels.tolist() == [1, 2, 3]
    assert smooth.fraction.values == pytest.approx(share)
    assert smooth.stderr.values == pytest.approx(np.sqrt(share * (1 - share) / 1600))
    assert smooth.twin.values.tolist() == [1, 3, 2]
    assert (smooth.settle_periods.values > 0).all()
    assert (smooth["labels_reliable"].item(), smooth["unreliable"].item()) == (1, 0)


def test_unreliable_labels_are_reported() -> None:
    result = pendmap.basins(Pendulum(p=1.7), Grid.square(60))
    assert result["unreliable"].item() > 0.05
    assert result["labels_reliable"].item() == 0
    for words in ("NOT RELIABLE", "hardly better than chance"):
        assert words in result.attrs["summary"]


@pytest.mark.parametrize(
    ("parameters", "name"),
    [
        # Strong damping: area shrinks by 1e-55 a period.
        ({"gamma": 20.0, "p": 2.0, "omega": 1.0}, "rest"),
        # Cycles in less than 1 % of the plane, strongly stretched before they contract.
        (
            {"gamma": 0.5, "p": 2.68962157, "omega": 2.30547203, "torque": 0.1},
            "oscillation 7:0 (+)",
        ),
        ({"gamma": 0.02, "p": 1.23286585, "omega": 0.94662087}, "oscillation 4:0 (+)"),
        # A running state near the resonance 17/5, which fills its curve slowly.
        (
            {"gamma": 0.2, "p": 2.1744, "omega": 1.7613, "torque": 1.2},
            "quasiperiodic rotation +",
        ),
    ],
)
def test_hard_attractors_are_found(parameters: dict[str, float], name: str) -> None:
    result = pendmap.basins(Pendulum(**parameters), Grid.square(60))
    assert name in result.attractor.values.tolist()
    assert result["undecided"].item() == 0


# Shares of the starts


def test_a_share_of_all_or_of_none_has_its_binomial_bound() -> None:
    found = pendmap.basins(Pendulum(p=14.21, omega=10), 30)
    shares = dict(zip(found.kind.values.tolist(), found.fraction.values.tolist(), strict=True))
    assert shares == {"rest": 1.0, "inverted_rest": 0.0}
    most = 1 - 0.05 ** (1 / 900)
    bounds = dict(zip(found.kind.values.tolist(), found.ci95.values.tolist(), strict=True))
    assert bounds["inverted_rest"] == pytest.approx([0.0, most])
    assert bounds["rest"] == pytest.approx([1 - most, 1.0])
    text = found.attrs["summary"]
    assert "inverted rest: 0.00 % of the starts, at most 0.332 % of the plane (95 %)" in text
    assert "rest: 100.00 % of the starts, at least 99.67 % of the plane (95 %)" in text


def test_intervals_of_shares_are_binomial() -> None:
    found = pendmap.sweep(Pendulum(), {"p": [0.3, 0.6, 1.0]}, grid=9, check=False)
    hits = np.rint(81 * found.fraction.values).astype(int)
    bounds = {0: [0.0, 1 - 0.05 ** (1 / 81)], 81: [0.05 ** (1 / 81), 1.0]}
    assert np.count_nonzero((hits > 0) & (hits < 81)) > 4
    for place in np.ndindex(hits.shape):
        exact = scipy.stats.binomtest(hits[place], 81).proportion_ci()
        expected = bounds.get(hits[place], [exact.low, exact.high])
        assert found.ci95.values[place] == pytest.approx(expected)


def test_every_stable_rest_is_listed() -> None:
    source = np.random.default_rng(7)
    for _ in range(24):
        gamma, omega = source.choice([0.02, 0.1, 0.3]), source.uniform(0.5, 12.0)
        model = Pendulum(gamma, math.sqrt(2) * omega * source.uniform(0.9, 1.2), omega)
        found = pendmap.basins(model, 6, check=False, max_periods=200)
        rests = [kind in found.kind.values for kind in ("rest", "inverted_rest")]
        assert rests == [decays(model, theta) for theta in (0.0, math.pi)], model
    held = pendmap.basins(Pendulum(theta_r=0.01, p=0.3), 10, check=False)
    assert {"rest", "inverted_rest"} <= set(held.kind.values)


def test_starts_tell_what_they_may_miss() -> None:
    found = pendmap.bifurcation(Pendulum(), {"p": [0.8, 0.9]})
    assert float(found.missed) == pytest.approx(1 - 0.05 ** (1 / 9))
    assert "9 starts a value may miss attractors with 28.3 % of the box" in found.summary
    assert "all with 15.3 % (95 %)" in found.summary


# Symmetry under reflection and a shift by half a period of the drive

PUSH = Formula("push", "f*cos(phase)", {"f": 2})
FAMOUS = {"gamma": 0.5, "p": 0.0, "omega": 2 / 3}
DRIVEN = Pendulum(**FAMOUS, effects=(PUSH(f=1.07),))


def half_a_period_on(state: np.ndarray) -> np.ndarray:
    def push(t: float, *_: np.ndarray) -> float:
        return 1.07 * math.cos(DRIVEN.omega * t)

    return motion(DRIVEN, *state, [math.pi / DRIVEN.omega], push)[:, 0, 0]


def test_two_attractors_of_a_direct_drive_are_each_other_s_image() -> None:
    found = pendmap.basins(DRIVEN, Grid.square(12))
    names = [str(name) for name in found["attractor"].values]
    assert sorted(names) == ["oscillation 2:0 (+)", "oscillation 2:0 (-)"]
    assert list(found["twin"].values) == [2, 1]
    which = found["point_attractor"].values
    points = np.stack([found["point_theta"].values, found["point_velocity"].values], axis=1)
    own, other = points[which == 1], points[which == 2]
    for point in own:
        image = -half_a_period_on(point)
        image[0] = math.remainder(image[0], math.tau)
        assert np.abs(other - image).max(axis=1).min() < 1e-8
    assert found["unreliable_mirror"].item() < 0.05
    # By symmetry their mean angles over a period are opposite: (+) is at positive angles.
    positive = own if names[0].endswith("(+)") else other
    images = np.array([half_a_period_on(point) for point in positive])
    assert (positive[:, 0] + images[:, 0]).mean() > 0
    orbits = pendmap.orbit(DRIVEN, 2, 0, Grid.square(24))
    stable = orbits["stable"].values.astype(bool)
    assert stable.sum() == 2
    assert sorted(orbits["twin"].values[stable]) == sorted(orbits["id"].values[stable])


@pytest.mark.parametrize(
    ("term", "seen"),
    [
        ("f*cos(phase)", True),
        ("f*cos(3*phase)*cos(theta)", True),
        ("f*cos(2*phase)", False),
        ("f*cos(2*phase)*sin(theta)", True),
        ("f*cos(phase)*sin(theta)", True),
        ("f*(cos(phase) + 0.5)", False),
        ("f*cos(2*phase)*cos(theta)", False),
    ],
)
def test_the_symmetry_is_detected_if_and_only_if_it_exists(term: str, seen: bool) -> None:  # noqa: FBT001
    push = Formula("push", term, {"f": 2})
    found = pendmap.basins(Pendulum(**FAMOUS, effects=(push(f=0.4),)), Grid.square(6))
    assert ("unreliable_mirror" in found) is seen


# Models that are not periodic in the angle

WINDOW = Grid((-25.0, 25.0, 50), (-4.0, 4.0, 20))


def spring(k: float) -> Effect:
    """Return an effect with the elastic torque ``-k theta``."""
    return Effect("elastic_restoring", {"k": k})


def wells(k: float) -> list[float]:
    """Return the stable rests without drive: rising zeros of ``sin(theta) + k theta``."""
    looked = np.linspace(-1.2 / k, 1.2 / k, 20_001)
    pull = np.sin(looked) + k * looked
    rising = np.flatnonzero((pull[:-1] < 0) & (pull[1:] >= 0))
    found = [brentq(lambda x: math.sin(x) + k * x, looked[i], looked[i + 1]) for i in rising]
    return [0.0 if abs(x) < 1e-12 else x for x in found if abs(x) < 25.0]


@pytest.mark.parametrize("k", [0.03, 0.05, 0.11])
def test_rests_are_the_wells_of_the_potential(k: float) -> None:
    found = pendmap.basins(Pendulum(gamma=0.3, p=0.0, effects=(spring(k),)), WINDOW)
    np.testing.assert_allclose(np.sort(found["point_theta"].values), wells(k), atol=1e-9)
    for name, theta in zip(found["attractor"].values, found["point_theta"].values, strict=True):
        turn = round(theta / math.tau)
        assert str(name) == ("rest" if turn == 0 else f"rest turn {turn:+d}")


@pytest.mark.parametrize("seed", range(4))
def test_starts_end_where_scipy_takes_them(seed: int) -> None:
    draw = np.random.default_rng(seed)
    k, p = draw.uniform(0.03, 0.15), draw.uniform(0.3, 0.8)
    model = Pendulum(gamma=0.3, p=p, omega=2.0, effects=(spring(k),))
    found = pendmap.basins(model, WINDOW)
    owner, angles = found["point_attractor"].values, found["point_theta"].values
    turns = {int(i): round(float(angles[owner == i].mean()) / math.tau) for i in found["id"].values}
    rows, columns = draw.integers(0, (20, 50), size=(10, 2)).T
    starts = found.theta.values[columns], found.velocity.values[rows]
    ends = motion(model, *starts, [60 * math.pi], lambda _, theta, __: -k * theta)[0, :, 0]
    known = [turns[int(label)] for label in found["label"].values[rows, columns]]
    assert np.round(ends / math.tau).astype(int).tolist() == known


def test_friction_holds_the_pendulum_in_the_wells_of_several_turns() -> None:
    model = Pendulum(gamma=0.2, p=0.0, theta_r=0.1, effects=(spring(0.05),))
    found = pendmap.basins(model, WINDOW)
    rests = [str(n) for n in found["attractor"].values if str(n).startswith("rest")]
    assert len(rests) == len(wells(0.05))
    # A start at rest near a well remains there.
    still = pendmap.basins_of(model, [6.0, -6.0, 0.0], [0.0, 0.0, 0.0])
    names = [str(still["attractor"].values[i - 1]) for i in still["label"].values]
    assert names == ["rest turn +1", "rest turn -1", "rest"]


# Summaries


READINGS = (Effect("encoder_offset", {"d": 0.1}), Effect("encoder_gain", {"e": 0.01}))


def test_effects_on_the_reading_alone_are_reported_as_such() -> None:
    plain, run = (
        pendmap.simulate(Pendulum(p=0, effects=effects), 1.0, 0.0, 5.0)
        for effects in ((), READINGS)
    )
    assert (run.theta.values == plain.theta.values).all()
    names = "encoder_offset, encoder_gain act on the sensor's reading alone: "
    assert names + "angle and velocity here are of the motion" in run.attrs["summary"]
    assert "reading" not in plain.attrs["summary"]


@pytest.mark.parametrize(
    ("model", "unlimited"),
    [
        (Pendulum(gamma=0, p=0, theta_r=0.1, torque=1.3), True),
        (Pendulum(gamma=0, p=0.3, theta_r=0.01), True),
        (Pendulum(gamma=0, p=0, theta_r=0.1, torque=0.05), False),
        (Pendulum(gamma=0.01, p=0, theta_r=0.1, torque=1.3), False),
    ],
)
def test_a_summary_explains_an_unlimited_rotation(model: Pendulum, *, unlimited: bool) -> None:
    summary = pendmap.basins(model, Grid.square(5), max_periods=20).attrs["summary"]
    assert ("nothing limits a rotation" in summary) == unlimited
    assert not unlimited or "raises this bound" not in summary


@pytest.mark.parametrize(
    ("model", "own"), [(Rig(w0=6.2, c_over_m=0.5), "2π/w0"), (Pendulum(p=0), "2π")]
)
def test_periods_without_drive_have_their_length(model: Rig | Pendulum, own: str) -> None:
    result = pendmap.basins(model, Grid.square(8))
    unit = basins.text_of(result, basins.LAYERS["settle"].unit)
    assert unit == f"periods of {own} to settle"
    assert "forcing" not in result.settle_periods.attrs["long_name"]


# How it is run


@pytest.mark.parametrize("name", ["basins", "chaos", "slow", "lifetime"])
def test_no_result_depends_on_the_size_of_tiles(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = tiled.case(name)
    monkeypatch.setattr("pendmap.analysis.basin_tiles.TILE", tiled.TILE)
    tiled.assert_same(tiled.case(name), whole)


def test_other_threads_run_and_progress_is_reported() -> None:
    ticks, shares, stop = [0], [], threading.Event()

    def tick() -> None:
        while not stop.wait(0.005):
            ticks[0] += 1

    other = threading.Thread(target=tick)
    other.start()
    began = time.perf_counter()
    pendmap.basins(Pendulum(p=1.7), 200, progress=lambda *x: shares.append(x))
    seconds = time.perf_counter() - began
    stop.set()
    other.join()
    assert ticks[0] > seconds / 0.005 / 10  # almost none if the lock were held all the time
    assert all(0 <= done <= total for done, total in shares)
    with pytest.raises(ZeroDivisionError):
        pendmap.basins(Pendulum(p=1.7), 700, progress=lambda *_: 1 / 0)


def test_ctrl_c_raises_keyboard_interrupt() -> None:
    # Progress is reported once the map has begun: all imports are complete by then.
    code = (
        "import pendmap, sys\n"
        "under_way = lambda *_: print('go', flush=True)\n"
        "try:\n"
        "    pendmap.basins(pendmap.Pendulum(p=1.7), 9000, progress=under_way)\n"
        "except KeyboardInterrupt:\n"
        "    sys.exit(42)\n"
    )
    with started([sys.executable, "-c", code], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "go\n"
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=20) == 42


@pytest.mark.parametrize("words", ["basins --grid 8", "orbit --grid 8", "simulate --until 5"])
def test_the_option_simd_applies_to_one_command(
    words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(*more: str) -> tuple[object, Any]:
        monkeypatch.setattr(sys, "argv", ["pendmap", *words.split(), *more, "--json", "--quiet"])
        with pytest.raises(SystemExit) as end:
            cli.run()
        return end.value.code or 0, capsys.readouterr()

    monkeypatch.delenv("PENDMAP_SIMD", raising=False)
    for path in _core.simd_available():
        code, output = run("--simd", path)
        assert (code, json.loads(output.out)["simd"]) == (0, path)
        assert "PENDMAP_SIMD" not in os.environ
    code, output = run("--simd", "mmx")
    assert code == 2
    assert re.fullmatch(r".*--simd': must be one of .* on this processor, got 'mmx'\n", output.err)
    monkeypatch.setenv("PENDMAP_SIMD", "mmx")
    code, output = run()
    assert (code, output.out) == (2, "")
    assert re.fullmatch("pendmap: PENDMAP_SIMD must be .*, got 'mmx'\n", output.err)
