"""The recording of a map over two parameters: kinds of attractor, exponent, how many coexist."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap.charts import palette
from pendmap.charts import parameter_map as drawn
from pendmap.viewer import frame

if TYPE_CHECKING:
    import xarray as xr

SIZE, STRIPE = 1200, 8
"""Pixels of the picture of kinds, and of a stripe in it."""

CELLS = 4096
"""Rows and columns of an image at most: graphics processors take no larger ones for sure."""

_FIELDS = ("exponent", "attractors", "undecided")


def blueprint(dataset: xr.Dataset) -> rrb.Blueprint:
    """Return the layout: a tab a layer, legend and summary beside it."""
    around = _frame(dataset)
    tabs = [around.view("kinds", "Kinds of attractor; stripes: they coexist")]
    for one in _fields(dataset):
        text = drawn.said(dataset, one)
        tabs.append(around.view(one, text[0].upper() + text[1:]))
    aside = rrb.Vertical(
        rrb.TextDocumentView(origin="/legend", name="Legend"),
        rrb.TextDocumentView(origin="/summary", name="Summary"),
    )
    return frame.screen(rrb.Tabs(*tabs, active_tab=0), aside, shares=[11, 5])


def log(stream: rr.RecordingStream, dataset: xr.Dataset) -> None:
    """Log the kinds as a segmentation, the other layers as colours, and the legend."""
    frame.summary(stream, dataset)
    around = _frame(dataset)
    listed = drawn.kinds(dataset)
    around.log(stream, "kinds")
    context = [(k, kind.name, palette.parts(kind.colour)) for k, kind in enumerate(listed)]
    stream.log("kinds", rr.AnnotationContext(context), static=True)
    image = drawn.striped(dataset, SIZE, STRIPE)
    stream.log("kinds/data/kinds", around.of_pixels(image.shape), static=True)
    stream.log("kinds/data/kinds", rr.SegmentationImage(image, opacity=1.0), static=True)
    curves = drawn.curves(dataset)
    for k, (_, parts) in enumerate(curves.values()):
        (left, right), (bottom, top) = drawn.edges(dataset)
        strips = frame.pieces(parts, (left, bottom), (right, top))
        if strips:
            thin = rr.Radius.ui_points(1.0)
            curve = rr.LineStrips2D(strips, colors=[(20, 20, 20)], radii=thin, draw_order=50.0)
            stream.log(f"kinds/data/curves/{k}", curve, static=True)
    lines = ["| kind | of the cells | colour |", "|---|---|---|"]
    lines += [f"| {kind.name} | {100 * kind.presence:.2g} % | {kind.shade} |" for kind in listed]
    if curves:
        lines += ["", f"Black lines: {'; '.join(curves)}."]
    frame.text(stream, "legend", "\n".join(lines))
    for one in _fields(dataset):
        values = drawn.layer(dataset, one, CELLS)
        finite = values[np.isfinite(values)]
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
        if one == "exponent" and finite.size:
            low, high = (float(q) for q in np.quantile(finite, [0.01, 0.99]))
        high = max(high, low + 1e-9)
        around.log(stream, one)
        # Chaos is red and order blue; other quantities have the same scale about their middle.
        middle, half = (0.0, max(abs(low), abs(high))) if one == "exponent" else (low, high - low)
        known = np.isfinite(values)
        scaled = np.where(known, (values - middle) / half, 0.0).ravel()
        shades = palette.diverging(scaled).reshape(*values.shape, 3)
        shades[~known] = palette.rgb("undecided")
        stream.log(f"{one}/data/values", around.of_pixels(values.shape), static=True)
        stream.log(f"{one}/data/values", rr.Image(shades), static=True)
        bar = np.linspace(low, high, 256)
        colours = palette.diverging((bar - middle) / half).reshape(256, 1, 3)
        around.bar(stream, one, rr.Image(colours), low=low, high=high)


def _fields(dataset: xr.Dataset) -> tuple[str, ...]:
    """Return the layers beside the kinds; over draws also how sure they are."""
    return (*(("certainty",) if "certainty" in dataset else ()), *_FIELDS)


def _frame(dataset: xr.Dataset) -> frame.Frame:
    across, up = drawn.edges(dataset)
    return frame.Frame(across, up, axes=drawn.axes(dataset))
