"""Basins over draws: probability of each outcome of a start, and sources of its uncertainty.

In a box of 5 x 5 cells let ``p_d(a)`` be the share of the cells that end on attractor ``a`` in draw
``d``, and ``H(p) = -sum p ln p``. Then

``H(mean_d p_d) = mean_d H(p_d) + I``

The first term is the uncertainty that remains when the parameters are known: the basin entropy of
single maps, due to the position of the start in the box. The second, ``I >= 0``, is the mutual
information between the outcome of a start in the box and the draw: uncertainty that better known
parameters would remove. If a smooth boundary moves by more than a box, ``I`` dominates; if the
boundary is fractal, each draw mixes the labels in the same shares, and ``I`` is small. With 25
cells a box, shares scatter by chance: ``I`` of ``K`` random labels is about ``(K - 1) / 50``.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.draws import drawn_field, outcomes, sure_line
from pendmap.analysis.fractality import BOX
from pendmap.analysis.orbit_table import attractors_of, named_alike, points_of
from pendmap.analysis.result import rows
from pendmap.files.variables import variable

if TYPE_CHECKING:
    from collections.abc import Iterable

    import xarray as xr
    from numpy.typing import NDArray

    from pendmap.analysis.draws import Analysis, Draws
    from pendmap.signal import Floats, Mask


_SHARES: Final = ("outcome", "share_mean", "share_low", "share_high", "exists")
"""Variables over the outcomes."""
_DOUBT: Final = ("doubt_start", "doubt_parameters")  # Variables over boxes, and their means
_UNKNOWN: Final = ("undecided", "failed")  # Outcomes of the labels 0 and -1


def basins_over(dataset: xr.Dataset, draws: Draws, analysis: Analysis) -> xr.Dataset:
    """Return a basin map of M x N cells with statistics of the maps of D draws.

    Adds, over ``outcome``, all outcomes of starts by name: ``probability`` (outcome, M, N),
    ``drawn_share`` (outcome, D), ``exists`` (the share of the draws that have it), ``share_mean``,
    ``share_low``, ``share_high`` (the 95 % interval over the draws); over the cells ``certainty``,
    the probability of the most likely outcome, and ``label_entropy``, in nat; over boxes
    ``doubt_start`` and ``doubt_parameters``, in nat, and their means ``doubt_start_mean`` and
    ``doubt_parameters_mean``; ``drawn`` (D, parameter); ``sure_cells``, the share of the cells with
    a certainty of 95 % or more.
    """
    ends, start, known = _counted(dataset, draws.each(analysis))
    with_draws = dataset.assign(_variables(dataset["label"], ends, start, known, len(draws)))
    means = {f"{name}_mean": with_draws[name].mean(keep_attrs=True) for name in _DOUBT}
    with_draws = with_draws.assign(means)
    return draws.complete(with_draws, _summary(with_draws))


@drawn_field
def drawn_basins(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the draws of a basin map for the JSON object."""
    attractors = [
        {"name": name, "fraction": mean, "ci95": [low, high], "exists": exists}
        for name, mean, low, high, exists in rows(dataset, *_SHARES)
    ]
    return {"attractors": attractors} | {
        name: float(dataset[place])
        for name, place in [("sure_cells", "sure_cells"), *((x, f"{x}_mean") for x in _DOUBT)]
    }


@dataclasses.dataclass
class _End:
    """An outcome of starts with its counts over draws."""

    plain: str
    """Plain name of the attractor."""
    points: Floats
    """Its stroboscopic points, shape (L, 2)."""
    cells: NDArray[np.uint16]
    """Number of draws in which each cell has this outcome."""
    boxes: Floats
    """Sum over the draws of the outcome's share of each box."""
    shares: dict[int, float] = dataclasses.field(default_factory=dict)
    """The outcome's share of the starts, by number of the draw."""


