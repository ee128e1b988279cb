"""The recording of a bifurcation diagram: points, exponents, sweeps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap.charts import bifurcation as drawn
from pendmap.charts import names, plane
from pendmap.units import Units
from pendmap.viewer import frame

if TYPE_CHECKING:
    import numpy.typing as npt
    import xarray as xr


def blueprint(dataset: xr.Dataset) -> rrb.Blueprint:
    """Return the layout: angles, velocities and exponents in tabs, legend and summary beside."""
    tabs = [frame_of.view(root, title) for root, title, frame_of in _frames(dataset)]
    aside = rrb.Vertical(
        rrb.TextDocumentView(origin="/legend", name="Legend"),
        rrb.TextDocumentView(origin="/summary", name="Summary"),
    )
    return frame.screen(rrb.Tabs(*tabs, active_tab=0), aside, shares=[11, 5])


def log(stream: rr.RecordingStream, dataset: xr.Dataset) -> None:
    """Log the points of each family, its exponents, and where the sweeps are on it."""
    frame.summary(stream, dataset)
    every = drawn.families(dataset)
    for root, _, around in _frames(dataset):
        around.log(stream, root)
    for k, one in enumerate(every):
        colour = one.rgb
        size = 0.7 if "chaos" in one.name else 1.5
        for root, column in (("bifurcation", 1), ("velocity", 2)):
            at = one.points[:, [0, column]]
            _points(stream, f"{root}/data/{k}/points", at, colour, size)
        _points(stream, f"exponent/data/{k}/points", one.exponents, colour, 1.5)
    values = dataset[str(dataset.attrs["varied"])].values
    low, high = plane.angles(dataset, dataset["point_theta"].values)
    for name, height in (("up", 0.025), ("down", 0.055)):
        for k, one in enumerate(every):
            on = values[getattr(one, name)]
            at = np.stack([on, np.full(on.size, high + height * (high - low))], axis=1)
            _points(stream, f"bifurcation/data/{k}/{name}", at, one.rgb, 2.0)
    lines = ["| attractor | colour |", "|---|---|"]
    lines += [f"| {one.text} | {one.shade} |" for one in every[: drawn.MOST]]
    lines += ["", "The two lines above the angles: on which attractor the sweep up (lower) and the"]
    lines += ["sweep down (upper) are."]
    frame.text(stream, "legend", "\n".join(lines))


def _points(
    stream: rr.RecordingStream,
    path: str,
    at: npt.NDArray[np.float64],
    colour: tuple[int, int, int],
    size: float,
) -> None:
    known = at[np.isfinite(at).all(axis=1)].astype(np.float32)
    if len(known):
        radius = rr.Radius.ui_points(size)
        stream.log(path, rr.Points2D(known, colors=[colour], radii=radius), static=True)


def _frames(dataset: xr.Dataset) -> list[tuple[str, str, frame.Frame]]:
    units = Units.of(dataset.attrs)
    across, name = drawn.across(dataset), drawn.name(dataset)
    known = dataset["entry_exponent"].values
    known = known[np.isfinite(known)]
    speeds = plane.padded(np.append(dataset["point_velocity"].values, 0.0))
    growth = plane.padded(np.append(known, 0.0))
    exponent = f"exponent {names.per_time(units)}"
    angles = plane.angles(dataset, dataset["point_theta"].values)
    return [
        ("bifurcation", "Angles", frame.Frame(across, angles, axes=(name, names.ANGLE))),
        ("velocity", "Velocities", frame.Frame(across, speeds, axes=(name, names.speed(units)))),
        ("exponent", "Exponents", frame.Frame(across, growth, axes=(name, exponent))),
    ]
