"""Charts of branches of orbits over a parameter, and of their bifurcations over two."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from scipy.interpolate import PchipInterpolator

from pendmap._core import Attractor
from pendmap.analysis.result import rows
from pendmap.charts import names, palette, plane
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.marks import DASHED, DOTTED, INK, NONE, QUIET, Line, Mark, Points
from pendmap.files import facts
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    import xarray as xr

    from pendmap.charts.marks import Dash, Floats

_COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
_UNSTABLE: Final = {"colour": "#555555", "width": 0.7, "name": "unstable"}
_MARKERS: Final = {
    "fold": "s",
    "period_doubling": "o",
    "symmetry_breaking": "^",
    "neimark_sacker": "D",
    **dict.fromkeys(("stick_onset", "grazing", "rest_boundary"), "v"),
    "cusp": "s",
    "generalised_doubling": "o",
    "degenerate_symmetry_breaking": "^",
    "fold_at_event": "s",
    "period_doubling_at_event": "o",
    "symmetry_breaking_at_event": "^",
}
_DASHES: Final[dict[str, Dash]] = {kind: dash or "-" for kind, (_, dash) in palette.CURVES.items()}
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
    types = dict.fromkeys((n, abs(w)) for n, w in rows(dataset, "branch_n", "branch_w"))
    colours = dict(zip(types, itertools.cycle(_COLOURS), strict=False))
    panels = [
        Panel(which, "", below, side, [*lines(dataset, which, colours), *events(dataset, which)])
        for which, side in zip(("theta", "velocity"), sides, strict=True)
    ]
    if name in {"omega", "frequency_hz"} and np.isfinite(dataset["orbit_amplitude"]).any():
        side = Axis("amplitude (rad)", (0.0, 1.05 * float(dataset["orbit_amplitude"].max())))
        curves = [lines(dataset, "amplitude", colours), events(dataset, "amplitude")]
        marks = [*_backbones(dataset), *itertools.chain(*curves)]
        panels.append(Panel("resonance", "", below, side, marks))
    which = f"{a['n']}:{a['w']}" if "n" in a else f"up to period {a['up_to']}"
    title = f"Branches of orbits {which} over {names.over([name])}"
    chosen = names.parameters(a, [name])
    return Chart(title, chosen, [[panel] for panel in panels], size=(7.4, 6.8)).only(layer)


def lines(
    dataset: xr.Dataset, which: str, colours: Mapping[tuple[int, int], str] | None
) -> Iterator[Mark]:
    """Yield the branches, one line for each of their points; without colours unstable ones."""
    branch, value = dataset["orbit_branch"].values, dataset["orbit_value"].values
    stable, of = dataset["orbit_stable"].values.astype(bool), dataset["point_orbit"].values
    # Pieces on both sides of an event end there.
    ends = np.isin(np.arange(value.size), dataset["event_orbit"].values)
    whole = which == "amplitude"  # one number of an orbit, not of each of its points
    y = dataset["orbit_amplitude" if whole else f"point_{which}"].values
    for number, (n, w) in enumerate(rows(dataset, "branch_n", "branch_w")):
        mine = branch == number
        points, x = y[mine][:, None] if whole else y[mine[of]].reshape(-1, n), value[mine]
        for way in range(2):
            dash: Dash = DASHED if way else "-"
            shown = (stable != way) | ends
            for k in range(points.shape[1] if colours or way else 0):
                line = np.where(shown[mine], points[:, k], np.nan)
                wraps = np.abs(np.diff(line, prepend=line[:1])) > np.pi
                line[wraps if which == "theta" else np.zeros_like(wraps)] = np.nan
                look: dict[str, Any] = _UNSTABLE
                if colours:
                    name = f"{n}:{abs(w)}" if way + k == 0 else ""
                    look = {"colour": colours[n, abs(w)], "name": name}
                yield Line(x, line, dash=dash, path=f"branch/{number}/{way}/{k}", **look)


def events(dataset: xr.Dataset, which: str) -> Iterator[Mark]:
    """Yield what happens on the branches, the marks of each kind."""
    kinds = dataset["event_kind"].values
    if which == "amplitude":
        heights = dataset["orbit_amplitude"].values[dataset["event_orbit"].values]
    else:
        heights = dataset[f"event_{which}"].values
    for kind in dict.fromkeys(kinds.tolist()):
        at = kinds == kind
        yield _events(kind, dataset["event_value"].values[at], heights[at])


def _events(kind: str, x: Floats, y: Floats) -> Points:
    """Return points at which something happens."""
    look: dict[str, Any] = {"marker": _MARKERS[kind], "name": kind.replace("_", " ")}
    return Points(x, y, size=5.0, order=4.0, **look, **_EMPTY)


def _backbones(dataset: xr.Dataset) -> list[Mark]:
    """Return the amplitude of free swings, for each period and number of swings of the orbits."""
    if "backbone_value" not in dataset:
        return []
    n, swings = dataset["branch_n"].values[dataset["orbit_branch"].values], dataset["orbit_swings"]
    types = sorted(
        {
            (a // g, b // g)
            for a, b in zip(n, swings.values, strict=True)
            if b
            for g in [math.gcd(a, b)]
        }
    )
    rate, height = (dataset[f"backbone_{key}"].values for key in ("value", "amplitude"))
    look: dict[str, Any] = {"colour": QUIET, "dash": DOTTED}
    return [
        Line(rate * n / k, height, path=f"backbone/{n}/{k}", name="" if i else "backbone", **look)
        for i, (n, k) in enumerate(types)
    ]


def bifurcation_set(
    dataset: xr.Dataset,
    over: Sequence[str],
    colours: Mapping[str, str] | None = None,
    to: Callable[[Floats], Floats] = np.asarray,
    **look: Any,  # noqa: ANN401 (fields of a line)
) -> list[Mark]:
    """Return the curves in the plane of two parameters and the points of codimension 2.

    Dashes say what happens; lines are thin where the orbits born there are subcritical, thick where
    a multiplier jumps over 1 or -1 as slips and sticks change. Colours are
    those of the orbits' types, or are given for what happens. ``to`` maps points, shape (m, 2).
    """
    if "curve_kind" not in dataset:
        return []
    names = ("curve", "supercritical", "jump")
    owner, sides, jumps = (dataset[f"place_{name}"].values for name in names)
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
        thin, thick = (one[mine][first + changes[mine][first]] for one in (sides == 0, jumps > 0))
        path = f"{name}/{kind}/{number}".replace(" ", "_").replace(":", "_")
        looks = (1.5, ~(thin | thick), path), (0.6, thin, f"{path}/subcritical")
        for width, shown, at in (*looks, (2.8, thick, f"{path}/jump")):
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
    if jumps.any():
        marks.append(Line(NONE, NONE, colour=INK, width=2.8, name="thick: a multiplier jumps"))
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
