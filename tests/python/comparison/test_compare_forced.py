"""``pendmap compare`` on forced runs: ensembles and steady states of rigs with known parameters."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from driven_decays import motion
from pendmap import InputError, Rig, virtual_rig
from pendmap.comparison import Ensemble, compare
from pendmap.comparison.forced import Statistic, drawn_starts, simulated_readings
from pendmap.comparison.itinerary import NEVER, Cycle, Ruler, wells
from pendmap.identification.runs import FitRun
from pendmap.records import Experiment, Run, read_experiment
from pendmap.virtual_rig import RunPlan

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run as Command

RIG = Rig(w0=6.2, c_over_m=0.3, Tr=0.08)
DRIVE = {"p": 0.6, "Omega": 12.0, "phi": 0.4}
TICK, PERIOD, NEAR = 0.01, 0.73, 0.05
RULER = Ruler(TICK, 1.0, PERIOD, 0.001)
TIME = np.arange(0, 40, TICK)


def made(folder: Path, *plans: RunPlan) -> Experiment:
    damping = {"w0": RIG.w0, "c_over_m": RIG.c_over_m, "friction": RIG.Tr}
    request = virtual_rig.Request(
        "forced", effects=("none",), noise=0.1, rate=50.0, plans=plans, **damping
    )
    where = virtual_rig.places(folder / "lab", replace=True)
    virtual_rig.write(virtual_rig.make(request), where)
    return read_experiment(where.experiment)


def forced(theta: float, velocity: float, seconds: float, **drive: float) -> RunPlan:
    given = {"p": 0.6, "frequency": 12.0, "phase": 0.4} | drive
    return RunPlan("forced", theta, velocity, seconds, **given)


def test_members_are_trajectories_of_the_model() -> None:
    """Members equal ``simulate`` from the same start, plus the error of the sensor."""
    rig = dataclasses.replace(RIG, effects=(pendmap.Effect("encoder_offset", {"d": 0.02}),))
    driven = dataclasses.replace(rig, p=0.6, Omega=12.0, phi=0.4)
    run = pendmap.simulate(driven, 1.0, -2.0, 6.0, samples=32)
    time = run["time"].values
    record = FitRun(time, np.zeros_like(time), 1e-3, drive=DRIVE)
    one, other = simulated_readings(record, rig, np.array([[1.0, 1.0], [-2.0, 0.0]]), time, None)
    np.testing.assert_allclose(one - 0.02, run["theta"].values, atol=2e-7)
    assert np.abs(other - one).max() > 0.1


def test_the_error_of_the_start_follows_from_the_noise(tmp_path: Path) -> None:
    experiment = made(tmp_path, forced(1.0, 2.0, 20.0))
    one = compare(RIG, experiment, ensemble=Ensemble(members=20)).forced[0]
    error = one.start_stderr
    assert abs(one.start[0] - 1.0) < 4 * error[0] < 0.004
    assert abs(one.start[1] - 2.0) < 4 * error[1] < 0.02
    ensemble = Ensemble(members=20_000, spread=0.01, seed=3)
    drawn = drawn_starts(one.start, np.diag(np.square(error)), ensemble, 6.2)
    assert tuple(drawn[:, 0]) == one.start
    for values, spread, stderr in zip(drawn, (0.01, 0.062), error, strict=True):
        assert values.std() == pytest.approx(math.hypot(spread, stderr), rel=0.03)


@pytest.mark.thorough
def test_statistics_accept_the_true_model_and_reject_another(tmp_path: Path) -> None:
    """On tumbling runs the p-values of a true model's statistics are uniform on [0, 1]."""
    plans = [forced(0.4 * k, 3.0, 40.0, p=1.5, frequency=11.0) for k in range(6)]
    experiment = made(tmp_path, *plans)
    true = compare(RIG, experiment, ensemble=Ensemble(members=200))
    chances = [s.chance for one in true.forced for s in one.statistics if s.name != "wells visited"]
    assert min(chances) > 0.002
    assert sum(chance < 0.05 for chance in chances) <= 4
    assert all(one.steady is None for one in true.forced)
    assert max(one.rms / one.sigma for one in true.forced) < 1.1
    assert min(one.statistics[1].measured for one in true.forced) > 10
    slower = dataclasses.replace(RIG, w0=4.2)
    other = compare(slower, experiment, ensemble=Ensemble(members=200))
    assert all(one.statistics[4].chance < 0.01 for one in other.forced)
    assert min(one.rms / one.sigma for one in other.forced) > 3


