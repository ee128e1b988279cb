"""Basins over draws: the probability of each end of a start, and the sources of its doubt.

In a box of 5 x 5 cells let ``p_d(a)`` be the share of the cells that end on attractor ``a`` in draw
``d``, and ``H(p) = -sum p ln p``. Then

``H(mean_d p_d) = mean_d H(p_d) + I``

The first part is doubt that remains when the parameters are known: it is the basin entropy of a
single map, and comes from where in the box a start lies. The second, ``I >= 0``, is the mutual
information between the end of a start in the box and the draw: doubt that better known parameters
would remove. Where a smooth boundary moves by more than a box, ``I`` leads; where the boundary is
fractal each draw mixes the labels anew in the same shares, and ``I`` is small. With 25 cells a box
shares scatter by chance: ``I`` of ``K`` labels drawn at random is about ``(K - 1) / 50``, not 0.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.draws.match import matched, names_of, plain, points_of
from pendmap.analysis.draws.sample import interval, rows
from pendmap.analysis.fractality import BOX

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from pendmap.analysis.draws.sample import Draws, Run
    from pendmap.analysis.numerics import Progress

    Floats = NDArray[np.float64]


SURE: Final = 0.95
"""Probability of an end from which a cell counts as sure."""

_UNKNOWN: Final = ("undecided", "failed")
"""The ends of labels 0 and -1."""


def basins_over(
    dataset: xr.Dataset, draws: Draws, run: Run, progress: Progress | None
) -> xr.Dataset:
    """Return a basin map of M x N cells with those of D draws.

    Adds, over ``outcome``, all ends of starts by name: ``probability`` (outcome, M, N),
    ``drawn_share`` (outcome, D), ``exists`` (the share of the draws that have it), ``share_mean``,
    ``share_low``, ``share_high`` (the 95 % interval over the draws); over the cells ``certainty``,
    the probability of the most likely end, and ``label_entropy``, in nat; over boxes
    ``doubt_start`` and ``doubt_parameters``, in nat, whose means are attributes; ``drawn``
    (D, parameter). Attribute ``sure_cells``: the share of the cells with a certainty of 95 % or
    more.
    """
    tally = _Tally(dataset)
    for one in draws.each(run, progress):
        tally.add(one)
    found = dataset.assign(tally.variables()).assign(draws.variables)
    start, by = (found[f"doubt_{name}"].values for name in ("start", "parameters"))
    found.attrs |= {
        "sure_cells": float((found["certainty"].values >= SURE).mean()),
        "doubt_start": float(start.mean()),
        "doubt_parameters": float(by.mean()),
    }
    draws.complete(found, _summary(found))
    return found


def fields(dataset: xr.Dataset) -> dict[str, Any]:
    """Return what the JSON object of a basin map says of draws."""
    names = ("outcome", "share_mean", "share_low", "share_high", "exists")
    outcomes = [
        {"name": str(name), "fraction": mean, "ci95": [low, high], "exists": exists}
        for name, mean, low, high, exists in rows(dataset, *names)
    ]
    doubt = ("sure_cells", "doubt_start", "doubt_parameters")
    return {"attractors": outcomes} | {name: dataset.attrs[name] for name in doubt}


class _Tally:
    """Counts of the ends of all cells over draws."""

    def __init__(self, own: xr.Dataset) -> None:
        self.cells = own["label"]
        self.names = names_of(own, "attractor")
        self.points = points_of(own, "attractor")
        shape = own["label"].shape
        self.side = tuple(min(BOX, size) for size in shape)
        self.boxes = tuple(size // side for size, side in zip(shape, self.side, strict=True))
        self.counts = [np.zeros(shape, dtype=np.uint16) for _ in self.names]
        self.mean = [np.zeros(self.boxes) for _ in self.names]
        self.start, self.known = np.zeros(self.boxes), np.zeros(self.boxes)
        self.shares: list[dict[int, float]] = []
        self.exists: list[set[int]] = []

    def add(self, drawn: xr.Dataset) -> None:
        """Count the map of one more draw."""
        label = drawn["label"].values
        places = self._places(drawn)
        shares, entropy = {}, np.zeros(self.boxes)
        which = {k + 1: place for k, place in enumerate(places)}
        inside = self._boxed(label > 0)
        self.known += inside > 0
        for value, place in which.items():
            mine = label == value
            self.counts[place] += mine
            shares[place] = float(mine.mean())
            part = self._boxed(mine) / np.maximum(inside, 1)
            self.mean[place] += part
            entropy += _entropy(part)
        self.start += entropy
        for value, name in zip((0, -1), _UNKNOWN, strict=True):
            if (label == value).any():
                place = self._place(name, np.empty((0, 2)))
                self.counts[place] += label == value
                shares[place] = float((label == value).mean())
        self.shares.append(shares)
        self.exists.append(set(places) | set(shares))

    def variables(self) -> dict[str, Any]:
        """Return the counts as variables of a dataset."""
        draws, dims = len(self.shares), self.cells.dims
        kept = [k for k, name in enumerate(self.names) if name not in _UNKNOWN]
        kept += [k for k, name in enumerate(self.names) if name in _UNKNOWN]
        names = [self.names[k] for k in kept]
        probability = np.stack([self.counts[k] for k in kept]).astype(np.float32) / draws
        share = np.array([[one.get(k, 0.0) for one in self.shares] for k in kept])
        mean, _, low, high = interval(share)
        exists = np.array([np.mean([k in one for one in self.exists]) for k in kept])
        known = np.maximum(self.known, 1)
        total = sum((_entropy(part / known) for part in self.mean), np.zeros(self.boxes))
        start = self.start / known
        over_boxes = tuple(f"box_{name}" for name in dims)
        one = {"units": "1"}
        nat = {"units": "nat"}
        return {
            "outcome": ("outcome", np.array(names, dtype=str)),
            "probability": (("outcome", *dims), probability, one),
            "certainty": (dims, probability.max(axis=0), one),
            "label_entropy": (dims, _entropy(probability).sum(axis=0, dtype=np.float32), nat),
            "drawn_share": (("outcome", "draw"), share, one),
            "exists": ("outcome", exists, {"comment": "share of the draws that have it"}),
            "share_mean": ("outcome", mean, one),
            "share_low": ("outcome", low, one),
            "share_high": ("outcome", high, one),
            "doubt_start": (over_boxes, start, nat),
            "doubt_parameters": (over_boxes, np.maximum(total - start, 0.0), nat),
            **{
                f"box_{name}": (f"box_{name}", self._centres(str(name), axis))
                for axis, name in enumerate(dims)
            },
        }

    def _places(self, drawn: xr.Dataset) -> list[int]:
        """Return the outcome of each attractor of a draw; new ones are added."""
        names, points = names_of(drawn, "attractor"), points_of(drawn, "attractor")
        found = matched(self.names, self.points, names, points)
        return [
            self._place(name, own) if place < 0 else place
            for name, own, place in zip(names, points, found, strict=True)
        ]

    def _place(self, name: str, points: Floats) -> int:
        """Return the place of an outcome by its name, a new one where it is not known."""
        if name in _UNKNOWN and name in self.names:
            return self.names.index(name)
        alike = sum(plain(own) == plain(name) for own in self.names)
        self.names.append(name if name not in self.names else f"{name} ({alike + 1})")
        self.points.append(points)
        self.counts.append(np.zeros(self.cells.shape, dtype=np.uint16))
        self.mean.append(np.zeros(self.boxes))
        return len(self.names) - 1

    def _boxed(self, cells: NDArray[np.bool_]) -> Floats:
        """Return the number of true cells in each whole box."""
        (rows, columns), (high, wide) = self.boxes, self.side
        whole = cells[: rows * high, : columns * wide].reshape(rows, high, columns, wide)
        return np.asarray(whole.sum(axis=(1, 3)), dtype=np.float64)

    def _centres(self, name: str, axis: int) -> Floats:
        values = self.cells[name].values[: self.boxes[axis] * self.side[axis]]
        return np.asarray(values.reshape(-1, self.side[axis]).mean(axis=1), dtype=np.float64)


def _entropy(part: NDArray[Any]) -> NDArray[Any]:
    """Return ``-p ln p``, 0 at 0."""
    return -part * np.log(np.where(part > 0, part, 1))


def _summary(found: xr.Dataset) -> list[str]:
    a, lines = found.attrs, []
    names = ("outcome", "share_mean", "share_low", "share_high", "exists")
    for name, mean, low, high, exists in rows(found, *names):
        there = "" if exists == 1 or name in _UNKNOWN else f", in {100 * exists:.3g} % of them"
        lines.append(
            f"{name}: {100 * mean:.2f} % of the starts, 95 % of the draws in "
            f"[{100 * low:.2f}, {100 * high:.2f}] %{there}."
        )
    lines.append(
        f"{100 * a['sure_cells']:.1f} % of the cells have an end with a probability of "
        f"{100 * SURE:g} % or more."
    )
    both = a["doubt_start"] + a["doubt_parameters"]
    lines.append(
        f"Doubt of an end in a box of {BOX} x {BOX} cells: {both:.3f} nat = "
        f"{a['doubt_start']:.3f} by where in the box the start lies + "
        f"{a['doubt_parameters']:.3f} by the parameters."
    )
    return lines
