"""Legend of a basin map: names, colours and shares of the attractors."""

from __future__ import annotations

import itertools
import math
import operator
import string
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pendmap.analysis.orbit_table import attractors_of
from pendmap.charts import palette, plane
from pendmap.errors import InputError
from pendmap.files import facts
from pendmap.formatting import MINUS, typographic, with_error

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr


@dataclass(frozen=True, eq=False)
class Entry:
    """One line of a legend.

    ``id`` is 1 or more for an attractor, 0 for undecided and -1 for failed cells; ``fraction`` and
    ``share`` are the share of the cells, in text with its standard error, ``twin`` the name of the
    mirror twin, ``points``, shape (m, 2), the stroboscopic points: angle in rad, velocity;
    ``chaotic`` says whether they are samples of a chaotic set rather than a periodic orbit.
    """

    id: int
    name: str
    colour: str
    marker: str
    chaotic: bool
    fraction: float
    share: str
    twin: str
    points: npt.NDArray[np.float64]

    @property
    def text(self) -> str:
        """Text of the line."""
        twin = f", twin of {typeset(self.twin)}" if self.twin else ""
        return f"{typeset(self.name)}, {self.share}{twin}"


def entries(dataset: xr.Dataset) -> list[Entry]:
    """Return the attractors of a map, then undecided and failed cells if there are any."""
    names = {
        int(i): str(name)
        for i, name in zip(dataset["id"].values, dataset["attractor"].values, strict=True)
    }
    owner = dataset["point_attractor"].values
    points = plane.points(dataset)
    listed = []
    looks = zip(names.items(), attractors_of(dataset), colours_of(dataset), strict=True)
    for k, ((i, name), one, colour) in enumerate(looks):
        row = dataset.isel(attractor=k)
        twin = int(row["twin"])
        other = names.get(twin, "") if twin != i else ""
        fraction, mine = float(row["fraction"]), points[owner == i]
        share = percent(fraction, float(row["stderr"]))
        look = (colour, palette.marker(one), one.chaotic)
        listed.append(Entry(i, name, *look, fraction, share, other, mine))
    if dataset.attrs.get("layers") == "finite_time" and not listed:
        return listed
    none = np.empty((0, 2))
    for i, name, colour in ((0, "undecided", palette.UNDECIDED), (-1, "failed", palette.FAILED)):
        share_of = float(facts(dataset).get(name, 0.0))
        if share_of > 0:
            look = (colour, "s", False)
            listed.append(Entry(i, name, *look, share_of, percent(share_of), "", none))
    return listed


def colours_of(dataset: xr.Dataset, prefix: str = "") -> list[str]:
    """Return the colour of each attractor: the one a user chose, or that of its type."""
    chosen = dataset["colour"].values.tolist() if "colour" in dataset else itertools.repeat("")
    every = attractors_of(dataset, prefix)
    return [choice or palette.colour(one) for choice, one in zip(chosen, every, strict=False)]


def with_looks(
    dataset: xr.Dataset, colours: Mapping[str, str], names: Mapping[str, str]
) -> xr.Dataset:
    """Return a result whose attractors, given by their names, have other colours and names."""
    dim = next((dim for dim in ("attractor", "orbit", "kind") if dim in dataset.coords), None)
    known = [] if dim is None else dataset[dim].values.tolist()
    for what, given in (("colors", colours), ("names", names)):
        for name in given:
            if name not in known:
                allowed = f"one of {', '.join(known)}" if known else "left out: there are none"
                raise InputError(f"{what}: attractor must be {allowed}, got {name!r}")
    if dim is None:
        return dataset
    chosen = [colours.get(name, "") for name in known]
    renamed = np.array([names.get(name, name) for name in known], dtype=str)
    return dataset.assign(colour=(dim, chosen)).assign_coords({dim: renamed})


def colours(dataset: xr.Dataset) -> npt.NDArray[np.uint8]:
    """Return the colours of the labels -1, 0, 1, ..., K, in this order: shape (K + 2, 3)."""
    ids = dataset["id"].values.astype(int)
    table = np.empty((int(ids.max(initial=0)) + 2, 3), dtype=np.uint8)
    table[:] = palette.parts(palette.UNNAMED)
    table[0], table[1] = palette.parts(palette.FAILED), palette.parts(palette.UNDECIDED)
    for i, colour in zip(ids, colours_of(dataset), strict=True):
        table[i + 1] = palette.parts(colour)
    return table


def percent(share: float, stderr: float = math.nan) -> str:
    """Return a share in percent, with as many digits as its standard error supports."""
    if not math.isfinite(stderr) or stderr <= 0:
        return f"{100 * share:.3g} %"
    return typographic(with_error(100 * share, 100 * stderr)) + " %"


def typeset(name: str) -> str:
    """Return a name with minus signs for the hyphens before numbers, brackets and the end."""
    parts = name.split("-")
    ends = (MINUS if part[:1] in {"", ")", *string.digits} else "-" for part in parts[1:])
    return parts[0] + "".join(map(operator.add, ends, parts[1:]))
