"""Zarr stores of results: what they may hold, and how a change of any byte is noticed.

The root's attribute ``pendmap`` has a digest of all metadata and of the chunks' places and
checksums; each chunk ends with its CRC-32C. What is missing is an error, never a fill value. Only
Zarr 3 with known codecs is opened.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import re
import uuid
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pendmap.errors import InputError, one_line
from pendmap.files.atomic import check_regular, synced

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    import fsspec
    import zarr

    from pendmap.files.strict import StrictStore

MARK: Final = "pendmap"
"""Attribute of a Zarr store: the digest, whether it is complete, and the request of a run."""
WORK: Final = "work"
"""Folder of what a run keeps beside its result until it is complete."""
GROUP: Final = b'{"zarr_format": 3, "node_type": "group", "attributes": {}}'
"""Metadata of a group without attributes."""
_DIGEST: Final = "sha256"  # Entry of the mark
CHUNKS: Final = "chunks"  # Entry of the mark of a complete store: digest of all chunks
_CODECS: Final = frozenset(("bytes", "crc32c", "vlen-utf8", "zstd"))
_REMAINS: Final = re.compile(r".*\.[0-9a-f]{32}\.part(ial)?")  # Files of killed writers
MOST_CHUNKS: Final = 2**18  # Most chunks of an array that is loaded as a whole
_OURS: Final = re.compile(rf"zarr\.json|{WORK}(/[a-z0-9_-]+)*(/(\d+|zarr\.json))?")
"""Files of a store that are no chunks: metadata, records of runs."""


def place(address: str | os.PathLike[str]) -> tuple[fsspec.AbstractFileSystem, str]:
    """Return the file system of a path or an address, and the path in it."""
    import fsspec  # noqa: PLC0415 (an extra)

    system, path = fsspec.core.url_to_fs(os.fspath(address))
    return system, str(Path(path).resolve()) if is_local(system) else path.rstrip("/")


def is_local(system: fsspec.AbstractFileSystem) -> bool:
    """Return whether a file system is that of this machine."""
    return "file" in ([system.protocol] if isinstance(system.protocol, str) else system.protocol)


def open_store(address: str | os.PathLike[str]) -> StrictStore:
    """Return a store of zarr in which a chunk that is missing is an error."""
    from zarr.storage import FsspecStore, LocalStore  # noqa: PLC0415 (an extra)

    from pendmap.files.strict import StrictStore  # noqa: PLC0415 (imports zarr)

    system, path = place(address)
    return StrictStore(LocalStore(path) if is_local(system) else FsspecStore.from_url(str(address)))


def put_whole(system: fsspec.AbstractFileSystem, target: str, data: bytes) -> None:
    """Write a file, whole or not at all."""
    if not is_local(system):
        system.pipe_file(target, data)
        return
    part = Path(f"{target}.{uuid.uuid4().hex}.part")
    part.parent.mkdir(parents=True, exist_ok=True)
    try:
        part.write_bytes(data)
        synced(part)
        part.replace(target)
    except OSError:
        part.unlink(missing_ok=True)
        raise


def metadata(address: str | os.PathLike[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the metadata of the root and of each array; InputError for what is not opened."""
    system, path = place(address)
    system.invalidate_cache()
    try:
        if is_local(system):
            check_regular(f"{path}/zarr.json")
        root = _parsed(system.cat_file(f"{path}/zarr.json"))
    except FileNotFoundError:
        raise InputError(f"{address}: must be a store of Zarr 3, it lacks zarr.json") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{address}: zarr.json is damaged: {error}") from None
    folders = [entry["name"] for entry in system.ls(path, detail=True) if entry["type"] != "file"]
    names = {f"{folder}/zarr.json": folder.rsplit("/", 1)[-1] for folder in folders}
    for file in names if is_local(system) else ():
        if Path(file).exists():
            check_regular(file)
    arrays = {}
    for file, data in system.cat([*names], on_error="omit").items():
        name = names[file.removeprefix("file://")]
        if name == WORK:
            continue
        try:
            arrays[name] = _parsed(data)
            codecs = {codec["name"] for codec in arrays[name]["codecs"]}
            counts(arrays[name])
        except (ValueError, LookupError, TypeError, RecursionError) as error:
            raise InputError(f"{address}: {name}/zarr.json is damaged: {error}") from None
        if not codecs <= _CODECS:
            wanted = f"must be among {', '.join(sorted(_CODECS))}"
            raise InputError(
                f"{address}: codecs of {name} {wanted}, got {', '.join(sorted(codecs - _CODECS))}"
            )
    return root, arrays


def _parsed(data: bytes) -> dict[str, Any]:
    """Return the metadata of a group or an array of Zarr 3."""
    content = json.loads(data)
    if not isinstance(content, dict) or content.get("zarr_format") != 3:  # noqa: PLR2004
        raise ValueError("zarr_format must be 3")
    return content


def digest(root: Mapping[str, Any], arrays: Mapping[str, Any]) -> str:
    """Return the digest of all metadata; of an unfinished store that of the mark."""
    attributes = root["attributes"]
    mark = {key: value for key, value in attributes[MARK].items() if key != _DIGEST}
    content: Any = mark
    if mark["complete"] is True:
        content = [{**root, "attributes": {**attributes, MARK: mark}}, arrays]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def signed(mark: Mapping[str, Any]) -> dict[str, Any]:
    """Return the mark of an unfinished store with its digest."""
    return {**mark, _DIGEST: digest({"attributes": {MARK: mark}}, {})}


