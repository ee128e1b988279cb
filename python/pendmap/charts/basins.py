"""Basin maps: meaningful layers, their order, and their chart."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap import _core
from pendmap.analysis.orbit_table import chaotic
from pendmap.charts import legend, names, plane
from pendmap.charts.chart import Chart, Panel, holding
from pendmap.charts.marks import INK, NONE, QUIET, Colours, Ends, Image, Mark, Points
from pendmap.errors import InputError
from pendmap.files import facts
from pendmap.formatting import counted, typographic, with_error
from pendmap.units import Units

if TYPE_CHECKING:
    import numpy.typing as npt
    import xarray as xr


BYTES_OF_CELL = 64
"""Memory of a cell of a basin map during drawing and recording, bytes."""

BYTES_OF_VALUE = 16  # Memory of a value of any other dataset during drawing, bytes

VARIABLES = {
    "labels": "label",
    "settle": "settle_periods",
    "turns": "net_turns",
    "exponent": "finite_time_exponent",
    "probability": "certainty",
    "entropy": "label_entropy",
}
"""Layers by the name a user types, and the variable of each."""

FLAT: Final = 0.55  # Height over width of panels below which they are stacked
_COLOUR_MAPS: Final = {
    "settle": "viridis",
    "turns": "RdBu_r",
    "exponent": "magma",
    "probability": "cividis",
    "entropy": "magma",
}


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 1200) -> Chart:
    """Return a panel for each layer, or for one alone; a figure shows the leading ones."""
    shown = (named(dataset, layer),) if layer else layers(dataset)
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
        marks = _layer(dataset, one, cells, (theta, velocity), listed, shown)
        if one == shown[0]:
            marks += _names(dataset, listed, shown)
        if one == "labels":
            marks += _attractors(dataset, listed, (theta, velocity), shown)
        root = "basin" if one == "labels" else one
        doubt = warning(dataset) if one == "labels" and not reliable(dataset) else ""
        panels.append(Panel(one, what(dataset, one), *sides, marks, root=root, warning=doubt))
    leading = panels[: 2 if no_labels or reliable(dataset) else 3]
    if no_labels and layer is None and chaos:
        panels.append(_section(dataset, chaos, units))
        leading.append(panels[-1])
    ratio = names.proportion(theta, velocity, units)
    rows, columns = dataset["label"].shape
    subtitle = [names.parameters(facts(dataset)), f"{columns} × {rows} cells"]
    if layer is None and no_labels:
        subtitle.append(exponents(dataset))
    elif layer is None and not reliable(dataset):
        subtitle.append(transients(dataset))
    return Chart(
        _title(dataset, shown),
        ";   ".join(filter(None, subtitle)),
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


def _names(dataset: xr.Dataset, listed: list[legend.Entry], shown: tuple[str, ...]) -> list[Mark]:
    """Return the legend: each basin's colour."""
    look: dict[str, Any] = {"marker": "s", "size": 9.0, "edge": QUIET, "edge_width": 0.5}
    return [
        Points(NONE, NONE, colour=entry.colour, name=_text(dataset, entry, shown), **look)
        for entry in listed
    ]


def _text(dataset: xr.Dataset, entry: legend.Entry, shown: tuple[str, ...]) -> str:
    """Return the text of an attractor in the legend."""
    if finite_time(dataset) and entry.chaotic:
        return f"{legend.typeset(entry.name)}, {entry.share} of the starts"
    dots = entry.chaotic and "labels" in shown and len(entry.points)
    return f"{entry.text} (dots: its points)" if dots else entry.text


def _layer(  # noqa: PLR0913, PLR0917 (parts of an image)
    dataset: xr.Dataset,
    layer: str,
    cells: int,
    window: tuple[Ends, Ends],
    listed: list[legend.Entry],
    shown: tuple[str, ...],
) -> list[Mark]:
    """Return one layer; cells without a value have the colour of their label."""
    label = plane.pixels(dataset, dataset["label"], cells)
    texts = {entry.id: _text(dataset, entry, shown) for entry in listed}
    colours = ("#{:02x}{:02x}{:02x}".format(*row) for row in legend.colours(dataset))
    classes = [(texts.get(number, ""), colour) for number, colour in enumerate(colours, -1)]
    path = "labels" if layer == "labels" else "without"
    labels = Image(label.astype(np.int16) + 1, *window, classes=classes, path=path)
    if layer == "labels":
        return [labels]
    mine = plane.pixels(dataset, dataset[VARIABLES[layer]], cells)
    absent, values = missing(layer, mine) | (label < 0), mine.astype(np.float32)
    if layer == "settle":
        np.maximum(values, 1.0, out=values)
    values[absent] = np.nan
    look = _colours(dataset, layer, values[~absent])
    image = Image(values, *window, colours=look, path="steps" if layer == "settle" else layer)
    return [labels, image] if absent.any() else [image]


def _colours(dataset: xr.Dataset, layer: str, values: npt.NDArray[np.float32]) -> Colours:
    """Return the colour scale of a layer."""
    name, colours = unit(dataset, layer), _COLOUR_MAPS[layer]
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
        powers = (10**k for k in itertools.count())
        step = next(s for m in powers for s in (m, 2 * m, 5 * m) if 3 * s >= top)
        ticks = [float(k) for k in range(-3 * step, 3 * step + 1, step) if abs(k) <= top]
        over: Any = "both" if size.max() > top else "neither"
        return Colours(name, colours, -top, top, beyond=over, ticks=ticks)
    low, high = (float(q) for q in np.quantile(values, [0.005, 0.995]))
    if high <= low:
        low, high = low - 0.5, high + 0.5
    beyond: Any = (("neither", "max"), ("min", "both"))[least < low][most > high]
    return Colours(name, colours, low, high, beyond=beyond)


