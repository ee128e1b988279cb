"""Recording of a sweep: the basins of each model on a timeline, beside the measures of all."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap.analysis.sweeps.report import varied_names
from pendmap.charts import basin_sweep as shown
from pendmap.charts import names, palette, plane
from pendmap.files import facts
from pendmap.formatting import typographic
from pendmap.units import Units
from pendmap.viewer import basins, chart, frame

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr


ROOT: Final = "basin"
MODELS: Final = "map"  # Timeline over two parameters: maps row by row


def blueprint(dataset: xr.Dataset) -> rrb.Blueprint:
    """Return the layout: the basins of one model left, the measures of all right."""
    made = shown.chart(dataset, cells=basins.CELLS)
    views = [one.frame.view(one.panel.where, chart.title(one.panel)) for one in chart.places(made)]
    aside = rrb.Vertical(
        rrb.Tabs(*views, active_tab=0),
        rrb.Tabs(
            rrb.TextDocumentView(origin="/legend", name="Legend"),
            rrb.TextDocumentView(origin="/summary", name="Summary"),
        ),
        row_shares=[3, 2],
    )
    return rrb.Blueprint(
        rrb.Horizontal(_frame(dataset).view(ROOT, "Basins of attraction"), aside),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="expanded", timeline=timeline(dataset)),
        auto_layout=False,
        auto_views=False,
    )


def timeline(dataset: xr.Dataset) -> str:
    """Return the name of the timeline: the parameter that varies, its value in seconds."""
    dims = varied_names(dataset)
    return dims[0] if len(dims) == 1 else MODELS


def log(stream: rr.RecordingStream, dataset: xr.Dataset) -> None:
    """Log labels and attractors of each model, and the panels of the chart."""
    every = shown.listed(dataset, None)
    dims = varied_names(dataset)
    around = _frame(dataset)
    made = shown.chart(dataset, cells=basins.CELLS)
    frame.summary(stream, dataset)
    lines = ["| number | attractor | colour |", "|---|---|---|"]
    lines += [f"| {one.id} | {one.name} | {palette.in_words(one.colour)} |" for one in every]
    curves: dict[str, str] = {}
    for panel in made.recorded:
        curves |= chart.legend(panel.marks)
    others = curves.keys() - {one.name for one in every}
    lines += ["", *(f"- {name}: {shade}" for name, shade in curves.items() if name in others)]
    frame.text(stream, "legend", "\n".join(lines))
    around.log(stream, ROOT)
    classes = [(0, "failed", palette.rgb("failed")), (1, "undecided", palette.rgb("undecided"))]
    classes += [(one.id + 1, one.name, palette.parts(one.colour)) for one in every]
    stream.log(ROOT, rr.AnnotationContext(classes), static=True)
    places = chart.places(made)
    for place in places:
        chart.log_panel(stream, place)
    path = f"{ROOT}/data/labels"
    for number, (values, one) in enumerate(_models(dataset, dims)):
        if len(dims) == 1:
            stream.set_time(dims[0], duration=values[0])
        else:
            stream.set_time(MODELS, sequence=number)
        label = plane.pixels(one, one["label"], basins.CELLS)
        if number == 0:
            stream.log(path, around.of_pixels(label.shape), static=True)
        kind: Any = np.uint8 if len(every) + 2 <= np.iinfo(np.uint8).max else np.uint16
        stream.log(path, rr.SegmentationImage((label + 1).astype(kind), opacity=1.0))
        _attractors(stream, dataset, dims, values)
        symbols = zip(dims, values, strict=True)
        text = ", ".join(f"{names.symbol(dim)} = {value:g}" for dim, value in symbols)
        spot = rr.Points2D(
            [[frame.SIDE / 2, -60.0]],
            labels=[typographic(text)],
            radii=[0.0],
            colors=[frame.INK],
            show_labels=True,
        )
        stream.log(f"{ROOT}/axes/values", spot)
        if len(dims) == 1:
            for place in places:
                ends = place.points([values[0]] * 2, place.frame.y)
                strip = rr.LineStrips2D([ends], colors=[frame.INK], radii=rr.Radius.ui_points(1.0))
                stream.log(f"{place.panel.where}/data/now", strip)
    stream.reset_time()


def _attractors(
    stream: rr.RecordingStream, dataset: xr.Dataset, dims: list[str], values: tuple[float, ...]
) -> None:
    """Log the stroboscopic points of the attractors of a model."""
    own = np.ones(dataset.sizes["point"], dtype=bool)
    for dim, value in zip(dims, values, strict=True):
        own &= dataset[f"point_{dim}"].values == value
    theta, velocity = (plane.outer_edges(dataset, axis) for axis in ("theta", "velocity"))
    at = plane.copies(dataset, plane.points(dataset)[own], *theta)
    at = at[(at[:, 1] >= velocity[0]) & (at[:, 1] <= velocity[1])]
    spots = rr.Points2D(
        at.astype(np.float32), colors=[(255, 255, 255)], radii=rr.Radius.ui_points(2.5)
    )
    stream.log(f"{ROOT}/data/attractors", spots)


def _models(dataset: xr.Dataset, dims: list[str]) -> Iterator[tuple[tuple[float, ...], xr.Dataset]]:
    """Yield the values of the parameters and the plane of each model, row by row."""
    kept = dataset[["label", "theta_bounds", "velocity_bounds"]]
    for place in np.ndindex(*(dataset.sizes[dim] for dim in dims)):
        values = tuple(float(dataset[dim].values[k]) for dim, k in zip(dims, place, strict=True))
        yield values, kept.isel(dict(zip(dims, place, strict=True)))


def _frame(dataset: xr.Dataset) -> frame.Frame:
    theta, velocity = (plane.outer_edges(dataset, axis) for axis in ("theta", "velocity"))
    return frame.Frame.phase(theta, velocity, Units.of(facts(dataset)))
