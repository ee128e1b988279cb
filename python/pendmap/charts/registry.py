"""Chart builders by the kind of dataset: functions ``chart`` of the modules named as the kind."""

from __future__ import annotations

import importlib
import pkgutil
from typing import TYPE_CHECKING, Any, Final, Protocol

from pendmap import charts
from pendmap.charts.basins import refuse_too_large
from pendmap.charts.legend import with_looks
from pendmap.charts.selection import shown
from pendmap.errors import InputError, short_repr

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr

    from pendmap.charts.chart import Chart, Sheet


class Builder(Protocol):
    """Builder of a chart, of one ``layer``, with images of at most ``cells`` along a side."""

    def __call__(self, dataset: xr.Dataset, *, layer: str | None, cells: int) -> Chart:
        """Return the chart."""


RESULTS: Final = {
    "Experiment": "record",
    "Run": "record",
    "IdentificationReport": "identification",
    "Comparison": "comparison",
    "Discrepancy": "diagnosis",
}
"""Results that are no datasets, by the names of their classes, and the modules of their charts."""
BUILDERS: Final[dict[str, Builder]] = {}  # Builders of kinds without a module here


def kinds() -> list[str]:
    """Return the kinds of datasets that have a chart."""
    names = [module.name for module in pkgutil.iter_modules(charts.__path__)]
    return sorted({*BUILDERS, *(name for name in names if _builder(name) is not None)})


def _builder(kind: str) -> Builder | None:
    if kind not in {module.name for module in pkgutil.iter_modules(charts.__path__)}:
        return BUILDERS.get(kind)
    return getattr(importlib.import_module(f"pendmap.charts.{kind}"), "chart", None)


def ready(dataset: xr.Dataset, action: str) -> xr.Dataset:
    """Return a dataset prepared for drawing; raise an error without a chart or enough memory."""
    kind = getattr(dataset, "attrs", {}).get("kind")
    if not isinstance(kind, str) or _builder(kind) is None:
        what = f"a dataset of kind {kind!r}" if hasattr(dataset, "attrs") else short_repr(dataset)
        raise InputError(f"cannot {action} {what}; kinds that can be: {', '.join(kinds())}")
    if kind == "trajectory" and "start" in dataset.dims:
        raise InputError(
            f"cannot {action} {dataset.sizes['start']} trajectories at once: dataset must be one, "
            "like dataset.isel(start=0)"
        )
    dataset = shown(dataset)
    refuse_too_large(dataset)
    return dataset


def build(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 1200) -> Chart:
    """Return the chart of a dataset returned by :func:`ready`."""
    builder = _builder(dataset.attrs["kind"])
    if builder is None:
        raise InputError(f"no chart of kind {dataset.attrs['kind']!r}")
    return builder(dataset, layer=layer, cells=cells)


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
        dataset = ready(result, "draw")
        if colours or names:
            dataset = with_looks(dataset, colours or {}, names or {})
        return build(dataset, layer=layer, cells=cells)
    made: Chart | Sheet = importlib.import_module(f"pendmap.charts.{name}").sheet(result)
    return made.only(layer)
