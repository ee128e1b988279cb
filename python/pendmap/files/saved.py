"""Results of records in files: tables and arrays as named variables, all else as JSON."""

from __future__ import annotations

import abc
from typing import TYPE_CHECKING, Any, ClassVar, Self

import xarray as xr

from pendmap import _core
from pendmap.errors import InputError
from pendmap.files import dataset as files
from pendmap.files.fields import Packed
from pendmap.files.variables import CONVENTIONS, variable
from pendmap.formatting import Readable

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    import pandas as pd

    from pendmap.files.fields import About


class Saved(Readable):
    """A result that a file can hold."""

    KIND: ClassVar[str]
    """Its kind in files."""
    ROWS: ClassVar[str]
    """The dimension of its table in files."""
    COLUMNS: ClassVar[Mapping[str, str]]
    """Meaning of each column of its table; units are in the column ``unit``."""

    ARRAYS: ClassVar[Mapping[str, About]]
    """Arrays of its parts that are variables, by class and field."""

    @abc.abstractmethod
    def to_dataframe(self) -> pd.DataFrame:
        """Return the result as a table."""

    def further(self) -> dict[str, Any]:
        """Return further variables of the dataset."""
        return {}

    def to_dataset(self) -> xr.Dataset:
        """Return the result as a dataset, as files have it.

        Variables are the columns of :meth:`to_dataframe`, and the arrays of records, fits and
        statistics by name; those of several runs stand one after the other along one dimension. The
        attribute ``content`` is JSON of all that is no array.
        """
        summary, further = str(self), self.further()
        packed = Packed(self, self.ARRAYS)
        data: dict[str, Any] = {**packed.variables(), **further}
        table = self.to_dataframe().reset_index()
        for name, column in table.items() if len(table) else ():
            values = column.to_numpy()
            values = values if values.dtype.kind in "biuf" else values.astype(str)
            data[str(name)] = variable(self.ROWS, values, "", self.COLUMNS[str(name)])
        attributes = {
            "Conventions": CONVENTIONS,
            "kind": self.KIND,
            "format_version": files.FORMAT_VERSION,
            "title": repr(self),
            "summary": summary,
            "source": f"pendmap {_core.__version__}",
            "pendmap_version": _core.__version__,
            "content": packed.content,
        }
        return xr.Dataset(data, attrs=attributes)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the dataset of :meth:`to_dataset`; :meth:`load` returns the same numbers.

        :func:`pendmap.save_model` writes a model alone, as TOML.

        Parameters
        ----------
        path : str or path
            A .nc (NetCDF 4) or .zarr file; it is complete or absent.

        Raises
        ------
        InputError
            For another suffix, or a result with a Python function.
        OSError
            If the file cannot be written.
        """
        return files.save(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a result that :meth:`save` wrote.

        Raises
        ------
        InputError
            If it is no such result, or of another version of pendmap.
        OSError
            If it cannot be read.
        """
        result = files.load(path)
        if not isinstance(result, cls):
            kind = result.KIND if isinstance(result, Saved) else result.attrs["kind"]
            raise InputError(f"{path}: kind must be {cls.KIND}, got {kind}")
        return result
