"""Models drawn from the covariance of fitted parameters, and what results over them have in common.

The end of a start has two sources of uncertainty. In a box of 5 x 5 cells let
``p_d(a)`` be the share of the cells that end on attractor ``a`` in draw ``d``, and ``H(p) = -sum p
ln p``. Then

``H(mean_d p_d) = mean_d H(p_d) + I``

The first term is the uncertainty that remains when the parameters are known: the basin entropy of
single maps, due to the position of the start in the box. The second, ``I >= 0``, is the mutual
information between the outcome of a start in the box and the draw: uncertainty that better known
parameters would remove. If a smooth boundary moves by more than a box, ``I`` dominates; if the
boundary is fractal, ``I`` is small: about ``(K - 1) / 50`` of ``K`` random labels in 25 cells.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import xarray as xr

from pendmap import _core
from pendmap.analysis.fractality import BOX
from pendmap.analysis.orbit_table import attractors_of, points_of
from pendmap.analysis.result import Field, indices, rows
from pendmap.analysis.varied import with_values
from pendmap.errors import MOST_DRAWS, InputError, check_whole, short_repr
from pendmap.files.variables import variable
from pendmap.formatting import counted
from pendmap.model.covariance import covariance_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from pendmap.analysis.run import RunOptions
    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats

    Analysis = Callable[..., xr.Dataset]
    """Function that computes the result of a model, with the keyword ``run``."""


_TRIES: Final = 1000  # Largest number of successive draws outside the allowed values
LEVELS: Final = (0.025, 0.975)  # Probabilities at the ends of a 95 % interval
_SURE: Final = 0.95  # Probability of an outcome from which a cell is sure
_UNKNOWN: Final = {0: "undecided", -1: "failed"}  # Outcomes of starts without an attractor
_SHARES: Final = ("share_mean", "share_low", "share_high", "exists")
_DOUBT: Final = ("doubt_start", "doubt_parameters")  # Variables over boxes, and their means


@dataclasses.dataclass(frozen=True)
class Draws:
    """Models drawn from the covariance of a fitted model."""

    names: tuple[str, ...]
    values: Floats
    """Parameters of each draw in the units of the model, shape (N, K)."""
    models: tuple[Pendulum | Rig, ...]
    run: RunOptions
    """Options of the results of the model itself and of all draws."""

    def __len__(self) -> int:
        return len(self.models)

    @property
    def first(self) -> RunOptions:
        """Options of the result of the model itself."""
        return self.run.part(0, len(self) + 1)

    def results(self, analysis: Analysis) -> Iterator[xr.Dataset]:
        """Yield the result of each drawn model."""
        for k, model in enumerate(self.models, 1):
            yield analysis(model, run=self.run.part(k, len(self) + 1))

    def complete(self, dataset: xr.Dataset, lines: Iterable[str]) -> xr.Dataset:
        """Return a result with the drawn parameters, and with summary lines on the draws."""
        names = ", ".join(self.names)
        head = f"{counted(len(self), 'draw')} of {names} from the covariance of the fit."
        dataset.attrs |= {"draws": len(self), "draws_seed": self.run.seed}
        dataset.attrs["summary"] = "\n".join([dataset.attrs["summary"], head, *lines])
        text, comment = "parameters of each draw", "each in the units of the model"
        dataset = dataset.assign(
            drawn=variable(("draw", "parameter"), self.values, "", text, comment),
            parameter=variable("parameter", np.array(self.names, dtype=str), long_name="name"),
        )
        return dataset.assign_coords(indices(dataset))


def drawn_field(entries_of: Callable[[xr.Dataset], dict[str, Any]]) -> Field:
    """Return the JSON key ``draws``: the drawn models and their results, null without draws."""

    def read(dataset: xr.Dataset) -> dict[str, Any] | None:
        a = dataset.attrs
        if "draws" not in a:
            return None
        names = dataset["parameter"].values.tolist()
        common = {"count": a["draws"], "seed": a["draws_seed"], "parameters": names}
        return common | entries_of(dataset)

    return Field("draws", "", "models drawn from the covariance, and their results", read=read)


def drawn(model: Pendulum | Rig, count: object, run: RunOptions) -> Draws:
    """Return models drawn from the Gaussian of a model's ``[covariance]``.

    It is cut off where damping or friction is below 0, the size of a damping effect changes sign,
    or a value is outside a model's range. The first draws do not depend on the number of draws.
    """
    number = check_whole("draws", count, 2, MOST_DRAWS)
    known = covariance_of(model.notes)
    if known is None:
        raise InputError(
            "draws: the model must have a [covariance], as the model files of identify and diagnose"
            " have, got none"
        )
    there = {name: getattr(model, name) for name in model.numbers()}
    for effect in model.effects:
        there |= {f"{effect.name}.{name}": x for name, x in effect.parameters.items()}
    for name in known.names:
        if name not in there:
            raise InputError(
                f"covariance: {short_repr(name)} must be a parameter of the model, got none"
            )
    middle = np.array([there[name] for name in known.names], dtype=float)
    root = known.root
    brakes = (effect for effect in model.effects if effect.brakes)
    sizes = {f"{effect.name}.{size}" for effect in brakes for size in effect.sizes}
    signs = np.where([name in sizes for name in known.names], np.sign(middle), 0.0)
    source = np.random.default_rng(run.in_memory("draws").seed)
    values: list[Floats] = []
    models: list[Pendulum | Rig] = []
    tries = 0
    while len(models) < number:
        x = middle + root @ source.standard_normal(len(known.names))
        tries += 1
        with contextlib.suppress(InputError):
            if not (x * signs < 0).any():
                models.append(with_values(model, dict(zip(known.names, x.tolist(), strict=True))))
                values.append(x)
                tries = 0
        if tries == _TRIES:
            raise InputError(
                "draws: the [covariance] must leave room for allowed values, got none in "
                f"{_TRIES} draws"
            )
    return Draws(known.names, np.array(values), tuple(models), run)


def outcomes(
    dims: tuple[Any, ...], cells: Iterable[tuple[NDArray[Any], Mapping[int, Any]]]
) -> tuple[list[Any], xr.Dataset]:
    """Return the outcomes of cells over draws, and their shares; cells have numbers of outcomes."""
    counts: dict[Any, NDArray[np.uint16]] = {}
    shares: list[dict[Any, float]] = []
    for numbers, of_number in cells:
        shares.append({})
        for number, outcome in of_number.items():
            here = numbers == number
            counts.setdefault(outcome, np.zeros(here.shape, np.uint16))[...] += here
            shares[-1][outcome] = float(here.mean())
    probability = np.stack(list(counts.values())).astype(np.float32) / len(shares)
    share = np.array([[one.get(outcome, 0.0) for one in shares] for outcome in counts])
    exists = np.array([[outcome in one for one in shares] for outcome in counts]).mean(axis=1)
    low, high = np.quantile(share, LEVELS, axis=1)
    certain = probability.max(axis=0)
    of_share = "of the outcome's share of the cells over the draws"
    likely, sure = "probability of the most likely outcome", "share of the cells with a sure one"
    one = "outcome"
    return list(counts), xr.Dataset(
        {
            "probability": variable((one, *dims), probability, "1", "probability"),
            "certainty": variable(dims, certain, "1", likely),
            "drawn_share": variable((one, "draw"), share, "1", "share of the cells in each draw"),
            "share_mean": variable(one, share.mean(axis=1), "1", f"mean {of_share}"),
            "share_low": variable(one, low, "1", f"lower end of 95 % {of_share}"),
            "share_high": variable(one, high, "1", f"upper end of 95 % {of_share}"),
            "exists": variable(one, exists, "1", "share of the draws that have it"),
            "sure_cells": variable((), (certain >= _SURE).mean(), "1", sure),
        }
    )


def outcome_lines(dataset: xr.Dataset, names: Sequence[str], what: str, most: int) -> list[str]:
    """Return summary lines on the shares of the outcomes, and of the sure cells."""
    shares = rows(dataset, *_SHARES)
    lines = [
        f"{name}: {100 * mean:.2f} % of the {what}, 95 % of the draws in [{100 * low:.2f}, "
        f"{100 * high:.2f}] %" + (f", in {100 * there:.3g} % of them." if there < 1 else ".")
        for name, (mean, low, high, there) in zip(names[:most], shares, strict=False)
    ]
    if len(names) > most:
        lines.append(f"{len(names) - most} more are in the result.")
    sure = 100 * float(dataset["sure_cells"])
    return [*lines, f"{sure:.1f} % of the {what} are certain by {100 * _SURE:g} % or more."]


def basins_over(dataset: xr.Dataset, draws: Draws, analysis: Analysis) -> xr.Dataset:
    """Return a basin map with the outcomes of draws by name, and both sources of uncertainty."""
    labels = dataset["label"]
    boxes = _in_boxes(labels, labels.values > 0)
    shares_of: dict[str, Floats] = {}  # sums over the draws of the shares of the boxes
    known, start = np.zeros(boxes.shape, np.int64), np.zeros(boxes.shape)
    ends: dict[str, tuple[str, Floats]] = {}

    def cells() -> Iterator[tuple[NDArray[Any], dict[int, str]]]:
        nonlocal known, start
        for one in draws.results(analysis):
            label = one["label"].values
            names = dict(enumerate(_named(one, ends), 1))
            inside = _in_boxes(labels, label > 0).values
            known += inside > 0
            for number, name in names.items():
                part = _in_boxes(labels, label == number).values / np.maximum(inside, 1)
                shares_of[name] = shares_of.get(name, 0.0) + part
                start += _entropy(part)
            yield label, names | {k: text for k, text in _UNKNOWN.items() if (label == k).any()}

    _named(dataset, ends)
    names, over = outcomes(labels.dims, cells())
    known = np.maximum(known, 1)
    start = start / known
    every = sum((_entropy(part / known) for part in shares_of.values()), np.zeros(boxes.shape))
    at = tuple(f"box_{name}" for name in labels.dims)
    entropy = _entropy(over["probability"].values).sum(axis=0, dtype=np.float32)
    text = "entropy of the end that remains where the parameters are known"
    due = "entropy due to the parameters"
    over = over.assign(
        outcome=variable("outcome", np.array(names, dtype=str), long_name="end of a start"),
        label_entropy=variable(labels.dims, entropy, "nat", "entropy of the end over the draws"),
        doubt_start=variable(at, start, "nat", text),
        doubt_parameters=variable(at, np.maximum(every - start, 0.0), "nat", due),
    )
    for name in labels.dims:
        unit = labels[name].attrs.get("units", "1")
        centres = variable(f"box_{name}", boxes[name].values, unit, f"centre of a box: {name}")
        over[f"box_{name}"] = centres
    over = over.isel(outcome=np.argsort([n in _UNKNOWN.values() for n in names], kind="stable"))
    over = over.assign({f"{name}_mean": over[name].mean(keep_attrs=True) for name in _DOUBT})
    lines = outcome_lines(over, over["outcome"].values.tolist(), "starts", len(names))
    first, second = (float(over[f"{name}_mean"]) for name in _DOUBT)
    lines.append(
        f"Entropy of the end in a box of {BOX} x {BOX} cells: {first + second:.3f} nat = "
        f"{first:.3f} from the position of the start in the box + {second:.3f} from the parameters."
    )
    return draws.complete(dataset.assign(over), lines)


@drawn_field
def drawn_basins(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the draws of a basin map for the JSON object."""
    attractors = [
        {"name": name, "fraction": mean, "ci95": [low, high], "exists": exists}
        for name, mean, low, high, exists in rows(dataset, "outcome", *_SHARES)
    ]
    means = {name: float(dataset[f"{name}_mean"]) for name in _DOUBT}
    return {"attractors": attractors, "sure_cells": float(dataset["sure_cells"])} | means


