"""Preparation of results, or selections of them, for charts: rising axes and recomputed shares.

An xarray selection keeps the tables and attributes of the whole result, and may reverse or
transpose its axes. :func:`shown` corrects both for figures and recordings.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap.analysis.basins import RELIABLE
from pendmap.analysis.orbit_table import attractors_of
from pendmap.analysis.result import shares
from pendmap.charts import plane
from pendmap.errors import InputError
from pendmap.files import facts, with_facts
from pendmap.formatting import counted, span

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterable

    import numpy.typing as npt
    import xarray as xr


_TABLES, _COLUMNS = ("kind", "curve", "attractor", "orbit"), ("eigenvalue", "part", "trajectory")
"""Dimensions before the axes of an image, and after them."""

_RISING = ("averaged", "event_time")  # Rising variables along dimensions without a coordinate

_OVER: dict[str, dict[str, tuple[str, ...]]] = {
    "basin_sweep": {"twin": ("attractor",), "point_theta": ("point",)},
    "basins": {"fraction": ("attractor",)},
    "bifurcation": {"kind": ("kind",), "entry_kind": ("entry",), "point_value": ("point",)},
    "lifetime": {"captured": ("attractor", "elapsed"), "tail_mean": ("tail_begin",)},
    "lyapunov": {"growth": ("elapsed",), "kind": ("attractor",)},
    "melnikov": {"p_melnikov": ("omega", "branch")},
    "orbits": {"kind": ("orbit",), "point_theta": ("point",)},
    "parameter_map": {"kind": ("kind",), "regime_has": ("set", "kind")},
    "tongues": {"p": ("critical",), "asymptotic": ("curve", "omega")},
    "trajectory": {"theta": ("time",), "section_time": ("period",)},
}
"""Dimensions that variables of a result must have in every selection of it."""

_CELLS = {
    "basin_sweep": ("label",),
    "basins": ("label",),
    "bifurcation": ("up", "down"),
    "parameter_map": ("regime", "exponent"),
}
"""Variables over the axes of an image."""

_OF_THE_WHOLE = (
    "basin_entropy",
    "mean_periods",
    "boundary_",
    "uncertainty_",
    "neighbours_",
)
"""Prefixes of facts that hold for a whole map alone."""

_BLOCK = 1_000_000  # Cells that are counted at a time, so that a large map is never converted whole


def shown(dataset: xr.Dataset) -> xr.Dataset:
    """Return a result, or a selection of one, ready to be drawn; raise InputError otherwise."""
    dataset = member(dataset)
    kind = str(dataset.attrs["kind"])
    if kind == "basins" and "theta" not in dataset.coords:
        raise InputError("a list of starts is no map: only basins on a grid can be drawn")
    axes = _axes(dataset)
    for name in axes:
        if name not in dataset.dims:
            raise InputError(
                f"{name} must be a range here, got a single value: select like"
                f" isel({name}=slice(3, 4))"
            )
        if not dataset.sizes[name]:
            raise InputError(f"{name} must have one value at least in a selection, got none")
    over = _OVER.get(kind, {}) | dict.fromkeys(_CELLS.get(kind, ()), axes)
    for name, dimensions in over.items():
        if name not in dataset or set(dataset[name].dims) != set(dimensions):
            there = f"is over {_listed(dataset[name].dims)}" if name in dataset else "is missing"
            raise InputError(
                f"{name} must be over {_listed(dimensions)} here, as isel and sel of ranges leave"
                f" it, but {there}"
            )
    dataset = _rising(dataset)
    dataset = dataset.transpose(*_TABLES, *axes, *_COLUMNS, ..., missing_dims="ignore")
    count = _COUNTED.get(kind)
    return dataset if count is None else count(dataset)


def member(dataset: xr.Dataset) -> xr.Dataset:
    """Return one map of a sweep, selected by its parameters, as a basin map; else the dataset."""
    varied = str(dataset.attrs.get("varied")).split()
    sweep = dataset.attrs.get("kind") == "basin_sweep"
    if not sweep or any(name not in dataset.coords or dataset[name].ndim for name in varied):
        return dataset
    here = np.ones(dataset.sizes["point"], bool)
    for name in varied:
        here &= dataset[f"point_{name}"].values == float(dataset[name])
    part: xr.Dataset = dataset.isel(attractor=dataset["exists"].values.astype(bool), point=here)
    shows = str(part["plane"].attrs["flag_meanings"]).split()[int(part["plane"])]
    kinds = np.array(str(part["kind"].attrs["flag_meanings"]).split())
    part = part.drop_vars("plane").assign(kind=("attractor", kinds[part["kind"].values]))
    at = ", ".join(span(name, *[float(dataset[name])] * 2) for name in varied)
    text = f"One map of a sweep, {at}. The text below describes the whole sweep."
    part.attrs = dataset.attrs | {
        "kind": "basins",
        "layers": "labels",
        "plane": shows,
        "summary": f"{text}\n{dataset.attrs['summary']}",
    }
    # Not every map of a sweep is checked.
    reliable = not float(part["unreliable"]) > RELIABLE
    one: xr.Dataset = with_facts(part, labels_reliable=int(reliable))
    return one


def _listed(dimensions: Iterable[Hashable]) -> str:
    return ", ".join(map(str, dimensions)) or "nothing"


def _axes(dataset: xr.Dataset) -> tuple[str, ...]:
    """Return the axes of an image, rows first."""
    a = dataset.attrs
    axes: dict[str, tuple[str, ...]] = {
        "basin_sweep": (*str(a.get("varied")).split(), "velocity", "theta"),
        "basins": ("velocity", "theta"),
        "parameter_map": (str(a.get("rows")), str(a.get("columns"))),
        "bifurcation": (str(a.get("varied")),),
        "lifetime": ("elapsed",),
        "lyapunov": ("elapsed",),
        "melnikov": ("omega",),
        "tongues": ("omega",),
        "trajectory": ("time",),
    }
    return axes.get(str(a["kind"]), ())


def _rising(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset in which numeric coordinates rise, and kinds in their order."""
    if "kind" in dataset.indexes:
        ranks = [(*one.rank, one.w, one.lean, one.turn) for one in attractors_of(dataset, "kind_")]
        dataset = dataset.isel(kind=sorted(range(len(ranks)), key=ranks.__getitem__))
    numbers = [name for name in dataset.indexes if dataset[name].dtype.kind in "iuf"]
    for name in [*numbers, *(key for key in _RISING if key in dataset)]:
        values = dataset[name].values
        if not (values[:-1] <= values[1:]).all():
            dataset = dataset.sortby(name)
    return dataset


