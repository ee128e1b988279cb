"""Maps over two parameters: a colour for each kind of attractor, striped if several coexist."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from pendmap._core import Attractor
from pendmap.analysis.cell_search import UNDECIDED
from pendmap.analysis.orbit_table import attractors_of
from pendmap.analysis.parameter_map import sets
from pendmap.charts import names, palette, plane, tongues
from pendmap.charts.chart import Axis, Chart, Panel
from pendmap.charts.legend import colours_of
from pendmap.charts.marks import Colours, Image, Line, Mark, together
from pendmap.errors import InputError
from pendmap.files import facts
from pendmap.formatting import typographic
from pendmap.units import Units

if TYPE_CHECKING:
    import numpy.typing as npt
    import xarray as xr


LAYERS = {
    "kinds": "kinds of attractor",
    "exponent": "largest Lyapunov exponent",
    "attractors": "attractors that coexist",
    "period": "period of what most starts end on",
    "winding": "turns in that period",
    "undecided": "share of the starts undecided",
    "certainty": "probability of the most likely regime",
}
"""Layers by the name a user types; ``share KIND`` is the share of the starts on a kind."""

_RECORDED: Final = ("exponent", "attractors", "undecided")
"""Layers of a recording in addition to the leading ones."""
_STRIPES: Final = 100  # Stripes across an image
_LEAST_HALF: Final = 0.05  # Least ratio of the halves of the colour scale of exponents
_MOST_COUNT: Final = 8  # Largest count that has its own colour
_MOST, _LEAST = 13, 0.002
"""Greatest number of named kinds, and the least share of the cells with one."""

_OTHERS: Final = {
    "oscillation": ("oscillation, other periods", palette.colour(Attractor("oscillation", 12))),
    "rotation": ("rotation, others", palette.colour(Attractor("rotation", 9, 9))),
}
"""Names of the rare kinds of a family together, and their colours."""


@dataclass(frozen=True)
class Kind:
    """A kind of attractor in an image, or a family of rare kinds.

    ``members`` are kinds of the dataset, ``presence`` the share of the cells with any of them.
    """

    name: str
    colour: str
    members: tuple[str, ...]
    presence: float

    @property
    def text(self) -> str:
        """Line of the legend."""
        return f"{self.name}, {_percent(self.presence)}"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %" if share >= 0.001 else "under 0.1 %"  # noqa: PLR2004


def kinds(dataset: xr.Dataset) -> list[Kind]:
    """Return the kinds that a map names, in a fixed order of families."""
    share = dataset["regime_share"].values
    has = dataset["regime_has"].transpose("set", "kind").values.astype(bool)
    presence, called = share @ has, dataset["kind"].values
    looks, every = colours_of(dataset, "kind_"), attractors_of(dataset, "kind_")
    frequent = np.argsort(-presence, kind="stable")[:_MOST]
    frequent = frequent[presence[frequent] >= _LEAST]
    found: list[tuple[tuple[float, ...], Kind]] = []
    rare: dict[str, list[int]] = {}
    for k in np.flatnonzero(presence).tolist():
        family, colour = every[k].kind, looks[k]
        if family not in _OTHERS or (k in frequent and colour != _OTHERS[family][1]):
            one = Kind(str(called[k]), colour, (str(called[k]),), float(presence[k]))
            found.append((every[k].rank, one))
        else:
            rare.setdefault(family, []).append(k)
    for family, members in rare.items():
        total = float(share[has[:, members].any(axis=1)].sum())
        own, first = tuple(map(str, called[members])), every[members[0]].rank
        if len(members) > 1:
            found.append(((first[0], math.inf), Kind(*_OTHERS[family], own, total)))
        else:
            found.append((first, Kind(own[0], looks[members[0]], own, total)))
    undecided = float(share[~has.any(axis=1)].sum())
    if undecided:
        one = Kind(UNDECIDED, palette.UNDECIDED, (UNDECIDED,), undecided)
        found.append(((math.inf,), one))
    return [one for _, one in sorted(found, key=operator.itemgetter(0))]


def striped(dataset: xr.Dataset, size: int, width: int) -> npt.NDArray[np.uint8]:
    """Return an image of indices into :func:`kinds`, row 0 lowest, one block of pixels per cell.

    Cells with several kinds have diagonal stripes in turn. ``size`` is about the number of pixels
    of the longer side, ``width`` that of a stripe along a row.
    """
    listed = kinds(dataset)
    own = {member: k for k, kind in enumerate(listed) for member in kind.members}
    groups = [sorted({own[name] for name in one}) for one in sets(dataset)]
    regime = plane.pixels(dataset, dataset["regime"], size)
    rows, columns = regime.shape
    factor = [max(1, round(size / count)) for count in (rows, columns)]
    large = np.repeat(np.repeat(regime, factor[0], axis=0), factor[1], axis=1)
    y, x = np.indices(large.shape)
    stripe = (x + y) // width
    counts = np.array([len(group) for group in groups])
    table = np.zeros((len(groups), max(counts)), dtype=np.uint8)
    for k, group in enumerate(groups):
        table[k, : len(group)] = group
    image: npt.NDArray[np.uint8] = table[large, stripe % counts[large]]
    return image


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 1200) -> Chart:
    """Return the kinds of attractor, striped if several coexist, and other layers."""
    shares = [f"share {kind}" for kind in dataset["kind"].values]
    known = [one for one in LAYERS if one != "certainty" or one in dataset]
    if layer is not None and layer not in (*known, *shares):
        layers = ", ".join([*known, *shares])
        raise InputError(f"layer must be one of this map: {layers}, got {layer!r}")
    leading = ("kinds", "certainty" if "certainty" in dataset else "exponent")
    others = [one for one in _RECORDED if one in known and one not in leading]
    shown = [layer] if layer else [*leading, *others]
    varied = [str(dataset.attrs[which]) for which in ("columns", "rows")]
    symbols = [names.symbol(one, str(dataset[one].attrs.get("units", "1"))) for one in varied]
    across, up = (plane.outer_edges(dataset, one) for one in varied)
    sides = Axis(symbols[0], across), Axis(symbols[1], up)
    lines = _curves(dataset)
    panels = []
    for one in shown:
        title = LAYERS.get(one, one) + (
            " and shares; stripes: coexisting" if one == "kinds" else ""
        )
        image = _image(dataset, one, across, up, cells)
        panels.append(Panel(one, title, *sides, [image, *lines]))
    fixed = names.parameters(facts(dataset), varied)
    shape: tuple[Any, ...] = dataset["regime"].shape
    starts = int(dataset.attrs["starts"])
    size = f"{shape[1]} × {shape[0]} cells, {starts} starts each"
    return Chart(
        f"Attractors over {' and '.join(name.split(' (')[0] for name in symbols)}",
        f"{fixed};   {size}",
        [panels[: len(leading)]],
        recorded=panels,
        ratio=0.85,
        tabs=True,
    )


def _image(
    dataset: xr.Dataset, name: str, across: tuple[float, float], up: tuple[float, float], cells: int
) -> Image:
    """Return the image of a layer."""
    if name == "kinds":
        classes = [(kind.text, kind.colour) for kind in kinds(dataset)]
        picture = striped(dataset, cells, max(2, cells // _STRIPES))
        return Image(picture, across, up, classes=classes, path="kinds")
    of_kind = name.removeprefix("share ")
    layer = dataset[name] if of_kind == name else dataset["share"].sel(kind=of_kind)
    values = np.asarray(plane.pixels(dataset, layer, cells), dtype=np.float64)
    if name == "period":
        values = np.where(values > 0, values, np.nan)
    look = _colours(dataset, name, values[np.isfinite(values)])
    return Image(values, across, up, colours=look, path="values")


def _colours(dataset: xr.Dataset, name: str, values: npt.NDArray[np.float64]) -> Colours:
    """Return the colour scale: centred at 0 for exponents, steps for counts, 0 to 1 for shares."""
    said = _said(dataset, name)
    if name == "exponent":
        low, high = (float(q) for q in np.quantile(values, [0.01, 0.99])) if values.size else (0, 0)
        low, high = min(low, -1e-3, -_LEAST_HALF * high), max(high, 1e-3, -_LEAST_HALF * low)
        # The halves have different scales: without ticks on both, dark blue would appear as far
        # from 0 as dark red.
        ticks = sorted({at for side in ((low, 0.0), (0.0, high)) for at in _few(*side)})
        return Colours(said, "RdBu_r", low, high, "centred", "both", ticks)
    if name in ("attractors", "period", "winding"):
        top = int(min(values.max(initial=1), _MOST_COUNT))
        low = -0.5 if name != "period" else 0.5
        beyond: Literal["max", "neither"] = "max" if values.max(initial=0) > top else "neither"
        whole = [float(k) for k in range(int(low + 0.5), top + 1)]
        return Colours(said, "viridis", low, top + 0.5, "counts", beyond, whole)
    return Colours(said, "cividis", 0.0, 1.0)


def _few(low: float, high: float) -> list[float]:
    """Return at most four round ticks in a half of a colour bar."""
    ticks = [at for at, _ in plane.plain_ticks(low, high)]
    return ticks[::2] if low == 0.0 or len(ticks) % 2 else ticks[1::2]


def _said(dataset: xr.Dataset, name: str) -> str:
    """Return the quantity of a layer in words, with its unit."""
    if name.startswith("share "):
        return f"share of the starts on {name.removeprefix('share ')}"
    unit = ""
    if name == "exponent":
        none = "" if np.isfinite(dataset["exponent"].values).all() else "; grey: none"
        unit = f" ({'1/s' if Units.of(facts(dataset)).si else '1 per τ'}{none})"
    if name == "period":
        unit = " (drive's; grey: none)"
    return LAYERS[name] + unit


def _curves(dataset: xr.Dataset) -> list[Mark]:
    """Return the critical curves of a map; an empty list if it has none."""
    if "curve_p" not in dataset:
        return []
    omega = dataset["curve_omega"].values
    rows = tongues.by_frequency(dataset, "curve_", omega.size)
    turned = str(dataset.attrs["rows"]).lower() == "omega"
    sought = dataset["curve_fold_sought"].values > 0
    fold = np.stack([omega, dataset["curve_fold"].values], axis=1)[sought]
    found: list[Mark] = []
    for k, (name, dash, lines) in enumerate(
        (
            ("rest: multiplier +1", "-", tongues.joined(omega, rows, 1)),
            (typographic("rest: multiplier -1"), "--", tongues.joined(omega, rows, -1)),
            ("fold of the oscillation born there", ":", [fold]),
        )
    ):
        x, y = together(line[:, ::-1] if turned else line for line in lines)
        if np.isfinite(x + y).sum() > 1:
            look: dict[str, Any] = {"name": name, "dash": dash, "path": f"curves/{k}"}
            look["colour"] = palette.CURVES[k]
            found.append(Line(x, y, width=1.1, halo="#ffffff", order=2.0, **look))
    return found