def _named(dataset: xr.Dataset, ends: dict[str, tuple[str, Floats]]) -> list[str]:
    """Return the attractors' names among ``ends``, plain names and points; new ones are added."""
    plain = [one.plain for one in attractors_of(dataset)]
    points, known = points_of(dataset, "attractor"), list(ends)
    kinds, places = [end for end, _ in ends.values()], [at for _, at in ends.values()]
    reach = [[math.inf if kind == name else 0.0 for name in plain] for kind in kinds]
    sets = [[at.tolist() for at in every] for every in (places, points)]
    pairs = _core.matched(sets[0], sets[1], reach)
    place = {m: known[k] for *_, k, m in pairs}
    names: list[str] = []
    for k, name in enumerate(dataset["attractor"].values.tolist()):
        new = name
        if name in ends:
            new = f"{name} ({sum(end == plain[k] for end, _ in ends.values()) + 1})"
        names.append(place.get(k, new))
        ends.setdefault(names[-1], (plain[k], points[k]))
    return names


def _in_boxes(labels: xr.DataArray, cells: NDArray[np.bool_]) -> xr.DataArray:
    """Return the number of true cells in each whole box, at the boxes' centres."""
    window = {name: min(BOX, size) for name, size in labels.sizes.items()}
    return labels.copy(data=cells).coarsen(window, boundary="trim").sum()


def _entropy(part: NDArray[Any]) -> NDArray[Any]:
    """Return ``-p ln p``, 0 at 0."""
    return -part * np.log(np.where(part > 0, part, 1))
