"""Saving and loading of results: NetCDF and Zarr.

A store of Zarr has the SHA-256 of all its files in ``pendmap.json``, the last one that is written:
what is missing or changed is an error, never a fill value.
"""

from __future__ import annotations

import contextlib
import contextvars
import hashlib
import importlib.util
import json
import math
import os
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import xarray as xr

from pendmap import ANALYSES, _core
from pendmap.errors import InputError
from pendmap.files import read_whole, whole_file, whole_folder
from pendmap.files.atomic import check_regular
from pendmap.files.saved import Saved, unpacked
from pendmap.files.variables import FORMAT_VERSION, MARKS, restored, stored_form

if TYPE_CHECKING:
    from collections.abc import Iterator

SUFFIXES: Final = (".nc", ".zarr")  # Suffixes of files that hold a result
KINDS: Final = {kind: names for kind, (_, names, _) in ANALYSES.items()}  # Functions by kind
_MADE_BY: Final = contextvars.ContextVar("made_by", default="")
_SEAL: Final = "pendmap.json"
_MOST_SEAL: Final = 2**26  # Largest size of it, bytes; a file of a store takes a hundred
_CODECS: Final = {"bytes", "vlen-utf8", "zstd"}
_LARGE: Final = 4096  # Number of values above which a variable is compressed
_ONE: Final = threading.RLock()  # Held while NetCDF is read or written: the library has no threads


def save(dataset: Any, path: str | os.PathLike[str]) -> Path:
    """Write a result by the CF conventions 1.11; the file is complete or absent.

    The attribute ``history`` is added, unless the result has one: UTC time (or that of the
    environment variable ``SOURCE_DATE_EPOCH``), version, and the function or command.

    Parameters
    ----------
    dataset : xarray.Dataset or other result
        A result of pendmap, of records too; :func:`pendmap.save_model` writes a model alone.
    path : str or path
        Its suffix chooses the format: .nc (NetCDF 4) or .zarr.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If it is not a result of pendmap, the suffix is not known, or zarr is needed and missing.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import pendmap
    >>> result = pendmap.melnikov(pendmap.Pendulum(gamma=0.1, p=1.0, omega=2.0))
    >>> pendmap.save(result, "melnikov.nc").name
    'melnikov.nc'
    """
    target = Path(path)
    if isinstance(dataset, Saved):
        dataset = dataset.to_dataset()
    if not (isinstance(dataset, xr.Dataset) and set(dataset.attrs) >= MARKS):
        raise InputError(f"{target}: dataset is not a result of pendmap")
    dataset = dataset.assign_attrs(history=history_of(dataset))
    if target.suffix.lower() == ".zarr":
        write_store(dataset, target)
        return target
    dataset, encoding = stored_form(dataset)
    small = {"zlib": True, "complevel": 1, "shuffle": True}
    encoding |= {name: small for name, one in dataset.data_vars.items() if one.size > _LARGE}
    with _ONE, whole_file(target, SUFFIXES) as part:
        dataset.to_netcdf(part, engine="netcdf4", encoding=encoding)
    return target


@contextlib.contextmanager
def made_by(command: str) -> Iterator[None]:
    """Let ``history`` name a command in the place of the function that it calls."""
    token = _MADE_BY.set(command)
    try:
        yield
    finally:
        _MADE_BY.reset(token)


def history_of(dataset: xr.Dataset) -> str:
    """Return the attribute ``history``: that of a result, or time, version and what made it."""
    if "history" in dataset.attrs:
        return str(dataset.attrs["history"])
    functions = (f"pendmap.{f}" for f in KINDS.get(dataset.attrs["kind"], ["save"]))
    made_by = _MADE_BY.get() or " or ".join(functions)
    given = os.environ.get("SOURCE_DATE_EPOCH", "")
    now = time.gmtime(int(given) if given.isdecimal() else None)
    return f"{time.strftime('%Y-%m-%dT%H:%M:%SZ', now)} pendmap {_core.__version__}: {made_by}"


def load(path: str | os.PathLike[str]) -> Any:
    """Read a result back into memory.

    Parameters
    ----------
    path : str or path
        A file that :func:`pendmap.save` wrote, or a store (``store=``).

    Returns
    -------
    xarray.Dataset, IdentificationReport, Discrepancy or Comparison
        The result as it was, with the same numbers.

    Raises
    ------
    InputError
        If it is not a result of pendmap, of a later format, not yet complete, or damaged; for a
        result of records, also if another version of pendmap wrote it in another form.
    OSError
        If it cannot be read.

    Examples
    --------
    >>> import pendmap
    >>> path = pendmap.save(pendmap.melnikov(pendmap.Pendulum(p=1.0, omega=2.0)), "melnikov.nc")
    >>> pendmap.load(path).attrs["kind"]
    'melnikov'
    """
    source = Path(path)
    suffix = source.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{source}: suffix must be {' or '.join(SUFFIXES)}, got {suffix!r}")
    form: Any = {"mask_and_scale": False, "decode_coords": "all"}  # as it is stored
    if suffix == ".nc":
        check_regular(source)
    try:
        if suffix == ".zarr":
            _check_whole(source)
            dataset = _loaded(xr.open_zarr(source, chunks=None, zarr_format=3, **form), source)
        else:
            _check_alone(source)
            with _ONE, xr.open_dataset(source, engine="netcdf4", **form) as opened:
                dataset = _loaded(opened, source)
        if "content" not in dataset.attrs:
            return dataset
        arrays = {str(name): one.to_numpy() for name, one in dataset.variables.items()}
        return unpacked(dataset.attrs["content"], arrays)
    except InputError:
        raise
    except Exception as error:  # a damaged file may raise any error
        raise InputError(f"{source}: cannot be read as a result of pendmap: {error}") from error


