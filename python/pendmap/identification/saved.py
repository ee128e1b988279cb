"""Results of records in files: a table for other tools, and all the rest for pendmap."""

from __future__ import annotations

import abc
import importlib.metadata
import json
import os
from typing import TYPE_CHECKING, Any, ClassVar, Self

import xarray as xr

from pendmap.errors import InputError, short_repr
from pendmap.files.dataset import FORMAT_VERSION, load, made_by, save
from pendmap.files.tree import Packed, unpacked
from pendmap.formatting import Readable

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd


class Saved(Readable):
    """A result that a file can hold."""

    KIND: ClassVar[str]
    """Its kind in files."""
    ROWS: ClassVar[str]
    """The dimension of its table in files."""

    @abc.abstractmethod
    def to_dataframe(self) -> pd.DataFrame:
        """Return the result as a table."""

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the whole result, which :meth:`load` reads back with the same numbers.

        The file has the table of :meth:`to_dataframe` over its rows for other tools, and in
        ``content`` (JSON) and ``array_0``, ... all the rest for this version of pendmap.
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
        packed = Packed(self)
        data: dict[str, Any] = {"content": ((), json.dumps(packed.tree))}
        table = self.to_dataframe().reset_index()
        for name, column in table.items() if len(table) else ():
            values = column.to_numpy()
            data[str(name)] = (
                self.ROWS,
                values.astype(str) if values.dtype == object else values,
            )
        for name, values in packed.arrays.items():
            data[name] = ([f"{name}_{k}" for k in range(values.ndim)], values)
        attributes = {
            "kind": self.KIND,
            "format_version": FORMAT_VERSION,
            "title": repr(self),
            "pendmap_version": importlib.metadata.version("pendmap"),
        }
        with made_by(f"{type(self).__name__}.save"):
            return save(xr.Dataset(data, attrs=attributes), path)

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
        where, dataset = os.fspath(path), load(path)
        kind = dataset.attrs["kind"]
        if kind != cls.KIND:
            raise InputError(f"{where}: kind must be {cls.KIND}, got {kind}")
        try:
            arrays = {str(name): each.to_numpy() for name, each in dataset.variables.items()}
            found = unpacked(json.loads(dataset["content"].item()), arrays)
        except Exception as error:  # a damaged file may raise any error
            raise InputError(f"{where}: cannot be read as {cls.__name__}: {error}") from error
        if not isinstance(found, cls):
            raise InputError(f"{where}: must hold {cls.__name__}, got {short_repr(found)}")
        return found
