"""Maps over two parameters as drawn: a colour for each kind, stripes where some coexist."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from pendmap.charts import basins, palette, plane, tongues
from pendmap.errors import InputError

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
"""Layers by the name a user types; ``share KIND`` is the share of the starts of a kind."""

Stroke = Literal["-", "--", ":"]

_MOST = 13
_LEAST = 0.002
"""Kinds that are named: so many, and those in no fewer of the cells."""

_OTHERS = {"oscillation": "oscillation, other periods", "rotation": "rotation, others"}


@dataclass(frozen=True)
class Kind:
    """A kind of attractor in a picture, or a family of rare ones.

    Attributes
    ----------
    name : str
        As it is printed.
    colour : str
        ``"#rrggbb"``.
    shade : str
        The colour in words.
    members : tuple of str
        The kinds of the dataset that it stands for.
    presence : float
        Share of the cells that have it.
    """

    name: str
    colour: str
    shade: str
    members: tuple[str, ...]
    presence: float

    @property
    def text(self) -> str:
        """Its line in a legend."""
        return f"{self.name}: {_percent(self.presence)} of the cells"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %" if share >= 0.001 else "under 0.1 %"  # noqa: PLR2004


def sets(dataset: xr.Dataset) -> list[list[str]]:
    """Return the kinds of each regime."""
    return [json.loads(str(text)) for text in dataset["regime_kinds"].values]


def kinds(dataset: xr.Dataset) -> list[Kind]:
    """Return the kinds that a picture names, in the order of the regimes' words."""
    share = dataset["regime_share"].values
    presence: dict[str, float] = {}
    for k, one in enumerate(sets(dataset)):
        for name in one:
            presence[name] = presence.get(name, 0.0) + float(share[k])
    frequent = sorted(presence, key=lambda name: -presence[name])[:_MOST]
    frequent = [name for name in frequent if presence[name] >= _LEAST]
    found: list[Kind] = []
    rare: dict[str, list[str]] = {}
    for name, here in presence.items():
        family = name.split()[0]
        if name in frequent or family not in _OTHERS:
            found.append(_kind(name, _named(name), (name,), here))
        else:
            rare.setdefault(family, []).append(name)
    for family, members in rare.items():
        own = [set(members) & set(one) for one in sets(dataset)]
        total = float(sum(s for s, has in zip(share, own, strict=True) if has))
        name = _OTHERS[family] if len(members) > 1 else members[0]
        like = "oscillation 12:0" if family == "oscillation" else "rotation 9:+9"
        found.append(_kind(name, like, tuple(members), total))
    return sorted(found, key=lambda kind: _place(kind.name))


def _kind(name: str, like: str, members: tuple[str, ...], presence: float) -> Kind:
    return Kind(name, palette.colour(like), palette.describe(like), members, presence)


def _named(name: str) -> str:
    """Return an attractor with the colour of a kind: of the two senses the forward one."""
    family, _, which = name.rpartition(" ")
    if name.startswith("oscillation period"):
        return f"oscillation {which}:0"
    if family == "rotation":
        n, _, w = which.partition(":")
        # Those that do not turn once a period look like none that do.
        return f"rotation {n}:+{w}" if n == w else f"rotation {5 * int(n)}:+{w}"
    return f"{name} +" if name in ("rotating chaos", "quasiperiodic rotation") else name


def _place(name: str) -> tuple[int, float, float]:
    families = ("rest", "inverted", "oscillation", "rotation", "quasi", "libration", "rotating")
    order = next((k for k, word in enumerate(families) if name.startswith(word)), len(families))
    n, _, w = name.rsplit(" ", 1)[-1].partition(":")
    return (
        order + 10 * (name == "undecided"),
        float(n) if n.isdigit() else math.inf,
        float(w) if w.isdigit() else 0.0,
    )


