"""The recording of lifetimes: the survival curve with its tail, and where that begins."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt
import rerun.blueprint as rrb

from pendmap.charts import lifetime as drawn
from pendmap.charts import palette
from pendmap.viewer import frame
from pendmap.viewer.panel import Panel

if TYPE_CHECKING:
    import rerun as rr
    import xarray as xr

Floats = npt.NDArray[np.float64]

_FIT: Final = (213, 94, 0)


def blueprint(dataset: xr.Dataset) -> rrb.Blueprint:
    """Return the layout: survival and the tail's mean left, legend and summary right."""
    views = [panel.view(root, name) for root, (panel, name) in _panels(dataset).items()]
    aside = rrb.Vertical(
        rrb.TextDocumentView(origin="/legend", name="Legend"),
        rrb.TextDocumentView(origin="/summary", name="Summary"),
    )
    return frame.screen(rrb.Vertical(*views), aside, shares=[3, 2])


def log(stream: rr.RecordingStream, dataset: xr.Dataset) -> None:
    """Log panels with axes of their own; nothing moves."""
    frame.summary(stream, dataset)
    panels = _panels(dataset)
    for root, (panel, _) in panels.items():
        panel.log(stream, root)
    lines = ["- all starts: grey, thick"]
    survival = panels["survival"][0]
    for number, curve in enumerate(drawn.curves(dataset)):
        colour = palette.rgb(curve.name, curve.kind) if curve.name else frame.INK
        path = f"survival/data/{number}"
        own = _columns(curve.periods, np.log10(curve.share))
        survival.strips(stream, path, [own], colour, 1.2 if curve.name else 2.5)
        if curve.name:
            says = palette.describe(curve.name, curve.kind)
            lines.append(f"- those that {curve.text} captures: {says}")
    fit = drawn.fit(dataset)
    if fit is not None:
        curves = [_columns(fit.periods, np.log10(y)) for y in (fit.share, fit.low, fit.high)]
        middle, band = survival.within(curves[:1]), survival.within(curves[1:])
        survival.strips(stream, "survival/data/tail", middle, _FIT, 1.5)
        survival.strips(stream, "survival/data/band", band, _FIT, 0.6)
        lines.append(f"- {fit.text}: vermillion, two standard errors thin")
    frame.text(stream, "legend", "\n".join(lines))
    if "tail" in panels:
        tail = panels["tail"][0]
        begin, mean = dataset["tail_begin"].values, dataset["tail_mean"].values
        error = dataset["tail_stderr"].values
        bars = [
            np.array([[at, value - wide], [at, value + wide]])
            for at, value, wide in zip(begin, mean, error, strict=True)
        ]
        tail.strips(stream, "tail/data/mean", [_columns(begin, mean)], frame.INK, 1.5)
        tail.strips(stream, "tail/data/error", bars, frame.INK, 0.6)
        if fit is not None:
            level = _columns(np.array(tail.x), np.full(2, dataset.attrs["mean_periods"]))
            tail.strips(stream, "tail/data/fitted", [level], _FIT, 1.5)


def _columns(x: npt.ArrayLike, y: npt.ArrayLike) -> Floats:
    return np.stack([np.asarray(x, dtype=float), np.asarray(y, dtype=float)], axis=1)


def _panels(dataset: xr.Dataset) -> dict[str, tuple[Panel, str]]:
    all_of = drawn.curves(dataset)
    periods = np.concatenate([curve.periods for curve in all_of])
    share = np.log10(np.concatenate([curve.share for curve in all_of]))
    lowest = -np.log10(float(dataset.attrs["starts"]))
    panel = Panel.holding(periods, np.append(share, lowest), "periods", "log10 of share alive")
    panels = {"survival": (panel, "Share of starts still alive")}
    if dataset.sizes["tail_begin"] > 1:
        mean, error = dataset["tail_mean"].values, dataset["tail_stderr"].values
        begin = dataset["tail_begin"].values.astype(float)
        both = np.concatenate([mean - error, mean + error])
        panel = Panel.holding(
            np.append(begin, 0.0), both, "where the tail begins (periods)", "mean time left"
        )
        panels["tail"] = panel, "Mean time left, against where the tail begins"
    return panels
