"""Numbers and texts of a result, be they attributes or variables without dimensions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr


def facts(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the attributes of a result and its variables without dimensions, as plain values.

    Attributes hold what was asked for and how it was computed; variables without dimensions what
    was computed and, as coordinates, the parameters of the model.
    """
    scalars = {
        name: each.values.item() for name, each in dataset.variables.items() if not each.dims
    }
    return {str(name): value for name, value in {**dataset.attrs, **scalars}.items()}


def with_facts(dataset: xr.Dataset, **values: Any) -> xr.Dataset:  # noqa: ANN401 (numbers or texts)
    """Return a result with these values in the place of its attributes and scalar variables."""
    scalars = {name: value for name, value in values.items() if name in dataset.variables}
    rest = {name: value for name, value in values.items() if name not in scalars}
    scalars = {name: ((), value, dataset[name].attrs) for name, value in scalars.items()}
    return dataset.assign(scalars).assign_attrs(rest)