def _attractors(
    dataset: xr.Dataset,
    listed: list[legend.Entry],
    window: tuple[Ends, Ends],
    shown: tuple[str, ...],
) -> list[Mark]:
    """Return the points of all attractors, with their copies shifted by 2 pi."""
    marks: list[Mark] = []
    for entry in listed:
        at = plane.copies(dataset, entry.points, *window[0])
        at = at[(at[:, 1] >= window[1][0]) & (at[:, 1] <= window[1][1])]
        look: dict[str, Any] = {"size": 1.1, "order": 4.0, "path": f"attractors/{entry.id}"}
        if not entry.chaotic:
            look |= {"size": 5.5, "edge_width": 0.935, "edge": "#ffffff", "halo": INK}
            look |= {"marker": entry.marker, "colour": entry.colour}
            look |= {"clip": False, "order": 5.0, "name": _text(dataset, entry, shown)}
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


def missing(layer: str, values: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    """Return which values of a layer are missing: of cells that never settled or failed."""
    return np.asarray(values < 0 if layer == "settle" else ~np.isfinite(values))


def reliable(dataset: xr.Dataset) -> bool:
    """Return whether the labels agree with those at half the step and under mirroring."""
    return bool(int(facts(dataset).get("labels_reliable", 1)))


def finite_time(dataset: xr.Dataset) -> bool:
    """Return whether labels are meaningless: one chaotic attractor has every start, or none."""
    return bool(dataset.attrs.get("layers") == "finite_time")


def refuse_too_large(dataset: xr.Dataset) -> None:
    """Raise MemoryError for a dataset whose image would need more memory than is free."""
    _core.reckon(
        "values", sum(values.size for values in dataset.variables.values()), BYTES_OF_VALUE
    )


def settles(dataset: xr.Dataset) -> bool:
    """Return whether any start settles on an attractor; a map of a sweep has no settle times."""
    return "settle_periods" not in dataset or int(dataset["settle_periods"].max()) >= 0


def warning(dataset: xr.Dataset) -> str:
    """Return the warning that labels are unreliable."""
    share = 100 * float(facts(dataset).get("unreliable", math.nan))
    return f"labels unreliable: {share:.3g} % change under half the step or mirroring"


def transients(dataset: xr.Dataset) -> str:
    """Return mean and longest settle time and the basin entropy in one line, if known."""
    keys = ("mean_settle", "longest_settle", "basin_entropy")
    mean, longest, entropy = (float(facts(dataset).get(key, math.nan)) for key in keys)
    settle = [f"mean {mean:.3g}"] if mean >= 0 else []
    settle += [f"longest {longest:g}"] if longest >= 0 else []
    parts = [f"settle time: {', '.join(settle)} periods"] if settle else []
    parts += [f"basin entropy {entropy:.3g}"] if math.isfinite(entropy) else []
    return "; ".join(parts)


def exponents(dataset: xr.Dataset) -> str:
    """Return the largest exponents of the chaotic attractors in one line; empty if unknown."""
    which = chaotic(dataset)
    values = dataset["exponent"].values[which]
    errors = dataset.get("exponent_stderr", dataset["exponent"] * math.nan).values[which]
    known = [x for x in values if math.isfinite(x)]
    listed = ", ".join(f"{x:.3g}" for x in known)
    if len(known) == len(errors) == 1 and math.isfinite(errors[0]):
        listed = typographic(with_error(known[0], errors[0]))
    return f"largest exponent {listed} {names.per_time(Units.of(facts(dataset)))}" if known else ""


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
    present = [layer for layer in order if VARIABLES[layer] in dataset]
    if "settle" in present and not settles(dataset):
        present.remove("settle")
    return tuple(present)


def named(dataset: xr.Dataset, layer: str) -> str:
    """Return the layer of a name or variable; raise InputError if the map has none."""
    for name, variable in VARIABLES.items():
        if layer in (name, variable) and variable in dataset:
            return name
    known = ", ".join(name for name, variable in VARIABLES.items() if variable in dataset)
    raise InputError(f"no layer {layer!r} in this map; it has {known}")


def what(dataset: xr.Dataset, layer: str) -> str:
    """Return the quantity of a layer in words, for a title."""
    periods = counted(int(dataset.attrs.get("layer_periods", 0)), "period")
    draws = counted(int(dataset.attrs.get("draws", 0)), "draw")
    turns = "until settled"
    if finite_time(dataset):
        turns = f"after {periods}"
    elif not settles(dataset):
        turns = f"after {counted(int(dataset.attrs['max_periods']), 'period')}"
    unsure = "" if reliable(dataset) else " (unreliable)"
    return {
        "labels": f"basins of attraction{unsure}",
        "settle": "settle time",
        "turns": f"net turns {turns}",
        "exponent": f"finite-time exponent over {periods}",
        "probability": f"most likely end over {draws}",
        "entropy": f"doubt of the end over {draws}",
    }[layer]


def unit(dataset: xr.Dataset, layer: str) -> str:
    """Return the unit of a scalar layer, for a colour bar; without drive also the period."""
    driven = float(facts(dataset).get("p", 1.0)) != 0.0
    units = Units.of(facts(dataset))
    mine = "" if driven else f" of {units.own_period.replace(' pi', 'π').replace(' ', '')}"
    return {
        "settle": f"periods{mine} to settle",
        "turns": "net turns",
        "exponent": f"exponent {names.per_time(units)}",
        "probability": "probability",
        "entropy": "entropy (nat)",
    }[layer]
