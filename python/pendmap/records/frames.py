"""Records in memory, of numpy, pandas and xarray, as DataFrames."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap.errors import InputError
from pendmap.records.units import name_and_unit

if TYPE_CHECKING:
    import pandas as pd


def frame_of(records: object, theta: object = None) -> pd.DataFrame | None:
    """Return arrays, or a table of pandas or xarray, as a DataFrame; None for other records."""
    import pandas as pd

    if theta is not None:
        return _of_arrays(records, theta)
    xarray = sys.modules.get("xarray")  # without it nothing is of its types
    if xarray is not None and isinstance(records, xarray.DataArray | xarray.Dataset):
        return _of_xarray(records)
    if isinstance(records, pd.Series):
        return records.to_frame(_heading(records, "theta_rad"))
    return records if isinstance(records, pd.DataFrame) else None


def _of_arrays(time: Any, theta: Any) -> pd.DataFrame:  # noqa: ANN401 (arrays)
    """Return times and angles as a DataFrame; headings are the names that they have."""
    import pandas as pd

    arrays = np.asarray(time), np.asarray(theta)
    if arrays[0].ndim != 1 or arrays[1].shape != arrays[0].shape:
        shapes = [array.shape for array in arrays]
        raise InputError(f"times and theta must be of one shape (N,), got {shapes}")
    frame = pd.DataFrame(dict(enumerate(arrays))).infer_objects()
    return frame.set_axis([_heading(time, "t_s"), _heading(theta, "theta_rad")], axis=1)


def _of_xarray(records: Any) -> pd.DataFrame:  # noqa: ANN401 (a Dataset or DataArray)
    """Return the variables and coordinates along the longest dimension as a DataFrame."""
    import pandas as pd

    if not hasattr(records, "data_vars"):
        records = records.to_dataset(name=records.name or "theta_rad", promote_attrs=False)
    along = max(records.sizes, key=records.sizes.__getitem__, default=None)
    columns = [part for part in records.variables.items() if part[1].dims == (along,)]
    heads = [_heading(values, str(name)) for name, values in columns]
    return pd.DataFrame(dict(enumerate(v.to_numpy() for _, v in columns))).set_axis(heads, axis=1)


def _heading(values: Any, usual: str) -> str:  # noqa: ANN401 (an array)
    """Return the name of an array, with the unit that its attributes give."""
    name = str(getattr(values, "name", None) or usual)
    unit = str(getattr(values, "attrs", {}).get("units", "")).partition(" since ")[0]
    return f"{name_and_unit(name)[0]} [{unit}]" if unit else name
