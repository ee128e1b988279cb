"""Critical curves in the plane of the drive, and regions of stable rest."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.charts import names
from pendmap.charts.chart import Axis, Chart, Panel
from pendmap.charts.continuation import bifurcation_set
from pendmap.charts.marks import Areas, Line, Mark, Points, Text, this_pendulum
from pendmap.files import facts
from pendmap.formatting import typographic

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

    from pendmap.charts.marks import Floats

_COLOURS: Final = {"symmetry_breaking": "#d55e00", "fold": "#009e73", "period_doubling": "#0072b2"}
_STABLE, _INVERTED = "#e3ecd8", "#9a6fb0"
_DRIVE: Final = {"p", "omega", "phase", "Omega", "phi"}  # Parameters that vary
_PLANES: Final = {
    "omega-p": ("tongues", "ω = Ω/w0", "p = YΩ²/g"),
    "e-alpha2": ("paper", "α² = 1/ω²", "e = p/ω² = Y/l"),
}
"""Path in a recording, and names of the axes, of each plane."""
_HIGHEST: Final = 2.6  # Largest ``e`` of a figure, if it was computed


def chart(
    dataset: xr.Dataset,
    *,
    layer: str | None = None,
    cells: int = 0,
    title: str = "Where rest is stable, hanging and inverted",
    marks: Sequence[tuple[float, float, str]] = (),
) -> Chart:
    """Return the critical curves in both planes; a figure shows one of them."""
    del cells
    panels = [_panel(dataset, plane, marks) for plane in _PLANES]
    return Chart(
        title,
        names.parameters({k: v for k, v in facts(dataset).items() if k not in _DRIVE}),
        [panels[:1]],
        recorded=panels,
        ratio=0.72,
        tabs=True,
    ).only(layer)


def _panel(dataset: xr.Dataset, plane: str, marks: Sequence[tuple[float, float, str]]) -> Panel:
    omega, attrs = dataset["omega"].values, facts(dataset)
    low, high, p_max = float(omega[0]), float(omega[-1]), float(attrs["p_max"])
    x, top = (low, high) if low < high else (0.95 * low, 1.05 * high), p_max
    if plane != "omega-p":
        x, top = (0.0, 1 / low**2), min(_HIGHEST, p_max / low**2)

    def to(points: Floats) -> Floats:
        """Return points (omega, p) in the coordinates of the plane."""
        if plane == "omega-p":
            return points
        return np.stack([1 / points[..., 0] ** 2, points[..., 1] / points[..., 0] ** 2], axis=-1)

    rest = "rest: its orbit is stable" if attrs["moved"] else "rest is stable"
    hanging, inverted = ([to(one) for one in _stable(dataset, up)] for up in (False, True))
    drawn: list[Mark] = [Areas(hanging, colour=_STABLE, name=f"hanging {rest}")]
    if inverted:
        name = f"inverted {rest}"
        drawn.append(Areas(inverted, colour=_INVERTED, hatch="////", name=name))
    if "curve_kind" in dataset:
        drawn += bifurcation_set(dataset, ("omega", "p"), _COLOURS, to, order=2.1)
    else:
        at = np.stack([dataset[f"critical_{one}"].values for one in ("omega", "p")], axis=-1)
        multiplier = dataset["critical_multiplier"].values
        for m, kind in ((-1, "period_doubling"), (1, "symmetry_breaking")):
            text, shown = typographic(f"multiplier {m:+}"), to(at[multiplier == m])
            drawn.append(Points(*shown.T, colour=_COLOURS[kind], size=2.0, name=text))
    for k, look in enumerate(("-.", ":")):
        line = to(np.stack([omega, dataset["asymptotic"].values[k]], axis=-1))
        text = str(dataset["formula"].values[k]) if np.isfinite(line).any() else ""
        drawn.append(Line(*line.T, dash=look, width=1.0, name=text))
    if not marks:
        star = to(np.array([float(attrs["own_omega"]), float(attrs["own_p"])]))
        across, high = map(float, star)
        drawn.append(this_pendulum(across, high, named=x[0] <= across <= x[1] and high <= top))
    for p, frequency, name in marks:
        spot = to(np.array([frequency, p]))
        drawn.append(Points(*spot[:, None], size=5.0))
        aside, up = spot[0] + 0.015 * (x[1] - x[0]), spot[1] + 0.012 * top
        drawn.append(Text(aside, up, name, align=("left", "bottom")))
    root, *sides = _PLANES[plane]
    return Panel(plane, "", Axis(sides[0], x), Axis(sides[1], (0.0, top)), drawn, root=root)


def _stable(dataset: xr.Dataset, inverted: bool) -> list[Floats]:  # noqa: FBT001 (which rest)
    """Return quadrangles between neighbouring frequencies in which rest is stable."""
    omega, p_max = dataset["omega"].values, float(dataset.attrs["p_max"])
    mine = dataset["critical_inverted"].values == inverted
    index, p, above = (
        dataset[f"critical_{name}"].values[mine] for name in ("index", "p", "stable_above")
    )
    first = np.zeros(omega.size) if inverted else dataset["stable_at_first"].values
    intervals = []
    for k in range(omega.size):
        edges = np.array([0.0, *p[index == k], p_max])
        stable = np.array([0, first[k], *above[index == k], 0]) > 0
        changes = np.flatnonzero(np.diff(stable))
        intervals.append(edges[changes].reshape(-1, 2))
    areas = []
    for k, (here, there) in enumerate(itertools.pairwise(omega)):
        before, after = intervals[k], intervals[k + 1]
        same = len(before) == len(after)
        for a, b in zip(before, after, strict=True) if same else itertools.product(before, after):
            if same or min(a[1], b[1]) > max(a[0], b[0]):
                areas.append(np.array([(here, a[0]), (here, a[1]), (there, b[1]), (there, b[0])]))
    return areas
