"""Recordings: read back what was written and, if wanted, look at the viewer's picture of it."""

# ruff: noqa: D102 (their names say what the tests test)

from __future__ import annotations

import contextlib
import io
import math
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import pytest
import rerun as rr
import xarray as xr
from PIL import Image
from rerun.chunk import RrdReader

import synthetic
from pendmap import InputError, palette, viewer
from pendmap.viewer import basins, window

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

UNRELIABLE: dict[str, Any] = {"labels_reliable": 0, "unreliable": 0.207}


@pytest.fixture(autouse=True)
def strict() -> Iterator[None]:
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


class ReadBack:
    """A recording as it stands in the file."""

    def __init__(self, path: Path) -> None:
        reader = RrdReader(path)
        self.columns: dict[str, dict[str, list[Any]]] = {}
        self.static: set[str] = set()
        self.recordings = reader.recordings()
        for chunk in reader.stream():
            batch = chunk.to_record_batch()
            entity = self.columns.setdefault(chunk.entity_path, {})
            for name in batch.schema.names:
                column = batch.column(name)
                entity[name] = entity.get(name, []) + column.to_pylist()
            if chunk.is_static:
                self.static.add(chunk.entity_path)
        self.views: dict[str, str] = {}
        self.tabs: list[int] = []
        for store in reader.blueprints():
            for chunk in reader.stream(store=store):
                batch = chunk.to_record_batch()
                if "ViewBlueprint:space_origin" in batch.schema.names:
                    origin = batch.column("ViewBlueprint:space_origin").to_pylist()[0][0]
                    name = batch.column("ViewBlueprint:display_name").to_pylist()[0][0]
                    self.views[origin] = name

    def one(self, entity: str, component: str) -> Any:  # noqa: ANN401 (whatever was logged)
        """Return the only value of a static component."""
        (row,) = self.columns[entity][component]
        return row[0] if len(row) == 1 else row

    def image(self, entity: str, archetype: str, kind: type) -> npt.NDArray[Any]:
        shape = self.one(entity, f"{archetype}:format")
        buffer = np.asarray(self.one(entity, f"{archetype}:buffer"), dtype=np.uint8)
        return buffer.view(kind).reshape(shape["height"], shape["width"])

    def rows(self, entity: str, component: str) -> npt.NDArray[np.float64]:
        return np.array([row[0] for row in self.columns[entity][component]], dtype=float)

    def seconds(self, entity: str) -> npt.NDArray[np.float64]:
        times = self.columns[entity]["sim_time"]
        return np.array([t.total_seconds() for t in times])

    def names(self, entity: str) -> dict[int, str]:
        context = self.columns[entity]["AnnotationContext:context"][0][0]
        return {e["class_id"]: e["class_description"]["info"]["label"] for e in context}


def recorded(dataset: xr.Dataset, folder: Path) -> ReadBack:
    return ReadBack(viewer.record(dataset, folder / "a.rrd"))


def test_a_map_read_back(tmp_path: Path) -> None:
    dataset = synthetic.painted(synthetic.USUAL[:4], (13, 9), undecided=3, failed=2)
    back = recorded(dataset, tmp_path)
    wanted = {
        "/basin/data/labels",
        "/basin/data/attractors",
        "/settle/data/steps",
        "/turns/data/turns",
        "/legend",
        "/summary",
        "/basin/axes/frame",
        "/basin/axes/ticks",
    }
    assert wanted <= set(back.columns)
    assert wanted <= back.static
    labels = back.image("/basin/data/labels", "SegmentationImage", np.uint8)
    assert (labels == dataset["label"].values + 1).all()
    settle = back.image("/settle/data/steps", "DepthImage", np.uint16)
    assert (settle == np.maximum(dataset["settle_periods"].values, 0)).all()
    without = back.image("/settle/data/without", "SegmentationImage", np.uint16)
    assert ((without > 0) == (dataset["settle_periods"].values < 0)).all()
    classes = back.image("/turns/data/turns", "SegmentationImage", np.uint16).astype(int)
    kept = dataset["label"].values >= 0
    none = int(back.one("/turns/data/turns", "class_of_no_turn"))
    assert (classes - none == dataset["net_turns"].values)[kept].all()
    assert (classes[~kept] == 0).all()


