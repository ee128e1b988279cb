"""The viewer's own screenshots of recordings, with a Vulkan driver, which may be a software one."""

from __future__ import annotations

import contextlib
import io
import os
import socket
import subprocess
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

import decays
import motions
import pendmap
import synthetic
from pendmap import viewer
from pendmap._core import Attractor
from pendmap.charts import palette
from pendmap.identification import identify
from pendmap.viewer import runs, window
from recordings import ReadBack

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import xarray as xr

pytestmark = pytest.mark.usefixtures("strict_recordings")


Colour = tuple[int, int, int]

DRIVERS = list(Path("/usr/share/vulkan/icd.d").glob("*.json"))

PICTURES: dict[str, tuple[Callable[[], xr.Dataset], float | None]] = {
    "labels": (lambda: motions.integrated(p=0.6, cells=30, periods=60), None),
    "unreliable": (lambda: synthetic.painted(**synthetic.UNRELIABLE), None),
    "finite time": (lambda: motions.chaotic(cells=30, periods=4), None),
    "trajectory": (lambda: motions.swing(periods=12), 60.0),
}


@contextlib.contextmanager
def headless(folder: Path) -> Iterator[Any]:
    from rerun.experimental import ViewerClient  # noqa: PLC0415 (used only here)

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    size = ["--window-size", "1400x900"]
    address = ["--bind", "127.0.0.1", "--port", str(port)]
    process = subprocess.Popen(
        [window._program(), "--headless", "--hide-welcome-screen", *address, *size],  # noqa: SLF001
        env=os.environ | {"HOME": str(folder)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        for _ in range(100):
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 0.2):
                break
            time.sleep(0.1)
        yield ViewerClient(f"rerun+http://127.0.0.1:{port}/proxy")
    finally:
        process.terminate()
        process.wait(timeout=20)


def shares_of_colours(file: Path, folder: Path, cursor: float | None) -> dict[Colour, float]:
    """Return shares of colours in the viewer's screenshot; it must report no problem."""
    with headless(folder) as client:
        client.open(str(file))
        if cursor is not None:
            client.set_time("sim_time", duration=cursor, play_state="paused")
        time.sleep(8)  # the viewer's notifications fade
        state = client.get_state()
        picture = Image.open(io.BytesIO(client.take_screenshot())).convert("RGB")
    assert {view.origin for view in state.views} == set(ReadBack(file).views)
    assert [view.reports for view in state.views if view.reports] == []
    colours, counts = np.unique(np.asarray(picture).reshape(-1, 3), axis=0, return_counts=True)
    return {tuple(c.tolist()): n / counts.sum() for c, n in zip(colours, counts, strict=True)}


@pytest.mark.viewer
@pytest.mark.skipif(not DRIVERS, reason="no Vulkan driver")
def test_the_viewers_own_picture_of_an_identification(tmp_path: Path) -> None:
    read = decays.record(decays.decay(release=2.0), seconds=20.0, rate=50.0)
    content = "\n".join(["t_s,theta_rad", *(f"{t},{x}" for t, x in zip(*read, strict=True))])
    record = tmp_path / "a.csv"
    record.write_text(content + "\n")
    report = identify(pendmap.read_experiment(record))
    file = viewer.record(report, tmp_path / "a.rrd")
    shares = shares_of_colours(file, tmp_path, 5.0)
    for shade in (runs.RECORD.colour, palette.parts(palette.look("model").colour)):
        assert shares.get(shade, 0.0) > 2e-4


@pytest.mark.viewer
@pytest.mark.skipif(not DRIVERS, reason="no Vulkan driver")
@pytest.mark.parametrize("which", PICTURES)
def test_the_viewers_own_picture(tmp_path: Path, which: str) -> None:
    make, cursor = PICTURES[which]
    file = viewer.record(make(), tmp_path / "a.rrd")
    shares = shares_of_colours(file, tmp_path, cursor)
    if which == "labels":
        map_share = 0.25
        for one, share in (
            (Attractor("oscillation", 2), 0.83),
            (Attractor("rotation", 1, 1), 0.08),
        ):
            shade = palette.parts(palette.colour(one))
            assert shares.get(shade, 0.0) > 0.5 * share * map_share
    elif which == "trajectory":
        assert shares.get((120, 150, 190), 0.0) > 1e-3, "the curve in the phase plane"
    else:
        assert len(shares) > 100
