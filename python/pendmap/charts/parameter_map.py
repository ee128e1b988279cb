"""Maps over two parameters: a colour for each kind of attractor, striped if several coexist."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap._core import Attractor
from pendmap.analysis.cell_search import UNDECIDED
from pendmap.analysis.orbit_table import attractors_of
from pendmap.analysis.parameter_map import sets
from pendmap.charts import names, palette, plane
from pendmap.charts.continuation import bifurcation_set
from pendmap.charts.legend import colours_of
from pendmap.charts.marks import Colours, Image, Mark
from pendmap.files import facts
from pendmap.files.toml import packaged
from pendmap.units import Units

if TYPE_CHECKING:
    import numpy.typing as npt
    import xarray as xr

    from pendmap.charts.chart import Chart
    from pendmap.charts.marks import Ends, Floats

LAYERS: Final[dict[str, str]] = packaged("charts/layers.toml")["parameter_map"]
"""Layers by the name a user types; ``share KIND`` is the share of the starts on a kind."""

_RECORDED: Final = ("exponent", "attractors", "undecided")
"""Layers of a recording in addition to the leading ones."""
_STRIPES: Final = 100  # Stripes across an image
_LEAST_HALF: Final = 0.05  # Least ratio of the halves of the colour scale of exponents
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
        share = f"{100 * self.presence:.1f} %"
        return f"{self.name}, {share if self.presence >= 0.001 else 'under 0.1 %'}"  # noqa: PLR2004


def kinds(dataset: xr.Dataset) -> list[Kind]:
    """Return the kinds that a map names, in a fixed order of families."""
    regime = dataset["regime"].values
    share = np.bincount(regime.ravel(), minlength=dataset.sizes["set"]) / regime.size
    has = dataset["regime_has"].transpose("set", "kind").values.astype(bool)
    presence, called = share @ has, dataset["kind"].values
    looks, every = colours_of(dataset, "kind_"), attractors_of(dataset, "kind_")
    frequent = np.argsort(-presence, kind="stable")[:_MOST]
    frequent = frequent[presence[frequent] >= _LEAST]
    groups: dict[str, list[int]] = {}
    for k in np.flatnonzero(presence).tolist():
        family = every[k].kind
        rare = family in _OTHERS and (k not in frequent or looks[k] == _OTHERS[family][1])
        groups.setdefault(family if rare else str(called[k]), []).append(k)
    ranked: list[tuple[tuple[float, ...], Kind]] = []
    for family, members in groups.items():
        rank: tuple[float, ...] = every[members[0]].rank
        look = str(called[members[0]]), looks[members[0]]
        if len(members) > 1:
            rank, look = (rank[0], math.inf), _OTHERS[family]
        total = float(share[has[:, members].any(axis=1)].sum())
        ranked.append((rank, Kind(*look, tuple(map(str, called[members])), total)))
    undecided = float(share[~has.any(axis=1)].sum())
    if undecided:
        one = Kind(UNDECIDED, palette.UNDECIDED, (UNDECIDED,), undecided)
        ranked.append(((math.inf,), one))
    return [one for _, one in sorted(ranked, key=operator.itemgetter(0))]


def striped(dataset: xr.Dataset, size: int, width: int) -> npt.NDArray[np.uint8]:
    """Return an image of indices into :func:`kinds`, row 0 lowest, one block of pixels per cell."""
    listed = kinds(dataset)
    mine = {member: k for k, kind in enumerate(listed) for member in kind.members}
    groups = [sorted({mine[name] for name in one if name in mine}) for one in sets(dataset)]
    regime = plane.pixels(dataset, dataset["regime"], size)
    rows, columns = regime.shape
    factors = [max(1, round(size / count)) for count in (rows, columns)]
    large = np.kron(regime, np.ones(factors, dtype=regime.dtype))
    stripe = np.add.outer(*map(np.arange, large.shape)) // width
    counts = np.array([len(group) for group in groups])
    table = np.array([np.resize(group, counts.max()) for group in groups], dtype=np.uint8)
    image: npt.NDArray[np.uint8] = table[large, stripe % counts[large]]
    return image


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 1200) -> Chart:
    """Return the kinds of attractor, striped if several coexist, and other layers."""
    shares = [f"share {kind}" for kind in dataset["kind"].values]
    known = [one for one in LAYERS if one != "certainty" or one in dataset]
    leading = ("kinds", "certainty" if "certainty" in dataset else "exponent")
    others = [one for one in _RECORDED if one in known and one not in leading]
    varied = str(dataset.attrs["columns"]), str(dataset.attrs["rows"])
    shades = {kind: shade for kind, (shade, _) in palette.CURVES.items()}
    lines = bifurcation_set(dataset, varied, shades, halo="#ffffff", order=2.0)

    def make(name: str, across: Ends, up: Ends) -> tuple[str, list[Mark]]:
        title = LAYERS.get(name, name)
        if name == "kinds":
            title += " and shares; stripes: coexisting"
        return title, [_image(dataset, name, across, up, cells), *lines]

    fixed = names.parameters(facts(dataset), varied)
    rows, columns = dataset["regime"].shape
    size = f"{columns} × {rows} cells, {int(dataset.attrs['starts'])} starts each"
    titles = f"Attractors over {names.over(varied)}", f"{fixed};   {size}"
    every = [*known, *shares]
    return names.layers(dataset, varied, titles, make, every, (leading, others), layer)


def _image(dataset: xr.Dataset, name: str, across: Ends, up: Ends, cells: int) -> Image:
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


def _colours(dataset: xr.Dataset, name: str, values: Floats) -> Colours:
    """Return the colour scale: centred at 0 for exponents, steps for counts, 0 to 1 for shares."""
    if name.startswith("share "):
        kind = name.removeprefix("share ")
        return Colours(f"share of the starts on {kind}", "cividis", 0.0, 1.0)
    text = LAYERS[name]
    if name == "exponent":
        none = "" if np.isfinite(dataset["exponent"].values).all() else "; grey: none"
        unit = "1/s" if Units.of(facts(dataset)).si else "1 per τ"
        low, high = (float(q) for q in np.quantile(values, [0.01, 0.99])) if values.size else (0, 0)
        low, high = min(low, -1e-3, -_LEAST_HALF * high), max(high, 1e-3, -_LEAST_HALF * low)
        # The halves have different scales: without ticks on both, dark blue would appear as far
        # from 0 as dark red.
        halves = plane.plain_ticks(low, 0.0)[::-2], plane.plain_ticks(0.0, high)[::2]
        ticks = sorted({at for half in halves for at, _ in half})
        text = f"{text} ({unit}{none})"
        return Colours(text, "RdBu_r", low, high, "centred", "both", ticks)
    if name == "period":
        return names.counts(f"{text} (drive's; grey: none)", values, 1)
    if name in ("attractors", "winding"):
        return names.counts(text, values)
    return Colours(text, "cividis", 0.0, 1.0)