def test_every_class_has_its_name_and_colour(tmp_path: Path) -> None:
    dataset = synthetic.painted(synthetic.USUAL[:4], undecided=3)
    back = recorded(dataset, tmp_path)
    assert back.names("/basin") == {
        0: "failed",
        1: "undecided",
        2: "rest",
        3: "rotation 1:+1",
        4: "rotation 1:\N{MINUS SIGN}1",
        5: "oscillation 2:0",
    }
    colours = {
        e["class_id"]: e["class_description"]["info"]["color"]
        for e in back.columns["/basin"]["AnnotationContext:context"][0][0]
    }
    red, green, blue = palette.rgb("rotation 1:+1")
    assert colours[3] == (red << 24) + (green << 16) + (blue << 8) + 255
    turns = back.names("/turns")
    none = int(back.one("/turns/data/turns", "class_of_no_turn"))
    assert turns[none + 3] == "+3 turns"
    assert turns[none - 3] == "\N{MINUS SIGN}3 turns"
    for label in np.unique(back.image("/turns/data/turns", "SegmentationImage", np.uint16)):
        assert int(label) in turns


def test_attractors_lie_at_their_points_and_are_named(tmp_path: Path) -> None:
    dataset = synthetic.painted(synthetic.USUAL[:4])
    back = recorded(dataset, tmp_path)
    at = np.array(back.one("/basin/data/attractors", "Points2D:positions"))
    expected = np.stack([dataset["point_theta"].values, dataset["point_velocity"].values], axis=1)
    assert np.allclose(at, expected, atol=1e-6)
    labels = back.one("/basin/data/attractors/names", "Points2D:labels")
    assert labels == ["rest", "rotation 1:+1", "rotation 1:\N{MINUS SIGN}1", "oscillation 2:0"]


def test_transforms_bring_the_corners_of_the_map_to_the_frame(tmp_path: Path) -> None:
    dataset = synthetic.painted(shape=(20, 10), theta=(-1.0, 3.0), velocity=(-2.0, 4.0))
    back = recorded(dataset, tmp_path)
    corners = np.array([[0.0, 0.0, 0.0], [10.0, 20.0, 0.0]])
    for entity in ("/basin/data/labels", "/basin/data"):
        matrix = np.reshape(back.one(entity, "Transform3D:mat3x3"), (3, 3)).T
        corners = corners @ matrix.T + back.one(entity, "Transform3D:translation")
        if entity == "/basin/data/labels":
            assert np.allclose(corners[:, :2], [[-1.0, -2.0], [3.0, 4.0]], atol=1e-5)
    frame = np.array(back.one("/basin/axes/frame", "LineStrips2D:strips")[0])
    low, high = frame.min(axis=0), frame.max(axis=0)
    assert np.allclose(corners[0, :2], [low[0], high[1]], atol=1e-3), (
        "lowest velocity at the bottom"
    )
    assert np.allclose(corners[1, :2], [high[0], low[1]], atol=1e-3)


def test_legend_and_summary(tmp_path: Path) -> None:
    dataset = synthetic.painted(synthetic.USUAL[:4], (30, 40), undecided=12, **UNRELIABLE)
    back = recorded(dataset, tmp_path)
    text = back.one("/legend", "TextDocument:text")
    share = 100 * float(dataset["fraction"].values[1])
    assert f"| rotation 1:+1 | {share:.1f} \N{PLUS-MINUS SIGN} " in text
    assert "| vermillion | rotation 1:\N{MINUS SIGN}1 |" in text
    assert "| undecided | 1 % | light grey |" in text
    assert "labels unreliable: 20.7 % change under half the step or mirroring" in text
    summary = back.one("/summary", "TextDocument:text")
    assert summary.split("\n\n") == dataset.attrs["summary"].splitlines()


def test_parameters_are_properties(tmp_path: Path) -> None:
    back = recorded(synthetic.painted(p=1.7, gamma=0), tmp_path)
    assert back.one("/__properties/pendmap", "p") == 1.7
    assert back.one("/__properties/pendmap", "gamma") == 0
    assert back.one("/__properties/pendmap", "simd") == "avx2"


