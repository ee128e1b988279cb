"""Charts of branches of orbits over a parameter, and of their bifurcations over two."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap._core import Attractor
from pendmap.analysis.regions import smooth
from pendmap.analysis.result import rows
from pendmap.charts import names, palette, plane
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.marks import DASHED, DOTTED, INK, NONE, QUIET, Image, Line, Mark, Points
from pendmap.files import facts
from pendmap.formatting import counted
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    import xarray as xr

    from pendmap.charts.marks import Dash, Floats

_COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
_GREY: Final = "#555555"
_UNSTABLE: Final = {"colour": _GREY, "width": 0.7, "name": "unstable"}
_DASHES: Final[dict[str, Dash]] = {kind: dash or "-" for kind, (_, dash) in palette.CURVES.items()}
_STEPS: Final = 401  # Values of a parameter, besides those of events, in a recording
_SIDES: Final = ("theta", "velocity")
_MOVING: Final = {
    "phase": _SIDES,
    "theta": ("value", "theta"),
    "velocity": ("value", "velocity"),
    "resonance": ("value", "amplitude"),
    "curves": ("across", "value"),
}
"""Coordinates of the points of orbits at a value of the parameter, by panel."""
_SHADES: Final = ("#ffffff", "#f0f0f0", "#e2e2e2", "#d4d4d4", "#c6c6c6")  # By stable orbits
_EMPTY: Final[dict[str, Any]] = {"fill": "#ffffff", "edge": INK, "edge_width": 1.0}


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 0) -> Chart:
    """Return angles and velocities of the orbits: full lines if stable, broken ones if not.

    Over two parameters it has the curves in their plane.
    """
    del cells
    a, name = facts(dataset), str(dataset.attrs["varied"])
    which = "place" if "curve_kind" in dataset else "point"
    theta, speed = (dataset[f"{which}_{one}"].values for one in _SIDES)
    sides = names.phase_plane(plane.angles(dataset, theta), holding(speed), Units.of(a))
    if "curve_kind" in dataset:
        both = name.split(", ")
        ends = zip(np.ravel(a["low"]).tolist(), np.ravel(a["high"]).tolist(), strict=True)
        of = (str(dataset[f"place_{one}"].attrs.get("units", "1")) for one in both)
        triples = zip(both, of, ends, strict=True)
        across, up = (Axis(names.symbol(one, unit), pair) for one, unit, pair in triples)
        marks = [*_stable(dataset, both), *bifurcation_set(dataset, both, halo="#ffffff")]
        panels = [Panel("curves", "", across, up, marks)]
        steps = np.linspace(a["low"][1], a["high"][1], _STEPS)
        moving = recorded(panels, _critical(dataset, both, steps), *sides)
        longest = counted(a["up_to"], "period")
        title = f"Bifurcations of orbits up to {longest} over {names.over(both)}"
        look: dict[str, Any] = {"timeline": (both[1], steps), "size": (7.4, 5.6)}
        return Chart(title, names.parameters(a, both), [panels], recorded=moving, **look).only(
            layer
        )
    label = names.symbol(name, str(dataset["orbit_value"].attrs.get("units", "1")))
    below = Axis(label, (float(a["low"]), float(a["high"])))
    types = dict.fromkeys((n, abs(w)) for n, w in rows(dataset, "branch_n", "branch_w"))
    colours = dict(zip(types, itertools.cycle(_COLOURS), strict=False))
    panels = [
        Panel(which, "", below, side, [*lines(dataset, which, colours), *events(dataset, which)])
        for which, side in zip(_SIDES, sides, strict=True)
    ]
    if name in {"omega", "frequency_hz"} and np.isfinite(dataset["orbit_amplitude"]).any():
        side = Axis("amplitude (rad)", (0.0, 1.05 * float(dataset["orbit_amplitude"].max())))
        curves = [lines(dataset, "amplitude", colours), events(dataset, "amplitude")]
        marks = [*_backbones(dataset), *itertools.chain(*curves)]
        panels.append(Panel("resonance", "", below, side, marks))
    which = f"{a['n']}:{a['w']}" if "n" in a else f"up to period {a['up_to']}"
    title = f"Branches of orbits {which} over {names.over([name])}"
    steps = np.union1d(np.linspace(a["low"], a["high"], _STEPS), dataset["event_value"])
    moving = recorded(panels, at_values(dataset, steps, colours), *sides)
    look = {"recorded": moving, "timeline": (name, steps), "size": (7.4, 6.8)}
    chosen = names.parameters(a, [name])
    return Chart(title, chosen, [[panel] for panel in panels], **look).only(layer)


def recorded(
    panels: Sequence[Panel], moving: Mapping[str, list[Mark]], angle: Axis, speed: Axis
) -> list[Panel]:
    """Return panels with their marks that move, and the phase plane with its own."""
    paths = [mark.path for marks in moving.values() for mark in marks]
    small = any(path.endswith("unstable") for path in paths)
    known = [Line(NONE, NONE, name="small: unstable")] if small else []
    every = [*panels, Panel("phase", "Phase plane", angle, speed, known)]
    return [replace(one, marks=[*one.marks, *moving.get(one.name, ())]) for one in every]


def at_values(
    dataset: xr.Dataset, steps: Floats, colours: Mapping[tuple[int, int], str] | None
) -> dict[str, list[Mark]]:
    """Return the orbits at values of the parameter, for each panel; without colours grey."""
    orbit, branch = dataset["point_orbit"].values, dataset["orbit_branch"].values
    place = np.arange(orbit.size) - np.searchsorted(orbit, orbit)
    order = np.lexsort((orbit, place, branch[orbit]))
    orbit, place = orbit[order], place[order]
    types = [(n, abs(w)) for n, w in rows(dataset, "branch_n", "branch_w")]
    shades = {f"{n}:{w}": colours[n, w] if colours else _GREY for n, w in types}
    columns = {f"point_{name}": order for name in _SIDES}
    columns |= {f"orbit_{name}": orbit for name in ("value", "amplitude")}
    points = {name[6:]: dataset[name].values[of] for name, of in columns.items()}
    points["type"] = np.array([f"{n}:{w}" for n, w in types])[branch[orbit]]
    points["stable"] = _shown(dataset, 0)[orbit]
    points["line"] = branch[orbit] * (1 + int(place.max(initial=0))) + place
    return _moving(dataset, points, steps, shades)


def _critical(dataset: xr.Dataset, both: Sequence[str], steps: Floats) -> dict[str, list[Mark]]:
    """Return the orbits to which something happens at values of the second parameter."""
    names = dict(zip(("across", "value", *_SIDES), (*both, *_SIDES), strict=True))
    points = {key: dataset[f"place_{name}"].values for key, name in names.items()}
    points["line"] = owner = dataset["place_curve"].values
    every = enumerate(rows(dataset, "curve_n", "curve_w"))
    looks = [_type_of(dataset, np.flatnonzero(owner == k), n, w) for k, (n, w) in every]
    points["type"] = np.array([name for name, _ in looks])[owner]
    points["stable"] = np.ones(owner.size, dtype=bool)
    return _moving(dataset, points, steps, dict(looks))


def _moving(
    dataset: xr.Dataset, points: Mapping[str, Any], steps: Floats, colours: Mapping[str, str]
) -> dict[str, list[Mark]]:
    """Return the points of lines at values of their parameter, interpolated, for each panel."""
    x, stable = points["value"], points["stable"]
    low, high = np.sort([x[:-1], x[1:]], axis=0)
    crossed = (low <= steps[:, None]) & (steps[:, None] <= high) & (low < high)
    new = np.diff(points["line"], append=-1) != 0
    step, at = np.nonzero(crossed & ~new[:-1])
    part = (steps[step] - x[at]) / (x[at + 1] - x[at])
    once = (part < 1) | new[at + 1]  # a point where two pieces meet
    step, at, part = step[once], at[once], part[once]
    places = {}
    for name in {*points} & {"value", "across", "amplitude", *_SIDES}:
        gap = points[name][at + 1] - points[name][at]
        places[name] = points[name][at] + part * (plane.wrapped(gap) if name == "theta" else gap)
    if not plane.on_line(dataset):
        places["theta"] = plane.wrapped(places["theta"])
    marks: dict[str, list[Mark]] = {panel: [] for panel in _MOVING}
    for name, way in itertools.product(colours, (True, False)):
        mine = (points["type"][at] == name) & ((stable[at] & stable[at + 1]) == way)
        path = re.sub(r"\W", "_", name) + "/unstable" * (not way)
        look: dict[str, Any] = {"colour": colours[name], "path": f"now/{path}"}
        look |= {"size": 9.0 if way else 5.0, "when": steps[step[mine]]}
        for panel, sides in _MOVING.items() if mine.any() else ():
            if sides[0] in places and sides[1] in places:
                marks[panel].append(Points(*(places[side][mine] for side in sides), **look))
    return marks


def _shown(dataset: xr.Dataset, way: int) -> Any:  # noqa: ANN401 (an array)
    """Return which orbits are stable, or not; events belong to the pieces on both sides."""
    stable = dataset["orbit_stable"].values.astype(bool)
    return (stable != way) | np.isin(np.arange(stable.size), dataset["event_orbit"].values)


def lines(
    dataset: xr.Dataset, which: str, colours: Mapping[tuple[int, int], str] | None
) -> Iterator[Mark]:
    """Yield the branches, one line for each of their points; without colours unstable ones."""
    branch, value = dataset["orbit_branch"].values, dataset["orbit_value"].values
    of = dataset["point_orbit"].values
    whole = which == "amplitude"  # one number of an orbit, not of each of its points
    y = dataset["orbit_amplitude" if whole else f"point_{which}"].values
    for number, (n, w) in enumerate(rows(dataset, "branch_n", "branch_w")):
        mine = branch == number
        points, x = y[mine][:, None] if whole else y[mine[of]].reshape(-1, n), value[mine]
        for way in range(2):
            dash: Dash = DASHED if way else "-"
            shown = _shown(dataset, way)
            for k in range(points.shape[1] if colours or way else 0):
                line = np.where(shown[mine], points[:, k], np.nan)
                wraps = np.abs(np.diff(line, prepend=line[:1])) > np.pi
                line[wraps if which == "theta" else np.zeros_like(wraps)] = np.nan
                look: dict[str, Any] = _UNSTABLE
                if colours:
                    name = f"{n}:{abs(w)}" if way + k == 0 else ""
                    look = {"colour": colours[n, abs(w)], "name": name, "width": 1.3 - 0.5 * way}
                yield Line(x, line, dash=dash, path=f"branch/{number}/{way}/{k}", **look)
    if colours and not dataset["orbit_stable"].values.all():
        yield Line(NONE, NONE, dash=DASHED, width=0.8, name="thin: unstable")


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
    look: dict[str, Any] = {"marker": palette.MARKERS[kind], "name": kind.replace("_", " ")}
    return Points(x, y, size=5.0, order=4.0, **look, **_EMPTY)


def _backbones(dataset: xr.Dataset) -> list[Mark]:
    """Return the amplitude of free swings, for each period and number of swings of the orbits."""
    if "backbone_value" not in dataset:
        return []
    n, swings = dataset["branch_n"].values[dataset["orbit_branch"].values], dataset["orbit_swings"]
    pairs = zip(n, swings.values, strict=True)
    types = sorted({(a // math.gcd(a, b), b // math.gcd(a, b)) for a, b in pairs if b})
    rate, height = (dataset[f"backbone_{key}"].values for key in ("value", "amplitude"))
    look: dict[str, Any] = {"colour": QUIET, "dash": DOTTED}
    return [
        Line(rate * n / k, height, path=f"backbone/{n}/{k}", name="" if i else "backbone", **look)
        for i, (n, k) in enumerate(types)
    ]


def _stable(dataset: xr.Dataset, over: Sequence[str]) -> list[Mark]:
    """Return how many orbits are stable over the plane, in shades of grey."""
    if "stable_count" not in dataset:
        return []
    counts = dataset["stable_count"].values.clip(0).sum(axis=0).clip(0, len(_SHADES) - 1)
    texts = ["no stable orbit", *(counted(k, "stable orbit") for k in range(1, len(_SHADES)))]
    texts[-1] += " or more"
    x, y = (plane.outer_edges(dataset, name) for name in over)
    return [Image(counts, x, y, classes=list(zip(texts, _SHADES, strict=True)))]


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
        points, first = smooth(places[mine])
        # Where new orbits change their side the coefficient has no sign.
        thin, thick = (one[mine][first + changes[mine][first]] for one in (sides == 0, jumps > 0))
        path = f"{name}/{kind}/{number}".replace(" ", "_").replace(":", "_")
        looks = (0.9 if colours else 1.5, ~(thin | thick), path), (0.6, thin, f"{path}/subcritical")
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


def _type_of(dataset: xr.Dataset, mine: Any, n: int, w: int) -> tuple[str, str]:  # noqa: ANN401
    """Return the name and the colour of the orbits of a curve."""
    name, one = f"{n}:{w}", Attractor("rotation" if w else "oscillation", n, w)
    if (n, w) == (1, 0) and not dataset["place_velocity"].values[mine].any():
        upright = np.cos(dataset["place_theta"].values[mine][0]) < 0
        name = "inverted rest" if upright else "rest"
        one = Attractor(name.replace(" ", "_"), 1)
    return name, palette.on_white(palette.colour(one))
