"""Sweeps: shares of the attractors stacked along a parameter, or maps over two."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.orbit_table import attractors_of
from pendmap.analysis.sweep_table import varied_names
from pendmap.charts import names, palette, parameters, plane
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.legend import typeset
from pendmap.charts.marks import (
    DASHED,
    INK,
    QUIET,
    Band,
    Colours,
    Image,
    Level,
    Line,
    Mark,
    Points,
    Text,
    bars,
)
from pendmap.files import facts
from pendmap.formatting import typographic
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr

    from pendmap.charts.marks import Ends, Floats


MOST: Final = 12  # Greatest number of attractors that a legend names; all others are grey
OTHERS: Final = "#c9c9c9"  # Colour of the others
LAYERS: Final = {
    "entropy": ("basin_entropy", "basin entropy", "nat"),
    "boundary": ("boundary_basin_entropy", "entropy of the boundary", "nat"),
    "uncertainty": ("uncertainty_exponent", "uncertainty exponent", ""),
    "attractors": ("attractors", "attractors that coexist", ""),
    "main": ("fraction", "share of the starts", ""),
    "undecided": ("undecided", "share of the starts undecided", ""),
}
"""Layers over two parameters by the name a user types: variable, title and unit."""
_LEADING: Final = ("entropy", "attractors", "main")
_SIZE: Final = (7.4, 8.4)  # Size of a figure over one parameter, inches
_HEIGHTS: Final = {"fraction": 2.6, "entropy": 1.2, "uncertainty": 1.2, "exponent": 1.3}


@dataclass(frozen=True)
class Branch:
    """An attractor of a sweep, with its colour."""

    id: int
    name: str
    colour: str


def listed(dataset: xr.Dataset, most: int | None = MOST) -> list[Branch]:
    """Return the attractors in the order of their numbers; all but ``most`` have one grey.

    Those of equal plain names have successive colours of their family.
    """
    share = dataset["fraction"].sum(varied_names(dataset)).values
    if most is not None and share.size == most + 1:
        most = None
    named = set(np.argsort(-share, kind="stable")[:most].tolist())
    seen: Counter[str] = Counter()
    branches = []
    chosen = dataset["colour"].values.tolist() if "colour" in dataset else [""] * share.size
    for k, one in enumerate(attractors_of(dataset, "branch_")):
        colour = chosen[k] or palette.colour(one, seen[one.plain])
        seen[one.plain] += 1
        name = typeset(str(dataset["attractor"].values[k]))
        branches.append(Branch(k + 1, *((name, colour) if k in named else ("", OTHERS))))
    return branches


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 1200) -> Chart:
    """Return shares, entropies and exponents along a parameter, or maps over two."""
    dims = varied_names(dataset)
    dataset = dataset.transpose(..., "attractor")
    rows, columns = dataset.sizes["velocity"], dataset.sizes["theta"]
    number = math.prod(dataset.sizes[one] for one in dims)
    fixed = names.parameters(facts(dataset), dims)
    subtitle = f"{fixed};   {number} maps of {columns} × {rows} cells"
    titles = f"Basins along {parameters.over(dims)}", subtitle
    if len(dims) == 1:
        return _line(dataset, dims[0], titles, layer)
    first, second = dims
    shares = {f"share {k + 1}": k for k in range(dataset.sizes["attractor"])}
    parameters.check_layer(layer, [*LAYERS, *shares], "this sweep: ")
    dataset = dataset.transpose(second, first, ...)

    def make(name: str, across: Ends, up: Ends) -> tuple[str, list[Mark]]:
        title, values, colours = _layer(dataset, name, shares.get(name), cells)
        return title, [Image(values, across, up, colours=colours, path="values")]

    shown = [layer] if layer else list(LAYERS)
    return parameters.layers(dataset, (first, second), titles, make, shown, _LEADING)


def models(
    dataset: xr.Dataset, cells: int
) -> Iterator[tuple[list[tuple[str, float]], Panel, float]]:
    """Yield the parameters of each model, row by row, its basins, and their height over width."""
    dims, units = varied_names(dataset), Units.of(facts(dataset))
    theta, velocity = (plane.outer_edges(dataset, axis) for axis in ("theta", "velocity"))
    sides, ratio = (
        names.phase_plane(theta, velocity, units),
        names.proportion(theta, velocity, units),
    )
    classes = [("failed", palette.FAILED), ("undecided", palette.UNDECIDED)]
    classes += [(one.name, one.colour) for one in listed(dataset, None)]
    planes = dataset[["label", "theta_bounds", "velocity_bounds"]]
    for place in np.ndindex(*(dataset.sizes[dim] for dim in dims)):
        at = [(dim, float(dataset[dim].values[k])) for dim, k in zip(dims, place, strict=True)]
        one = planes.isel(dict(zip(dims, place, strict=True)))
        label = plane.pixels(one, one["label"], cells)
        here = np.ones(dataset.sizes["point"], dtype=bool)
        for dim, value in at:
            here &= dataset[f"point_{dim}"].values == value
        points = plane.copies(dataset, plane.points(dataset)[here], *theta)
        text = typographic(", ".join(f"{names.symbol(dim)} = {value:g}" for dim, value in at))
        marks = [
            Image(label.astype(np.int32) + 1, theta, velocity, classes=classes, path="labels"),
            Points(*points.T, size=3.0, colour="#ffffff", path="attractors"),
            Text(sum(theta) / 2, velocity[1], text, colour="#ffffff", path="values"),
        ]
        yield at, Panel("basin", "basins of attraction", *sides, marks), ratio


def _line(dataset: xr.Dataset, dim: str, titles: tuple[str, str], layer: str | None) -> Chart:
    """Return the chart over one parameter."""
    x, every = dataset[dim].values, listed(dataset)
    below = parameters.axis(dataset, dim)
    bare = Axis("", below.ends, ticks=()) if layer is None else below
    entropies = _entropies(dataset, x)
    exponent = f"exponent\n{names.per_time(Units.of(facts(dataset)))}"
    parts: dict[str, tuple[Axis, list[Mark]]] = {
        "fraction": (Axis("share of the starts", (0.0, 1.0)), _stack(dataset, dim, every)),
        "entropy": (Axis("entropy\n(nat)", _from_0(entropies, math.log(2))), entropies),
        "uncertainty": (Axis("uncertainty\nexponent", (0.0, 1.1)), _uncertainty(dataset, x)),
        "exponent": (
            Axis(exponent, parameters.rates(dataset["exponent"].values)),
            _growth(dataset, x, every, named=layer is not None),
        ),
    }
    panels = [
        Panel(name, "", below if name == "exponent" else bare, up, marks)
        for name, (up, marks) in parts.items()
        if marks
    ]
    return Chart(
        *titles,
        [[panel] for panel in panels],
        recorded=panels,
        heights=[_HEIGHTS[panel.name] for panel in panels],
        size=_SIZE,
        letters=False,
        tabs=True,
    ).only(layer)


def _stack(dataset: xr.Dataset, dim: str, every: list[Branch]) -> list[Mark]:
    """Return the shares of the attractors on one another with errors, then undecided starts."""
    x, edges = dataset[dim].values, np.repeat(plane.edges(dataset, dim), 2)[1:-1]
    fraction, stderr = dataset["fraction"].values, dataset["stderr"].values
    top = np.zeros(x.size)
    marks: list[Mark] = []
    grey = sum(not one.name for one in every)
    layers = [
        (one.name or f"{grey} others", one.colour, fraction[:, k]) for k, one in enumerate(every)
    ]
    layers.append(("undecided", palette.UNDECIDED, dataset["undecided"].values))
    layers.append(("failed", palette.FAILED, dataset["failed"].values))
    for k, (name, colour, share) in enumerate(layers):
        if not share.any():
            continue
        low, top = top, top + share
        ends = np.repeat(low, 2), np.repeat(top, 2)
        marks.append(Band(edges, *ends, colour=colour, name=name, path=f"{k + 1}/share"))
        size = stderr[:, k] if k < len(every) and every[k].name else np.zeros(x.size)
        mine = size > 0
        at = bars(x[mine], (top - size)[mine], (top + size)[mine])
        marks.append(Line(*at, width=0.6, colour=INK, order=3.0))
    return marks


def _entropies(dataset: xr.Dataset, x: Floats) -> list[Mark]:
    """Return the entropy of the plane and that of the boundary with its error."""
    whole, edge = dataset["basin_entropy"].values, dataset["boundary_basin_entropy"].values
    edge = np.where(dataset["boundary_boxes"].values > 0, edge, np.nan)
    error = dataset["boundary_basin_entropy_stderr"].values
    return [
        Level(math.log(2), colour=QUIET, dash=DASHED),
        Line(x, whole, colour=palette.CURVES[2], name="basin entropy", path="whole"),
        Line(
            x,
            edge,
            colour=INK,
            name="of the boundary (dashed: ln 2, fractal above)",
            path="boundary",
        ),
        *_error(x, edge, error, INK),
    ]


def _uncertainty(dataset: xr.Dataset, x: Floats) -> list[Mark]:
    """Return the uncertainty exponent with its error: 1 where the boundary is smooth."""
    value, error = (dataset[f"uncertainty_exponent{end}"].values for end in ("", "_stderr"))
    if not np.isfinite(value).any():
        return []
    level = Level(1.0, colour=QUIET, dash=DASHED)
    return [level, Line(x, value, colour=INK, path="value"), *_error(x, value, error, INK)]


def _error(x: Floats, value: Floats, error: Floats, colour: str) -> list[Mark]:
    known = np.isfinite(value) & np.isfinite(error)
    at = bars(x[known], (value - error)[known], (value + error)[known])
    dots = Points(x[known], value[known], colour=colour, size=2.0)
    return [Line(*at, width=0.7, colour=colour), dots]


def _growth(dataset: xr.Dataset, x: Floats, every: list[Branch], *, named: bool) -> list[Mark]:
    """Return the largest Lyapunov exponent of each attractor, for the legend if ``named``."""
    marks: list[Mark] = [Level(0.0, colour=QUIET)]
    for k, one in enumerate(every):
        at = x, dataset["exponent"].values[:, k]
        colour, order = palette.on_white(one.colour), 2.0 if one.name else 1.0
        look: dict[str, Any] = {"colour": colour, "order": order}
        marks.append(Line(*at, width=0.8, name=one.name if named else "", **look))
        marks.append(Points(*at, size=2.2, path=f"{one.id}/exponent", **look))
    return marks


def _from_0(marks: list[Mark], least: float) -> Ends:
    values = [np.asarray(mark.y) for mark in marks if isinstance(mark, Line)]
    return 0.0, holding(*values, [0.0, 1.1 * least])[1]


def _layer(
    dataset: xr.Dataset, layer: str, which: int | None, cells: int
) -> tuple[str, Floats, Colours]:
    """Return the title of a layer over two parameters, its values and their colours."""
    name, text, unit = LAYERS[layer if which is None else "main"]
    array, title = dataset[name], text
    if name == "fraction":
        total = array.sum([*array.dims[:-1]]).values
        which = int(np.argmax(total)) if which is None else which
        array = array.isel(attractor=which)
        title = f"{text} on {typeset(str(dataset['attractor'].values[which]))}"
    values = np.asarray(plane.pixels(dataset, array, cells), dtype=np.float64)
    if layer == "boundary":
        boxes = plane.pixels(dataset, dataset["boundary_boxes"], cells)
        values = np.where(boxes > 0, values, np.nan)
    if layer == "attractors":
        return title, values, parameters.counts(text, values)
    if not unit:
        return title, values, Colours(text, "cividis", 0.0, 1.0)
    high = max(float(values[np.isfinite(values)].max(initial=0.0)), 1e-3)
    return title, values, Colours(f"{text} ({unit})", "magma", 0.0, high)
