"""Bifurcation diagrams: points, sweeps up and down, exponents, coloured by attractor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap._core import Attractor
from pendmap.analysis.bifurcation import followed
from pendmap.analysis.orbit_table import attractors_of
from pendmap.charts import continuation, names, palette, plane
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.legend import colours_of, typeset
from pendmap.charts.marks import QUIET, Image, Level, Mark, Points
from pendmap.files import facts
from pendmap.units import Units

if TYPE_CHECKING:
    import numpy.typing as npt
    import xarray as xr

    from pendmap.charts.marks import Floats

MOST: Final = 16  # Greatest number of families that a legend names; all others are grey
_POINTS: Final = ("theta", "velocity")  # What the points of a diagram show
_SIZE: Final = (7.4, 6.8)  # Size of the figure, inches
_HEIGHTS: Final = (2.4, 0.42, 1.6)  # Relative heights of points, sweeps and exponents
_STRIP: Final = Axis("", (-1.0, 1.0), ticks=((0.5, "up →"), (-0.5, "← down")))


@dataclass(frozen=True, eq=False)
class Family:
    """All attractors of one name.

    ``points``, shape (m, 3), are value, angle and velocity; ``exponents``, shape (k, 2), value and
    largest exponent; ``up`` and ``down`` mark the values at which the sweeps are on one of them.
    """

    name: str
    colour: str
    chaotic: bool
    points: npt.NDArray[np.float64]
    exponents: npt.NDArray[np.float64]
    up: npt.NDArray[np.bool_]
    down: npt.NDArray[np.bool_]


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 1200) -> Chart:
    """Return angles and velocities of the points, the sweeps, and the exponents."""
    varied = str(dataset.attrs["varied"])
    below, every = names.parameter_axis(dataset, varied), families(dataset)
    units, ends = Units.of(facts(dataset)), plane.outer_edges(dataset, varied)
    theta = plane.angles(dataset, dataset["point_theta"].values)
    speeds = holding(dataset["point_velocity"].values, 0.0)
    angle, speed = names.phase_plane(theta, speeds, units)
    bare = Axis("", ends, ticks=())
    growth = holding(dataset["entry_exponent"].values, 0.0)
    rate = Axis(f"exponent {names.per_time(units)}", growth)
    exponents: list[Mark] = [Level(0.0, colour=QUIET)]
    for k, one in reversed([*enumerate(every)]):
        name = _text(every, k) if layer == "exponent" else ""
        exponents.append(_dots(dataset, one, one.exponents, 1.6, f"{k}/points", name))
    panels = [
        Panel("theta", "", bare, angle, _points(dataset, every, "theta"), root="bifurcation"),
        Panel("velocity", "", bare, speed, _points(dataset, every, "velocity")),
        Panel("sweeps", "", bare, _STRIP, _sweeps(dataset, every, ends, cells)),
        Panel("exponent", "", below, rate, exponents),
    ]
    count, starts = dataset.sizes[varied], int(dataset.attrs["starts"])
    return Chart(
        f"Bifurcations over {names.over([varied])}",
        f"{names.parameters(facts(dataset), [varied])};   {count} values, {starts} starts each",
        [[panels[0]], [panels[2]], [panels[3]]],
        recorded=continuation.recorded(panels, _moving(dataset, every), angle, speed),
        timeline=(varied, np.sort(dataset[varied].values)),
        heights=_HEIGHTS,
        size=_SIZE,
        letters=False,
        tabs=True,
    ).only(layer)


def _dots(  # noqa: PLR0913, PLR0917 (what points are, and their look)
    dataset: xr.Dataset, one: Family, at: Floats, size: float, path: str, name: str = ""
) -> Points:
    cells = plane.edges(dataset, str(dataset.attrs["varied"])) if one.chaotic else None
    return Points(*at.T, colour=one.colour, size=size, path=path, name=name, cells=cells)


def _points(dataset: xr.Dataset, every: list[Family], which: str) -> list[Mark]:
    """Return the stroboscopic points; points of orbits are larger than those of chaos."""
    column = 1 + _POINTS.index(which)
    values = dataset[str(dataset.attrs["varied"])].values
    # A single point must be visible.
    size = min(3.0, max(1.3, 200.0 / values.size))
    drawn: list[Mark] = []
    if dataset.sizes.get("loose"):
        shown = np.isin(dataset["loose_value"].values, values)
        loose = (dataset[f"loose_{name}"].values[shown] for name in ("value", which))
        look: dict[str, Any] = {"colour": palette.UNNAMED, "name": "sweep, undecided"}
        drawn.append(Points(*loose, size=0.45, order=1.0, **look))
    for k, one in reversed([*enumerate(every)]):
        of = 0.45 if one.chaotic else size
        points = one.points[:, [0, column]]
        drawn.append(_dots(dataset, one, points, of, f"{k}/points", _text(every, k)))
    if (branches := followed(dataset)).sizes:
        drawn += [*continuation.lines(branches, which, None), *continuation.events(branches, which)]
    return drawn


def _moving(dataset: xr.Dataset, every: list[Family]) -> dict[str, list[Mark]]:
    """Return the attractors and the unstable orbits at each value."""
    moving: dict[str, list[Mark]] = {name: [] for name in ("theta", "velocity", "phase")}
    if (branches := followed(dataset)).sizes:
        at = np.sort(dataset[str(dataset.attrs["varied"])].values)
        orbits = continuation.at_values(branches, at, None)
        moving = {name: [one for one in orbits[name] if "unstable" in one.path] for name in moving}
    for k, one in enumerate(every):
        look: dict[str, Any] = {"colour": one.colour, "size": 3.0 if one.chaotic else 9.0}
        for marks, axes in zip(moving.values(), ([0, 1], [0, 2], [1, 2]), strict=True):
            at = one.points[:, axes].T
            marks.append(Points(*at, when=one.points[:, 0], path=f"now/{k}", **look))
    return moving


def _sweeps(
    dataset: xr.Dataset, every: list[Family], ends: tuple[float, float], cells: int
) -> list[Mark]:
    """Return a strip for each sweep, coloured by its attractor, with the names of all families."""
    strip = np.zeros((2, dataset.sizes[str(dataset.attrs["varied"])]), dtype=np.int64)
    classes = [("", "#ffffff")]
    for k, one in enumerate(every):
        strip[1, one.up] = strip[0, one.down] = k + 1
        classes.append((_text(every, k), one.colour))
    if (strip == 0).any():
        classes[0] = ("sweep on none", "#ffffff")
    shown = strip[:, plane.cells(plane.edges(dataset, str(dataset.attrs["varied"])), cells)]
    image = Image(shown, ends, (-1.0, 1.0), classes=classes, path="attractors")
    return [image, Level(0.0, colour="#ffffff", width=1.2)]


def _text(every: list[Family], k: int) -> str:
    """Return the entry of a family in the legend; the rare ones share one."""
    return typeset(every[k].name) if k < MOST else f"{len(every) - MOST} more" * (k == MOST)


def families(dataset: xr.Dataset) -> list[Family]:
    """Return the families, ordered by the number of values at which they occur.

    Twins that lean to opposite sides are of one family. Chaos is always among the :data:`MOST`
    named ones, however rare.
    """
    every, shades = attractors_of(dataset, "kind_"), colours_of(dataset, "kind_")
    numbers: dict[tuple[str, int | None, int], int] = {}
    keys = [(one.kind, one.n, one.w) for one in every]
    group = np.array([numbers.setdefault(key, len(numbers)) for key in keys], dtype=np.intp)
    which, value = group[dataset["entry_kind"].values], dataset["entry_value"].values
    # A selection of values has the attractors of all.
    chosen = dataset[str(dataset.attrs["varied"])].values
    here = np.isin(value, chosen)
    count = np.bincount(which[here], minlength=len(numbers))
    points = np.column_stack([dataset["point_value"].values, plane.points(dataset)])
    of_point = np.where(np.isin(points[:, 0], chosen), which[dataset["point_entry"].values], -1)
    up, down = (np.append(which, -1)[dataset[key].values] for key in ("up", "down"))
    chaos = group[[k for k, one in enumerate(every) if one.chaotic]]
    regular = ~np.isin(np.arange(count.size), chaos)
    first = np.lexsort((-count, regular, count == 0))[:MOST]
    order = np.lexsort((-count, ~np.isin(np.arange(count.size), first)))[: np.sum(count > 0)]
    listed: list[Family] = []
    for k in order.tolist():
        places = sorted(np.flatnonzero(group == k).tolist(), key=lambda at: abs(every[at].lean))
        one, mine = every[places[0]], here & (which == k)
        exponents = np.stack([value[mine], dataset["entry_exponent"].values[mine]], axis=1)
        name = str(dataset["kind"].values[places[0]])
        if len(places) > 1:
            name = Attractor(one.kind, one.n or 0, one.w).name
        shade = palette.on_white(shades[places[0]]) if len(listed) < MOST else palette.UNNAMED
        on = (points[of_point == k], exponents, up == k, down == k)
        listed.append(Family(name, shade, one.chaotic, *on))
    return listed
