"""Saving and loading of results: NetCDF, and Zarr if it is installed."""

from __future__ import annotations

import contextlib
import contextvars
import functools
import importlib.util
import math
import os
import threading
import time
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
import xarray as xr

import pendmap.files.accessor  # noqa: F401 (dataset.pendmap)
from pendmap import ANALYSES, _core
from pendmap.errors import InputError
from pendmap.files import check_regular, sealed, whole_file, whole_folder
from pendmap.files.hdf5 import check_alone
from pendmap.files.saved import Saved, unpacked
from pendmap.files.sealed import MARK
from pendmap.files.variables import FORMAT_VERSION

if TYPE_CHECKING:
    from collections.abc import Collection, Hashable, Iterator, Mapping

    from pendmap.files.strict import StrictStore

SUFFIXES: Final = (".nc", ".zarr")  # Suffixes of files that hold a result
_MARKS: Final = frozenset(("format_version", "kind"))  # Attributes that mark a dataset as a result
# Kinds of result, and the functions that return each
KINDS: Final = {kind: functions for kind, (_, functions, _) in ANALYSES.items()}
_TEXT: Final = "_name"
"""Suffix of a coordinate of text in a file: by CF those named as their dimension are numbers."""
_MADE_BY: Final = contextvars.ContextVar("made_by", default="")
_LARGE: Final = 4096  # Number of values above which a variable is compressed
_AS_STORED: Final[dict[str, Any]] = {"mask_and_scale": False, "decode_coords": "all"}
"""How files are read: whole numbers stay whole, missing or not, and bounds are coordinates."""
_NETCDF: Final[Any] = functools.partial(xr.open_dataset, engine="netcdf4", **_AS_STORED)
_ONE: Final = threading.RLock()  # Held while NetCDF is read or written: the library has no threads
_UNFINISHED: Final = "is an unfinished run: its command completes it with --resume (resume=True)"


def save(
    dataset: Any,  # noqa: ANN401 (a dataset, or what was found in records)
    path: str | os.PathLike[str],
) -> Path:
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
    target = Path(os.fspath(path).removeprefix("file://"))
    if isinstance(dataset, Saved):
        dataset = dataset.to_dataset()
    if not (isinstance(dataset, xr.Dataset) and set(dataset.attrs) >= _MARKS):
        made = {name for functions in KINDS.values() for name in functions}
        raise InputError(
            f"{target}: dataset is not a result of pendmap: it must be one of the "
            f"datasets that {', '.join(sorted(made))} return"
        )
    if target.suffix.lower() == ".zarr" and importlib.util.find_spec("zarr") is None:
        raise InputError(f"{target}: .zarr needs the extra pendmap[zarr]; .nc always works")
    if target.suffix.lower() != ".zarr":
        dataset, encoding = stored_form(dataset)
        for name, values in dataset.data_vars.items():
            if values.size > _LARGE:
                encoding[name] = {"zlib": True, "complevel": 1, "shuffle": True}
        with _ONE, whole_file(target, SUFFIXES) as part:
            dataset.to_netcdf(part, engine="netcdf4", encoding=encoding)
        return target
    check_replaceable(target)
    with whole_folder(target) as part:
        write_zarr(dataset.assign_attrs({MARK: {"complete": True}}), part)
        sealed.seal(part)
    return target


def stored_form(dataset: xr.Dataset) -> tuple[xr.Dataset, dict[Hashable, dict[str, Any]]]:
    """Return a result as files have it by CF, and the encoding of its variables."""
    dataset = dataset.assign_attrs(history=history_of(dataset))
    texts = [name for name in dataset.indexes if dataset[name].dtype.kind not in "iuf"]
    dataset = dataset.reset_index(texts).rename_vars({name: f"{name}{_TEXT}" for name in texts})
    # Coordinates have no missing values.
    floats = (name for name, one in dataset.coords.items() if one.dtype.kind == "f")
    return dataset, {name: {"_FillValue": None} for name in floats}