def test_every_view_has_an_origin_and_a_name(tmp_path: Path) -> None:
    assert recorded(synthetic.painted(), tmp_path).views == {
        "/basin": "Basins of attraction",
        "/settle": "Settle time (periods)",
        "/turns": "Net turns until settled",
        "/legend": "Legend",
        "/summary": "Summary",
    }
    unreliable = synthetic.painted(**UNRELIABLE)
    assert recorded(unreliable, tmp_path).views["/basin"] == "Labels (unreliable)"
    contents = [str(part.origin) for part in tabs_of(unreliable)]
    assert contents == ["/settle", "/turns", "/basin"]


def tabs_of(dataset: xr.Dataset) -> list[Any]:
    """Return the tabs of the layout, the one in front first."""
    screen: Any = basins.blueprint(dataset)
    return list(screen.root_container.contents[0].contents)


def test_chaos_that_takes_all(tmp_path: Path) -> None:
    dataset = synthetic.chaotic(cells=20, periods=4)
    back = recorded(dataset, tmp_path)
    assert "/basin/data/labels" not in back.columns
    assert "/settle/data/steps" not in back.columns
    exponent = back.image("/exponent/data/exponent", "DepthImage", np.float32)
    assert (exponent == dataset["finite_time_exponent"].values).all()
    classes = back.image("/turns/data/turns", "SegmentationImage", np.uint16).astype(int)
    none = int(back.one("/turns/data/turns", "class_of_no_turn"))
    assert (classes - none == dataset["net_turns"].values).all()
    assert len(back.one("/basin/data/attractors", "Points2D:positions")) == dataset.sizes["point"]
    assert [str(part.origin) for part in tabs_of(dataset)] == ["/turns", "/exponent", "/basin"]


def test_without_damping(tmp_path: Path) -> None:
    dataset = synthetic.chaotic(gamma=0.0, p=0.6, omega=2.0, cells=20, periods=4)
    back = recorded(dataset, tmp_path)
    assert "No attractors." in back.one("/legend", "TextDocument:text")
    assert not [entity for entity in back.columns if "attractors" in entity]


@pytest.mark.parametrize(
    "dataset",
    [
        synthetic.painted((), (4, 3)),
        synthetic.painted(synthetic.USUAL[:1], (1, 1)),
        synthetic.painted(synthetic.USUAL, (3, 2)),
        synthetic.painted(synthetic.USUAL[10:12]),
        synthetic.painted(theta=(-4 * math.pi, 4 * math.pi), velocity=(5.0, 6.0)),
    ],
    ids=["none", "one cell", "twelve in six cells", "two chaotic", "attractors outside"],
)
def test_odd_maps(tmp_path: Path, dataset: xr.Dataset) -> None:
    back = recorded(dataset, tmp_path)
    labels = back.image("/basin/data/labels", "SegmentationImage", np.uint8)
    assert (labels == dataset["label"].values + 1).all()


def test_a_failed_exponent_is_covered(tmp_path: Path) -> None:
    dataset = synthetic.chaotic(cells=12, periods=2)
    dataset["finite_time_exponent"][3, 4] = np.nan
    dataset["label"][3, 4] = -1
    back = recorded(dataset, tmp_path)
    cover = back.image("/exponent/data/without", "SegmentationImage", np.uint16)
    assert cover[3, 4] == 1
    assert np.count_nonzero(cover) == 1


def test_a_map_beyond_the_largest_image_is_thinned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(basins, "CELLS", 16)
    dataset = synthetic.painted(synthetic.USUAL[:3], (32, 40), undecided=5)
    back = recorded(dataset, tmp_path)
    labels = back.image("/basin/data/labels", "SegmentationImage", np.uint8)
    assert (labels == dataset["label"].values[::2, 1::3] + 1).all()


# Trajectories


@pytest.fixture(scope="module")
def swing() -> xr.Dataset:
    return synthetic.swing(periods=12, steps=200, p=1.7, omega=0.87)


