"""Charts of results: preparation of datasets and selections of them, and the builder of each kind.

The chart of a dataset is made by the function ``chart`` of the module named as its kind.
"""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap import _core, charts
from pendmap.analysis.basins import RELIABLE
from pendmap.analysis.result import shares
from pendmap.charts import legend, plane
from pendmap.errors import InputError, short_repr
from pendmap.files import facts, with_facts
from pendmap.formatting import span

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import xarray as xr

    from pendmap.charts.chart import Chart, Sheet

RESULTS: Final = {
    "Experiment": "record",
    "Run": "record",
    "IdentificationReport": "identification",
    "Comparison": "comparison",
    "Discrepancy": "diagnosis",
}
"""Results that are no datasets, by the names of their classes, and the modules of their charts."""
ALL: Final = "all"  # Layer of all panels of a result whose figure shows a few of them
BUILDERS: Final[dict[str, Callable[..., Chart]]] = {}  # Builders of kinds without a module here
_MODULES: Final = {module.name for module in pkgutil.iter_modules(charts.__path__)}
_BYTES: Final = 16  # Memory of a value of a dataset during drawing

_AXES: Final[dict[str, tuple[str, ...]]] = {
    "basins": ("velocity", "theta"),
    "lifetime": ("elapsed",),
    "lyapunov": ("elapsed",),
    "melnikov": ("omega",),
    "tongues": ("omega",),
    "trajectory": ("time",),
}
"""Axes of a chart, rows first, where they are not parameters that a user chose."""
_TABLES: Final = {
    "basins": (("label", "id", "attractor"),),
    "bifurcation": (("up", "entry", "entry"), ("entry_kind", "kind", "kind")),
    "parameter_map": (("regime", "set", "set"), ("entry_kind", "kind", "kind")),
}
"""Variables that number the rows of a table, the column of these numbers or of names, the table."""
_OF_THE_WHOLE: Final = (
    *("mean_settle", "longest_settle", "mean_periods"),
    *("basin_entropy", "boundary_", "uncertainty_", "neighbours_"),
)
"""Prefixes of facts that hold for a whole basin map alone."""


def _builder(kind: object) -> Callable[..., Chart] | None:
    if str(kind) not in _MODULES:
        return BUILDERS.get(str(kind))
    return getattr(importlib.import_module(f"pendmap.charts.{kind}"), "chart", None)


def kinds() -> list[str]:
    """Return the kinds of datasets that have a chart."""
    return sorted(name for name in {*BUILDERS, *_MODULES} if _builder(name) is not None)


def ready(dataset: xr.Dataset, action: str = "draw") -> xr.Dataset:
    """Return a dataset, or a selection of one, prepared for drawing; else raise InputError."""
    if _builder(getattr(dataset, "attrs", {}).get("kind")) is None:
        what = short_repr(dataset)
        if hasattr(dataset, "attrs"):
            what = f"a dataset of kind {dataset.attrs.get('kind')!r}"
        raise InputError(f"cannot {action} {what}; kinds that can be: {', '.join(kinds())}")
    dataset = member(dataset)
    kind = dataset.attrs["kind"]
    if kind == "trajectory" and "start" in dataset.dims:
        raise InputError(
            f"cannot {action} {dataset.sizes['start']} trajectories at once: dataset must be one, "
            "like dataset.isel(start=0)"
        )
    if kind == "basins" and "theta" not in dataset.coords:
        raise InputError("a list of starts is no map: only basins on a grid can be drawn")
    axes = _axes(dataset)
    _check(dataset, axes)
    _core.reckon("values", sum(one.size for one in dataset.variables.values()), _BYTES)
    for name in dataset.indexes:
        values = dataset[name].values
        if values.dtype.kind in "iuf" and (values[1:] < values[:-1]).any():
            dataset = dataset.sortby(name)
    if kind == "trajectory":
        first, last = dataset["time"].values[[0, -1]]
        at, slack = dataset["section_time"].values, 1e-9 * max(abs(first), abs(last))
        dataset = dataset.isel(period=(at >= first - slack) & (at <= last + slack))
    if kind == "basins" and dataset["label"].size != int(dataset.attrs["cells"]):
        dataset = _recounted(dataset)
    before, after = ("kind", "formula", "attractor", "orbit"), ("eigenvalue", "part", "trajectory")
    return dataset.transpose(*before, *axes, *after, ..., missing_dims="ignore")


