"""Critical curves: lines joined from frequency to frequency, and regions of stable rest."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from pendmap.analysis.critical_curves import PLANES, in_plane, window
from pendmap.analysis.tongues import NEAR
from pendmap.charts import names
from pendmap.charts.chart import Axis, Chart, Panel
from pendmap.charts.marks import QUIET, Areas, Line, Mark, Points, Text, together
from pendmap.errors import InputError
from pendmap.formatting import typographic

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import xarray as xr

    from pendmap.charts.marks import Floats

_CURVES: Final = {
    -1: ("minus", typographic("exact, multiplier -1 (period 2)"), "#0072b2", "#56b4e9"),
    1: ("plus", "exact, multiplier +1 (period 1)", "#d55e00", "#e69f00"),
}
"""Path, name and colours of the curves of hanging and inverted rest, by multiplier; +1 has
solutions of the drive's period, -1 of twice that."""
_STABLE, _INVERTED, _FOLD = "#e3ecd8", "#9a6fb0", "#009e73"
_ROOTS: Final = {"omega-p": ("tongues", ""), "e-alpha2": ("paper", "")}
"""Path and title of each plane in a recording."""
_DRIVE: Final = {"p", "omega", "phase", "Omega", "phi"}  # Parameters that vary

_SQUARED = "²"
_NAMES = {
    "omega-p": (
        "ω = Ω/w0",
        f"p = YΩ{_SQUARED}/g",
    ),
    "e-alpha2": (
        f"α{_SQUARED} = 1/ω{_SQUARED}",
        f"e = p/ω{_SQUARED} = Y/l",
    ),
}

_PARTED = 0.3  # Error above which an asymptotic curve is not drawn

_TIP = 0.6  # Amplitude below which an undamped tongue is extended to its tip

_JUMP = 0.6
"""Largest change of p between two frequencies over which lines are joined, over the mean ``p`` plus
0.3."""


def chart(
    dataset: xr.Dataset,
    *,
    layer: str | None = None,
    cells: int = 0,
    title: str = "Where rest is stable, hanging and inverted",
    marks: Sequence[tuple[float, float, str]] = (),
) -> Chart:
    """Return the critical curves in both planes; a figure shows one of them.

    ``marks`` are points ``(p, omega, name)`` drawn instead of the pendulum's own.
    """
    del cells
    first = layer or str(dataset.attrs.get("plane", PLANES[0]))
    if first not in PLANES:
        raise InputError(f"layer must be one of {', '.join(PLANES)}, got {first!r}")
    order = sorted(_ROOTS, key=lambda plane: plane != first)
    panels = [_panel(dataset, plane, marks) for plane in order]
    return Chart(
        title,
        names.parameters({k: v for k, v in dataset.attrs.items() if k not in _DRIVE}),
        [panels[:1]],
        recorded=panels,
        ratio=0.72,
        tabs=True,
    )


