"""The recording of an exponent: growth along the start, the running mean, the attractor."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt
import rerun as rr
import rerun.blueprint as rrb

from pendmap.charts import lyapunov as drawn
from pendmap.charts import names, palette, plane
from pendmap.units import Units
from pendmap.viewer import frame
from pendmap.viewer.panel import Panel

if TYPE_CHECKING:
    import xarray as xr

Floats = npt.NDArray[np.float64]

_LINE: Final = (86, 120, 175)
_MEAN: Final = (213, 94, 0)
_SIGMAS: Final = 2.0
_BINS: Final = 60


def blueprint(dataset: xr.Dataset) -> rrb.Blueprint:
    """Return the layout: growth and exponent left; the attractor, where there is one, and text."""
    views: list[rrb.View] = [
        panel.view(root, name) for root, (panel, name) in _panels(dataset).items()
    ]
    aside: list[rrb.View] = [rrb.TextDocumentView(origin="/summary", name="Summary")]
    if dataset.sizes["point"]:
        aside.insert(0, _frame(dataset).view("attractor", "Attractor, once a period"))
    return frame.screen(rrb.Vertical(*views), rrb.Vertical(*aside), shares=[3, 2])


def log(stream: rr.RecordingStream, dataset: xr.Dataset) -> None:
    """Log panels with axes of their own; nothing moves."""
    frame.summary(stream, dataset)
    panels = _panels(dataset)
    for root, (panel, _) in panels.items():
        panel.log(stream, root)
    growth = _columns(dataset["elapsed"].values, dataset["growth"].values)
    panels["growth"][0].strips(stream, "growth/data/own", [growth], _LINE, 1.5)
    value = float(dataset.attrs["exponent"])
    for root in ("average", "exponent"):
        if root not in panels:
            continue
        panel = panels[root][0]
        for name, lines in _exponents(dataset).items():
            panel.strips(stream, f"{root}/data/{name}", lines, _LINE, 1.5 if name == "own" else 0.8)
        if math.isfinite(value):
            level = _columns(np.array(panel.x), np.full(2, value))
            panel.strips(stream, f"{root}/data/value", [level], _MEAN, 1.5)
    if "distribution" in panels:
        panel = panels["distribution"][0]
        panel.strips(stream, "distribution/data/density", [_density(dataset)], _LINE, 1.5)
        mean = _columns(np.full(2, value), np.array(panel.y))
        panel.strips(stream, "distribution/data/value", [mean], _MEAN, 1.5)
    if dataset.sizes["point"]:
        _attractor(stream, dataset)


def _columns(x: npt.ArrayLike, y: npt.ArrayLike) -> Floats:
    return np.stack([np.asarray(x, dtype=float), np.asarray(y, dtype=float)], axis=1)


def _exponents(dataset: xr.Dataset) -> dict[str, list[Floats]]:
    """The running mean of chaos with its band; else exponents along the start's trajectory."""
    if not dataset.sizes["window"]:
        return {"own": [_columns(*drawn.sliding(dataset))]}
    periods = np.log10(dataset["averaged"].values)
    mean, error = dataset["running_exponent"].values, dataset["running_stderr"].values
    own = {"own": [_columns(periods, mean)]}
    if math.isnan(dataset.attrs["stderr"]):
        return own
    return own | {"band": [_columns(periods, mean + way * _SIGMAS * error) for way in (-1, 1)]}


def _density(dataset: xr.Dataset) -> Floats:
    density, edges = np.histogram(
        dataset["finite_time_exponent"].values.ravel(), bins=_BINS, density=True
    )
    return _columns(np.repeat(edges, 2), np.concatenate([[0.0], np.repeat(density, 2), [0.0]]))


def _panels(dataset: xr.Dataset) -> dict[str, tuple[Panel, str]]:
    units = Units.of(dataset.attrs)
    rate = f"\N{GREEK SMALL LETTER LAMDA} ({names.per_time(units)})"
    window = dataset.attrs["window"]
    growth = np.append(dataset["growth"].values, 0.0)
    elapsed = np.array(drawn.elapsed(dataset))
    panels = {
        "growth": (
            Panel.holding(elapsed, growth, "periods since the start", "ln |dx|"),
            "Growth along the start's own trajectory",
        )
    }
    lines = [line for own in _exponents(dataset).values() for line in own]
    all_of = np.concatenate(lines)
    if dataset.sizes["window"]:
        x, said = "log10 of the periods averaged", f"Mean over {dataset.attrs['trajectories']}"
        panel = Panel.holding(all_of[:, 0], all_of[:, 1], x, rate)
        panels["average"] = panel, f"{said} trajectories"
        density = _density(dataset)
        panel = Panel.holding(density[:, 0], density[:, 1], rate, "density")
        panels["distribution"] = panel, f"Exponents over {window} periods"
    else:
        shown = np.append(all_of[:, 1], 0.0)
        panel = Panel.holding(elapsed, shown, "periods since the start, last of each", rate)
        panels["exponent"] = panel, f"Exponent over {window} periods"
    return panels


def _frame(dataset: xr.Dataset) -> frame.Frame:
    speeds = plane.padded(dataset["point_velocity"].values)
    angles = plane.angles(dataset, dataset["point_theta"].values)
    return frame.Frame(angles, speeds, Units.of(dataset.attrs))


def _attractor(stream: rr.RecordingStream, dataset: xr.Dataset) -> None:
    name, kind = (str(dataset[key].values[0]) for key in ("attractor", "kind"))
    around = _frame(dataset)
    around.log(stream, "attractor")
    points = _columns(dataset["point_theta"].values, dataset["point_velocity"].values)
    at = plane.copies(dataset, points, *around.x).astype(np.float32)
    size = rr.Radius.ui_points(1.5 if kind.endswith("chaos") else 5.0)
    shown = rr.Points2D(at, colors=[palette.rgb(name, kind)], radii=size)
    stream.log("attractor/data/points", shown, static=True)