def _axes(dataset: xr.Dataset) -> tuple[str, ...]:
    attrs, kind = dataset.attrs, str(dataset.attrs["kind"])
    if kind == "parameter_map":
        return str(attrs["rows"]), str(attrs["columns"])
    varied = tuple(str(attrs.get("varied", "")).split())
    known = {"bifurcation": varied, "basin_sweep": (*varied, "velocity", "theta"), **_AXES}
    return known.get(kind, ())


def _check(dataset: xr.Dataset, axes: tuple[str, ...]) -> None:
    """Raise InputError for a selection of anything but ranges of the axes."""
    for name in axes:
        if name not in dataset.dims:
            raise InputError(
                f"{name} must be a range here, got a single value: select like"
                f" isel({name}=slice(3, 4))"
            )
        if not dataset.sizes[name]:
            raise InputError(f"{name} must have one value at least in a selection, got none")
    for variable, column, table in _TABLES.get(dataset.attrs["kind"], ()):
        whole = column in dataset and dataset[column].dims == (table,)
        if whole:
            number, rows = np.unique(dataset[variable].values), dataset[column].values
            place = np.arange(rows.size)
            known = rows if column == "id" else place
            there = np.isin(number[number >= (column == "id")], known)
            ordered = column in {"id", "kind"} or np.array_equal(rows, place)
            whole = ordered and bool(there.all())
        if not whole:
            raise InputError(
                f"{table}: a selection of it cannot be drawn; it must be one of an axis"
            )


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
    names = np.array(str(part["kind"].attrs["flag_meanings"]).split())
    part = part.drop_vars("plane").assign(kind=("attractor", names[part["kind"].values]))
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


def _recounted(dataset: xr.Dataset) -> xr.Dataset:
    """Return a part of a basin map with the shares of its own cells."""
    label, numbers = dataset["label"].values, [-1, 0, *dataset["id"].values.tolist()]
    failed, undecided, *ends = (np.count_nonzero(label == k) / label.size for k in numbers)
    gone = [name for name in facts(dataset) if name.startswith(_OF_THE_WHOLE)]
    part = dataset.drop_vars(gone, errors="ignore")
    part = part.assign(shares(("attractor",), np.array(ends), label.size))
    spans = (
        f"{name} = {low:.6g} to {high:.6g}"
        for name in ("theta", "velocity")
        for low, high in [plane.outer_edges(part, name)]
    )
    text = f"A part is shown: {', '.join(spans)}, {label.size} cells of {part.attrs['cells']}."
    text += f" The text below describes the whole result.\n{part.attrs['summary']}"
    part.attrs = {name: value for name, value in part.attrs.items() if name not in gone}
    known = {"cells": label.size, "failed": failed, "undecided": undecided, "summary": text}
    one: xr.Dataset = with_facts(part, **known)
    return one


def build(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 1200) -> Chart:
    """Return the chart of a dataset returned by :func:`ready`.

    It has one ``layer`` alone if one is asked for; images have at most ``cells`` along a side.
    """
    make: Any = _builder(dataset.attrs["kind"])
    chart: Chart = make(dataset, layer=layer, cells=cells)
    return chart


def of_result(
    result: Any,  # noqa: ANN401
    *,
    layer: str | None = None,
    cells: int = 1200,
    colours: Mapping[str, str] | None = None,
    names: Mapping[str, str] | None = None,
) -> Chart | Sheet:
    """Return what a figure shows of a dataset, of records, or of what was found in records.

    ``colours`` and ``names`` of attractors replace those of their types.
    """
    name = RESULTS.get(type(result).__name__)
    if name is None:
        dataset = ready(result)
        if colours or names:
            dataset = legend.with_looks(dataset, colours or {}, names or {})
        return build(dataset, layer=layer, cells=cells)
    module = importlib.import_module(f"pendmap.charts.{name}")
    made: Any = module.sheet(result)
    whole = getattr(module, "whole", module.sheet)
    if layer == ALL:
        made, layer = whole(result), None
    elif whole is not module.sheet and layer not in {None, *(one.name for one in made.panels)}:
        every = whole(result)
        made = dataclasses.replace(every, columns=[[made], *every.columns])
    shown: Chart | Sheet = made.only(layer)
    return shown
