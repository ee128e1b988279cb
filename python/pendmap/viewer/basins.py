"""Recording of a basin map: labels, attractors, settle time, net turns, exponent."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import rerun as rr
import rerun.blueprint as rrb

from pendmap.charts import basins as layering
from pendmap.charts import legend, palette, plane
from pendmap.charts import names as axis_names
from pendmap.files import facts
from pendmap.formatting import typographic
from pendmap.units import Units
from pendmap.viewer import frame

if TYPE_CHECKING:
    import xarray as xr

CELLS = 4096
"""Most rows and columns of an image; not all graphics processors take larger ones."""

SAMPLE = 1000  # Rows and columns of the sample that gives the limits of a colour scale

_SAME = {name: name for name in ("turns", "exponent", "probability", "entropy")}
ROOTS = {"labels": "basin", "settle": "settle"} | _SAME  # Path at which each layer is logged

_LEAF = {"labels": "labels", "settle": "steps"} | _SAME
_COLOUR_MAPS = {"settle": "viridis", "exponent": "magma"}
_COLOUR_MAPS |= {"probability": "viridis", "entropy": "magma"}
_TURNS_MOST = 30000


def blueprint(dataset: xr.Dataset) -> rrb.Blueprint:
    """Return the layout: one tab per layer, the leading one in front; legend and summary aside."""
    shown = layering.layers(dataset)
    listed = legend.entries(dataset)
    rows = -(-len(listed) // 4)
    tabs = [
        _frame(dataset).view(
            ROOTS[one], _title(dataset, one), below=110.0 * rows if one == "labels" else 0.0
        )
        for one in shown
    ]
    alone = _around_attractors(dataset, listed)
    if alone is not None:
        tabs.append(alone.view(ROOTS["labels"], "Its attractor, once a period"))
    aside = rrb.Vertical(
        rrb.TextDocumentView(origin="/legend", name="Legend"),
        rrb.TextDocumentView(origin="/summary", name="Summary"),
        row_shares=[1, 1],
    )
    return frame.screen(rrb.Tabs(*tabs, active_tab=0), aside, shares=[11, 5])


def log(stream: rr.RecordingStream, dataset: xr.Dataset) -> None:
    """Log every meaningful layer, the attractors and the legend."""
    around = _frame(dataset)
    shown = layering.layers(dataset)
    listed = legend.entries(dataset)
    frame.summary(stream, dataset)
    frame.text(stream, "legend", _legend(dataset, listed))
    for one in shown:
        around.log(stream, ROOTS[one])
        if one in _CLASSES:
            _CLASSES[one](stream, dataset, around)
        else:
            _scalar(stream, dataset, around, one)
        if one == "labels" or not layering.finite_time(dataset):
            _attractors(stream, ROOTS[one], dataset, around, named=one == "labels")
    alone = _around_attractors(dataset, listed)
    if alone is not None:
        alone.log(stream, ROOTS["labels"])
        _attractors(stream, ROOTS["labels"], dataset, alone, named=False)


def _frame(dataset: xr.Dataset) -> frame.Frame:
    theta, velocity = (plane.outer_edges(dataset, axis) for axis in ("theta", "velocity"))
    return frame.Frame.phase(theta, velocity, Units.of(facts(dataset)))


def _around_attractors(dataset: xr.Dataset, listed: list[legend.Entry]) -> frame.Frame | None:
    """Return a frame that contains every attractor's points, for a plane without a map of them."""
    points = np.concatenate([np.empty((0, 2)), *(entry.points for entry in listed)])
    if not (layering.finite_time(dataset) and len(points)):
        return None
    theta, velocity = plane.angles(dataset, points[:, 0]), plane.padded(points[:, 1])
    return frame.Frame.phase(theta, velocity, Units.of(facts(dataset)))


def _title(dataset: xr.Dataset, layer: str) -> str:
    if layer == "labels" and not layering.reliable(dataset):
        return "Labels (unreliable)"
    text = layering.what(dataset, layer) + (" (periods)" if layer == "settle" else "")
    return text[0].upper() + text[1:]


def _image(
    stream: rr.RecordingStream,
    around: frame.Frame,
    layer: str,
    image: rr.SegmentationImage | rr.DepthImage,
    shape: tuple[int, ...],
) -> None:
    path = f"{ROOTS[layer]}/data/{_LEAF[layer]}"
    stream.log(path, around.of_pixels(shape), static=True)
    stream.log(path, image, static=True)


