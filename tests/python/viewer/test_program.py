"""The viewer's program: trajectories streamed to it, its pictures, its start on a recording."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

import decays
import pendmap
import synthetic
from conftest import COMMAND
from interrupted import started, until
from pendmap import InputError, Pendulum, viewer
from pendmap._core import Attractor
from pendmap.charts import palette
from pendmap.identification import identify
from pendmap.viewer import runs, window
from recordings import ReadBack, recorded

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from conftest import Run
    from pendmap.identification import IdentificationReport

# The receiver is stopped by a signal, and writes no footer.
pytestmark = pytest.mark.filterwarnings("ignore:RRD file has no footer")

PENDULUM = Pendulum(p=1.7, omega=0.87)
MODEL = ("--p", "1.7", "--omega", "0.87", "--theta", "1")
DRIVERS = [*Path("/usr/share/vulkan/icd.d").glob("*.json")]
MAP_COLOURS = {
    palette.parts(palette.colour(Attractor("oscillation", 2))): 0.1,
    palette.parts(palette.colour(Attractor("rotation", 1, 1))): 0.01,
}
RUN_COLOURS = {runs.RECORD.colour: 2e-4, palette.parts(palette.look("model").colour): 2e-4}


@contextlib.contextmanager
def program(folder: Path, *words: str) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Start the viewer's program without a window, and wait until it listens at an address."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    process = subprocess.Popen(
        [window._program(), "--bind", "127.0.0.1", "--port", str(port), *words],  # noqa: SLF001
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
        yield f"127.0.0.1:{port}", process
    finally:
        process.kill()
        process.wait(timeout=20)


def ended(process: subprocess.Popen[bytes], file: Path) -> None:
    size = -1
    while size != (size := file.stat().st_size):  # until data in transit have arrived
        time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    process.wait(timeout=30)


def test_the_sent_data_are_the_trajectory(tmp_path: Path) -> None:
    file = tmp_path / "sent.rrd"
    with program(tmp_path, "--save", str(file)) as (address, process):
        live = viewer.Live(PENDULUM, (1.0, 0.0), address)

        def in_blocks(*new: np.ndarray) -> None:
            for k in range(0, new[0].size, 1500):
                live(*(values[k : k + 1500] for values in new))

        run = pendmap.simulate(PENDULUM, 1.0, 0.0, 600.0, live=in_blocks)
        live.finish(run)
        ended(process, file)
    sent, plain = ReadBack(file), recorded(run, tmp_path)
    assert run.sizes["time"] > 3000
    for entity, component in (
        ("/state/theta", "Scalars:scalars"),
        ("/state/energy", "Scalars:scalars"),
        ("/phase/data/now", "Points2D:positions"),
        ("/poincare/data/points", "Points2D:positions"),
        ("/pendulum/data/bob", "Points2D:positions"),
        ("/pendulum/data/trail", "LineStrips2D:strips"),
    ):
        assert np.allclose(sent.rows(entity, component), plain.rows(entity, component), atol=1e-5)
        assert np.allclose(sent.seconds(entity), plain.seconds(entity), atol=1e-6)
    # The page "Running." and the one that replaces it.
    pages = [row[0] for row in sent.columns["/summary"]["TextDocument:text"]]
    assert sum(run.attrs["summary"].split("\n")[0] in page for page in pages) == 1
    assert set(plain.views) == set(sent.views)


def test_ctrl_c_ends_it_with_what_was_computed(tmp_path: Path) -> None:
    file = tmp_path / "sent.rrd"
    with program(tmp_path, "--save", str(file)) as (address, process):
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
        ended(process, file)
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
        run = pendmap_command("simulate", "--until", "1e7", "--live", f"127.0.0.1:{port}")
    assert run.returncode == 2
    assert f"rerun --bind 127.0.0.1 --port {port}" in run.stderr
    assert run.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("address", ["nowhere", "host:0", "host:99999", ":9876", "host:many"])
def test_an_invalid_address_is_refused(address: str) -> None:
    with pytest.raises(InputError, match="HOST:PORT"):
        viewer.check_address(address)


def test_a_viewer_that_quits_does_not_end_the_computation(tmp_path: Path) -> None:
    with program(tmp_path, "--save", str(tmp_path / "sent.rrd")) as (address, process):
        live = viewer.Live(PENDULUM, (1.0, 0.0), address)
        process.kill()
        process.wait(timeout=20)
        run = pendmap.simulate(PENDULUM, 1.0, 0.0, 300.0, live=live)
        with pytest.raises(viewer.ViewerError, match="did not accept all"):
            live.finish(run)
    assert run.sizes["time"] > 1000


def identified() -> IdentificationReport:
    return identify(*decays.record(decays.decay(release=2.0), seconds=20.0, rate=50.0))


@pytest.mark.viewer
@pytest.mark.skipif(not DRIVERS, reason="no Vulkan driver")
@pytest.mark.parametrize(
    ("make", "cursor", "least"),
    [
        (lambda: pendmap.basins(pendmap.Pendulum(p=0.6), 30), None, MAP_COLOURS),
        (identified, 5.0, RUN_COLOURS),
    ],
    ids=["basins", "identification"],
)
def test_the_viewers_own_picture(
    make: Callable[[], Any], cursor: float | None, least: dict[Any, float], tmp_path: Path
) -> None:
    from rerun.experimental import ViewerClient  # noqa: PLC0415 (used only here)

    file = viewer.record(make(), tmp_path / "a.rrd")
    words = ("--headless", "--hide-welcome-screen", "--window-size", "1400x900")
    with program(tmp_path, *words) as (address, _):
        time.sleep(5)
        client = ViewerClient(f"rerun+http://{address}/proxy")
        client.open(str(file))
        if cursor is not None:
            client.set_time("sim_time", duration=cursor, play_state="paused")
        time.sleep(8)  # the viewer's notifications fade
        state = client.get_state()
        picture = Image.open(io.BytesIO(client.take_screenshot())).convert("RGB")
    assert {view.origin for view in state.views} == set(ReadBack(file).views)
    assert [view.reports for view in state.views if view.reports] == []
    pixels = np.asarray(picture).reshape(-1, 3)
    for colour, share in least.items():
        assert np.mean((pixels == colour).all(axis=1)) > share


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return viewer.record(synthetic.painted(), tmp_path / "a.rrd")


def test_only_recordings_are_written_and_opened(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"suffix must be \.rrd, got '\.txt'"):
        viewer.record(synthetic.painted(), tmp_path / "a.txt")
    with pytest.raises(viewer.RecordingNotFoundError, match=r"absent\.rrd' does not exist"):
        viewer.open_viewer(tmp_path / "absent.rrd")
    with pytest.raises(viewer.NotARecordingError, match="is a folder"):
        viewer.open_viewer(tmp_path)
    for content in (b"", b"CDF\x01 something else"):
        (tmp_path / "other.rrd").write_bytes(content)
        with pytest.raises(viewer.NotARecordingError, match=r"other\.rrd' is not an \.rrd"):
            viewer.open_viewer(tmp_path / "other.rrd")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have a display")
def test_without_a_display_the_error_names_the_remedy(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(viewer.NoDisplayError, match=r"DISPLAY.*pendmap view a\.rrd"):
        viewer.open_viewer(recording)
    with pytest.raises(viewer.NoDisplayError, match=r"DISPLAY.*copy the \.rrd"):
        viewer.check_display()


def replaced(folder: Path, script: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the viewer by a script, on a display."""
    file = folder / "program"
    file.write_text(f"#!/bin/sh\n{script}\n")
    file.chmod(0o755)
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(window, "_program", lambda: file)