def _panel(dataset: xr.Dataset, plane: str, marks: Sequence[tuple[float, float, str]]) -> Panel:
    omega = dataset["omega"].values
    p_max = float(dataset.attrs["p_max"])
    x, top = window(omega, p_max, plane)

    def to(points: Floats) -> Floats:
        """Return points (omega, p) in the coordinates of the plane."""
        return np.stack(in_plane(points[..., 0], points[..., 1], plane), axis=-1)

    def curves(found: list[list[tuple[float, int]]], m: int) -> tuple[Floats, Floats]:
        return together(to(line) for line in joined(omega, found, m))

    first = dataset["stable_at_first"].values
    stable = "hanging rest: its orbit is" if dataset.attrs["moved"] else "hanging rest is"
    upright = stable.replace("hanging", "inverted")
    drawn: list[Mark] = [
        Areas(
            [to(area) for area in _stable(omega, dataset, "", first, p_max)],
            colour=_STABLE,
            name=f"{stable} stable",
        )
    ]
    inverted = _stable(omega, dataset, "inverted_", np.zeros_like(first), p_max)
    if inverted:
        # A hatch leaves the area below it visible, and has no seams.
        drawn.append(
            Areas(
                [to(area) for area in inverted],
                colour=_INVERTED,
                hatch="////",
                name=f"{upright} stable",
            )
        )
    found = by_frequency(dataset, "", omega.size)
    above = by_frequency(dataset, "inverted_", omega.size)
    for m, (name, said, colour, pale) in _CURVES.items():
        look: dict[str, Any] = {"width": 1.5 if m < 0 else 1.1, "order": 2.2}
        drawn.append(Line(*curves(found, m), colour=colour, name=said, path=name, **look))
        x_up, y_up = curves(above, m)
        of_upright = f"inverted rest: {said.partition(' (')[0]}" if x_up.size else ""
        pair: dict[str, Any] = {"colour": pale, "name": of_upright, "path": f"inverted_{name}"}
        drawn.append(Line(x_up, y_up, **(look | pair)))
    bare = by_frequency(dataset, "undamped_", omega.size)
    lines = [to(_tipped(line, m, omega)) for m in _CURVES for line in joined(omega, bare, m)]
    damped = float(dataset.attrs["gamma"]) > 0 and bool(lines)
    said = "exact, without damping" if damped else ""
    drawn.append(Line(*together(lines), colour=QUIET, width=0.6, name=said, path="undamped"))
    fold = to(np.stack([omega, dataset["fold"].values], axis=-1)[dataset["fold_sought"].values > 0])
    said = "fold: the oscillation exists from here" if np.isfinite(fold).any() else ""
    drawn.append(
        Line(*fold.T, colour=_FOLD, width=1.6, dash=(5.0, 2.0), name=said, path="fold", order=2.1)
    )
    drawn += _asymptotic(dataset, to)
    bands = [to(band) for prefix in ("", "inverted_") for band in _bands(dataset, prefix)]
    if bands:
        draws = "95 % of the draws"
        drawn.append(Line(*together(bands), colour=QUIET, width=3.0, alpha=0.5, name=draws))
    edge = to(np.stack([omega, np.full_like(omega, p_max)], axis=-1))
    if (edge[:, 1] < 0.995 * top).any():
        drawn.append(Line(*edge.T, colour="#c8c8c8", width=3.0, name="largest p computed", order=1))
    own_at = np.array([[float(dataset.attrs["own_omega"]), float(dataset.attrs["own_p"])]])
    drawn += _points(to(own_at), x, top) if not marks else []
    for p, at, name in marks:
        ((across, up),) = to(np.array([[at, p]]))
        spot = np.array([across]), np.array([up])
        drawn.append(Points(*spot, size=5.0))
        shift = (0.015 * (x[1] - x[0]), 0.012 * top)
        drawn.append(Text(across + shift[0], up + shift[1], name, align=("left", "bottom")))
    names = _NAMES[plane]
    sides = Axis(names[0], x), Axis(names[1], (0.0, top))
    return Panel(plane, _ROOTS[plane][1], *sides, drawn, root=_ROOTS[plane][0])


def _asymptotic(dataset: xr.Dataset, to: Callable[[Floats], Floats]) -> list[Mark]:
    """Return the asymptotic curves, thin where they differ from the exact ones."""
    omega, error = dataset["omega"].values, dataset["asymptotic_error"].values
    drawn: list[Mark] = []
    for k, (name, look) in enumerate(zip(dataset["curve"].values, ("-.", "--", ":"), strict=False)):
        whole = to(np.stack([omega, dataset["asymptotic"].values[k]], axis=-1))
        close = (error[k] < NEAR)[:, None]
        parting = np.where((error[k] < _PARTED)[:, None] & ~close, whole, np.nan)
        said = "" if np.isnan(parting).all() else str(name)
        near = np.where(close, whole, np.nan)
        drawn += [
            Line(*near.T, dash=look, width=1.0, name=said),
            Line(*parting.T, dash=look, width=0.5, alpha=0.45),
        ]
    return drawn


def _points(own: Floats, x: tuple[float, float], top: float) -> list[Mark]:
    (across, up) = own[0]
    said = "this pendulum" if x[0] <= across <= x[1] and 0 <= up <= top else ""
    return [Points(*own.T, marker="*", size=9.0, name=said, path="own", order=4.0)]


def _bands(dataset: xr.Dataset, prefix: str) -> list[Floats]:
    """Return the interval of each critical amplitude over draws, as points (omega, p)."""
    if f"{prefix}p_low" not in dataset:
        return []
    low, high = (dataset[f"{prefix}p_{end}"].values for end in ("low", "high"))
    omega = dataset["omega"].values[dataset[f"{prefix}index"].values]
    ends = np.stack([np.stack([omega, low], axis=1), np.stack([omega, high], axis=1)], axis=1)
    return [*ends[np.isfinite(low)]]


def by_frequency(dataset: xr.Dataset, prefix: str, count: int) -> list[list[tuple[float, int]]]:
    """Return amplitude and multiplier of the critical points of each frequency."""
    found: list[list[tuple[float, int]]] = [[] for _ in range(count)]
    columns = (dataset[f"{prefix}{name}"].values for name in ("index", "p", "multiplier"))
    for index, p, multiplier in zip(*columns, strict=True):
        found[int(index)].append((float(p), int(multiplier)))
    return found