@pytest.mark.parametrize(
    ("start", "name"), [((0.9, 0.0), "oscillation 2:0"), ((0.2, 14.5), "rotation 1:+1")]
)
def test_a_steady_state_is_the_models_orbit(
    start: tuple[float, float], name: str, tmp_path: Path
) -> None:
    """The orbit equals that found by Newton's method."""
    experiment = made(tmp_path, forced(*start, 90.0))
    one = compare(RIG, experiment, ensemble=Ensemble(members=30, spread=0.002)).forced[0]
    steady = one.steady
    assert steady is not None
    assert [(r.cycle.name, r.share) for r in steady.reached] == [(name, 1.0)]
    assert steady.rms < 3e-3
    assert steady.rms_velocity < 0.05
    assert abs(steady.overestimate) < 3e-3
    n, w = steady.measured.n, steady.measured.w
    driven = dataclasses.replace(RIG, **DRIVE)  # type: ignore[arg-type]
    box = pendmap.Grid(pendmap.Axis(-math.pi, math.pi, 120), pendmap.Axis(-18, 18, 120))
    orbits = pendmap.orbit(driven, n, w, box)
    stable = orbits.isel(orbit=np.flatnonzero(orbits["stable"].values))
    assert steady.model is not None
    ours = [(steady.model.theta[0] + math.pi) % math.tau - math.pi, steady.model.velocity[0]]
    points = zip(stable["point_theta"].values, stable["point_velocity"].values, strict=True)
    nearest = min(points, key=lambda point: math.dist(ours, point))
    assert ours[0] == pytest.approx(nearest[0], abs=3e-4)
    # Friction has a kink at each turning point, which twelve harmonics resolve poorly.
    assert ours[1] == pytest.approx(nearest[1], abs=3e-3)


def test_a_different_steady_state_is_reported(tmp_path: Path) -> None:
    experiment = made(tmp_path, forced(0.2, 14.5, 60.0))
    stiff = dataclasses.replace(RIG, c_over_m=6.0)  # no rotation lasts
    comparison = compare(stiff, experiment, ensemble=Ensemble(members=20))
    steady = comparison.forced[0].steady
    assert steady is not None
    assert steady.model is None
    assert math.isnan(steady.rms)
    text = str(comparison)
    for part in ("settles on rotation 1:+1; the model on", "not on the measured", "0 of 1 run"):
        assert part in text
    assert "escapes from a well" in text


def test_an_unknown_phase_is_found_and_a_recorded_pivot_drives(tmp_path: Path) -> None:
    time = np.arange(0, 20, 0.02)

    def pivot(t: float) -> tuple[float, float]:
        return 0.6 * math.cos(12.0 * t + 0.4), 0.0

    theta = motion(time, (1.0, 0.0), w0=6.2, c_over_m=0.3, pivot=pivot)
    theta += np.random.default_rng(0).normal(0, 1e-3, time.size)
    rig = dataclasses.replace(RIG, Tr=0.0)
    trusted = np.ones(time.size, dtype=bool)
    run = Run("run", "run.csv", "forced", time, theta, trusted, drive=DRIVE)
    unknown = dataclasses.replace(run, drive={**DRIVE, "phi": None})
    up = 9.81 * np.array([pivot(t)[0] for t in time])
    recorded = dataclasses.replace(run, drive=None, pivot={"vertical": up}, pivot_unit="m/s2")
    few = Ensemble(members=40)
    three = compare(rig, Experiment(tmp_path, (run, unknown, recorded)), ensemble=few).forced
    for one in three:
        assert one.rms == pytest.approx(1e-3, rel=0.1)
        assert (one.phase is None) == (one is not three[1])
        assert min(s.chance for s in one.statistics) > 0.01
    assert three[1].phase is not None
    assert three[1].phase.value == pytest.approx(0.4, abs=1e-3)
    assert three[2].steady is None
    assert math.isinf(three[2].statistics[3].measured)  # driven without a period: no rest