def write_zarr(
    dataset: xr.Dataset,
    place: str | os.PathLike[str],
    beside: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Write a result as Zarr v3, and return its attributes.

    With ``beside`` its variables are added to a store, which has these attributes instead. Text is
    written as strings of any length, the only ones that Zarr v3 specifies.
    """
    dataset, encoding = stored_form(dataset)
    attributes = dict(dataset.attrs)
    texts = [name for name, values in dataset.variables.items() if values.dtype.kind == "U"]
    kinds = (object if dataset[name].size else np.dtypes.StringDType() for name in texts)
    dataset = dataset.assign({n: dataset[n].astype(k) for n, k in zip(texts, kinds, strict=True)})
    mode: Literal["w", "a"] = "w" if beside is None else "a"
    dataset.attrs = attributes if beside is None else dict(beside)
    checks = {"compressors": sealed.compressors()}
    encoding = {name: encoding.get(name, {}) | checks for name in dataset.variables}
    form: Any = {"zarr_format": 3, "consolidated": False, "write_empty_chunks": True}
    with sealed.beside_others():
        dataset.to_zarr(place, mode=mode, encoding=encoding, **form)
    return attributes


def open_zarr(
    place: str | os.PathLike[str],
    chunks: Any = None,  # noqa: ANN401 (of xarray)
    drop: Collection[str] = (),
    store: StrictStore | None = None,
) -> xr.Dataset:
    """Open a Zarr store as it is stored; variables are read when they are used, but for text."""
    form: Any = {"zarr_format": 3, "consolidated": False, "drop_variables": list(drop)}
    with sealed.beside_others():
        dataset: xr.Dataset = xr.open_zarr(
            store or sealed.open_store(place), chunks=chunks, **form, **_AS_STORED
        )
    texts = [name for name, values in dataset.variables.items() if values.dtype.kind in "OT"]
    plain = {name: np.array(dataset[name].values.tolist(), dtype=str) for name in texts}
    return dataset.assign({name: dataset[name].copy(data=values) for name, values in plain.items()})


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


def check_replaceable(path: str | os.PathLike[str]) -> None:
    """Raise InputError unless a path is free or a Zarr store of a result without other files."""
    target = Path(path)
    wanted = "must be a new folder, or a result of pendmap, which is replaced"
    if target.exists() and not target.is_dir():
        raise InputError(f"{target}: {wanted}; it is a file")
    if not target.exists() or not any(target.iterdir()):
        return
    attributes: Any = {}
    with contextlib.suppress(InputError, LookupError, TypeError):
        attributes = dict(sealed.metadata(target)[0]["attributes"])
    known = "content" in attributes or attributes.get("kind") in [*KINDS]
    if not (attributes.keys() >= _MARKS and known):
        raise InputError(f"{target}: {wanted}; the folder does not contain a result")
    for name in sealed.foreign(target):
        raise InputError(f"{target}: {wanted}; it contains {name!r}, no part of a result")


def load(path: str | os.PathLike[str]) -> Any:  # noqa: ANN401 (a dataset, or any other result)
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
    name = os.fspath(path).removeprefix("file://")
    source = name if "://" in name else Path(name)
    _check_source(source)
    try:
        if PurePath(source).suffix.lower() == ".zarr":
            mark = _check_complete(source)
            store = sealed.open_store(source)
            with open_zarr(source, store=store) as opened:
                dataset = _loaded(opened, source)
            sealed.check_digest(source, mark, store.digest())
            dataset.attrs.pop(MARK, None)
        else:
            check_alone(Path(source))
            with _ONE, _NETCDF(source) as opened:
                dataset = _loaded(opened, source)
        if "content" not in dataset.attrs:
            return dataset
        arrays = {str(name): one.to_numpy() for name, one in dataset.variables.items()}
        return unpacked(dataset.attrs["content"], arrays)
    except InputError:
        raise
    except Exception as error:  # a damaged file may raise any error
        raise InputError(f"{source}: cannot be read as a result of pendmap: {error}") from error


def _check_source(source: Path | str) -> None:
    """Raise InputError or OSError for what is no file or store by its name and kind."""
    suffix = PurePath(source).suffix.lower()
    if isinstance(source, str):
        if suffix != ".zarr":
            raise InputError(f"{source}: suffix of an address must be .zarr, got {suffix!r}")
        return
    if not source.exists():
        if source.with_name(f"{source.name}.part").exists():
            raise InputError(f"{source}: {_UNFINISHED}")
        raise FileNotFoundError(2, "no such file", str(source))
    if suffix not in SUFFIXES:
        raise InputError(f"{source}: suffix must be {' or '.join(SUFFIXES)}, got {suffix!r}")
    if not (suffix == ".zarr" and source.is_dir()):
        check_regular(source)


def restored(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset read as it is stored with the types and names that it had."""
    dataset.attrs = {
        name: value.item() if isinstance(value, np.generic) else value
        for name, value in dataset.attrs.items()
    }
    for one in dataset.variables.values():
        missing = one.attrs.pop("_FillValue", None)
        if missing is not None and one.dtype.kind in "iu":
            one.attrs["_FillValue"] = one.dtype.type(missing)
        if "flag_values" in one.attrs:  # one alone, or a list, became another type
            flags = np.atleast_1d(one.attrs["flag_values"]).astype(one.dtype)
            one.attrs["flag_values"] = flags
        if "bounds" in one.encoding:
            one.attrs["bounds"] = one.encoding.pop("bounds")
    texts = {f"{name}{_TEXT}": name for name in dataset.dims if f"{name}{_TEXT}" in dataset}
    named = {
        name: (name, dataset[text].values, dataset[text].attrs) for text, name in texts.items()
    }
    return dataset.drop_vars([*texts]).assign_coords(named)


def _check_complete(source: Path | str) -> dict[str, Any]:
    """Return the mark of a complete store; InputError for another."""
    mark, arrays = sealed.checked(source)
    if mark["complete"] is not True:
        raise InputError(f"{source}: {_UNFINISHED}")
    for name, array in arrays.items():
        if (count := math.prod(sealed.counts(array))) > sealed.MOST_CHUNKS:
            wanted = f"must have at most {sealed.MOST_CHUNKS} chunks, got {count}"
            raise InputError(f"{source}: {name} {wanted}")
    return mark


def _loaded(dataset: xr.Dataset, source: Path | str) -> xr.Dataset:
    """Return an opened result in memory, as it was; InputError for what is none or too large."""
    if not set(dataset.attrs) >= _MARKS:
        raise InputError(f"{source}: is not a result of pendmap")
    version, kind = dataset.attrs["format_version"], dataset.attrs["kind"]
    if not isinstance(version, int | np.integer) or version != FORMAT_VERSION:
        known = f"this pendmap reads format {FORMAT_VERSION}"
        raise InputError(f"{source}: has format {version}, {known}")
    if not isinstance(kind, str):
        raise InputError(f"{source}: has kind {kind}, which is no text")
    # The dataset is opened lazily: its size is known before it takes memory.
    if dataset.nbytes > _memory() / 2:
        size = f"{dataset.nbytes / 2**20:.0f} MiB"
        raise InputError(f"{source}: must unpack to half of this memory at most, got {size}")
    return restored(dataset.load())


def _memory() -> float:
    """Return this machine's memory in bytes; infinity if it is unknown."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return math.inf