def test_a_trajectory_read_back(tmp_path: Path, swing: xr.Dataset) -> None:
    back = recorded(swing, tmp_path)
    theta, velocity = swing["theta"].values, swing["velocity"].values
    assert np.allclose(back.rows("/state/theta", "Scalars:scalars"), theta)
    assert np.allclose(back.rows("/state/omega", "Scalars:scalars"), velocity)
    energy = back.rows("/state/energy", "Scalars:scalars")
    assert np.allclose(energy, velocity**2 / 2 + 1 - np.cos(theta))
    assert np.allclose(back.seconds("/state/theta"), swing["time"].values, atol=1e-5)
    now = back.rows("/phase/data/now", "Points2D:positions")
    assert np.allclose(now[:, 0], synthetic.wrap(theta), atol=1e-6)
    assert np.allclose(now[:, 1], velocity, atol=1e-6)
    points = back.rows("/poincare/data/points", "Points2D:positions")
    assert np.allclose(points[:, 0], swing["section_theta"].values, atol=1e-6)
    assert back.columns["/poincare/data/points"]["period"] == list(range(13))
    assert {"/pendulum/data/trail", "/phase/data/curve", "/summary"} <= set(back.columns)


def test_the_pendulum_hangs_on_its_pivot(tmp_path: Path, swing: xr.Dataset) -> None:
    back = recorded(swing, tmp_path)
    bob = back.rows("/pendulum/data/bob", "Points2D:positions")
    pivot = back.rows("/pendulum/data/pivot", "Points2D:positions")
    arm = back.rows("/pendulum/data/arm", "LineStrips2D:strips")
    assert np.allclose(np.hypot(*(bob - pivot).T), 1.0, atol=1e-5)
    assert np.allclose(arm, np.stack([pivot, bob], axis=1))
    hanging = np.arctan2((bob - pivot)[:, 0], -(bob - pivot)[:, 1])
    assert np.allclose(np.cos(hanging - swing["theta"].values), 1.0, atol=1e-6)


def test_the_pivot_accelerates_as_the_equation_says(tmp_path: Path, swing: xr.Dataset) -> None:
    back = recorded(swing, tmp_path)
    height = back.rows("/pendulum/data/pivot", "Points2D:positions")[:, 1]
    h = float(swing["time"][1] - swing["time"][0])
    every = 20  # the positions have single precision
    acceleration = np.diff(height[::every], 2) / (every * h) ** 2
    drive = 1.7 * np.cos(0.87 * swing["time"].values[::every][1:-1])
    assert np.allclose(acceleration, drive, atol=0.06)


def test_the_curve_does_not_cross_the_plane(tmp_path: Path, swing: xr.Dataset) -> None:
    back = recorded(swing, tmp_path)
    curve = np.array(back.one("/phase/data/curve", "LineStrips2D:strips"))
    assert np.isnan(curve[:, 0]).any(), "this trajectory tumbles"
    assert np.nanmax(np.abs(np.diff(curve[:, 0]))) < 1.0


def test_the_trail_ends_at_the_bob(tmp_path: Path, swing: xr.Dataset) -> None:
    back = recorded(swing, tmp_path)
    trail = back.rows("/pendulum/data/trail", "LineStrips2D:strips")
    bob = back.rows("/pendulum/data/bob", "Points2D:positions")
    assert np.allclose(trail[:, -1], bob)
    assert np.allclose(trail[150, -2], bob[145]), (
        "every fifth of 200 samples: one period, 40 points"
    )
    assert np.allclose(trail[0], bob[0])


@pytest.mark.parametrize("periods", [0, 1])
def test_the_shortest_trajectories(tmp_path: Path, periods: int) -> None:
    back = recorded(synthetic.swing(periods=periods, steps=3, p=0.0), tmp_path)
    assert len(back.rows("/state/theta", "Scalars:scalars")) == 3 * periods + 1


# Files


def test_a_recording_is_whole_or_absent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "a.rrd"
    file.write_bytes(b"old")

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setitem(viewer._KINDS, "basins", (basins.blueprint, interrupted))  # noqa: SLF001
    with pytest.raises(KeyboardInterrupt):
        viewer.record(synthetic.painted(), file)
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]