def test_runs_that_cannot_be_compared_are_left_out_with_a_reason(tmp_path: Path) -> None:
    time = np.arange(0, 12, 0.02)
    theta = motion(time, (1.0, 0.0), w0=6.2, c_over_m=0.3, friction=0.08)
    theta += np.random.default_rng(0).normal(0, 1e-3, time.size)
    trusted = np.ones(time.size, dtype=bool)
    free = Run("free", "a.csv", "free", time, theta, trusted)
    lost = dataclasses.replace(free, name="lost", kind="forced")
    still = dataclasses.replace(free, name="still", trusted=~trusted)
    short = dataclasses.replace(
        lost, name="short", time=time[:9], theta=theta[:9], trusted=trusted[:9], drive=DRIVE
    )
    result = compare(RIG, Experiment(tmp_path, (free, lost, still, short)))
    assert [one.run.name for one in result.every] == ["free"]
    why = dict(result.left_out)
    assert why["lost"] == "neither its drive nor its pivot is given"
    assert why["still"] == "nothing moves in it"
    assert "too short: 9 samples over 0.16 s" in why["short"]
    assert "lost: not compared: neither its drive nor its pivot is given" in str(result)
    with pytest.raises(InputError, match="no run can be compared: lost: neither its drive"):
        compare(RIG, Experiment(tmp_path, (lost,)))


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"members": 5}, "members must be a whole number from 20 to 100000, got 5"),
        ({"spread": math.nan}, "spread"),
        ({"spread": -1.0}, "spread must be a number from 0 to 1 rad, got -1"),
        ({"seed": -1}, "seed must be .*, got -1"),
    ],
)
def test_ensembles_out_of_range_are_refused(given: dict[str, float], text: str) -> None:
    with pytest.raises(InputError, match=text):
        Ensemble(**given)  # type: ignore[arg-type]


def test_the_command_compares_both_kinds_of_run(tmp_path: Path, pendmap_command: Command) -> None:
    made(tmp_path, RunPlan("free", 1.5, 0.0, 10.0), forced(0.9, 0.0, 15.0))
    (tmp_path / "m.toml").write_text("[pendulum]\nw0 = 6.2\nc_over_m = 0.3\nTr = 0.08\n")
    words = ("compare", "m.toml", "lab", "--members", 50)
    run = pendmap_command(*words, "--json")
    assert run.returncode == 0, run.stderr
    first, second = json.loads(run.stdout)["runs"]
    assert (first["kind"], second["kind"]) == ("free", "forced")
    assert second["members"] == 50
    what = {row["quantity"]: row for row in second["quantities"]}
    assert what["wells visited"]["record"] == 1
    assert what["time to settle"]["record"] is None
    assert 0 < what["greatest velocity"]["chance"] <= 1
    assert second["drive"] == {"p": 0.6, "Omega": 12.0, "phi": 0.4}
    again = json.loads(pendmap_command(*words, "--json", "--threads", 1).stdout)["runs"][1]
    assert again == second


# Statistics of paths between wells, for paths with known itineraries.