def seal(address: str | os.PathLike[str], attributes: Mapping[str, Any] | None = None) -> None:
    """Write the digest of a store, and the attributes of its root.

    All chunks are read. The root also has the metadata of all arrays, where other tools look first.
    """
    system, path = place(address)
    root, arrays = metadata(address)
    chunks = read_chunks(address, arrays)
    gathered = {"kind": "inline", "must_understand": False, "metadata": arrays}
    root["consolidated_metadata"] = gathered
    root["attributes"] = {**root.get("attributes", {}), **(attributes or {})}
    root["attributes"][MARK] = {**root["attributes"][MARK], CHUNKS: chunks}
    root["attributes"][MARK][_DIGEST] = digest(root, arrays)
    put_whole(system, f"{path}/zarr.json", json.dumps(root, indent=2).encode())


def checked(address: str | os.PathLike[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the metadata of a store of pendmap; InputError if they have been changed."""
    root, arrays = metadata(address)
    try:
        mark = root["attributes"][MARK]
        if mark[_DIGEST] == digest(root, arrays):
            return mark, arrays
    except (LookupError, TypeError):
        raise InputError(f"{address}: is not a result of pendmap, or is damaged") from None
    raise InputError(f"{address}: its metadata were changed after they were written")


def check_chunks(address: str | os.PathLike[str]) -> None:
    """Read all chunks of a complete store; InputError for one that is missing or changed."""
    mark, arrays = checked(address)
    check_digest(address, mark, read_chunks(address, arrays))


def check_digest(address: str | os.PathLike[str], mark: Mapping[str, Any], computed: str) -> None:
    """Raise InputError if the digest of a complete store's chunks is another than its mark has."""
    if mark.get(CHUNKS, computed) != computed:
        raise InputError(f"{address}: its chunks were changed after they were written")


def read_chunks(address: str | os.PathLike[str], names: Iterable[str]) -> str:
    """Read all chunks of arrays, and return their digest; InputError for one that is damaged."""
    import zarr  # noqa: PLC0415 (an extra)

    store = open_store(address)
    group = zarr.open_group(store, mode="r", zarr_format=3, use_consolidated=False)
    for name in names:
        array: Any = group[name]
        height = array.chunks[0] if array.ndim else 1
        for first in range(0, array.shape[0] if array.ndim else 1, height):
            try:
                array[first : first + height] if array.ndim else array[...]
            except Exception as error:  # a damaged chunk may raise any error
                raise InputError(f"{address}: {name} is damaged: {one_line(str(error))}") from error
    return store.digest()


def counts(array: Mapping[str, Any]) -> list[int]:
    """Return the number of chunks of an array along each dimension."""
    sides = array["chunk_grid"]["configuration"]["chunk_shape"]
    return [-(-n // max(side, 1)) for n, side in zip(array["shape"], sides, strict=True)]


def foreign(address: str | os.PathLike[str]) -> Iterator[str]:
    """Yield the names of files and links in a store that are no part of one."""
    _, arrays = metadata(address)

    def ours(folder: str, key: str) -> bool:
        if folder not in arrays or key == "zarr.json":
            return folder in arrays
        first, *places = key.split("/")
        most = counts(arrays[folder])
        inside = (k.isdecimal() and int(k) < n for k, n in zip(places, most, strict=False))
        return first == "c" and len(places) == len(most) and all(inside)

    for name in strangers(address):
        folder, _, key = name.partition("/")
        if not ours(folder, key):
            yield name


def strangers(address: str | os.PathLike[str]) -> Iterator[str]:
    """Yield the names of files and links that are neither metadata nor records of a run."""
    system, path = place(address)
    links: set[str] = set()
    if is_local(system):
        entries = {entry.relative_to(path).as_posix(): entry for entry in Path(path).rglob("*")}
        links = {name for name, entry in entries.items() if entry.is_symlink()}
        names = sorted(name for name, entry in entries.items() if not entry.is_dir())
    else:
        names = [name.removeprefix(path).lstrip("/") for name in system.find(path)]
    for name in [*links, *names]:
        if name in links or not (_OURS.fullmatch(name) or _REMAINS.fullmatch(name)):
            yield name


def remove_remains(folder: Path) -> None:
    """Remove the files of writers that were killed."""
    for file in folder.rglob("*"):
        if _REMAINS.fullmatch(file.name):
            file.unlink(missing_ok=True)


@contextlib.contextmanager
def beside_others() -> Iterator[None]:
    """Let zarr be silent about files in a store that are no part of it."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Object at .* is not recognized")
        yield


@functools.cache
def compressors() -> tuple[Any, ...]:
    """Return the compressors of all arrays: each chunk ends with its checksum."""
    from zarr.codecs import Crc32cCodec, ZstdCodec  # noqa: PLC0415 (an extra)

    return (ZstdCodec(), Crc32cCodec())


def opened(address: str | os.PathLike[str]) -> zarr.Group:
    """Return the root of a store that is written."""
    import zarr  # noqa: PLC0415 (an extra)

    return zarr.open_group(open_store(address), mode="r+", zarr_format=3, use_consolidated=False)