def test_the_same_map_is_the_same_recording(tmp_path: Path) -> None:
    other = synthetic.painted()
    other["label"][4, 5] = 0
    ids = [
        recorded(dataset, tmp_path).recordings[0].recording_id
        for dataset in (synthetic.painted(), synthetic.painted(seconds=9.0), other)
    ]
    assert ids[0] == ids[1] != ids[2]


def test_errors_are_raised_although_the_library_would_only_warn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rr.set_strict_mode(False)
    monkeypatch.setattr(basins, "_COLOUR_MAPS", {"settle": "no such map"})
    with pytest.raises(ValueError, match="no such map"):
        viewer.record(synthetic.painted(), tmp_path / "a.rrd")
    assert not rr.strict_mode()
    assert not list(tmp_path.iterdir())


def test_bad_input_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"'\.txt'.*\.rrd"):
        viewer.record(synthetic.painted(), tmp_path / "a.txt")
    with pytest.raises(InputError, match=r"kind None.*basins, trajectory"):
        viewer.record(xr.Dataset(), tmp_path / "a.rrd")
    with pytest.raises(InputError, match="list of starts"):
        viewer.record(synthetic.painted().isel(theta=0, drop=True), tmp_path / "a.rrd")
    with pytest.raises(FileNotFoundError, match="folder does not exist"):
        viewer.record(synthetic.painted(), tmp_path / "no" / "a.rrd")
    assert not list(tmp_path.iterdir())


# The window


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
def test_without_a_display_it_says_what_to_do(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    began = time.monotonic()
    with pytest.raises(viewer.NoDisplayError, match=r"DISPLAY.*pendmap view a\.rrd"):
        viewer.open_viewer(recording)
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
def test_a_viewer_that_ends_at_once(
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


def test_the_real_viewer_is_found() -> None:
    said = subprocess.run(
        [window._program(), "--version"],  # noqa: SLF001
        capture_output=True,
        text=True,
        check=True,
    )
    assert "rerun" in said.stdout


# The viewer's own picture: needs a Vulkan driver, if only a software one

DRIVERS = list(Path("/usr/share/vulkan/icd.d").glob("*.json"))

PICTURES: dict[str, tuple[Callable[[], xr.Dataset], float | None]] = {
    "labels": (lambda: synthetic.integrated(p=0.6, cells=30, periods=60), None),
    "unreliable": (lambda: synthetic.painted(**UNRELIABLE), None),
    "finite time": (lambda: synthetic.chaotic(cells=30, periods=4), None),
    "trajectory": (lambda: synthetic.swing(periods=12), 60.0),
}


@contextlib.contextmanager
def headless(folder: Path) -> Iterator[Any]:
    from rerun.experimental import ViewerClient  # noqa: PLC0415 (only where it is wanted)

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


@pytest.mark.viewer
@pytest.mark.skipif(not DRIVERS, reason="no Vulkan driver")
@pytest.mark.parametrize("which", PICTURES)
def test_the_viewers_own_picture(tmp_path: Path, which: str) -> None:
    make, cursor = PICTURES[which]
    dataset = make()
    file = viewer.record(dataset, tmp_path / "a.rrd")
    with headless(tmp_path) as client:
        client.open(str(file))
        if cursor is not None:
            client.set_time("sim_time", duration=cursor, play_state="paused")
        time.sleep(8)  # the viewer's own notices fade
        state = client.get_state()
        picture = Image.open(io.BytesIO(client.take_screenshot())).convert("RGB")
    assert {view.origin for view in state.views} == set(ReadBack(file).views)
    assert [view.reports for view in state.views if view.reports] == []
    colours, counts = np.unique(np.asarray(picture).reshape(-1, 3), axis=0, return_counts=True)
    shares = {tuple(c.tolist()): n / counts.sum() for c, n in zip(colours, counts, strict=True)}
    if which == "labels":
        map_share = 0.25
        for name, share in (("oscillation 2:0", 0.83), ("rotation 1:+1", 0.08)):
            assert shares.get(palette.rgb(name), 0.0) > 0.5 * share * map_share
    elif which == "trajectory":
        assert shares.get((120, 150, 190), 0.0) > 1e-3, "the curve in the phase plane"
    else:
        assert len(shares) > 100
