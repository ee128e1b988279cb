"""Files: written whole or not at all; TOML; results as NetCDF or Zarr (``files.dataset``)."""

from __future__ import annotations

from typing import Any

from pendmap.files.atomic import COMPLETE as COMPLETE
from pendmap.files.atomic import STOPS as STOPS
from pendmap.files.atomic import check_room as check_room
from pendmap.files.atomic import held_interrupts as held_interrupts
from pendmap.files.atomic import read_whole as read_whole
from pendmap.files.atomic import whole_file as whole_file
from pendmap.files.atomic import whole_folder as whole_folder
from pendmap.files.toml import read_toml as read_toml
from pendmap.files.toml import toml_text as toml_text


def facts(dataset: Any) -> dict[str, Any]:
    """Return the attributes of a result and its variables without dimensions, as plain values."""
    scalars = {name: one.values.item() for name, one in dataset.variables.items() if not one.dims}
    return {str(name): value for name, value in {**dataset.attrs, **scalars}.items()}


def with_facts(dataset: Any, **values: Any) -> Any:
    """Return a result with these values in the place of its attributes and scalar variables."""
    scalars = {name: value for name, value in values.items() if name in dataset.variables}
    rest = {name: value for name, value in values.items() if name not in scalars}
    scalars = {name: ((), value, dataset[name].attrs) for name, value in scalars.items()}
    return dataset.assign(scalars).assign_attrs(rest)
