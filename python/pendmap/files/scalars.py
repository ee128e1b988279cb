"""Numbers and texts of a result, be they attributes or variables without dimensions.

Datasets have the type Any: the virtual rig, which writes files too, is kept apart from xarray.
"""

from __future__ import annotations

from typing import Any


def facts(dataset: Any) -> dict[str, Any]:  # noqa: ANN401 (an xarray.Dataset)
    """Return the attributes of a result and its variables without dimensions, as plain values.

    Attributes hold what was asked for and how it was computed; variables without dimensions what
    was computed and, as coordinates, the parameters of the model.
    """
    scalars = {name: one.values.item() for name, one in dataset.variables.items() if not one.dims}
    return {str(name): value for name, value in {**dataset.attrs, **scalars}.items()}


def with_facts(dataset: Any, **values: Any) -> Any:  # noqa: ANN401 (an xarray.Dataset)
    """Return a result with these values in the place of its attributes and scalar variables."""
    scalars = {name: value for name, value in values.items() if name in dataset.variables}
    rest = {name: value for name, value in values.items() if name not in scalars}
    scalars = {name: ((), value, dataset[name].attrs) for name, value in scalars.items()}
    return dataset.assign(scalars).assign_attrs(rest)
