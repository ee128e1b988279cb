"""Charts of branches of orbits over a parameter, and of their bifurcations over two."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from scipy.interpolate import PchipInterpolator

from pendmap._core import Attractor
from pendmap.analysis.result import rows
from pendmap.charts import names, palette, plane
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.marks import DASHED, DOTTED, INK, NONE, Line, Mark, Points
from pendmap.files import facts
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import xarray as xr

    from pendmap.charts.marks import Dash, Floats

_COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
_MARKERS: Final = {
    "fold": "s",
    "period_doubling": "o",
    "symmetry_breaking": "^",
    "neimark_sacker": "D",
    **dict.fromkeys(("stick_onset", "grazing", "rest_boundary"), "v"),
    "cusp": "s",
    "generalised_doubling": "o",
    "degenerate_symmetry_breaking": "^",
}
_DASHES: Final[dict[str, Dash]] = {
    "fold": "-",
    "period_doubling": DASHED,
    "symmetry_breaking": DOTTED,
}
_FINER: Final = 8  # Points of a line for each that was computed
_EMPTY: Final[dict[str, Any]] = {"fill": "#ffffff", "edge": INK, "edge_width": 1.0}


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 0) -> Chart:
    """Return angles and velocities of the orbits: full lines if stable, broken ones if not.

    Over two parameters it has the curves in their plane.
    """
    del cells
    a, name = facts(dataset), str(dataset.attrs["varied"])
    if "curve_kind" in dataset:
        both = name.split(", ")
        ends = zip(np.ravel(a["low"]).tolist(), np.ravel(a["high"]).tolist(), strict=True)
        of = (str(dataset[f"place_{one}"].attrs.get("units", "1")) for one in both)
        triples = zip(both, of, ends, strict=True)
        across, up = (Axis(names.symbol(one, unit), pair) for one, unit, pair in triples)
        panel = Panel("curves", "", across, up, bifurcation_set(dataset, both))
        title = f"Bifurcations of orbits up to {a['up_to']} periods over {names.over(both)}"
        return Chart(title, names.parameters(a, both), [[panel]], size=(7.4, 5.6)).only(layer)
    units = Units.of(a)
    theta = plane.angles(dataset, dataset["point_theta"].values)
    sides = names.phase_plane(theta, holding(dataset["point_velocity"].values), units)
    label = names.symbol(name, str(dataset["orbit_value"].attrs.get("units", "1")))
    below = Axis(label, (float(a["low"]), float(a["high"])))
    panels = [
        Panel(which, "", below, side, _marks(dataset, which))
        for which, side in zip(("theta", "velocity"), sides, strict=True)
    ]
    title = f"Branches of orbits {a['n']}:{a['w']} over {names.over([name])}"
    chosen = names.parameters(a, [name])
    return Chart(title, chosen, [[panel] for panel in panels], size=(7.4, 6.8)).only(layer)


def _marks(dataset: xr.Dataset, which: str) -> list[Mark]:
    """Return the branches as lines, one for each of their points, and the events."""
    branch, value = dataset["orbit_branch"].values, dataset["orbit_value"].values
    stable, of = dataset["orbit_stable"].values.astype(bool), dataset["point_orbit"].values
    y = dataset[f"point_{which}"].values
    marks: list[Mark] = []
    types = [*rows(dataset, "branch_n", "branch_w")]
    colours = dict(zip(dict.fromkeys(types), itertools.cycle(_COLOURS), strict=False))
    for number, (n, w) in enumerate(types):
        mine = branch == number
        points, x, full = y[mine[of]].reshape(-1, n), value[mine], stable[mine]
        for way, (dash, shown) in enumerate((("-", full), (DASHED, ~full))):
            # A piece belongs to both looks at the orbit where it changes.
            near = shown | np.roll(shown, 1) & (np.arange(shown.size) > 0)
            for k in range(n):
                line = np.where(near, points[:, k], np.nan)
                wraps = np.abs(np.diff(line, prepend=line[:1])) > np.pi
                line[wraps if which == "theta" else np.zeros_like(wraps)] = np.nan
                text = f"{n}:{w}" if not way and not k else ""
                look: dict[str, Any] = {"colour": colours[n, w], "dash": dash, "name": text}
                marks.append(Line(x, line, path=f"{number}/{way}/{k}", **look))
    kinds = dataset["event_kind"].values
    for kind in dict.fromkeys(kinds.tolist()):
        at = kinds == kind
        place = dataset["event_value"].values[at], dataset[f"event_{which}"].values[at]
        marks.append(_events(kind, *place))
    return marks


def _events(kind: str, x: Floats, y: Floats) -> Points:
    """Return points at which something happens."""
    look: dict[str, Any] = {"marker": _MARKERS[kind], "name": kind.replace("_", " ")}
    return Points(x, y, size=5.0, order=4.0, **look, **_EMPTY)


def bifurcation_set(
    dataset: xr.Dataset,
    over: Sequence[str],
    colours: Mapping[str, str] | None = None,
    to: Callable[[Floats], Floats] = np.asarray,
    **look: Any,  # noqa: ANN401 (fields of a line)
) -> list[Mark]:
    """Return the curves in the plane of two parameters and the points of codimension 2.

    Dashes say what happens; lines are thin where the orbits born there are subcritical. Colours are
    those of the orbits' types, or are given for what happens. ``to`` maps points, shape (m, 2).
    """
    if "curve_kind" not in dataset:
        return []
    owner, sides = (dataset[f"place_{name}"].values for name in ("curve", "supercritical"))
    places, degenerate = (
        to(np.stack([dataset[f"{which}_{name}"].values for name in over], axis=-1))
        for which in ("place", "degenerate")
    )
    changes = np.isin(np.arange(owner.size), dataset["degenerate_place"].values)
    types: dict[str, str] = {}
    lines: list[Mark] = []
    every = list(rows(dataset, "curve_kind", "curve_n", "curve_w"))
    for number, (kind, n, w) in enumerate(every):
        mine = np.flatnonzero(owner == number)
        if mine.size == 1:  # a corner of the plane
            continue
        name, colour = _type_of(dataset, mine, n, w)
        types[name] = colour
        of: dict[str, Any] = {"colour": (colours or {}).get(kind, colour), "dash": _DASHES[kind]}
        points, first = _smooth(places[mine])
        # Where new orbits change their side the coefficient has no sign.
        thin = (sides[mine] == 0)[first + changes[mine][first]]
        path = f"{name}/{kind}/{number}".replace(" ", "_").replace(":", "_")
        for width, shown, at in ((1.5, ~thin, path), (0.6, thin, f"{path}/subcritical")):
            # A piece belongs to both looks at the point where it changes.
            near = shown | np.roll(shown, 1) & (np.arange(shown.size) > 0)
            x, y = np.where(near[:, None], points, np.nan).T
            if shown.any():
                lines.append(Line(x, y, width=width, path=at, **of, **look))
    marks: list[Mark] = []
    if colours is None:
        marks += [Line(NONE, NONE, colour=types[name], name=name) for name in sorted(types)]
    for kind in [one for one in _DASHES if any(one == row[0] for row in every)]:
        shade, text = (colours or {}).get(kind, INK), kind.replace("_", " ")
        marks.append(Line(NONE, NONE, colour=shade, dash=_DASHES[kind], name=text))
    if (sides == 0).any():
        marks.append(Line(NONE, NONE, colour=INK, width=0.6, name="thin: subcritical"))
    special = dataset["degenerate_kind"].values
    at_kind = ((one, degenerate[special == one]) for one in dict.fromkeys(special.tolist()))
    return [*marks, *lines, *(_events(kind, *at.T) for kind, at in at_kind)]


def _smooth(points: Floats) -> tuple[Floats, Any]:
    """Return a curve through points, with the number of the point before each of its own."""
    pieces = np.linalg.norm(np.diff(points, axis=0) / np.ptp(points, axis=0).clip(1e-12), axis=1)
    along = np.concatenate([[0.0], pieces.clip(1e-12).cumsum()])
    part = np.linspace(0.0, along.size - 1, _FINER * (along.size - 1) + 1)
    at = np.interp(part, np.arange(along.size), along)
    first = np.minimum(part.astype(int), along.size - 2)
    return PchipInterpolator(along, points)(at), first


def _type_of(dataset: xr.Dataset, mine: Any, n: int, w: int) -> tuple[str, str]:  # noqa: ANN401
    """Return the name and the colour of the orbits of a curve."""
    name, one = f"{n}:{w}", Attractor("rotation" if w else "oscillation", n, w)
    if (n, w) == (1, 0) and not dataset["place_velocity"].values[mine].any():
        upright = np.cos(dataset["place_theta"].values[mine][0]) < 0
        name = "inverted rest" if upright else "rest"
        one = Attractor(name.replace(" ", "_"), 1)
    return name, palette.on_white(palette.colour(one))