def joined(omega: Floats, found: list[list[tuple[float, int]]], multiplier: int) -> list[Floats]:
    """Return the lines through the points with this multiplier.

    Counted from below, the two boundaries of a tongue keep their order; if the count changes from
    one frequency to the next, the nearest points are joined.
    """
    open_: list[list[tuple[float, float]]] = []
    done: list[list[tuple[float, float]]] = []
    for w, row in zip(omega, found, strict=True):
        values = [p for p, m in row if m == multiplier]
        pairs = sorted(
            (abs(_ahead(line, w) - p), i, j)
            for i, line in enumerate(open_)
            for j, p in enumerate(values)
            if abs(line[-1][1] - p) < _JUMP * (0.3 + (line[-1][1] + p) / 2)
        )
        taken: dict[int, int] = {}
        used: set[int] = set()
        for _, i, j in pairs:
            if i not in taken and j not in used:
                taken[i] = j
                used.add(j)
        on, ended = [], []
        for i, line in enumerate(open_):
            if i in taken:
                line.append((w, values[taken[i]]))
                on.append(line)
            else:
                ended.append(line)
        done += _paired(ended)
        begun = [[(w, p)] for j, p in enumerate(values) if j not in used]
        # Two neighbouring lines that begin here are one curve that turns back between frequencies.
        for lower, upper in itertools.pairwise(begun if w > omega[0] else []):
            if _tip(lower[0], upper[0]) and len(lower) == 1:
                upper.insert(0, lower[0])
        open_ = [*on, *begun]
    return [np.array(line) for line in [*done, *open_] if len(line) > 1]


def _tip(a: tuple[float, float], b: tuple[float, float]) -> bool:
    """Return whether two points at one frequency lie next to a turning point of a curve."""
    return abs(a[1] - b[1]) < _JUMP * (0.3 + (a[1] + b[1]) / 2)


def _paired(
    ended: list[list[tuple[float, float]]],
) -> list[list[tuple[float, float]]]:
    """Join neighbouring lines that end at one frequency, at which a curve turns back."""
    done: list[list[tuple[float, float]]] = []
    for line in sorted(ended, key=lambda one: one[-1][1]):
        if done and done[-1][-1][0] == line[-1][0] and _tip(done[-1][-1], line[-1]):
            done[-1] = [*done[-1], *reversed(line)]
        else:
            done.append(line)
    return done


def _tipped(line: Floats, multiplier: int, omega: Floats) -> Floats:
    """Add the tip of an undamped tongue, ``p = 0`` at ``omega = 2/k``, to a line around it.

    At the tip the linear equation without drive has the multiplier ``(-1)^k``, for any model.
    """
    spacing = float(np.diff(omega).max())
    for k in range(1 if multiplier < 0 else 2, 9, 2):
        tip = 2 / k
        for i in range(len(line) - 1):
            (w0, p0), (w1, p1) = line[i], line[i + 1]
            around = min(w0, w1) - spacing < tip < max(w0, w1) + spacing
            passed = w0 == w1 or (w0 - tip) * (w1 - tip) < 0
            if around and passed and 0 < max(p0, p1) < _TIP:
                line = np.insert(line, i + 1, (tip, 0.0), axis=0)
                break
    return line


def _ahead(line: list[tuple[float, float]], w: float) -> float:
    """Return the extrapolation of a line to the next frequency."""
    if len(line) == 1:
        return line[-1][1]
    (w0, p0), (w1, p1) = line[-2:]
    if w0 == w1:  # it begins at a turning point of a curve
        return p1
    return p1 + (p1 - p0) * (w - w1) / (w1 - w0)


def _stable(
    omega: Floats,
    dataset: xr.Dataset,
    prefix: str,
    first: npt.NDArray[np.int8],
    p_max: float,
) -> list[Floats]:
    """Return quadrangles between neighbouring frequencies in which rest is stable.

    Between two frequencies with equal curves, strips are matched in order, however steep; otherwise
    all overlapping ones are joined.
    """
    names = (f"{prefix}{name}" for name in ("index", "p", "multiplier", "stable_above"))
    index, p, multiplier, above = (dataset[name].values for name in names)
    intervals: list[list[tuple[float, float]]] = []
    curves: list[tuple[int, ...]] = []
    for k in range(omega.size):
        mine = index == k
        curves.append(tuple(multiplier[mine]))
        edges = [0.0, *p[mine], p_max]
        is_stable = [int(first[k]), *above[mine]]
        pairs = zip(edges[:-1], edges[1:], is_stable, strict=True)
        merged: list[tuple[float, float]] = []
        for low, high, yes in pairs:
            if yes and merged and merged[-1][1] == low:
                merged[-1] = (merged[-1][0], high)
            elif yes and high > low:
                merged.append((low, high))
        intervals.append(merged)
    areas = []
    for k in range(omega.size - 1):
        here, there = omega[k], omega[k + 1]
        before, after = intervals[k], intervals[k + 1]
        # Curves that exceed p_max at one of the frequencies come last.
        shared = min(len(curves[k]), len(curves[k + 1]))
        same = curves[k][:shared] == curves[k + 1][:shared] and len(before) == len(after)
        for a, b in zip(before, after, strict=True) if same else itertools.product(before, after):
            if same or min(a[1], b[1]) > max(a[0], b[0]):
                areas.append(np.array([(here, a[0]), (here, a[1]), (there, b[1]), (there, b[0])]))
    return areas
