"""Opening the viewer: refusals, and messages where it cannot open."""

from __future__ import annotations

import os
import signal
import sys
import time
from typing import TYPE_CHECKING

import pytest

import synthetic
from pendmap import viewer
from pendmap.viewer import window

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.usefixtures("strict_recordings")


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return viewer.record(synthetic.painted(), tmp_path / "a.rrd")


def test_only_recordings_are_opened(tmp_path: Path) -> None:
    with pytest.raises(viewer.RecordingNotFoundError, match=r"absent\.rrd' does not exist"):
        viewer.open_viewer(tmp_path / "absent.rrd")
    with pytest.raises(viewer.NotARecordingError, match="is a folder"):
        viewer.open_viewer(tmp_path)
    for content in (b"", b"CDF\x01 something else"):
        (tmp_path / "other.rrd").write_bytes(content)
        with pytest.raises(viewer.NotARecordingError, match=r"other\.rrd' is not an \.rrd"):
            viewer.open_viewer(tmp_path / "other.rrd")
    assert issubclass(viewer.RecordingNotFoundError, viewer.ViewerError)
    assert issubclass(viewer.NoDisplayError, viewer.ViewerError)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have a display")
def test_without_a_display_the_error_names_the_remedy(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    began = time.monotonic()
    with pytest.raises(viewer.NoDisplayError, match=r"DISPLAY.*pendmap view a\.rrd"):
        viewer.open_viewer(recording)
    with pytest.raises(viewer.NoDisplayError, match=r"DISPLAY.*copy the \.rrd"):
        viewer.check_display()
    assert time.monotonic() - began < 1.0


def program(folder: Path, script: str) -> Path:
    file = folder / "program"
    file.write_text(f"#!/bin/sh\n{script}\n")
    file.chmod(0o755)
    return file


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
    monkeypatch.setenv("DISPLAY", ":0")
    made = program(recording.parent, script)
    monkeypatch.setattr(window, "_program", lambda: made)
    with pytest.raises(error, match=says):
        viewer.open_viewer(recording)


def test_a_viewer_that_runs_is_left_running(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    told = recording.parent / "told"
    made = program(recording.parent, f"echo \"$@\" > '{told}'; exec sleep 60")
    monkeypatch.setattr(window, "_program", lambda: made)
    monkeypatch.setattr(window, "PATIENCE", 0.5)
    process = viewer.open_viewer(recording)
    try:
        assert told.read_text().startswith("--bind 127.0.0.1 --port ")
        assert told.read_text().strip().endswith(str(recording))
    finally:
        os.kill(process, signal.SIGTERM)
        os.waitpid(process, 0)