def _check_alone(path: Path) -> None:
    """Raise InputError if a NetCDF file refers to other files, which the library would open."""
    import h5py  # noqa: PLC0415 (loading alone needs it)

    if not h5py.is_hdf5(path):  # the classic format has one file
        return
    with h5py.File(path) as file:
        for name in file:
            linked = not isinstance(file.get(name, getlink=True), h5py.HardLink)
            one = None if linked else file[name]
            if not isinstance(one, h5py.Dataset) or one.external or one.is_virtual:
                raise InputError(f"{path}: {name} must be in this file, without a link or a group")


def _loaded(dataset: xr.Dataset, source: Path) -> xr.Dataset:
    """Return an opened result in memory, as it was; InputError for what is none or too large."""
    if not set(dataset.attrs) >= MARKS:
        raise InputError(f"{source}: is not a result of pendmap")
    if str(version := dataset.attrs["format_version"]) != str(FORMAT_VERSION):
        text = f"has format {version}, this pendmap reads format {FORMAT_VERSION}"
        raise InputError(f"{source}: {text}")
    # The dataset is opened lazily: its size is known before it takes memory.
    if hasattr(os, "sysconf"):
        memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        if (size := dataset.nbytes) > memory / 2:
            text = f"must unpack to half of this memory at most, got {size / 2**20:.0f} MiB"
            raise InputError(f"{source}: {text}")
    return restored(dataset.load())


def write_store(dataset: xr.Dataset, path: Path, request: object = None) -> None:
    """Write a result as Zarr, with the request of its run; the store is complete or absent."""
    check_replaceable(path)
    dataset, encoding = stored_form(dataset)
    # Text has any length, as Zarr 3 specifies it.
    texts = [name for name, values in dataset.variables.items() if values.dtype.kind == "U"]
    dataset = dataset.assign({n: dataset[n].astype(np.dtypes.StringDType()) for n in texts})
    form: Any = {"zarr_format": 3, "consolidated": False, "write_empty_chunks": True}
    with whole_folder(path) as folder:
        dataset.to_zarr(folder, encoding=encoding, **form)
        # The root also has the metadata of all arrays, where other tools look first.
        arrays = {f.parent.name: json.loads(f.read_bytes()) for f in folder.glob("*/zarr.json")}
        inline = {"kind": "inline", "must_understand": False, "metadata": arrays}
        root = json.loads((folder / "zarr.json").read_bytes()) | {"consolidated_metadata": inline}
        (folder / "zarr.json").write_text(json.dumps(root))
        files = {name: _digest(folder / name) for name in _names(folder)}
        (folder / _SEAL).write_text(json.dumps({"request": request, "files": files}, indent=1))


def _names(folder: Path) -> list[str]:
    """Return the names of all files in a folder and its folders."""
    files = (path for path in folder.rglob("*") if not path.is_dir())
    return sorted(path.relative_to(folder).as_posix() for path in files)


def _digest(path: Path) -> str:
    """Return the SHA-256 of a file."""
    check_regular(path)
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sealed(path: Path) -> dict[str, Any] | None:
    """Return the request and the digests of a complete store, None if there is none."""
    try:
        content = json.loads(read_whole(path / _SEAL, _MOST_SEAL))
        return {"request": content["request"], "files": dict(content["files"])}
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (LookupError, TypeError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: {_SEAL} is damaged: {error}") from None


def _check_whole(path: Path) -> None:
    """Raise InputError for a store in which a file is missing, changed, or of an unknown form."""
    stored = sealed(path)
    if stored is None:
        text = f"must be a result of pendmap in format {FORMAT_VERSION}, it lacks {_SEAL}"
        if path.with_name(f"{path.name}.part").exists():
            text = "is an unfinished run: its command completes it with --resume (resume=True)"
        raise InputError(f"{path}: {text}")
    files = stored["files"]
    for name, digest in files.items():
        try:
            changed = _digest(path / name) != digest
        except FileNotFoundError:
            raise InputError(f"{path}: lacks {name}") from None
        if changed:
            raise InputError(f"{path}: {name} was changed after it was written")
    root = json.loads(read_whole(path / "zarr.json", _MOST_SEAL))  # which arrays are opened by
    for name, array in root["consolidated_metadata"]["metadata"].items():
        if unknown := {codec["name"] for codec in array["codecs"]} - _CODECS:
            known = f"must be among {', '.join(sorted(_CODECS))}, got {', '.join(sorted(unknown))}"
            raise InputError(f"{path}: codecs of {name} {known}")
        sides = array["chunk_grid"]["configuration"]["chunk_shape"]
        count = math.prod(-(-n // max(k, 1)) for n, k in zip(array["shape"], sides, strict=True))
        if count != (there := sum(key.startswith(f"{name}/c") for key in files)):
            raise InputError(f"{path}: {name} must have {count} chunks, got {there}")


def check_replaceable(path: Path) -> None:
    """Raise InputError unless a place is free, or has a store of a result without other files."""
    if importlib.util.find_spec("zarr") is None:
        raise InputError(f"{path}: .zarr needs the extra pendmap[zarr]; .nc always works")
    wanted = "must be a new folder, or a result of pendmap, which is replaced"
    if path.is_file():
        raise InputError(f"{path}: {wanted}; it is a file")
    names = _names(path)
    stored = sealed(path) if names else {"files": ()}
    if stored is None:
        raise InputError(f"{path}: {wanted}; the folder does not contain a result")
    for name in sorted({*names} - {_SEAL, *stored["files"]}):
        raise InputError(f"{path}: {wanted}; it contains {name!r}, no part of a result")
