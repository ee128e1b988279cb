"""Critical curves: lines joined from frequency to frequency, and regions of stable rest."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from scipy.optimize import linear_sum_assignment

from pendmap.analysis.critical_curves import in_plane, window
from pendmap.analysis.tongues import NEAR
from pendmap.charts import names
from pendmap.charts.chart import Axis, Chart, Panel
from pendmap.charts.marks import QUIET, Areas, Line, Mark, Points, Text, this_pendulum, together
from pendmap.files import facts
from pendmap.formatting import typographic

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    import xarray as xr

    from pendmap.charts.marks import Floats

    Point = tuple[float, float]

_CURVES: Final = {
    -1: ("minus", typographic("exact, multiplier -1 (period 2)"), "#0072b2", "#56b4e9"),
    1: ("plus", "exact, multiplier +1 (period 1)", "#d55e00", "#e69f00"),
}
"""Path, name and colours of the curves of hanging and inverted rest, by multiplier; +1 has
solutions of the drive's period, -1 of twice that."""
_STABLE, _INVERTED, _FOLD = "#e3ecd8", "#9a6fb0", "#009e73"
_DRIVE: Final = {"p", "omega", "phase", "Omega", "phi"}  # Parameters that vary

_PLANES: Final = {
    "omega-p": ("tongues", "ω = Ω/w0", "p = YΩ²/g"),
    "e-alpha2": ("paper", "α² = 1/ω²", "e = p/ω² = Y/l"),
}
"""Path in a recording, and names of the axes, of each plane."""
_PARTED = 0.3  # Error above which an asymptotic curve is not drawn
_JUMP = 0.6  # Largest change of p along a line from point to point, over the mean p plus 0.3
_FAR: Final = 1e6  # Cost of joining points that lie on different curves


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
    first = str(dataset.attrs.get("plane"))
    order = sorted(_PLANES, key=lambda plane: plane != first)
    panels = [_panel(dataset, plane, marks) for plane in order]
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
    p_max = float(attrs["p_max"])
    x, top = window(omega, p_max, plane)

    def to(points: Floats) -> Floats:
        """Return points (omega, p) in the coordinates of the plane."""
        return np.stack(in_plane(points[..., 0], points[..., 1], plane), axis=-1)

    def curve(lines: Iterable[Floats], **look: Any) -> Line:  # noqa: ANN401 (fields of a line)
        return Line(*together(map(to, lines)), **look)

    def critical(prefix: str, which: int) -> list[Floats]:
        return joined(omega, *_points(dataset, prefix, which))

    rest = "rest: its orbit is stable" if attrs["moved"] else "rest is stable"
    hanging, inverted = ([to(area) for area in _stable(dataset, one)] for one in ("", "inverted_"))
    drawn: list[Mark] = [Areas(hanging, colour=_STABLE, name=f"hanging {rest}")]
    if inverted:
        # A hatch leaves the area below it visible, and has no seams.
        name = f"inverted {rest}"
        drawn.append(Areas(inverted, colour=_INVERTED, hatch="////", name=name))
    for m, (name, text, colour, pale) in _CURVES.items():
        look: dict[str, Any] = {"width": 1.5 if m < 0 else 1.1, "order": 2.2}
        drawn.append(curve(critical("", m), colour=colour, name=text, path=name, **look))
        lines = critical("inverted_", m)
        look["name"] = f"inverted rest: {text.partition(' (')[0]}" if lines else ""
        drawn.append(curve(lines, colour=pale, path=f"inverted_{name}", **look))
    lines = [line for m in _CURVES for line in critical("undamped_", m)]
    text = "exact, without damping" if float(attrs["gamma"]) > 0 and lines else ""
    drawn.append(curve(lines, colour=QUIET, width=0.6, name=text, path="undamped"))
    fold = np.stack([omega, dataset["fold"].values], axis=-1)[dataset["fold_sought"].values > 0]
    text = "fold: the oscillation exists from here" if np.isfinite(to(fold)).any() else ""
    look = {"colour": _FOLD, "width": 1.6, "dash": (5.0, 2.0), "order": 2.1}
    drawn.append(Line(*to(fold).T, name=text, path="fold", **look))
    drawn += _asymptotic(dataset, to)
    bands = [band for prefix in ("", "inverted_") for band in _bands(dataset, prefix)]
    if bands:
        text = "95 % of the draws"
        drawn.append(curve(bands, colour=QUIET, width=3.0, alpha=0.5, name=text))
    edge = to(np.stack([omega, np.full_like(omega, p_max)], axis=-1))
    if (edge[:, 1] < 0.995 * top).any():
        drawn.append(Line(*edge.T, colour="#c8c8c8", width=3.0, name="largest p computed", order=1))
    if not marks:
        at, up = map(float, to(np.array([float(attrs["own_omega"]), float(attrs["own_p"])])))
        drawn.append(this_pendulum(at, up, named=x[0] <= at <= x[1] and 0 <= up <= top))
    for p, at, name in marks:
        spot = to(np.array([at, p]))
        drawn.append(Points(*spot[:, None], size=5.0))
        aside, up = spot[0] + 0.015 * (x[1] - x[0]), spot[1] + 0.012 * top
        drawn.append(Text(aside, up, name, align=("left", "bottom")))
    root, across, along = _PLANES[plane]
    return Panel(plane, "", Axis(across, x), Axis(along, (0.0, top)), drawn, root=root)


