"""The viewer's own screenshots of recordings, with a Vulkan driver, which may be a software one."""

from __future__ import annotations

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
    from collections.abc import Callable

pytestmark = pytest.mark.usefixtures("strict_recordings")


def identification(folder: Path) -> Any:  # noqa: ANN401
    time_, theta = decays.record(decays.decay(release=2.0), seconds=20.0, rate=50.0)
    rows = (f"{t},{x}" for t, x in zip(time_, theta, strict=True))
    (folder / "a.csv").write_text("\n".join(["t_s,theta_rad", *rows]) + "\n")
    return identify(pendmap.read_experiment(folder / "a.csv"))


OSCILLATION, ROTATION = Attractor("oscillation", 2), Attractor("rotation", 1, 1)
PICTURES: dict[
    str, tuple[Callable[[Path], Any], float | None, dict[tuple[int, int, int], float]]
] = {
    "labels": (
        lambda _: motions.integrated(p=0.6, cells=30, periods=60),
        None,
        {
            palette.parts(palette.colour(OSCILLATION)): 0.1,
            palette.parts(palette.colour(ROTATION)): 0.01,
        },
    ),
    "unreliable": (lambda _: synthetic.painted(**synthetic.UNRELIABLE), None, {}),
    "finite time": (lambda _: motions.chaotic(cells=30, periods=4), None, {}),
    "trajectory": (lambda _: motions.swing(periods=12), 60.0, {(120, 150, 190): 1e-3}),
    "identification": (
        identification,
        5.0,
        {runs.RECORD.colour: 2e-4, palette.parts(palette.look("model").colour): 2e-4},
    ),
}
"""What is recorded, the time shown, and the least shares of colours in the picture."""


@pytest.mark.viewer
@pytest.mark.skipif(
    not list(Path("/usr/share/vulkan/icd.d").glob("*.json")), reason="no Vulkan driver"
)
@pytest.mark.parametrize("which", PICTURES)
def test_the_viewers_own_picture(tmp_path: Path, which: str) -> None:
    from rerun.experimental import ViewerClient  # noqa: PLC0415 (used only here)

    make, cursor, least = PICTURES[which]
    file = viewer.record(make(tmp_path), tmp_path / "a.rrd")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    words = ["--headless", "--hide-welcome-screen", "--window-size", "1400x900"]
    process = subprocess.Popen(
        [window._program(), "--bind", "127.0.0.1", "--port", str(port), *words],  # noqa: SLF001
        env=os.environ | {"HOME": str(tmp_path)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        time.sleep(5)
        client = ViewerClient(f"rerun+http://127.0.0.1:{port}/proxy")
        client.open(str(file))
        if cursor is not None:
            client.set_time("sim_time", duration=cursor, play_state="paused")
        time.sleep(8)  # the viewer's notifications fade
        state = client.get_state()
        picture = Image.open(io.BytesIO(client.take_screenshot())).convert("RGB")
    finally:
        process.terminate()
        process.wait(timeout=20)
    assert {view.origin for view in state.views} == set(ReadBack(file).views)
    assert [view.reports for view in state.views if view.reports] == []
    pixels = np.asarray(picture).reshape(-1, 3)
    for colour, share in least.items():
        assert np.mean((pixels == colour).all(axis=1)) > share
    assert len(np.unique(pixels, axis=0)) > 100
