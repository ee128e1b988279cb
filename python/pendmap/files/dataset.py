"""Saving and loading of results: NetCDF, and Zarr at a path or an address of fsspec.

A store of Zarr has the SHA-256 of all its files in ``pendmap.json``, the last one that is written:
what is missing or changed is an error, never a fill value.
"""

from __future__ import annotations

import contextlib
import contextvars
import hashlib
import json
import math
import mmap
import os
import re
import threading
import time
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import xarray as xr

from pendmap import ANALYSES, _core
from pendmap.errors import InputError, NotWrittenError, one_line
from pendmap.files import check_regular, whole_file, whole_folder
from pendmap.files.saved import Saved, unpacked
from pendmap.files.variables import FORMAT_VERSION, MARKS, restored, stored_form

if TYPE_CHECKING:
    from collections.abc import Iterator

    import fsspec

    Address = str | Path
    """A path, or an address of fsspec."""

SUFFIXES: Final = (".nc", ".zarr")  # Suffixes of files that hold a result
# Kinds of result, and the functions that return each
KINDS: Final = {kind: functions for kind, (_, functions, _) in ANALYSES.items()}
_MADE_BY: Final = contextvars.ContextVar("made_by", default="")
_SEAL: Final = "pendmap.json"
_CODECS: Final = {"bytes", "vlen-utf8", "zstd"}
_UNFINISHED: Final = "is an unfinished run: its command completes it with --resume (resume=True)"
_LARGE: Final = 4096  # Number of values above which a variable is compressed
_ONE: Final = threading.RLock()  # Held while NetCDF is read or written: the library has no threads
_LINK: Final = re.compile(rb"\x01([\x08-\x0f\x18-\x1f])\x40", re.DOTALL)
"""Beginning of the message of an external link: version, flags, type."""
_STORAGE: Final = re.compile(rb"\x01\x00\x00\x00")  # Beginning of a message of external files
_STORAGE_TYPES: Final = (4, 6, 8)  # Places of its type before that, by the version of the header
_VIRTUAL: Final = re.compile(rb"\x04\x03")  # Layout of a virtual dataset: version, class
_HEAP: Final = re.compile(rb"FRHP\x00..(?!\x00\x00)", re.DOTALL)
"""Heap that is compressed: links in it cannot be seen."""


def save(dataset: Any, path: str | os.PathLike[str]) -> Path | str:
    """Write a result by the CF conventions 1.11; the file is complete or absent.

    The attribute ``history`` is added, unless the result has one: UTC time (or that of the
    environment variable ``SOURCE_DATE_EPOCH``), version, and the function or command.

    Parameters
    ----------
    dataset : xarray.Dataset or other result
        A result of pendmap, of records too; :func:`pendmap.save_model` writes a model alone.
    path : str or path
        Its suffix chooses the format: .nc (NetCDF 4) or .zarr, which may be at an address of fsspec
        like ``s3://bucket/map.zarr``.

    Returns
    -------
    Path or str
        The file, or the address.

    Raises
    ------
    InputError
        If it is not a result of pendmap, the suffix is not known, or it is .zarr and zarr is not
        installed.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import pendmap
    >>> result = pendmap.melnikov(pendmap.Pendulum(gamma=0.1, p=1.0, omega=2.0))
    >>> pendmap.save(result, "melnikov.nc").name
    'melnikov.nc'
    """
    target = _address(path)
    if isinstance(dataset, Saved):
        dataset = dataset.to_dataset()
    if not (isinstance(dataset, xr.Dataset) and set(dataset.attrs) >= MARKS):
        made = {name for functions in KINDS.values() for name in functions}
        raise InputError(
            f"{target}: dataset is not a result of pendmap: it must be one of the "
            f"datasets that {', '.join(sorted(made))} return"
        )
    dataset = dataset.assign_attrs(history=history_of(dataset))
    if PurePath(target).suffix.lower() == ".zarr":
        check_replaceable(target)
        write_store(dataset, target)
        return target
    dataset, encoding = stored_form(dataset)
    for name, values in dataset.data_vars.items():
        if values.size > _LARGE:
            encoding[name] = {"zlib": True, "complevel": 1, "shuffle": True}
    with _ONE, whole_file(target, SUFFIXES) as part:
        dataset.to_netcdf(part, engine="netcdf4", encoding=encoding)
    return target


def _address(path: str | os.PathLike[str]) -> Address:
    """Return a path, or an address of a store; InputError for one of anything else."""
    name = os.fspath(path).removeprefix("file://")
    if "://" in name and PurePath(name).suffix.lower() != ".zarr":
        raise InputError(f"{name}: suffix of an address must be .zarr")
    return name if "://" in name else Path(name)


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
    at = time.strftime("%Y-%m-%dT%H:%M:%SZ", now)
    return f"{at} pendmap {_core.__version__}: {made_by}"