def _asymptotic(dataset: xr.Dataset, to: Callable[[Floats], Floats]) -> list[Mark]:
    """Return the asymptotic curves, thin where they differ from the exact ones."""
    omega, error = dataset["omega"].values, dataset["asymptotic_error"].values
    drawn: list[Mark] = []
    for k, (name, look) in enumerate(zip(dataset["curve"].values, ("-.", "--", ":"), strict=False)):
        whole = to(np.stack([omega, dataset["asymptotic"].values[k]], axis=-1))
        close = (error[k] < NEAR)[:, None]
        parting = np.where((error[k] < _PARTED)[:, None] & ~close, whole, np.nan)
        text = "" if np.isnan(parting).all() else str(name)
        near = np.where(close, whole, np.nan)
        drawn += [
            Line(*near.T, dash=look, width=1.0, name=text),
            Line(*parting.T, dash=look, width=0.5, alpha=0.45),
        ]
    return drawn


def _bands(dataset: xr.Dataset, prefix: str) -> list[Floats]:
    """Return the interval of each critical amplitude over draws, as points (omega, p)."""
    if f"{prefix}p_low" not in dataset:
        return []
    low, high = (dataset[f"{prefix}p_{end}"].values for end in ("low", "high"))
    omega, _ = _points(dataset, prefix)
    ends = np.stack([np.stack([omega, low], axis=1), np.stack([omega, high], axis=1)], axis=1)
    return [*ends[np.isfinite(low)]]


def joined(omega: Floats, at: Floats, p: Floats) -> list[Floats]:
    """Return lines, each (n, 2), through critical amplitudes ``p`` at frequencies ``at``.

    Points at successive frequencies are joined where they continue lines best. Where a curve turns
    back between two frequencies, its neighbouring ends are joined.
    """
    done: list[list[Point]] = []
    lines: list[list[Point]] = []
    for w in omega:
        values = np.sort(p[at == w])
        ends = np.array([line[-1][1] for line in lines])
        away = np.abs(np.array([_ahead(line, w) for line in lines])[:, None] - values)
        far = np.abs(ends[:, None] - values) >= _reach(ends[:, None], values)
        pairs = linear_sum_assignment(np.where(far, _FAR, away))
        following = {int(i): int(j) for i, j in zip(*pairs, strict=True) if not far[i, j]}
        for i, j in following.items():
            lines[i].append((w, values[j]))
        new = [[(w, v)] for j, v in enumerate(values) if j not in following.values()]
        ended = [line for i, line in enumerate(lines) if i not in following]
        done += ended + _turns(sorted(line[-1] for line in ended))
        done += _turns([line[0] for line in new]) if w > omega[0] else []
        lines = [*(lines[i] for i in sorted(following)), *new]
    return [np.array(line) for line in [*done, *lines] if len(line) > 1]


def _reach(one: Any, other: Any) -> Any:  # noqa: ANN401 (numbers or arrays)
    """Return the distance below which points at neighbouring frequencies lie on one curve."""
    return _JUMP * (0.3 + (one + other) / 2)


def _turns(ends: Sequence[Point]) -> list[list[Point]]:
    """Return joints between neighbouring ends at one frequency, at which a curve turns back."""
    pairs = list(itertools.pairwise(ends))
    return [[a, b] for a, b in pairs if abs(a[1] - b[1]) < _reach(a[1], b[1])]


def _ahead(line: list[Point], w: float) -> float:
    """Return the extrapolation of a line to the next frequency."""
    (w0, p0), (w1, p1) = line[-2:] if len(line) > 1 else (line[0], line[0])
    return p1 + (p1 - p0) * (w - w1) / (w1 - w0) if w1 > w0 else p1


def _stable(dataset: xr.Dataset, prefix: str) -> list[Floats]:
    """Return quadrangles between neighbouring frequencies in which rest is stable."""
    omega, p_max = dataset["omega"].values, float(dataset.attrs["p_max"])
    at, p = _points(dataset, prefix)
    above = dataset[f"{prefix}stable_above"].values
    first = np.zeros(omega.size) if prefix else dataset["stable_at_first"].values
    intervals: list[list[Point]] = []
    for w, stable in zip(omega, first, strict=True):
        mine = at == w
        edges = itertools.pairwise([0.0, *p[mine], p_max])
        merged: list[Point] = []
        for (low, high), yes in zip(edges, [stable, *above[mine]], strict=True):
            if yes and merged and merged[-1][1] == low:
                merged[-1] = (merged[-1][0], high)
            elif yes and high > low:
                merged.append((low, high))
        intervals.append(merged)
    areas = []
    for k, (here, there) in enumerate(itertools.pairwise(omega)):
        before, after = intervals[k], intervals[k + 1]
        same = len(before) == len(after)
        for a, b in zip(before, after, strict=True) if same else itertools.product(before, after):
            if same or min(a[1], b[1]) > max(a[0], b[0]):
                areas.append(np.array([(here, a[0]), (here, a[1]), (there, b[1]), (there, b[0])]))
    return areas


def _points(dataset: xr.Dataset, prefix: str, which: int = 0) -> tuple[Floats, Floats]:
    """Return the critical points of a multiplier, or all: frequencies and amplitudes."""
    multiplier = dataset[f"{prefix}multiplier"].values
    at, p = dataset[f"{prefix or 'critical_'}omega"].values, dataset[f"{prefix}p"].values
    mine = (multiplier == which) | (which == 0)
    return at[mine], p[mine]
