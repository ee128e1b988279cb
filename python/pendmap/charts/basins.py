"""Basin maps: meaningful layers, their order, and their chart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts import legend, names, plane
from pendmap.charts.chart import Chart, Panel, holding
from pendmap.charts.marks import INK, NONE, QUIET, Colours, Ends, Image, Mark, Points
from pendmap.errors import InputError
from pendmap.files import facts
from pendmap.files.toml import packaged
from pendmap.formatting import counted
from pendmap.units import Units

if TYPE_CHECKING:
    import numpy.typing as npt
    import xarray as xr


BYTES_OF_CELL = 64
"""Memory of a cell of a basin map during drawing and recording, bytes."""
FLAT: Final = 0.55  # Height over width of panels below which they are stacked


@dataclass(frozen=True)
class Layer:
    """Variable, title, name of the colour bar, and colour map of a layer."""

    variable: str
    title: str
    unit: str = ""
    colours: str = ""


LAYERS: Final = {
    name: Layer(*about) for name, about in packaged("charts/layers.toml")["basins"].items()
}
"""Layers by the name a user types."""


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 1200) -> Chart:
    """Return a panel for each layer, or for one alone; a figure shows the leading ones."""
    if layer == "section":
        return chart(dataset, cells=cells).only(layer)
    present = [name for name, one in LAYERS.items() if one.variable in dataset]
    if layer not in {None, *present}:
        raise InputError(f"no layer {layer!r} in this map; it has {', '.join(present)}")
    shown = (layer,) if layer else layers(dataset)
    theta, velocity = (plane.outer_edges(dataset, axis) for axis in ("theta", "velocity"))
    units, no_labels = Units.of(facts(dataset)), finite_time(dataset)
    listed = legend.entries(dataset)
    chaos = [entry for entry in listed if entry.chaotic and len(entry.points)]
    if "labels" not in shown and (layer or not no_labels):
        # Without labels the panel of its attractor alone shows chaos.
        listed = [entry for entry in listed if entry.id < 1 or (entry.chaotic and not no_labels)]
    sides = names.phase_plane(theta, velocity, units)
    panels = []
    for one in shown:
        marks = _layer(dataset, one, cells, (theta, velocity), listed)
        if one == shown[0]:
            look: dict[str, Any] = {"marker": "s", "size": 9.0, "edge": QUIET, "edge_width": 0.5}
            squares = ((entry.colour, entry.text) for entry in listed)
            marks += [Points(NONE, NONE, colour=c, name=text, **look) for c, text in squares]
        if one == "labels":
            marks += _attractors(dataset, listed, (theta, velocity))
        root = "basin" if one == "labels" else one
        doubt = warning(dataset) if one == "labels" and not reliable(dataset) else ""
        title = text_of(dataset, LAYERS[one].title)
        panels.append(Panel(one, title, *sides, marks, root=root, warning=doubt))
    leading = panels[: 2 if no_labels or reliable(dataset) else 3]
    if no_labels and layer is None and chaos:
        panels.append(_section(dataset, chaos, units))
        leading.append(panels[-1])
    ratio = names.proportion(theta, velocity, units)
    rows, columns = dataset["label"].shape
    return Chart(
        _title(dataset, shown),
        f"{names.parameters(facts(dataset))};   {columns} × {rows} cells",
        [[panel] for panel in leading] if ratio < FLAT else [leading],
        recorded=panels,
        ratio=ratio,
        tabs=True,
    )


def _title(dataset: xr.Dataset, shown: tuple[str, ...]) -> str:
    if finite_time(dataset):
        every = [str(name) for name in dataset["attractor"].values]
        if every:
            return f"{every[0].capitalize()} takes every start"
        return "No attractors" + (" without damping" if facts(dataset).get("gamma") == 0 else "")
    fractal = not reliable(dataset) and "labels" not in shown[:1]
    return "Fractal basins of attraction" if fractal else "Basins of attraction"


def _layer(
    dataset: xr.Dataset,
    layer: str,
    cells: int,
    window: tuple[Ends, Ends],
    listed: list[legend.Entry],
) -> list[Mark]:
    """Return one layer; cells without a value have the colour of their label."""
    label = plane.pixels(dataset, dataset["label"], cells)
    texts = {entry.id: entry.text for entry in listed}
    classes = [(texts.get(k, ""), colour) for k, colour in legend.colours(dataset).items()]
    path = "labels" if layer == "labels" else "without"
    labels = Image(label.astype(np.int16) + 1, *window, classes=classes, path=path)
    if layer == "labels":
        return [labels]
    mine = plane.pixels(dataset, dataset[LAYERS[layer].variable], cells)
    absent = (label < 0) | (mine < 0 if layer == "settle" else ~np.isfinite(mine))
    values = np.maximum(mine, 1.0 if layer == "settle" else -np.inf).astype(np.float32)
    values[absent] = np.nan
    look = _colours(dataset, layer, values[~absent])
    image = Image(values, *window, colours=look, path="steps" if layer == "settle" else layer)
    return [labels, image] if absent.any() else [image]


def _colours(dataset: xr.Dataset, layer: str, values: npt.NDArray[np.float32]) -> Colours:
    """Return the colour scale of a layer."""
    name, colours = text_of(dataset, LAYERS[layer].unit), LAYERS[layer].colours
    if values.size == 0 or layer == "probability":
        return Colours(name, colours, 0.0, 1.0)
    least, most = float(values.min()), float(values.max())
    if layer == "entropy":
        return Colours(name, colours, 0.0, max(most, 1e-3))
    if layer == "settle":
        high = max(most, least + 1.0)
        return Colours(name, colours, least, high, "log", ticks=plane.log_ticks(least, high))
    if layer == "turns":
        size = np.abs(values)
        top = max(1.0, float(np.ceil(np.quantile(size, 0.98))))
        ticks = [at for at, _ in plane.plain_ticks(-top, top) if at == round(at)]
        over: Any = "both" if size.max() > top else "neither"
        return Colours(name, colours, -top, top, beyond=over, ticks=ticks)
    low, high = (float(q) for q in np.quantile(values, [0.005, 0.995]))
    if high <= low:
        low, high = low - 0.5, high + 0.5
    beyond: Any = (("neither", "max"), ("min", "both"))[least < low][most > high]
    return Colours(name, colours, low, high, beyond=beyond)


def _attractors(
    dataset: xr.Dataset, listed: list[legend.Entry], window: tuple[Ends, Ends]
) -> list[Mark]:
    """Return the points of all attractors, with their copies shifted by 2 pi."""
    marks: list[Mark] = []
    for entry in listed:
        at = plane.copies(dataset, entry.points, *window[0])
        at = at[(at[:, 1] >= window[1][0]) & (at[:, 1] <= window[1][1])]
        look: dict[str, Any] = {"size": 1.1, "order": 4.0, "path": f"attractors/{entry.id}"}
        if entry.chaotic:
            look["name"] = f"points of {legend.typeset(entry.name)}" if len(at) else ""
        else:
            look |= {"size": 5.5, "edge_width": 0.935, "edge": "#ffffff", "halo": INK}
            look |= {"marker": entry.marker, "colour": entry.colour}
            look |= {"clip": False, "order": 5.0, "name": entry.text}
        if len(at) or entry.chaotic:
            marks.append(Points(*at.T, **look))
    return marks


def _section(dataset: xr.Dataset, chaos: list[legend.Entry], units: Units) -> Panel:
    """Return the stroboscopic points of chaotic attractors in a separate plane."""
    dots = [
        Points(*entry.points.T, size=1.1, colour=entry.colour, path=f"attractors/{entry.id}")
        for entry in chaos
    ]
    points = np.concatenate([entry.points for entry in chaos])
    speeds = holding(points[:, 1], margin=0.05)
    sides = names.phase_plane(plane.angles(dataset, points[:, 0]), speeds, units)
    return Panel("section", "its attractor, once a period", *sides, dots, root="basin")


def reliable(dataset: xr.Dataset) -> bool:
    """Return whether the labels agree with those at half the step and under mirroring."""
    return bool(int(facts(dataset).get("labels_reliable", 1)))


def finite_time(dataset: xr.Dataset) -> bool:
    """Return whether labels are meaningless: one chaotic attractor has every start, or none."""
    return bool(dataset.attrs.get("layers") == "finite_time")


def settles(dataset: xr.Dataset) -> bool:
    """Return whether any start settles on an attractor; a map of a sweep has no settle times."""
    return "settle_periods" not in dataset or int(dataset["settle_periods"].max()) >= 0


def warning(dataset: xr.Dataset) -> str:
    """Return the warning that labels are unreliable."""
    share = 100 * float(facts(dataset).get("unreliable", math.nan))
    return f"labels unreliable: {share:.3g} % change under half the step or mirroring"


def layers(dataset: xr.Dataset) -> tuple[str, ...]:
    """Return the meaningful layers of a map, the leading ones first.

    Usually these are labels, then settle time and net turns. If the labels are unreliable, settle
    time and net turns come first; if labels are meaningless, there are only the net turns and the
    finite-time exponent. Settle time is left out if no start settles. Over draws of the parameters
    the probability of the most likely end comes second.
    """
    if finite_time(dataset):
        order: tuple[str, ...] = ("turns", "exponent")
    elif reliable(dataset):
        order = ("labels", "probability", "settle", "turns", "exponent", "entropy")
    else:
        # Three layers lead, and the labels are one of them.
        middle = ("labels", "turns") if "certainty" in dataset else ("turns", "labels")
        order = ("settle", "probability", *middle, "exponent", "entropy")
    here = [name for name in order if LAYERS[name].variable in dataset]
    return tuple(name for name in here if name != "settle" or settles(dataset))


def text_of(dataset: xr.Dataset, text: str) -> str:
    """Return a text of a layer, with the periods, draws and units of a map filled in."""
    a, units = facts(dataset), Units.of(facts(dataset))
    periods = counted(int(a.get("layer_periods", 0)), "period")
    until = "until settled"
    if finite_time(dataset):
        until = f"after {periods}"
    elif not settles(dataset):
        until = f"after {counted(int(a['max_periods']), 'period')}"
    turn = units.own_period.replace(" pi", "π").replace(" ", "")
    return text.format(
        unsure="" if reliable(dataset) else " (unreliable)",
        of="" if float(a.get("p", 1.0)) else f" of {turn}",  # without drive
        until=until,
        periods=periods,
        draws=counted(int(a.get("draws", 0)), "draw"),
        rate=names.per_time(units),
    )
