"""Sweeps: shares of the attractors stacked along a parameter, or maps over two."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from pendmap.analysis.orbit_table import attractors_of
from pendmap.analysis.sweep_table import varied_names
from pendmap.charts import names, palette, plane
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.legend import typeset
from pendmap.charts.marks import QUIET, Band, Colours, Image, Level, Line, Points, bars
from pendmap.files import facts
from pendmap.files.toml import packaged
from pendmap.units import Units

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.charts.marks import Ends, Floats, Mark


MOST: Final = 12  # Greatest number of attractors that a legend names; all others are grey
OTHERS: Final = "#c9c9c9"  # Colour of the others
LAYERS: Final[dict[str, list[str]]] = packaged("charts/layers.toml")["basin_sweep"]
"""Layers over two parameters by the name a user types: variable, title and unit."""
_LEADING: Final = ("entropy", "attractors", "main")
_SIZE: Final = (7.4, 8.4)  # Size of a figure over one parameter, inches
_HEIGHTS: Final = {"fraction": 2.6, "entropy": 1.2, "uncertainty": 1.2, "exponent": 1.3}


class Branch(NamedTuple):
    """An attractor of a sweep: its name in a legend, empty for the others, and its colour."""

    name: str
    colour: str


def listed(dataset: xr.Dataset, most: int | None = MOST) -> list[Branch]:
    """Return the attractors in the order of their numbers; all but ``most`` have one grey.

    Those of equal plain names have successive colours of their family.
    """
    share = dataset["fraction"].sum(varied_names(dataset)).values
    most = None if share.size == MOST + 1 else most
    frequent = set(np.argsort(-share, kind="stable")[:most].tolist())
    seen: Counter[str] = Counter()
    branches = []
    chosen = dataset["colour"].values.tolist() if "colour" in dataset else [""] * share.size
    for k, one in enumerate(attractors_of(dataset, "branch_")):
        colour = chosen[k] or palette.colour(one, seen[one.plain])
        seen[one.plain] += 1
        name = typeset(str(dataset["attractor"].values[k]))
        branches.append(Branch(name, colour) if k in frequent else Branch("", OTHERS))
    return branches


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 1200) -> Chart:
    """Return shares, entropies and exponents along a parameter, or maps over two."""
    dims = varied_names(dataset)
    dataset = dataset.transpose(..., "attractor")
    rows, columns = dataset.sizes["velocity"], dataset.sizes["theta"]
    number = math.prod(dataset.sizes[one] for one in dims)
    fixed = names.parameters(facts(dataset), dims)
    subtitle = f"{fixed};   {number} maps of {columns} × {rows} cells"
    titles = f"Basins along {names.over(dims)}", subtitle
    if len(dims) == 1:
        return _line(dataset, dims[0], titles, layer)
    first, second = dims
    shares = {f"share {k + 1}": k for k in range(dataset.sizes["attractor"])}
    dataset = dataset.transpose(second, first, ...)

    def make(name: str, across: Ends, up: Ends) -> tuple[str, list[Mark]]:
        title, values, colours = _layer(dataset, name, shares.get(name), cells)
        return title, [Image(values, across, up, colours=colours, path="values")]

    known, others = [*LAYERS, *shares], [name for name in LAYERS if name not in _LEADING]
    varied, shown = (first, second), (_LEADING, others)
    return names.layers(dataset, varied, titles, make, known, shown, layer)


def _line(dataset: xr.Dataset, dim: str, titles: tuple[str, str], layer: str | None) -> Chart:
    """Return the chart over one parameter."""
    every, below = listed(dataset), names.parameter_axis(dataset, dim)
    bare = Axis("", below.ends, ticks=()) if layer is None else below
    exponent = f"exponent\n{names.per_time(Units.of(facts(dataset)))}"
    whole, edge = dataset["basin_entropy"].values, dataset["boundary_basin_entropy"].values
    highest = float(np.nanmax(np.append(whole, edge), initial=1.1 * math.log(2)))
    parts: dict[str, tuple[Axis, list[Mark]]] = {
        "fraction": (Axis("share of the starts", (0.0, 1.0)), _stack(dataset, dim, every)),
        "entropy": (Axis("entropy\n(nat)", (0.0, 1.06 * highest)), _entropies(dataset, dim)),
        "uncertainty": (Axis("uncertainty\nexponent", (0.0, 1.1)), _uncertainty(dataset, dim)),
        "exponent": (
            Axis(exponent, holding(dataset["exponent"].values, 0.0)),
            _growth(dataset, dim, every, named=layer is not None),
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
    grey = f"{sum(not one.name for one in every)} others"
    none = np.zeros(x.size)
    layers = [
        (one.name or grey, one.colour, share, error if one.name else none)
        for one, share, error in zip(
            every, dataset["fraction"].values.T, dataset["stderr"].values.T, strict=True
        )
    ]
    layers.append(("undecided", palette.UNDECIDED, dataset["undecided"].values, none))
    layers.append(("failed", palette.FAILED, dataset["failed"].values, none))
    top = none
    marks: list[Mark] = []
    for k, (name, colour, share, error) in enumerate(layers, 1):
        if not share.any():
            continue
        low, top = top, top + share
        ends = np.repeat(low, 2), np.repeat(top, 2)
        marks.append(Band(edges, *ends, colour=colour, name=name, path=f"{k}/share"))
        half = np.where(error > 0, error, np.nan)
        marks.append(Line(*bars(x, top - half, top + half), width=0.6, order=3.0))
    return marks


def _entropies(dataset: xr.Dataset, dim: str) -> list[Mark]:
    """Return the entropy of the plane and that of the boundary with its error."""
    x, whole = dataset[dim].values, dataset["basin_entropy"].values
    known = dataset["boundary_boxes"].values > 0
    edge = np.where(known, dataset["boundary_basin_entropy"].values, np.nan)
    text = "of the boundary (dashed: ln 2, fractal above)"
    indigo, _ = palette.CURVES["period_doubling"]
    return [
        Level(math.log(2), colour=QUIET, dash="--"),
        Line(x, whole, colour=indigo, name="basin entropy", path="whole"),
        *_with_error(x, edge, dataset["boundary_basin_entropy_stderr"].values, "boundary", text),
    ]


def _uncertainty(dataset: xr.Dataset, dim: str) -> list[Mark]:
    """Return the uncertainty exponent with its error: 1 where the boundary is smooth."""
    value, error = (dataset[f"uncertainty_exponent{end}"].values for end in ("", "_stderr"))
    if not np.isfinite(value).any():
        return []
    level = Level(1.0, colour=QUIET, dash="--")
    return [level, *_with_error(dataset[dim].values, value, error, "value")]


def _with_error(x: Floats, value: Floats, error: Floats, path: str, name: str = "") -> list[Mark]:
    dots = np.where(np.isfinite(error), value, np.nan)
    return [
        Line(x, value, path=path, name=name),
        Line(*bars(x, value - error, value + error), width=0.7),
        Points(x, dots, size=2.0),
    ]


def _growth(dataset: xr.Dataset, dim: str, every: list[Branch], *, named: bool) -> list[Mark]:
    """Return the largest Lyapunov exponent of each attractor, for the legend if ``named``."""
    marks: list[Mark] = [Level(0.0, colour=QUIET)]
    for k, one in enumerate(every, 1):
        at = dataset[dim].values, dataset["exponent"].values[:, k - 1]
        colour, order = palette.on_white(one.colour), 2.0 if one.name else 1.0
        look: dict[str, Any] = {"colour": colour, "order": order}
        marks.append(Line(*at, width=0.8, name=one.name if named else "", **look))
        marks.append(Points(*at, size=2.2, path=f"{k}/exponent", **look))
    return marks


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
        return title, values, names.counts(text, values)
    if not unit:
        return title, values, Colours(text, "cividis", 0.0, 1.0)
    high = float(np.nanmax(values, initial=1e-3))
    return title, values, Colours(f"{text} ({unit})", "magma", 0.0, high)