def _counted(
    dataset: xr.Dataset, drawn: Iterable[xr.Dataset]
) -> tuple[dict[str, _End], Floats, NDArray[np.int64]]:
    """Return outcomes by name, summed entropies of the boxes, and draws with known outcomes."""
    labels = dataset["label"]
    none = _in_boxes(labels, labels.values > 0).values * 0.0

    def new(plain: str, points: Floats) -> _End:
        return _End(plain, points, np.zeros(labels.shape, np.uint16), none.copy())

    names, plain, points = _attractors(dataset)
    ends = {name: new(plain[k], points[k]) for k, name in enumerate(names)}
    start, known = none.copy(), none.astype(np.int64)
    for d, one in enumerate(drawn):
        label = one["label"].values
        names, plain, points = _attractors(one)
        every = ends.values()
        places = named_alike([e.plain for e in every], [e.points for e in every], plain, points)
        mine = [list(ends)[place] if place >= 0 else "" for place in places]
        for k, name in enumerate(names):
            if not mine[k]:
                alike = sum(end.plain == plain[k] for end in ends.values())
                mine[k] = name if name not in ends else f"{name} ({alike + 1})"
                ends[mine[k]] = new(plain[k], points[k])
        inside = _in_boxes(labels, label > 0).values
        known += inside > 0
        entropy = none.copy()
        for value, name in enumerate(mine, 1):
            here = label == value
            ends[name].cells += here
            ends[name].shares[d] = float(here.mean())
            part = _in_boxes(labels, here).values / np.maximum(inside, 1)
            ends[name].boxes += part
            entropy += _entropy(part)
        start += entropy
        for value, name in zip((0, -1), _UNKNOWN, strict=True):
            here = label == value
            if here.any():
                end = ends.setdefault(name, new(name, np.empty((0, 2))))
                end.cells += here
                end.shares[d] = float(here.mean())
    return ends, start, known


def _attractors(dataset: xr.Dataset) -> tuple[list[str], list[str], list[Floats]]:
    """Return names, plain names and points of the attractors of a map."""
    plain = [one.plain for one in attractors_of(dataset)]
    return dataset["attractor"].values.tolist(), plain, points_of(dataset, "attractor")


def _variables(
    labels: xr.DataArray, ends: dict[str, _End], start: Floats, known: NDArray[np.int64], draws: int
) -> dict[str, Any]:
    """Return the counts as variables of a dataset."""
    dims, names = labels.dims, sorted(ends, key=lambda name: name in _UNKNOWN)
    every = [ends[name] for name in names]
    probability = np.stack([end.cells for end in every]).astype(np.float32) / draws
    share = np.array([[end.shares.get(d, 0.0) for d in range(draws)] for end in every])
    exists = np.array([len(end.shares) / draws for end in every])
    known = np.maximum(known, 1)
    total = sum((_entropy(end.boxes / known) for end in ends.values()), 0.0 * start)
    start = start / known
    boxes = _in_boxes(labels, labels.values > 0)
    over_boxes = tuple(f"box_{name}" for name in dims)
    label = _entropy(probability).sum(axis=0, dtype=np.float32)
    reduced, there = np.maximum(total - start, 0.0), "share of the draws that have it"
    known_too = "entropy of the end that remains where the parameters are known"
    return {
        "outcome": variable("outcome", np.array(names, dtype=str), long_name="end of a start"),
        **outcomes(dims, probability, share),
        "label_entropy": variable(dims, label, "nat", "entropy of the end over the draws"),
        "exists": variable("outcome", exists, "1", there),
        "doubt_start": variable(over_boxes, start, "nat", known_too),
        "doubt_parameters": variable(over_boxes, reduced, "nat", "entropy due to the parameters"),
        **{
            f"box_{name}": variable(
                f"box_{name}",
                boxes[name].values,
                labels[name].attrs.get("units", "1"),
                f"centre of a box: {name}",
            )
            for name in dims
        },
    }


def _in_boxes(labels: xr.DataArray, cells: Mask) -> xr.DataArray:
    """Return the number of true cells in each whole box, at the boxes' centres."""
    window = {name: min(BOX, size) for name, size in labels.sizes.items()}
    return labels.copy(data=cells).coarsen(window, boundary="trim").sum()


def _entropy(part: NDArray[Any]) -> NDArray[Any]:
    """Return ``-p ln p``, 0 at 0."""
    return -part * np.log(np.where(part > 0, part, 1))


def _summary(dataset: xr.Dataset) -> list[str]:
    lines: list[str] = []
    start, parameters = (float(dataset[f"{name}_mean"]) for name in _DOUBT)
    for name, mean, low, high, exists in rows(dataset, *_SHARES):
        there = "" if exists == 1 or name in _UNKNOWN else f", in {100 * exists:.3g} % of them"
        lines.append(
            f"{name}: {100 * mean:.2f} % of the starts, 95 % of the draws in "
            f"[{100 * low:.2f}, {100 * high:.2f}] %{there}."
        )
    lines.append(sure_line(dataset, "an end"))
    lines.append(
        f"Entropy of the end in a box of {BOX} x {BOX} cells: {start + parameters:.3f} nat = "
        f"{start:.3f} from the position of the start in the box + "
        f"{parameters:.3f} from the parameters."
    )
    return lines
