"""Records in memory, of numpy, pandas and xarray, as DataFrames."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap.errors import InputError
from pendmap.tables.units import name_and_unit

if TYPE_CHECKING:
    import pandas as pd


def frame_of(records: Any, theta: Any = None) -> pd.DataFrame | None:  # noqa: ANN401 (any form)
    """Return arrays, or a table of pandas or xarray, as a DataFrame; None for other records."""
    import pandas as pd

    xarray = sys.modules.get("xarray")  # without it nothing is of its types
    if theta is not None:
        parts = {"t_s": records, "theta_rad": theta}
    elif xarray is not None and isinstance(records, xarray.DataArray | xarray.Dataset):
        if isinstance(records, xarray.DataArray):
            records = records.to_dataset(name=records.name or "theta_rad")
        along = max(records.sizes, key=records.sizes.__getitem__, default="")
        parts = {name: part for name, part in records.variables.items() if part.dims == (along,)}
    elif isinstance(records, pd.Series):
        return records.to_frame(_heading(records, "theta_rad"))
    else:
        return records if isinstance(records, pd.DataFrame) else None
    arrays = [np.asarray(values) for values in parts.values()]
    shapes = [array.shape for array in arrays]
    if any(len(shape) != 1 or shape != shapes[0] for shape in shapes):
        raise InputError(f"times and theta must be of one shape (N,), got {shapes}")
    heads = [_heading(values, str(name)) for name, values in parts.items()]
    return pd.DataFrame(dict(enumerate(arrays))).set_axis(heads, axis=1)


def _heading(values: Any, usual: str) -> str:  # noqa: ANN401 (an array)
    """Return the name of an array, with the unit that its attributes give."""
    name = str(getattr(values, "name", None) or usual)
    unit = str(getattr(values, "attrs", {}).get("units", "")).partition(" since ")[0]
    return f"{name_and_unit(name)[0]} [{unit}]" if unit else name
