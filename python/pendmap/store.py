"""Results in files: NetCDF, and Zarr where it is installed."""

from __future__ import annotations

import shutil
import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import xarray as xr

from pendmap.errors import InputError
from pendmap.files import held_interrupts, whole_file

if TYPE_CHECKING:
    import os

__all__ = ["FORMAT_VERSION", "KINDS", "SUFFIXES", "load", "save"]

FORMAT_VERSION: Final = 1
"""Version of the layout of the datasets, in their attribute ``format_version``."""
SUFFIXES: Final = (".nc", ".zarr")
"""The kinds of file a result is stored in."""
KINDS: Final = {
    "basins": ("basins", "basins_of"),
    "bifurcation": ("bifurcation",),
    "lifetime": ("lifetime",),
    "lyapunov": ("lyapunov",),
    "melnikov": ("melnikov",),
    "orbits": ("orbit",),
    "parameter_map": ("parameter_map",),
    "tongues": ("tongues",),
    "trajectory": ("simulate",),
}
"""The kinds of result, and the functions that return each."""
_LARGE: Final = 4096


def save(dataset: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write a result; the file is complete or absent.

    Parameters
    ----------
    dataset : xarray.Dataset
        A result of pendmap.
    path : str or path
        Its suffix chooses the format: .nc (NetCDF 4) or .zarr.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If it is not a result of pendmap, the suffix is not known, or .zarr is asked for and zarr is
        not installed.
    OSError
        If the file cannot be written.
    """
    target = Path(path)
    if not (isinstance(dataset, xr.Dataset) and _is_result(dataset)):
        made = {name for functions in KINDS.values() for name in functions}
        raise InputError(
            f"{target}: what shall be saved is not a result of pendmap: allowed are the datasets "
            f"that {', '.join(sorted(made))} return"
        )
    if target.suffix.lower() == ".zarr":
        return _save_zarr(dataset, target)
    with whole_file(target, SUFFIXES) as part:
        dataset.to_netcdf(part, engine="netcdf4", encoding=_encoding(dataset))
    return target


def _is_result(dataset: xr.Dataset) -> bool:
    return {"format_version", "kind"} <= set(dataset.attrs)


def _encoding(dataset: xr.Dataset) -> dict[Any, dict[str, Any]]:
    large = (name for name, v in dataset.data_vars.items() if v.size > _LARGE)
    # Whole rows in chunks of about a megabyte, so that compression works on a part at a time.
    return {name: {"zlib": True, "complevel": 1, "shuffle": True} for name in large}


def _save_zarr(dataset: xr.Dataset, target: Path) -> Path:
    try:
        import zarr  # noqa: F401, PLC0415 (an extra: only where it is asked for)
    except ImportError:
        raise InputError(
            f"{target}: .zarr needs the extra pendmap[zarr]; .nc always works"
        ) from None
    if not target.parent.is_dir():
        raise FileNotFoundError(2, "the folder does not exist", str(target.parent))
    part = target.with_name(f".{target.stem}-{uuid.uuid4().hex[:8]}.part.zarr")
    old = part.with_suffix(".old")
    with held_interrupts():
        try:
            dataset.to_zarr(part, mode="w", zarr_format=2, consolidated=True)
            if target.exists():
                target.rename(old)
            part.rename(target)
        finally:
            for leftover in (part, old):
                shutil.rmtree(leftover, ignore_errors=True)
    return target


def load(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a result back into memory.

    Parameters
    ----------
    path : str or path
        A file that :func:`save` wrote.

    Raises
    ------
    InputError
        If it is not a result of pendmap, or of a later format.
    OSError
        If it cannot be read.
    """
    source = Path(path)
    if not source.exists():
        raise FileNotFoundError(2, "no such file", str(source))
    if source.suffix.lower() not in SUFFIXES:
        raise InputError(f"{source}: suffix {source.suffix!r}: allowed are {', '.join(SUFFIXES)}")
    try:
        if source.suffix.lower() == ".zarr":
            dataset: xr.Dataset = xr.open_zarr(source, consolidated=True).load()
        else:
            dataset = xr.load_dataset(source, engine="netcdf4")
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{source}: cannot be read as a result of pendmap: {error}") from error
    if not _is_result(dataset):
        raise InputError(f"{source}: is not a result of pendmap")
    version = dataset.attrs["format_version"]
    if int(version) > FORMAT_VERSION:
        known = f"this pendmap reads format {FORMAT_VERSION}"
        raise InputError(f"{source}: has format {version}, {known}")
    return dataset
