"""Legend of a basin map: names, colours and shares of the attractors."""

from __future__ import annotations

import dataclasses
import itertools
import math
import operator
import string
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


@dataclasses.dataclass(frozen=True, eq=False)
class Entry:
    """One line of a legend.

    ``id`` is 1 or more for an attractor, 0 for undecided and -1 for failed cells; ``text`` has its
    name, its share of the cells with the standard error, and its mirror twin; ``points``, shape
    (m, 2), are the stroboscopic points: angle in rad, velocity; ``chaotic`` says whether they are
    samples of a chaotic set rather than a periodic orbit.
    """

    id: int
    name: str
    text: str
    colour: str
    marker: str = "s"
    chaotic: bool = False
    points: npt.NDArray[np.float64] = dataclasses.field(default_factory=lambda: np.empty((0, 2)))


def entries(dataset: xr.Dataset) -> list[Entry]:
    """Return the attractors of a map, then undecided and failed cells if there are any."""
    names = dict(zip(dataset["id"].values.tolist(), dataset["attractor"].values, strict=True))
    owner, points = dataset["point_attractor"].values, plane.points(dataset)
    columns = (dataset[name].values for name in ("fraction", "stderr", "twin"))
    rows = zip(names, attractors_of(dataset), colours_of(dataset), *columns, strict=True)
    listed = []
    for i, one, colour, share, error, twin in rows:
        text = f"{typeset(str(names[i]))}, {percent(float(share), float(error))}"
        if twin != i and twin in names:
            text += f", twin of {typeset(str(names[twin]))}"
        look = (colour, palette.marker(one), one.chaotic)
        listed.append(Entry(i, str(names[i]), text, *look, points[owner == i]))
    if dataset.attrs.get("layers") == "finite_time" and not listed:
        return listed
    for i, name, colour in ((0, "undecided", palette.UNDECIDED), (-1, "failed", palette.FAILED)):
        share = float(facts(dataset).get(name, 0.0))
        if share > 0:
            listed.append(Entry(i, name, f"{name}, {percent(share)}", colour))
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


def colours(dataset: xr.Dataset) -> dict[int, str]:
    """Return the colours of the labels -1, 0, 1, ..., K, in this order."""
    ids = dataset["id"].values.tolist()
    mine = dict(zip(ids, colours_of(dataset), strict=True))
    mine |= {-1: palette.FAILED, 0: palette.UNDECIDED}
    return {k: mine.get(k, palette.UNNAMED) for k in range(-1, max(ids, default=0) + 1)}


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
