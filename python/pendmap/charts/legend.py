"""Legend of a basin map: names, colours and shares of the attractors."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pendmap.charts import palette, plane
from pendmap.files import facts
from pendmap.formatting import MINUS, typographic, with_error

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False)
class Entry:
    """One line of a legend.

    ``id`` is 1 or more for an attractor, 0 for undecided and -1 for failed cells, whose ``kind`` is
    the name; ``fraction`` and ``share`` are the share of the cells, in text with its standard
    error, ``twin`` the name of the mirror twin, ``points``, shape (m, 2), the stroboscopic points:
    angle in rad, velocity.
    """

    id: int
    name: str
    kind: str
    fraction: float
    share: str
    twin: str
    points: npt.NDArray[np.float64]

    @property
    def colour(self) -> str:
        """The colour, ``"#rrggbb"``."""
        return palette.colour(self.name, self.kind)

    @property
    def chaotic(self) -> bool:
        """Whether the points are samples of a chaotic set rather than a periodic orbit."""
        return self.kind.endswith("chaos")

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
    found = []
    for k, (i, name) in enumerate(names.items()):
        row = dataset.isel(attractor=k)
        twin = int(row["twin"])
        other = names.get(twin, "") if twin != i else ""
        fraction, mine = float(row["fraction"]), points[owner == i]
        share = percent(fraction, float(row["stderr"]))
        found.append(Entry(i, name, str(row["kind"].item()), fraction, share, other, mine))
    if dataset.attrs.get("layers") == "finite_time" and not found:
        return found
    for i, name in ((0, "undecided"), (-1, "failed")):
        share_of = float(facts(dataset).get(name, 0.0))
        if share_of > 0:
            none = np.empty((0, 2))
            found.append(Entry(i, name, name, share_of, percent(share_of), "", none))
    return found


def colours(dataset: xr.Dataset) -> npt.NDArray[np.uint8]:
    """Return the colours of the labels -1, 0, 1, ..., K, in this order: shape (K + 2, 3)."""
    ids = dataset["id"].values.astype(int)
    table = np.empty((int(ids.max(initial=0)) + 2, 3), dtype=np.uint8)
    table[:] = palette.rgb("unnamed")
    table[0], table[1] = palette.rgb("failed"), palette.rgb("undecided")
    for i, name, kind in zip(ids, dataset["attractor"].values, dataset["kind"].values, strict=True):
        table[i + 1] = palette.rgb(str(name), str(kind))
    return table


def percent(share: float, stderr: float = math.nan) -> str:
    """Return a share in percent, with as many digits as its standard error supports."""
    if not math.isfinite(stderr) or stderr <= 0:
        return f"{100 * share:.3g} %"
    return typographic(with_error(100 * share, 100 * stderr)) + " %"


def typeset(name: str) -> str:
    """Return a name with minus signs for the hyphens before numbers, brackets and the end."""
    return re.sub(r"-(?=\d|\)|$)", MINUS, name)