@pytest.mark.parametrize(
    ("script", "error", "says"),
    [
        ("echo 'Error: no graphics'; exit 1", viewer.ViewerError, "at once: Error: no graphics"),
        ("exit 3", viewer.ViewerError, "no reason"),
        (
            "echo 'Error: winit EventLoopError: Failed to open connection to X server'; exit 1",
            viewer.NoDisplayError,
            "does not answer",
        ),
    ],
)
def test_a_viewer_that_ends_at_once_is_reported(
    recording: Path,
    monkeypatch: pytest.MonkeyPatch,
    script: str,
    error: type[Exception],
    says: str,
) -> None:
    replaced(recording.parent, script, monkeypatch)
    with pytest.raises(error, match=says):
        viewer.open_viewer(recording)


def test_a_viewer_that_runs_is_left_running(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = recording.parent / "words"
    replaced(recording.parent, f"echo \"$@\" > '{words}'; exec sleep 60", monkeypatch)
    monkeypatch.setattr(window, "PATIENCE", 0.5)
    process = viewer.open_viewer(recording)
    try:
        assert words.read_text().startswith("--bind 127.0.0.1 --port ")
        assert words.read_text().strip().endswith(str(recording))
    finally:
        os.kill(process, signal.SIGTERM)
        os.waitpid(process, 0)
