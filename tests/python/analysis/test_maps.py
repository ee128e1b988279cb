"""Basin maps as datasets, against integrations that share no code with the package."""

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
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendmap
import tiled
from interrupted import started
from pendmap import Grid, Pendulum, _core, cli
from pendmap.files import facts


def independent_labels(pendulum: Pendulum, theta: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Return the turns in 2 periods after 80, by scipy's DOP853: 0 oscillation, +-2 rotation."""
    count = theta.size

    def equation(tau: float, state: np.ndarray) -> np.ndarray:
        angle, speed = state[:count], state[count:]
        pull = (1 + pendulum.p * math.cos(pendulum.omega * tau)) * np.sin(angle)
        return np.concatenate([speed, -pendulum.gamma * speed - pull])

    times = np.array([80, 82]) * math.tau / pendulum.omega
    start = np.concatenate([theta, velocity])
    run = solve_ivp(
        equation, (0, times[-1]), start, method="DOP853", t_eval=times, rtol=1e-11, atol=1e-11
    )
    return np.round((run.y[:count, 1] - run.y[:count, 0]) / math.tau).astype(int)


def test_labels_equal_those_of_scipy_cell_for_cell() -> None:
    pendulum = Pendulum(gamma=0.1, p=0.6, omega=2.0)
    result = pendmap.basins(pendulum, Grid.square(40))
    turns = {"oscillation 2:0": 0, "rotation 1:-1": -2, "rotation 1:+1": 2}
    by_label = np.array([turns[str(name)] for name in result.attractor.values])
    theta, velocity = np.meshgrid(result.theta.values, result.velocity.values)
    expected = independent_labels(pendulum, theta.ravel(), velocity.ravel())
    assert np.array_equal(by_label[result.label.values.ravel() - 1], expected)


@pytest.fixture(scope="module")
def smooth() -> Any:  # noqa: ANN401 (a Dataset)
    """Return a small map with three attractors."""
    return pendmap.basins(Pendulum(p=0.6), Grid.square(60))


def test_a_map_has_its_model_numerics_and_shares(smooth: Any) -> None:  # noqa: ANN401
    assert smooth.label.dims == ("velocity", "theta")
    assert smooth.theta.values[0] == pytest.approx(-math.pi + math.pi / 60)
    assert {"gamma", "p", "omega", "phase", "torque", "tol", "pendmap_version"} <= {*facts(smooth)}
    assert smooth["reached_error"].item() <= smooth.attrs["tol"]
    labels, counts = np.unique(smooth.label.values, return_counts=True)
    assert labels.tolist() == [1, 2, 3]
    assert counts.sum() == smooth.attrs["cells"] == 3600
    share = counts / 3600
    assert smooth.fraction.values == pytest.approx(share)
    assert smooth.stderr.values == pytest.approx(np.sqrt(share * (1 - share) / 3600))
    assert smooth.twin.values.tolist() == [1, 3, 2]
    assert (smooth.settle_periods.values > 0).all()
    assert (smooth["labels_reliable"].item(), smooth["unreliable"].item()) == (1, 0)


def test_a_list_of_starts_gives_the_labels_of_the_grid(smooth: Any) -> None:  # noqa: ANN401
    theta, velocity = np.meshgrid(smooth.theta.values, smooth.velocity.values)
    listed = pendmap.basins_of(Pendulum(p=0.6), theta.ravel(), velocity.ravel())
    assert np.array_equal(listed.label.values, smooth.label.values.ravel())


@pytest.mark.parametrize("name", ["basins", "chaos", "slow", "lifetime"])
def test_no_result_depends_on_the_size_of_tiles(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = tiled.case(name)
    monkeypatch.setattr("pendmap.analysis.basin_tiles.TILE", tiled.TILE)
    tiled.assert_same(tiled.case(name), whole)


def test_unreliable_labels_are_reported() -> None:
    result = pendmap.basins(Pendulum(p=1.7), Grid.square(60))
    assert result["unreliable"].item() > 0.05
    assert result["labels_reliable"].item() == 0
    for words in ("NOT RELIABLE", "hardly better than chance"):
        assert words in result.attrs["summary"]
    early = pendmap.basins(Pendulum(p=1.0), Grid.square(20), max_periods=5)
    assert "--max-periods raises this bound" in early.attrs["summary"]


def test_other_threads_run_and_progress_is_reported() -> None:
    ticks, told, stop = [0], [], threading.Event()

    def tick() -> None:
        while not stop.wait(0.005):
            ticks[0] += 1

    other = threading.Thread(target=tick)
    other.start()
    began = time.perf_counter()
    pendmap.basins(Pendulum(p=1.7), 200, progress=lambda *x: told.append(x))
    seconds = time.perf_counter() - began
    stop.set()
    other.join()
    assert ticks[0] > seconds / 0.005 / 10  # almost none if the lock were held all the time
    assert told
    assert all(0 <= done <= total for done, total in told)

    def fail(*_: int) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        pendmap.basins(Pendulum(p=1.7), 700, progress=fail)


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


COMMANDS = (
    "basins --p 0.6 --grid 8",
    "map --p 0.5:0.6:2 --omega 2:2.1:2",
    "bifurcation --vary p 0.5:0.6:2",
    "orbit --p 0.6 --grid 8",
    "lyapunov --p 0.6",
    "tongues --omega 2",
    "melnikov",
    "simulate --until 5",
)


@pytest.mark.parametrize("words", COMMANDS)
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
        code, said = run("--simd", path)
        assert (code, json.loads(said.out)["simd"]) == (0, path)
        assert "PENDMAP_SIMD" not in os.environ
    code, said = run("--simd", "mmx")
    assert code == 2
    assert re.fullmatch(r".*--simd': must be one of .* on this processor, got 'mmx'\n", said.err)
    monkeypatch.setenv("PENDMAP_SIMD", "mmx")
    code, said = run()
    assert (code, said.out) == (2, "")
    assert re.fullmatch("pendmap: PENDMAP_SIMD must be .*, got 'mmx'\n", said.err)


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
    result = pendmap.basins(Pendulum(**({"p": 1.0, "omega": 1.0} | parameters)), Grid.square(60))
    assert name in result.attractor.values.tolist()
    assert result["undecided"].item() == 0


@pytest.mark.thorough
@pytest.mark.parametrize("p", [0.0, 0.05])
def test_slow_settling_is_not_called_chaos(p: float) -> None:
    """With almost no damping no start settles within the bound, and shear stretches tangents."""
    result = pendmap.basins(
        Pendulum(gamma=1e-6, p=p, torque=0.1), Grid.square(24), max_periods=1000
    )
    assert not [kind for kind in result.kind.values.tolist() if "chaos" in kind]
    assert result["undecided"].item() > 0.5