def load(path: str | os.PathLike[str]) -> Any:
    """Read a result back into memory.

    Parameters
    ----------
    path : str or path
        A file that :func:`pendmap.save` wrote, or a store (``store=``)
        at a path or an address.

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
    source = _address(path)
    suffix = PurePath(source).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{source}: suffix must be {' or '.join(SUFFIXES)}, got {suffix!r}")
    if isinstance(source, Path) and not (suffix == ".zarr" and not source.is_file()):
        check_regular(source)
    form: Any = {"mask_and_scale": False, "decode_coords": "all"}  # as it is stored
    try:
        if suffix == ".zarr":
            _check_whole(source)
            store: Any = {"chunks": None, "zarr_format": 3, "consolidated": True}
            dataset = _loaded(xr.open_zarr(source, **store, **form), source)
        else:
            _check_alone(Path(source))
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


def _loaded(dataset: xr.Dataset, source: Address) -> xr.Dataset:
    """Return an opened result in memory, as it was; InputError for what is none or too large."""
    if not set(dataset.attrs) >= MARKS:
        raise InputError(f"{source}: is not a result of pendmap")
    version, kind = dataset.attrs["format_version"], dataset.attrs["kind"]
    if not isinstance(version, int | np.integer) or version != FORMAT_VERSION:
        known = f"this pendmap reads format {FORMAT_VERSION}"
        raise InputError(f"{source}: has format {version}, {known}")
    if not isinstance(kind, str):
        raise InputError(f"{source}: has kind {kind}, which is no text")
    # The dataset is opened lazily: its size is known before it takes memory.
    if hasattr(os, "sysconf"):
        memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        if dataset.nbytes > memory / 2:
            size = f"{dataset.nbytes / 2**20:.0f} MiB"
            raise InputError(f"{source}: must unpack to half of this memory at most, got {size}")
    return restored(dataset.load())


def place(address: Address) -> tuple[fsspec.AbstractFileSystem, str]:
    """Return the file system of a path or an address, and the path in it."""
    try:
        import fsspec  # noqa: PLC0415 (an extra)
        import zarr  # noqa: F401, PLC0415 (an extra)
    except ImportError as error:
        text = f"{address}: .zarr needs the extra pendmap[zarr]; .nc always works"
        raise InputError(text) from error
    try:
        system, path = fsspec.core.url_to_fs(str(address))
    except (ImportError, ValueError) as error:
        raise InputError(f"{address}: {error}") from None
    system.invalidate_cache()
    return system, str(Path(path).resolve()) if is_local(address) else path.rstrip("/")


def is_local(address: Address) -> bool:
    """Return whether it is a path of this machine, not an address."""
    return "://" not in str(address)


def write_store(dataset: xr.Dataset, address: Address, request: object = None) -> None:
    """Write a result as Zarr, with the request of its run; the store is complete or absent."""
    if is_local(address):
        with whole_folder(address) as folder:
            _fill(dataset, folder, request)
        return
    system, path = place(address)
    if system.exists(path):
        system.rm(path, recursive=True)
    _fill(dataset, address, request)


def _fill(dataset: xr.Dataset, address: Address, request: object) -> None:
    """Write the files of a store; text has any length, as Zarr 3 specifies it."""
    dataset, encoding = stored_form(dataset)
    texts = [name for name, values in dataset.variables.items() if values.dtype.kind == "U"]
    dataset = dataset.assign({n: dataset[n].astype(np.dtypes.StringDType()) for n in texts})
    form: Any = {"zarr_format": 3, "consolidated": False, "write_empty_chunks": True}
    dataset.to_zarr(address, encoding=encoding, **form)
    system, path = place(address)
    names = {name.removeprefix(path).lstrip("/"): name for name in system.find(path)}
    read = system.cat_file
    # The root also has the metadata of all arrays, where other tools look first.
    arrays = {key[:-10]: json.loads(read(names[key])) for key in names if key[-10:] == "/zarr.json"}
    root = json.loads(read(names["zarr.json"]))
    root["consolidated_metadata"] = {"kind": "inline", "must_understand": False, "metadata": arrays}
    system.pipe_file(names["zarr.json"], json.dumps(root).encode())
    files = {key: hashlib.sha256(read(name)).hexdigest() for key, name in names.items()}
    seal = json.dumps({"request": request, "files": files}, indent=1)
    system.pipe_file(f"{path}/{_SEAL}", seal.encode())


def sealed(address: Address) -> dict[str, Any] | None:
    """Return the request and the digests of a complete store, None if there is none."""
    system, path = place(address)
    try:
        if is_local(address):
            check_regular(f"{path}/{_SEAL}")
        content = json.loads(system.cat_file(f"{path}/{_SEAL}"))
        return {"request": content["request"], "files": dict(content["files"])}
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (LookupError, TypeError, ValueError, RecursionError) as error:
        raise InputError(f"{address}: {_SEAL} is damaged: {error}") from None


def _check_whole(address: Address) -> None:
    """Raise InputError for a store in which a file is missing, changed, or of an unknown form."""
    system, path = place(address)
    stored = sealed(address)
    if stored is None:
        unfinished = system.exists(f"{path}.part")
        lacks = f"must be a result of pendmap in format {FORMAT_VERSION}, it lacks {_SEAL}"
        raise InputError(f"{address}: {_UNFINISHED if unfinished else lacks}")
    files: dict[str, str] = stored["files"]
    for key in files if is_local(address) else ():
        with contextlib.suppress(FileNotFoundError):
            check_regular(f"{path}/{key}")
    data = system.cat([f"{path}/{key}" for key in files], on_error="omit")
    for key, digest in files.items():
        if f"{path}/{key}" not in data:
            raise InputError(f"{address}: lacks {key}")
        if hashlib.sha256(data[f"{path}/{key}"]).hexdigest() != digest:
            raise InputError(f"{address}: {key} was changed after it was written")
    root = json.loads(data[f"{path}/zarr.json"])  # which the arrays are opened by
    for name, array in root["consolidated_metadata"]["metadata"].items():
        if unknown := {codec["name"] for codec in array["codecs"]} - _CODECS:
            known = f"must be among {', '.join(sorted(_CODECS))}, got {', '.join(sorted(unknown))}"
            raise InputError(f"{address}: codecs of {name} {known}")
        sides = array["chunk_grid"]["configuration"]["chunk_shape"]
        count = math.prod(-(-n // max(k, 1)) for n, k in zip(array["shape"], sides, strict=True))
        if count != (there := sum(key.startswith(f"{name}/c") for key in files)):
            raise InputError(f"{address}: {name} must have {count} chunks, got {there}")


def check_replaceable(address: Address) -> None:
    """Raise InputError unless a place is free, or has a store of a result without other files."""
    system, path = place(address)
    wanted = "must be a new folder, or a result of pendmap, which is replaced"
    if system.isfile(path):
        raise InputError(f"{address}: {wanted}; it is a file")
    names = {name.removeprefix(path).lstrip("/") for name in system.find(path)}
    stored = sealed(address) if names else {"files": ()}
    if stored is None:
        raise InputError(f"{address}: {wanted}; the folder does not contain a result")
    for name in sorted(names - {_SEAL, *stored["files"]}):
        raise InputError(f"{address}: {wanted}; it contains {name!r}, no part of a result")


@contextlib.contextmanager
def reached(address: Address) -> Iterator[None]:
    """Let errors of an object store, whose libraries have their own, name its address."""
    try:
        yield
    except (InputError, MemoryError, NotWrittenError):
        raise
    except Exception as error:
        if is_local(address):
            raise
        reason = one_line(str(error)) or type(error).__name__
        raise NotWrittenError(f"{address}: cannot be reached: {reason}") from error


def _check_alone(path: Path) -> None:
    """Raise InputError if an HDF5 file may refer to other files."""
    with path.open("rb") as file:
        head = file.read(8)
        if head.startswith(b"CDF"):  # the classic format has one file
            return
        if head != b"\x89HDF\r\n\x1a\n":
            raise InputError(f"{path}: cannot be read as a result of pendmap: it is no NetCDF file")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            if _refers(data):
                raise InputError(f"{path}: cannot be read: it refers to other files or is damaged")


def _refers(data: mmap.mmap) -> bool:
    def leads(at: int, target: bytes) -> bool:
        place = int.from_bytes(data[at : at + 8], "little")
        return place < len(data) and data[place : place + 4] == target

    sizes, base = (13, 28 if data[8] else 24) if data[8] < 2 else (9, 12)
    if data[sizes] != 8 or data[base : base + 8] != bytes(8):
        return True  # no library writes such files unasked, and addresses would be others
    storage = (
        leads(hit.end() + 4, b"HEAP")
        for hit in _STORAGE.finditer(data)
        if any(data[max(hit.start() - before, 0)] == 7 for before in _STORAGE_TYPES)
    )
    virtual = (leads(hit.end(), b"GCOL") for hit in _VIRTUAL.finditer(data))
    links = (_is_link(data, hit.end(), hit[1][0]) for hit in _LINK.finditer(data))
    return bool(_HEAP.search(data)) or any(storage) or any(virtual) or any(links)


def _is_link(data: mmap.mmap, place: int, flags: int) -> bool:
    """Return whether a link follows: its name, then the names of a file and an object in it."""
    place += (8 if flags & 4 else 0) + (1 if flags & 16 else 0)
    size = 1 << (flags & 3)
    place += size + int.from_bytes(data[place : place + size], "little")
    value = int.from_bytes(data[place : place + 2], "little")
    names = data[place + 2 : place + 2 + value]
    return len(names) == value > 3 and names.count(0) == 3 and names[0] == names[-1] == 0
