"""Critical curves: lines joined from frequency to frequency, and regions of stable rest."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from pendmap.analysis.tongues import NEAR, PLANES, in_plane, window
from pendmap.charts import names
from pendmap.charts.chart import Axis, Chart, Panel
from pendmap.charts.marks import QUIET, Areas, Line, Mark, Points, Text, this_pendulum, together
from pendmap.errors import InputError
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

_TIP = 0.6  # Amplitude below which an undamped tongue is extended to its tip

_JUMP = 0.6  # Largest change of p along a line from point to point, over the mean p plus 0.3


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
    first = layer or str(dataset.attrs.get("plane", PLANES[0]))
    if first not in PLANES:
        raise InputError(f"layer must be one of {', '.join(PLANES)}, got {first!r}")
    order = sorted(_PLANES, key=lambda plane: plane != first)
    panels = [_panel(dataset, plane, marks) for plane in order]
    return Chart(
        title,
        names.parameters({k: v for k, v in facts(dataset).items() if k not in _DRIVE}),
        [panels[:1]],
        recorded=panels,
        ratio=0.72,
        tabs=True,
    )


def _panel(dataset: xr.Dataset, plane: str, marks: Sequence[tuple[float, float, str]]) -> Panel:
    omega, attrs = dataset["omega"].values, facts(dataset)
    p_max = float(attrs["p_max"])
    x, top = window(omega, p_max, plane)

    def to(points: Floats) -> Floats:
        """Return points (omega, p) in the coordinates of the plane."""
        return np.stack(in_plane(points[..., 0], points[..., 1], plane), axis=-1)

    def curve(lines: Iterable[Floats], **look: Any) -> Line:  # noqa: ANN401 (fields of a line)
        return Line(*together(map(to, lines)), **look)

    rest = "rest: its orbit is stable" if attrs["moved"] else "rest is stable"
    first = dataset["stable_at_first"].values
    hanging = [to(area) for area in _stable(omega, dataset, "", first, p_max)]
    drawn: list[Mark] = [Areas(hanging, colour=_STABLE, name=f"hanging {rest}")]
    none = np.zeros_like(first)
    inverted = [to(area) for area in _stable(omega, dataset, "inverted_", none, p_max)]
    if inverted:
        # A hatch leaves the area below it visible, and has no seams.
        name = f"inverted {rest}"
        drawn.append(Areas(inverted, colour=_INVERTED, hatch="////", name=name))
    result, above, undamped = (
        by_frequency(dataset, prefix, omega.size) for prefix in ("", "inverted_", "undamped_")
    )
    for m, (name, text, colour, pale) in _CURVES.items():
        look: dict[str, Any] = {"width": 1.5 if m < 0 else 1.1, "order": 2.2}
        lines = joined(omega, result, m)
        drawn.append(curve(lines, colour=colour, name=text, path=name, **look))
        lines = joined(omega, above, m)
        look["name"] = f"inverted rest: {text.partition(' (')[0]}" if lines else ""
        drawn.append(curve(lines, colour=pale, path=f"inverted_{name}", **look))
    lines = [_tipped(line, m, omega) for m in _CURVES for line in joined(omega, undamped, m)]
    text = "exact, without damping" if float(attrs["gamma"]) > 0 and lines else ""
    drawn.append(curve(lines, colour=QUIET, width=0.6, name=text, path="undamped"))
    fold = np.stack([omega, dataset["fold"].values], axis=-1)[dataset["asked"].values > 0]
    text = "fold: the oscillation exists from here" if np.isfinite(to(fold)).any() else ""
    look = {"colour": _FOLD, "width": 1.6, "dash": (5.0, 2.0), "order": 2.1}
    drawn.append(Line(*to(fold).T, name=text, path="fold", **look))
    drawn += _asymptotic(dataset, to)
    edge = to(np.stack([omega, np.full_like(omega, p_max)], axis=-1))
    if (edge[:, 1] < 0.995 * top).any():
        drawn.append(Line(*edge.T, colour="#c8c8c8", width=3.0, name="largest p computed", order=1))
    if not marks:
        mine = to(np.array([[float(attrs["own_omega"]), float(attrs["own_p"])]]))
        inside = x[0] <= mine[0, 0] <= x[1] and 0 <= mine[0, 1] <= top
        drawn.append(this_pendulum(*map(float, mine[0]), named=bool(inside)))
    for p, at, name in marks:
        spot = to(np.array([[at, p]]))
        drawn.append(Points(*spot.T, size=5.0))
        across, up = spot[0] + (0.015 * (x[1] - x[0]), 0.012 * top)
        drawn.append(Text(across, up, name, align=("left", "bottom")))
    root, across, up = _PLANES[plane]
    return Panel(plane, "", Axis(across, x), Axis(up, (0.0, top)), drawn, root=root)


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


def by_frequency(dataset: xr.Dataset, prefix: str, count: int) -> list[list[tuple[float, int]]]:
    """Return amplitude and multiplier of the critical points of each frequency."""
    result: list[list[tuple[float, int]]] = [[] for _ in range(count)]
    columns = (dataset[f"{prefix}{name}"].values for name in ("index", "p", "multiplier"))
    for index, p, multiplier in zip(*columns, strict=True):
        result[int(index)].append((float(p), int(multiplier)))
    return result


def joined(omega: Floats, result: list[list[tuple[float, int]]], multiplier: int) -> list[Floats]:
    """Return the lines through the points with this multiplier."""
    open_: list[list[Point]] = []
    done: list[list[Point]] = []
    for w, row in zip(omega, result, strict=True):
        values = [p for p, m in row if m == multiplier]
        pairs = sorted(
            (abs(_ahead(line, w) - p), i, j)
            for i, line in enumerate(open_)
            for j, p in enumerate(values)
            if _close(line[-1], (w, p))
        )
        taken: dict[int, int] = {}
        for _, i, j in pairs:
            if i not in taken and j not in taken.values():
                taken[i] = j
        for i, j in taken.items():
            open_[i].append((w, values[j]))
        done += _paired([line for i, line in enumerate(open_) if i not in taken])
        begun = [[(w, p)] for j, p in enumerate(values) if j not in taken.values()]
        # Two neighbouring lines that begin here are one curve that turns back between frequencies.
        for lower, upper in itertools.pairwise(begun if w > omega[0] else []):
            if _close(lower[0], upper[0]) and len(lower) == 1:
                upper.insert(0, lower[0])
        open_ = [*(open_[i] for i in sorted(taken)), *begun]
    return [np.array(line) for line in [*done, *open_] if len(line) > 1]


def _close(a: Point, b: Point) -> bool:
    """Return whether points at one frequency or neighbouring ones lie on one curve."""
    return abs(a[1] - b[1]) < _JUMP * (0.3 + (a[1] + b[1]) / 2)


def _paired(ended: list[list[Point]]) -> list[list[Point]]:
    """Join neighbouring lines that end at one frequency, at which a curve turns back."""
    done: list[list[Point]] = []
    for line in sorted(ended, key=lambda one: one[-1][1]):
        if done and done[-1][-1][0] == line[-1][0] and _close(done[-1][-1], line[-1]):
            done[-1] = [*done[-1], *reversed(line)]
        else:
            done.append(line)
    return done


def _tipped(line: Floats, multiplier: int, omega: Floats) -> Floats:
    """Add the tip of an undamped tongue, ``p = 0`` at ``omega = 2/k``, to a line around it."""
    spacing = float(np.diff(omega).max())
    for k in range(1 if multiplier < 0 else 2, 9, 2):
        tip = 2 / k
        for i, ((w0, p0), (w1, p1)) in enumerate(itertools.pairwise(line)):
            around = min(w0, w1) - spacing < tip < max(w0, w1) + spacing
            passed = w0 == w1 or (w0 - tip) * (w1 - tip) < 0
            if around and passed and 0 < max(p0, p1) < _TIP:
                line = np.insert(line, i + 1, (tip, 0.0), axis=0)
                break
    return line


def _ahead(line: list[Point], w: float) -> float:
    """Return the extrapolation of a line to the next frequency."""
    if len(line) == 1:
        return line[-1][1]
    (w0, p0), (w1, p1) = line[-2:]
    if w0 == w1:  # it begins at a turning point of a curve
        return p1
    return p1 + (p1 - p0) * (w - w1) / (w1 - w0)


def _stable(
    omega: Floats, dataset: xr.Dataset, prefix: str, first: npt.NDArray[np.int8], p_max: float
) -> list[Floats]:
    """Return quadrangles between neighbouring frequencies in which rest is stable."""
    keys = ("index", "p", "multiplier", "stable_above")
    index, p, multiplier, above = (dataset[f"{prefix}{key}"].values for key in keys)
    intervals: list[list[tuple[float, float]]] = []
    curves: list[tuple[int, ...]] = []
    for k in range(omega.size):
        mine = index == k
        curves.append(tuple(multiplier[mine]))
        edges = itertools.pairwise([0.0, *p[mine], p_max])
        merged: list[tuple[float, float]] = []
        for (low, high), yes in zip(edges, [int(first[k]), *above[mine]], strict=True):
            if yes and merged and merged[-1][1] == low:
                merged[-1] = (merged[-1][0], high)
            elif yes and high > low:
                merged.append((low, high))
        intervals.append(merged)
    areas = []
    for k, (here, there) in enumerate(itertools.pairwise(omega)):
        before, after = intervals[k], intervals[k + 1]
        # Curves that exceed p_max at one of the frequencies come last.
        alike = all(one == other for one, other in zip(curves[k], curves[k + 1], strict=False))
        same = alike and len(before) == len(after)
        for a, b in zip(before, after, strict=True) if same else itertools.product(before, after):
            if same or min(a[1], b[1]) > max(a[0], b[0]):
                areas.append(np.array([(here, a[0]), (here, a[1]), (there, b[1]), (there, b[0])]))
    return areas
