"""Results of records in files: a table for other tools, and all the rest for pendmap."""

from __future__ import annotations

import abc
import importlib.metadata
import json
import os
from typing import TYPE_CHECKING, Any, ClassVar, Self

import xarray as xr

from pendmap.errors import InputError
from pendmap.files import dataset as files
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
            "format_version": files.FORMAT_VERSION,
            "title": repr(self),
            "pendmap_version": importlib.metadata.version("pendmap"),
        }
        with files.made_by(f"{type(self).__name__}.save"):
            return files.save(xr.Dataset(data, attrs=attributes), path)

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
        found = load(path)
        if not isinstance(found, cls):
            given = found.KIND if isinstance(found, Saved) else found.attrs["kind"]
            raise InputError(f"{os.fspath(path)}: kind must be {cls.KIND}, got {given}")
        return found


def load(path: str | os.PathLike[str]) -> Any:  # noqa: ANN401 (a dataset, or any other result)
    """Read a result back into memory.

    Parameters
    ----------
    path : str or path
        A file that :func:`pendmap.save` or a result's own ``save`` wrote, or a store (``store=``)
        at a path or an address.

    Returns
    -------
    xarray.Dataset, IdentificationReport, Discrepancy or Comparison
        The result as it was, with the same numbers.

    Raises
    ------
    InputError
        If it is not a result of pendmap, of a later format, or not yet complete; for a result of
        records, also if another version of pendmap wrote it in another form.
    OSError
        If it cannot be read.

    Examples
    --------
    >>> import pendmap
    >>> path = pendmap.save(pendmap.melnikov(pendmap.Pendulum(p=1.0, omega=2.0)), "melnikov.nc")
    >>> pendmap.load(path).attrs["kind"]
    'melnikov'
    """
    dataset = files.load(path)
    kind = dataset.attrs["kind"]
    if kind in files.KINDS or "content" not in dataset:
        return dataset
    try:
        arrays = {str(name): each.to_numpy() for name, each in dataset.variables.items()}
        return unpacked(json.loads(dataset["content"].item()), arrays)
    except Exception as error:  # a damaged file may raise any error
        raise InputError(f"{os.fspath(path)}: cannot be read as {kind}: {error}") from error