def striped(dataset: xr.Dataset, size: int, width: int) -> npt.NDArray[np.uint8]:
    """Return an image of indices into :func:`kinds`, row 0 lowest, a cell a block of pixels.

    Where kinds coexist, diagonal stripes of their colours take turns.

    Parameters
    ----------
    dataset : xarray.Dataset
        A map over two parameters.
    size : int
        Pixels of the longer side, about.
    width : int
        Pixels of a stripe, measured along a row.
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


def axes(dataset: xr.Dataset) -> tuple[str, str]:
    """Return the names of columns and rows with their units."""
    across, up = (str(dataset.attrs[which]) for which in ("columns", "rows"))
    first, second = (
        basins.symbol(name, str(dataset[name].attrs.get("units", "1"))) for name in (across, up)
    )
    return first, second


def edges(dataset: xr.Dataset) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the outer edges of columns and rows."""
    across, up = (str(dataset.attrs[which]) for which in ("columns", "rows"))
    return plane.outer_edges(dataset, across), plane.outer_edges(dataset, up)


def curves(dataset: xr.Dataset) -> dict[str, tuple[Stroke, list[npt.NDArray[np.float64]]]]:
    """Return the critical curves of a map: for each name a line style and polylines, shape (m, 2).

    Empty where they were not asked for.
    """
    if "curve_p" not in dataset:
        return {}
    omega = dataset["curve_omega"].values
    rows = tongues.by_frequency(dataset, "curve_", omega.size)
    turned = str(dataset.attrs["rows"]).lower() == "omega"

    def to(line: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return line[:, ::-1] if turned else line

    sought = dataset["curve_fold_sought"].values > 0
    fold = to(np.stack([omega, dataset["curve_fold"].values], axis=1)[sought])
    return {
        "rest: multiplier +1": ("-", [to(line) for line in tongues.joined(omega, rows, 1)]),
        "rest: multiplier −1": (
            "--",
            [to(line) for line in tongues.joined(omega, rows, -1)],
        ),
        "fold of the oscillation born there": (":", [fold]),
    }


def named(dataset: xr.Dataset, name: str) -> str:
    """Return a layer's name.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    shares = [f"share {kind}" for kind in dataset["kind"].values]
    known = [one for one in LAYERS if one != "certainty" or one in dataset]
    if name not in known and name not in shares:
        layers = ", ".join([*known, *shares])
        raise InputError(f"layer must be one of this map, {layers}, got {name!r}")
    return name


def layer(dataset: xr.Dataset, name: str, limit: int) -> npt.NDArray[np.float64]:
    """Return the image of a layer that is no picture of kinds, as of :func:`plane.pixels`."""
    of_kind = name.removeprefix("share ")
    values = dataset[name] if of_kind == name else dataset["share"].sel(kind=of_kind)
    return np.asarray(plane.pixels(dataset, values, limit), dtype=np.float64)


def said(dataset: xr.Dataset, name: str) -> str:
    """Return what a layer shows, in words, with its unit."""
    if name.startswith("share "):
        return f"share of the starts on {name.removeprefix('share ')}"
    unit = ""
    if name == "exponent":
        none = "" if np.isfinite(dataset["exponent"].values).all() else "; grey: none"
        unit = f" ({dataset['exponent'].attrs['units'].replace('tau', chr(0x3C4))}{none})"
    if name == "period":
        unit = " (drive's; grey: none)"
    return LAYERS[name] + unit


def title(dataset: xr.Dataset) -> str:
    """Return the title of a figure."""
    return f"Attractors over {' and '.join(name.split(' (')[0] for name in axes(dataset))}"


def subtitle(dataset: xr.Dataset) -> str:
    """Return what does not vary, and how many cells there are."""
    varied = [str(dataset.attrs[which]) for which in ("columns", "rows")]
    parameters = basins.parameters(dataset.attrs, varied)
    shape: tuple[Any, ...] = dataset["regime"].shape
    times = "\N{MULTIPLICATION SIGN}"
    starts = int(dataset.attrs["starts"])
    return f"{parameters};   {shape[1]} {times} {shape[0]} cells, {starts} starts each"
