"""Critical curves as they are drawn: lines joined from frequency to frequency, stable regions."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pendmap.analysis.critical_curves import in_plane, window

if TYPE_CHECKING:
    import xarray as xr


Floats = npt.NDArray[np.float64]

COLOURS = {1: "#d55e00", -1: "#0072b2"}
"""Curves on which a multiplier is +1 (solutions of the drive's period), and -1 (twice that)."""

_SQUARED = "\N{SUPERSCRIPT TWO}"
_NAMES = {
    "omega-p": (
        "\N{GREEK SMALL LETTER OMEGA} = \N{GREEK CAPITAL LETTER OMEGA}/w0",
        f"p = Y\N{GREEK CAPITAL LETTER OMEGA}{_SQUARED}/g",
    ),
    "e-alpha2": (
        f"\N{GREEK SMALL LETTER ALPHA}{_SQUARED} = 1/\N{GREEK SMALL LETTER OMEGA}{_SQUARED}",
        f"e = p/\N{GREEK SMALL LETTER OMEGA}{_SQUARED} = Y/l",
    ),
}

_PARTED = 0.3
"""Asymptotic curves that err more are not drawn: they say nothing there."""

_TIP = 0.6
"""An undamped tongue goes down to its tip from below this amplitude."""

_JUMP = 0.6
"""Lines are joined over a change of p, between two frequencies, of at most this part of the mean
``p`` and a little."""


@dataclass(frozen=True)
class Chart:
    """Critical curves in one of the planes.

    Attributes
    ----------
    names : (str, str)
        What the axes show.
    x, y : (float, float)
        Their ranges.
    lines : dict
        For the multipliers 1 and -1 polylines, shape (m, 2) each.
    undamped : list of ndarray
        Those without damping.
    stable : list of ndarray, shape (m, 2)
        Polygons in which hanging rest is stable.
    inverted_lines, inverted : dict, list of ndarray
        Lines and polygons of inverted rest.
    beyond : ndarray, shape (m, 2)
        The edge of what was computed.
    fold : ndarray, shape (m, 2)
        Where the oscillation born toward smaller p folds; broken by nan.
    asymptotic : dict
        For each name a curve that is near the exact one, broken by nan, and the rest of it.
    own : (float, float)
        The pendulum's point.
    bands : list of ndarray, shape (2, 2)
        Over draws of the parameters the interval of each critical amplitude.
    """

    names: tuple[str, str]
    x: tuple[float, float]
    y: tuple[float, float]
    lines: dict[int, list[Floats]]
    undamped: list[Floats]
    stable: list[Floats]
    inverted_lines: dict[int, list[Floats]]
    inverted: list[Floats]
    beyond: Floats
    fold: Floats
    asymptotic: dict[str, tuple[Floats, Floats]]
    own: tuple[float, float]
    bands: list[Floats]


def chart(dataset: xr.Dataset, plane: str, near: float) -> Chart:
    """Return the critical curves of a dataset in one of :data:`PLANES`.

    Parameters
    ----------
    dataset : xarray.Dataset
        As made by :func:`pendmap.tongues`.
    plane : str
        One of :data:`PLANES`.
    near : float
        Relative error up to which an asymptotic curve counts as near the exact one.
    """
    omega = dataset["omega"].values
    p_max = float(dataset.attrs["p_max"])

    def to(points: Floats) -> Floats:
        """From (omega, p) to the plane."""
        return np.stack(in_plane(points[..., 0], points[..., 1], plane), axis=-1)

    damped = by_frequency(dataset, "", omega.size)
    bare = by_frequency(dataset, "undamped_", omega.size)
    lines = {m: [to(line) for line in joined(omega, damped, m)] for m in COLOURS}
    undamped = [to(_tipped(line, m, omega)) for m in COLOURS for line in joined(omega, bare, m)]
    first = dataset["stable_at_first"].values
    stable = [to(area) for area in _stable(omega, dataset, "", first, p_max)]
    upright = by_frequency(dataset, "inverted_", omega.size)
    inverted = _stable(omega, dataset, "inverted_", np.zeros_like(first), p_max)
    error = dataset["asymptotic_error"].values
    asymptotic = {}
    for k, name in enumerate(dataset["curve"].values):
        whole = to(np.stack([omega, dataset["asymptotic"].values[k]], axis=-1))
        close = (error[k] < near)[:, None]
        parting = (error[k] < _PARTED)[:, None] & ~close
        asymptotic[str(name)] = (np.where(close, whole, np.nan), np.where(parting, whole, np.nan))
    edge = to(np.stack([omega, np.full_like(omega, p_max)], axis=-1))
    own = to(np.array([float(dataset.attrs["own_omega"]), float(dataset.attrs["own_p"])]))
    x, top = window(omega, p_max, plane)
    return Chart(
        _NAMES[plane],
        x,
        (0.0, top),
        lines,
        undamped,
        stable,
        {m: [to(line) for line in joined(omega, upright, m)] for m in COLOURS},
        [to(area) for area in inverted],
        edge,
        to(np.stack([omega, dataset["fold"].values], axis=-1)[dataset["fold_sought"].values > 0]),
        asymptotic,
        (float(own[0]), float(own[1])),
        [to(band) for prefix in ("", "inverted_") for band in _bands(dataset, prefix)],
    )


def _bands(dataset: xr.Dataset, prefix: str) -> list[Floats]:
    """Return the interval of each critical amplitude over draws, as points (omega, p)."""
    if f"{prefix}p_low" not in dataset:
        return []
    low, high = (dataset[f"{prefix}p_{end}"].values for end in ("low", "high"))
    omega = dataset["omega"].values[dataset[f"{prefix}index"].values]
    ends = np.stack([np.stack([omega, low], axis=1), np.stack([omega, high], axis=1)], axis=1)
    return [*ends[np.isfinite(low)]]


def by_frequency(dataset: xr.Dataset, prefix: str, count: int) -> list[list[tuple[float, int]]]:
    """Return amplitude and multiplier of each critical point, frequency by frequency."""
    found: list[list[tuple[float, int]]] = [[] for _ in range(count)]
    columns = (dataset[f"{prefix}{name}"].values for name in ("index", "p", "multiplier"))
    for index, p, multiplier in zip(*columns, strict=True):
        found[int(index)].append((float(p), int(multiplier)))
    return found


def joined(omega: Floats, found: list[list[tuple[float, int]]], multiplier: int) -> list[Floats]:
    """Return the lines through the points with this multiplier.

    Counted from below, the two boundaries of a tongue keep their places; where the count changes
    from one frequency to the next, neighbours are the nearest.
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
        # Two that begin next to one another turn back between the frequencies.
        for lower, upper in itertools.pairwise(begun if w > omega[0] else []):
            if _tip(lower[0], upper[0]) and len(lower) == 1:
                upper.insert(0, lower[0])
        open_ = [*on, *begun]
    return [np.array(line) for line in [*done, *open_] if len(line) > 1]


def _tip(a: tuple[float, float], b: tuple[float, float]) -> bool:
    """Whether two points at one frequency are next to a place where a curve turns back."""
    return abs(a[1] - b[1]) < _JUMP * (0.3 + (a[1] + b[1]) / 2)


def _paired(
    ended: list[list[tuple[float, float]]],
) -> list[list[tuple[float, float]]]:
    """Join lines that end at one frequency next to one another: the curve turns back there."""
    done: list[list[tuple[float, float]]] = []
    for line in sorted(ended, key=lambda one: one[-1][1]):
        if done and done[-1][-1][0] == line[-1][0] and _tip(done[-1][-1], line[-1]):
            done[-1] = [*done[-1], *reversed(line)]
        else:
            done.append(line)
    return done


def _tipped(line: Floats, multiplier: int, omega: Floats) -> Floats:
    """Add the tip of an undamped tongue, ``p = 0`` at ``omega = 2/k``, where a line goes round it.

    There the linear equation without drive has the multiplier ``(-1)^k``, whatever the model.
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
    """Where a line would be at the next frequency."""
    if len(line) == 1:
        return line[-1][1]
    (w0, p0), (w1, p1) = line[-2:]
    if w0 == w1:  # begun where a curve turns back
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

    Between the same curves strips follow one another in their order, however steep they are; where
    a curve begins or ends, those that overlap.
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
        # Those that go beyond p_max on one side are the last.
        shared = min(len(curves[k]), len(curves[k + 1]))
        same = curves[k][:shared] == curves[k + 1][:shared] and len(before) == len(after)
        for a, b in zip(before, after, strict=True) if same else itertools.product(before, after):
            if same or min(a[1], b[1]) > max(a[0], b[0]):
                areas.append(np.array([(here, a[0]), (here, a[1]), (there, b[1]), (there, b[0])]))
    return areas