def test_passages_between_wells_are_counted() -> None:
    # Up two wells, back one, and twice round: 7 passages through 6 wells.
    visited = [0, 1, 2, 1, 0, -1, -2, -3]
    path = np.repeat(math.tau * np.array(visited, float), TIME.size // len(visited))
    counts = RULER.statistics(path)
    assert (counts["escapes from a well"], counts["wells visited"]) == (7, 6)
    assert counts["angle covered"] == pytest.approx(5 * math.tau)
    assert wells(path).tolist()[:: TIME.size // len(visited)] == visited
    # Noise at the top is no escape; a jump over wells is several.
    near_top = math.pi + np.random.default_rng(1).normal(0, 0.02, TIME.size)
    near_top[0] = 0.0
    assert RULER.statistics(near_top)["escapes from a well"] == 0
    over = RULER.statistics(np.where(TIME < 20, 0.3, 0.3 + 3 * math.tau))
    assert (over["escapes from a well"], over["wells visited"]) == (3, 2)


@pytest.mark.parametrize(("n", "w"), [(1, 0), (1, 1), (2, -1), (8, 3)])
def test_a_cycle_has_its_period_and_turns(n: int, w: int) -> None:
    rate = math.tau / (n * PERIOD)
    cycle = 0.8 * np.sin(rate * TIME) + 0.3 * np.cos((2 * n - 1) * rate * TIME)
    path = cycle + w * rate * TIME + np.random.default_rng(2).normal(0, 0.001, TIME.size)
    assert RULER.cycling(path) == (n, w, 0)


def test_the_time_to_settle_is_that_of_the_slowest_part() -> None:
    """A difference ``a exp(-k t)`` from the cycle changes by 0.05 a period at a known time."""
    rate, decay, apart = math.tau / PERIOD, 0.25, 1.5
    path = 0.5 * np.sin(rate * TIME) + apart * np.exp(-decay * TIME)
    expected = math.log(apart * (1 - math.exp(-decay * PERIOD)) / NEAR) / decay
    n, w, since = RULER.cycling(path)
    assert (n, w) == (1, 0)
    assert since == pytest.approx(expected, abs=2 * TICK)
    walk = 0.1 * np.cumsum(np.random.default_rng(3).normal(0, 1, TIME.size))
    assert RULER.cycling(walk) == NEVER
    # Five periods are required, and fewer than two are present.
    assert RULER.cycling(np.where(TIME < 39, walk, 0.0)) == NEVER
    # Without a period only rest counts as settled.
    ruler = Ruler(TICK, 1.0, None, 0.001)
    stays = np.exp(-0.5 * TIME) * np.cos(6 * TIME) + math.tau
    last = TIME[np.flatnonzero(np.abs(stays - stays[-1]) > NEAR)[-1]]
    assert ruler.cycling(stays) == (1, 0, pytest.approx(last + TICK))
    assert ruler.cycling(np.sin(6 * TIME)) == NEVER


def test_p_values_are_ranks() -> None:
    values = np.arange(99.0)
    assert Statistic("", "", 49.0, values).chance == 1.0
    assert Statistic("", "", 97.5, values).chance == pytest.approx(2 * 2 / 100)
    assert Statistic("", "", math.inf, values).chance == pytest.approx(2 / 100)
    assert Statistic("", "", math.inf, np.full(9, math.inf)).chance == 1.0
    assert Statistic("", "", 0.0, values).ci95 == (2.0, 96.0)


def test_cycles_are_aligned_by_shifts_of_periods_and_turns() -> None:
    x = np.arange(128) / 128
    one = Cycle.of(2, 0, 1.0, np.sin(math.tau * x) + 0.1 * np.sin(2 * math.tau * x))
    velocity = math.pi * (np.cos(math.tau * x) + 0.2 * np.cos(2 * math.tau * x))
    np.testing.assert_allclose(one.velocity, velocity, atol=1e-9)
    shifted = np.roll(one.theta, -64) + math.tau, np.roll(one.velocity, -64)
    later = dataclasses.replace(one, theta=shifted[0], velocity=shifted[1])
    apart, moved = later.nearest(one)
    assert apart < 1e-9
    np.testing.assert_allclose(moved.theta, one.theta, atol=1e-9)
    np.testing.assert_allclose(moved.velocity, one.velocity, atol=1e-9)
    whirling = Cycle.of(2, 1, 1.0, math.tau * x + 0.2 * np.sin(math.tau * x))
    theta = np.concatenate([whirling.theta[64:], whirling.theta[:64] + math.tau])
    assert dataclasses.replace(whirling, theta=theta).nearest(whirling)[0] < 1e-9
    turning = Cycle.of(1, 1, 1.0, math.tau * x + 0.2 * np.sin(math.tau * x))
    assert turning.amplitude == pytest.approx(0.2, rel=1e-3)
    assert math.isinf(turning.nearest(one)[0])