def _basins(dataset: xr.Dataset) -> xr.Dataset:
    """Recompute the shares of a part of a basin map from its cells."""
    label = dataset["label"].values
    whole = int(dataset.attrs["cells"])
    ids = dataset["id"].values.astype(int)
    present = np.unique(label)
    if not np.isin(present[present > 0], ids).all():
        raise InputError("attractor: a selection of it cannot be drawn; it must be one of an axis")
    if label.size == whole:
        return dataset
    counts = np.zeros(int(ids.max(initial=0)) + 2, dtype=np.int64)
    for rows in np.array_split(np.arange(label.shape[0]), -(-label.size // _BLOCK)):
        counts += np.bincount(label[rows].ravel().astype(np.int64) + 1, minlength=counts.size)
    share = counts / label.size
    settle = dataset["settle_periods"].values
    settled = settle[settle >= 0]
    fraction = share[ids + 1]
    part = dataset.assign(shares(("attractor",), fraction, label.size))
    gone = [name for name in facts(part) if name.startswith(_OF_THE_WHOLE)]
    part = part.drop_vars(gone, errors="ignore")
    part.attrs = {name: value for name, value in part.attrs.items() if name not in gone}
    part = with_facts(
        part,
        cells=label.size,
        failed=float(share[0]),
        undecided=float(share[1]),
        mean_settle=float(settled.mean()) if settled.size else -1.0,
        longest_settle=int(settled.max(initial=-1)),
    )
    return _note_selection(part, f"{counted(label.size, 'cell')} of {whole}")


def _parameter_map(dataset: xr.Dataset) -> xr.Dataset:
    """Recompute the shares of a part of a map over two parameters from its cells."""
    _refuse_kinds(dataset)
    regime = dataset["regime"]
    whole = int(dataset.attrs["cells"])
    if "set" in dataset.indexes:
        regime = regime.copy(data=_places(dataset, "set", regime.values))
    if regime.size == whole:
        return dataset
    used, place, count = np.unique(regime.values, return_inverse=True, return_counts=True)
    part = dataset.isel(set=used).assign(
        regime=regime.copy(data=place.reshape(regime.shape).astype(np.int16)),
        regime_share=("set", count / regime.size),
    )
    shares = {f"{key}_share": float(part[key].mean()) for key in ("undecided", "failed")}
    part = with_facts(part, cells=regime.size, **shares)
    return _note_selection(part, f"{counted(regime.size, 'cell')} of {whole}")


def _refuse_kinds(dataset: xr.Dataset) -> None:
    """Raise InputError for a selection of kinds, without which regimes and entries are wrong."""
    if dataset["entry_kind"].values.max(initial=-1) != dataset.sizes["kind"] - 1:
        raise InputError("kind: a selection of kinds cannot be drawn; it must be one of values")


def _bifurcation(dataset: xr.Dataset) -> xr.Dataset:
    """Keep the attractors and points at the selected values."""
    name = str(dataset.attrs["varied"])
    values = dataset[name].values
    _refuse_kinds(dataset)
    owner = _places(dataset, "entry", dataset["point_entry"].values)
    sweeps = {key: _places(dataset, "entry", dataset[key].values) for key in ("up", "down")}
    chosen = np.isin(dataset["entry_value"].values, values)
    loose = np.isin(dataset.get("loose_value", values[:0]), values)
    # The last entry is for -1, no attractor.
    new = np.append(np.where(chosen, np.cumsum(chosen) - 1, -1), -1)
    rows = {"entry": chosen, "point": chosen[owner], "loose": loose}
    part = dataset.isel(rows, missing_dims="ignore")
    part = part.assign(
        point_entry=("point", new[owner[chosen[owner]]]),
        up=(name, new[sweeps["up"]]),
        down=(name, new[sweeps["down"]]),
    )
    if chosen.all() and loose.all():
        return part
    return _note_selection(part, f"{counted(values.size, 'value')}")


def _tongues(dataset: xr.Dataset) -> xr.Dataset:
    """Keep the critical points at the selected frequencies."""
    omega = dataset["omega"].values
    for prefix in ("", "undamped_", "inverted_"):
        table = prefix.removesuffix("_") or "critical"
        if f"{table}_omega" in dataset:
            mine = dataset[f"{table}_omega"].values
            dataset = dataset.isel({table: np.isin(mine, omega)})
            mine = dataset[f"{table}_omega"].values
            dataset[f"{prefix}index"] = (table, np.searchsorted(omega, mine))
    return dataset


def _trajectory(dataset: xr.Dataset) -> xr.Dataset:
    """Keep the points of the section within the selected times."""
    first, last = (float(dataset["time"].values[end]) for end in (0, -1))
    at, slack = dataset["section_time"].values, 1e-9 * max(abs(first), abs(last))
    return dataset.isel(period=(at >= first - slack) & (at <= last + slack))


def _places(dataset: xr.Dataset, table: str, numbers: npt.NDArray[Any]) -> npt.NDArray[np.intp]:
    """Return the positions of numbers in a table; -1 for -1, which means none."""
    mine = dataset[table].values
    place = np.searchsorted(mine, numbers)
    result = mine[np.minimum(place, mine.size - 1)] == numbers if mine.size else numbers < 0
    if not (result | (numbers < 0)).all():
        raise InputError(f"{table}: a selection of it cannot be drawn; it must be one of an axis")
    return np.where(numbers < 0, -1, place)


def _note_selection(part: xr.Dataset, which: str) -> xr.Dataset:
    """Add to the summary which part is shown, and that the remaining text is about the whole."""
    spans = [
        f"{name} = {low:.6g} to {high:.6g}"
        for name in reversed(_axes(part))
        for low, high in [plane.outer_edges(part, name)]
    ]
    text = f"A part is shown: {', '.join(spans)}, {which}."
    text += " The text below describes the whole result."
    part.attrs = part.attrs | {"summary": f"{text}\n{part.attrs['summary']}"}
    return part


_COUNTED: dict[str, Callable[[xr.Dataset], xr.Dataset]] = {
    "basins": _basins,
    "bifurcation": _bifurcation,
    "parameter_map": _parameter_map,
    "tongues": _tongues,
    "trajectory": _trajectory,
}
