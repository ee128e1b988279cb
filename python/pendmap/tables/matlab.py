"""Reading of MATLAB files: vectors of one length in variables and structures are columns."""

from __future__ import annotations

import io
import struct
import zlib
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import InputError
from pendmap.tables.table import readable

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from pendmap.signal import Floats

_FEWEST: Final = 5  # Fewest numbers of a column
_HEADER: Final = 128  # Bytes before the first variable
_COMPRESSED: Final = 15  # Type of a compressed variable
_SAVE: Final = "save it as CSV: writematrix([t theta], 'run.csv')"


def matlab_frame(data: bytes, where: str, most: int) -> pd.DataFrame:
    """Return the vectors of the most common length, the longest of these, as columns.

    A matrix is its columns; one alone has no names, so that its first column is the time.
    """
    import pandas as pd

    with readable(where, "MATLAB file"):
        if data.startswith(b"MATLAB 7.3"):
            import h5py

            with h5py.File(io.BytesIO(data)) as file:
                vectors = dict(_vectors("", file))
        else:
            from scipy.io import loadmat

            _refuse_bomb(data, where, most)
            content = loadmat(io.BytesIO(data), simplify_cells=True)
            vectors = dict(_vectors("", {k: v for k, v in content.items() if k[:2] != "__"}))
    sizes = [values.size for values in vectors.values()]
    if not sizes:
        raise InputError(f"{where}: must have vectors of {_FEWEST} numbers or more: {_SAVE}")
    size = max(sizes, key=lambda n: (sizes.count(n), n))
    columns = {name: values for name, values in vectors.items() if values.size == size}
    frame = pd.DataFrame(columns)
    if len({name.rpartition(" ")[0] for name in columns}) == 1 and " " in next(iter(columns)):
        frame.columns = [""] * len(columns)
    return frame


def _vectors(name: str, value: Any) -> Iterator[tuple[str, Floats]]:  # noqa: ANN401 (any variable)
    """Yield the vectors of a variable, with the name of the innermost field."""
    if hasattr(value, "items"):
        for key, part in value.items():
            if not key.startswith("#"):
                yield from _vectors(key, part)
    elif isinstance(value, list):
        for k, part in enumerate(value, 1):
            yield from _vectors(f"{name}{k}", part)
    else:
        array = np.asarray(value).squeeze()
        if array.dtype.kind not in "biuf" or array.ndim not in {1, 2} or max(array.shape) < _FEWEST:
            return
        if array.ndim == 1:
            yield name, array.astype(float)
            return
        rows = array.T if array.shape[0] >= array.shape[1] else array
        yield from ((f"{name} {k}", row.astype(float)) for k, row in enumerate(rows, 1))


def _refuse_bomb(data: bytes, where: str, most: int) -> None:
    """Raise InputError for variables that unpack to too many bytes."""
    tag = struct.Struct("<II" if data[126:128] == b"IM" else ">II")
    place, size = _HEADER, 0
    while place + tag.size <= len(data):
        kind, length = tag.unpack_from(data, place)
        packed, place = data[place + 8 : place + 8 + length], place + 8 + length
        if kind == _COMPRESSED:
            size += len(zlib.decompressobj().decompress(packed, most + 1 - size))
        if size > most:
            raise InputError(f"{where}: unpacks to more than {most / 2**20:.0f} MiB")
