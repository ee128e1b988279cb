"""Trajectories streamed to a viewer during the computation; a receiver saves them."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import time
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from conftest import COMMAND
from interrupted import started, until
from pendmap import Pendulum, viewer
from pendmap.files import facts
from pendmap.viewer import window
from pendmap.viewer.trajectory import behind
from recordings import ReadBack

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from conftest import Run

# The receiver is stopped by a signal, and writes no footer.
pytestmark = pytest.mark.filterwarnings("ignore:RRD file has no footer")

MODEL = ("--p", "1.7", "--omega", "0.87", "--theta", "1")


@contextlib.contextmanager
def receiver(folder: Path) -> Iterator[tuple[str, Path, subprocess.Popen[bytes]]]:
    """Start the viewer's program without a window; it writes the received data when it ends."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    file = folder / "sent.rrd"
    words = ["--save", str(file), "--bind", "127.0.0.1", "--port", str(port)]
    process = subprocess.Popen(
        [window._program(), *words],  # noqa: SLF001
        env=os.environ | {"HOME": str(folder)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509
    )
    try:
        for _ in range(100):
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 0.2):
                break
            time.sleep(0.1)
        yield f"127.0.0.1:{port}", file, process
    finally:
        process.kill()
        process.wait(timeout=20)


def ended(process: subprocess.Popen[bytes]) -> None:
    time.sleep(1.0)  # time for data in transit to arrive
    process.send_signal(signal.SIGINT)
    process.wait(timeout=30)


def test_the_sent_data_are_the_trajectory(tmp_path: Path) -> None:
    pendulum, start = Pendulum(p=1.7, omega=0.87), (1.0, 0.0)
    with receiver(tmp_path) as (address, file, process):
        live = viewer.Live(pendulum, start, address)

        def in_blocks(*new: np.ndarray) -> None:
            for k in range(0, new[0].size, 1500):
                live(*(values[k : k + 1500] for values in new))

        run = pendmap.simulate(pendulum, *start, 600.0, live=in_blocks)
        live.finish(run)
        ended(process)
    back = ReadBack(file)
    theta = run["theta"].values
    assert run.sizes["time"] > 3000
    assert np.array_equal(back.rows("/state/theta", "Scalars:scalars"), theta)
    assert np.allclose(back.seconds("/state/theta"), run["time"].values, atol=1e-6)
    assert np.allclose(back.rows("/state/energy", "Scalars:scalars"), run["energy"].values)
    now = back.rows("/phase/data/now", "Points2D:positions")
    assert np.allclose(now[:, 1], run["velocity"].values, atol=1e-5)
    points = back.rows("/poincare/data/points", "Points2D:positions")
    assert np.allclose(points[:, 0], run["section_theta"].values, atol=1e-5)
    assert back.columns["/poincare/data/points"]["period"] == run["period"].values.tolist()
    bob = back.rows("/pendulum/data/bob", "Points2D:positions")
    trail = back.rows("/pendulum/data/trail", "LineStrips2D:strips")
    assert np.allclose(trail[:, -1], bob)
    # Blocks join: the trail behind the first samples of a block is in the preceding one.
    ago = behind(facts(run), run["time"].values)
    later = np.arange(ago[0], len(bob))
    assert np.allclose(trail[later], bob[later[:, None] - ago])
    assert "/phase/data/curve" in back.static
    # The page "Running." and the one that replaces it.
    pages = [row[0] for row in back.columns["/summary"]["TextDocument:text"]]
    assert sum(run.attrs["summary"].split("\n")[0] in page for page in pages) == 1
    assert {"/pendulum", "/phase", "/poincare", "/state/energy"} <= set(back.views)


def test_ctrl_c_ends_it_with_what_was_computed(tmp_path: Path) -> None:
    with receiver(tmp_path) as (address, file, process):
        words = [str(COMMAND), "simulate", *MODEL, "--until", "3e6", "--samples", "8"]
        words += ["--live", address, "--out", "a.nc"]
        with (
            (tmp_path / "said.txt").open("w") as said,  # a pipe that nobody reads would fill
            started(words, cwd=tmp_path, stderr=said, stdout=subprocess.PIPE) as run,
        ):
            until(run, lambda: file.stat().st_size > 1_000_000)
            run.send_signal(signal.SIGINT)
            out = run.communicate(timeout=60)[0]
        err = (tmp_path / "said.txt").read_text()
        assert run.returncode == 130, err
        assert "interrupted, a.nc written" in err
        assert "INTERRUPTED before tau = 3e+06" in out
        ended(process)
    kept = pendmap.load(tmp_path / "a.nc")
    assert kept.attrs["interrupted"] == 1
    assert 1000 < kept.sizes["time"] < 3e6
    assert ReadBack(file).seconds("/state/theta")[-1] == pytest.approx(float(kept["time"][-1]))


def test_a_missing_viewer_is_reported_before_the_computation(
    tmp_path: Path, pendmap_command: Run
) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))  # bound, but nobody listens
        port = probe.getsockname()[1]
        began = time.monotonic()
        run = pendmap_command("simulate", "--until", "1e7", "--live", f"127.0.0.1:{port}")
    assert run.returncode == 2
    assert f"rerun --bind 127.0.0.1 --port {port}" in run.stderr
    assert run.stderr.count("\n") == 1
    assert time.monotonic() - began < 20
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("address", ["nowhere", "host:0", "host:99999", ":9876", "host:many"])
def test_an_invalid_address_is_refused(address: str) -> None:
    with pytest.raises(pendmap.InputError, match="HOST:PORT"):
        viewer.check_address(address)


def test_a_viewer_that_quits_does_not_end_the_computation(tmp_path: Path) -> None:
    pendulum = Pendulum(p=1.7, omega=0.87)
    with receiver(tmp_path) as (address, _, process):
        live = viewer.Live(pendulum, (1.0, 0.0), address)
        process.kill()
        process.wait(timeout=20)
        run = pendmap.simulate(pendulum, 1.0, 0.0, 300.0, live=live)
        with pytest.raises(viewer.ViewerError, match="did not accept all"):
            live.finish(run)
    assert run.sizes["time"] > 1000