def _classes(dataset: xr.Dataset, shift: int) -> list[Any]:
    """Return class, name and colour of each label, including failed and undecided cells."""
    names = dict(zip(dataset["id"].values, dataset["attractor"].values, strict=True))
    names = {-1: "failed", 0: "undecided"} | {int(i): str(name) for i, name in names.items()}
    shades = legend.colours(dataset)
    return [(i + shift, legend.typeset(n), shades[i + 1]) for i, n in sorted(names.items())]


def _labels(stream: rr.RecordingStream, dataset: xr.Dataset, around: frame.Frame) -> None:
    """Log the labels, shifted by 1 (0 failed, 1 undecided, 2 the first attractor), and a legend."""
    label = plane.pixels(dataset, dataset["label"], CELLS)
    kind = np.uint8 if len(legend.colours(dataset)) <= np.iinfo(np.uint8).max else np.uint16
    shifted = np.add(label, 1, dtype=np.int16).astype(kind)
    stream.log(ROOTS["labels"], rr.AnnotationContext(_classes(dataset, 1)), static=True)
    _image(stream, around, "labels", rr.SegmentationImage(shifted, opacity=1.0), label.shape)
    listed = legend.entries(dataset)
    at = [
        (125.0 + 250.0 * (k % 4), around.height + 170.0 + 110.0 * (k // 4))
        for k in range(len(listed))
    ]
    if listed:
        named = [(legend.typeset(e.name), palette.rgb(e.name, e.kind)) for e in listed]
        frame.legend(stream, "basin/axes/legend", at, named, size=8.0, below=16.0)


def _scalar(
    stream: rr.RecordingStream, dataset: xr.Dataset, around: frame.Frame, layer: str
) -> None:
    """Log a scalar layer; cells without a value have their label's colour on top."""
    array = dataset[layering.VARIABLES[layer]]
    values, sample = (plane.pixels(dataset, array, most) for most in (CELLS, SAMPLE))
    absent = layering.missing(layer, values)
    known = sample[~layering.missing(layer, sample)]
    low, high = 0.0, 1.0
    if layer == "settle":
        high = max(1.0, float(np.quantile(known, 0.995)) if known.size else 1.0)
        whole = np.uint16 if int(values.max()) <= np.iinfo(np.uint16).max else np.float32
        values = np.maximum(values, 0).astype(whole)
    elif layer == "exponent":
        low, high = (float(q) for q in np.quantile(known, [0.005, 0.995])) if known.size else (0, 1)
        low, high = (low, high) if high > low else (low - 0.5, high + 0.5)
        values = values.astype(np.float32, copy=False)
    elif layer == "entropy":
        high = max(float(values.max()), 1e-3)
    look: dict[str, Any] = {
        "colormap": _COLOUR_MAPS[layer],
        "depth_range": [low, high],
        "meter": 1.0,
        "magnification_filter": "nearest",
    }
    _image(stream, around, layer, rr.DepthImage(values, **look), values.shape)
    column = np.linspace(low, high, 256, dtype=np.float32)[:, None]
    around.bar(stream, ROOTS[layer], rr.DepthImage(column, **look), low=low, high=high)
    if absent.any():
        _cover(stream, dataset, around, layer, absent)


def _turns(stream: rr.RecordingStream, dataset: xr.Dataset, around: frame.Frame) -> None:
    """Log the net turns as classes named by their number: class = turns + offset."""
    turns, sample = (plane.pixels(dataset, dataset["net_turns"], n) for n in (CELLS, SAMPLE))
    label = plane.pixels(dataset, dataset["label"], CELLS)
    most = int(min(max(-int(turns.min()), int(turns.max()), 1), _TURNS_MOST))
    offset = most + 1
    classes = np.clip(turns, -most, most)
    classes += offset
    classes = classes.astype(np.uint16)
    classes[label < 0] = 0
    top = max(1.0, float(np.quantile(np.abs(sample), 0.98)))
    span = np.arange(-most, most + 1)
    colours = palette.diverging(span / top)
    context: list[Any] = [(0, "failed", palette.rgb("failed"))]
    context += [
        (int(t) + offset, typographic(f"{t:+d} turns"), c)
        for t, c in zip(span, colours, strict=True)
    ]
    stream.log(ROOTS["turns"], rr.AnnotationContext(context), static=True)
    _image(stream, around, "turns", rr.SegmentationImage(classes, opacity=1.0), classes.shape)
    stream.log("turns/data/turns", rr.AnyValues(class_of_no_turn=offset), static=True)
    column = np.round(np.linspace(-top, top, 256)).astype(int) + offset
    bar = rr.SegmentationImage(column.astype(np.uint16)[:, None], opacity=1.0)
    around.bar(stream, ROOTS["turns"], bar, low=-top, high=top)


def _cover(
    stream: rr.RecordingStream,
    dataset: xr.Dataset,
    around: frame.Frame,
    layer: str,
    absent: npt.NDArray[np.bool_],
) -> None:
    """Log the labels, shifted by 2, of cells without a value over a layer; 0 is transparent."""
    label = plane.pixels(dataset, dataset["label"], CELLS)
    cover = np.where(absent, label + 2, 0).astype(np.uint16)
    path = f"{ROOTS[layer]}/data/without"
    context: list[Any] = [(0, "", (0, 0, 0, 0)), *_classes(dataset, 2)]
    stream.log(path, rr.AnnotationContext(context), static=True)
    stream.log(path, around.of_pixels(cover.shape), static=True)
    stream.log(path, rr.SegmentationImage(cover, opacity=1.0, draw_order=1.0), static=True)


def _attractors(
    stream: rr.RecordingStream,
    root: str,
    dataset: xr.Dataset,
    around: frame.Frame,
    *,
    named: bool,
) -> None:
    """Log the attractors' points; points of orbits have two rings, and a name at the first one."""
    path = f"{root}/data/attractors"
    shown = []
    for entry in legend.entries(dataset):
        at = plane.copies(dataset, entry.points, *around.x)
        at = at[(at[:, 1] >= around.y[0]) & (at[:, 1] <= around.y[1])]
        if len(at):
            shown.append((entry, at, palette.rgb(entry.name, entry.kind)))
    orbits = [each for each in shown if not each[0].chaotic]
    rings = (("outline", 8.0, (30, 30, 30), 41.0), ("ring", 6.8, (250, 250, 250), 42.0))
    for name, size, colour, order in rings if orbits else ():
        places = np.concatenate([at for _, at, _ in orbits])
        radius = rr.Radius.ui_points(size)
        ring = rr.Points2D(places, colors=[colour], radii=radius, draw_order=order)
        stream.log(f"{path}/{name}", ring, static=True)
    if shown:
        points = rr.Points2D(
            np.concatenate([at for _, at, _ in shown]),
            colors=[colour for _, at, colour in shown for _ in at],
            radii=rr.Radius.ui_points(
                [1.2 if e.chaotic else 5.0 for e, at, _ in shown for _ in at]
            ),
            draw_order=43.0,
        )
        stream.log(path, points, static=True)
    if named and orbits:
        texts = [legend.typeset(entry.name) for entry, *_ in orbits]
        tints = [_tint(colour) for *_, colour in orbits]
        frame.write(stream, f"{path}/names", [at[0] for _, at, _ in orbits], texts, colours=tints)


def _tint(colour: tuple[int, int, int]) -> tuple[int, int, int]:
    """Return a colour halfway to white, for text on the map."""
    red, green, blue = ((255 + part) // 2 for part in colour)
    return red, green, blue


def _legend(dataset: xr.Dataset, listed: list[legend.Entry]) -> str:
    """Return the legend as a table."""
    lines = [f"**{axis_names.parameters(facts(dataset))}**", ""]
    if not layering.reliable(dataset):
        lines += [f"**{layering.warning(dataset)}**", ""]
    if not listed:
        lines += ["No attractors."]
        return "\n".join(lines)
    twins = any(e.twin for e in listed)
    lines += [
        f"| attractor | share | colour |{' mirror twin |' * twins}",
        "|---" * (3 + twins) + "|",
    ]
    lines += [
        f"| {legend.typeset(e.name)} | {e.share} | {palette.describe(e.name, e.kind)} |"
        + f" {legend.typeset(e.twin)} |" * twins
        for e in listed
    ]
    return "\n".join(lines)


_CLASSES = {"labels": _labels, "turns": _turns}
