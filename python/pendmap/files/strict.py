"""A store of zarr in which a chunk that is missing is an error; imports zarr."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final

from zarr.storage import WrapperStore

from pendmap.errors import InputError

if TYPE_CHECKING:
    from zarr.abc.store import ByteRequest
    from zarr.core.buffer import Buffer, BufferPrototype

_CHUNK: Final = re.compile(r"(.*/)?c(/\d+)*")


class StrictStore(WrapperStore[Any]):
    """A store that has no fill values."""

    async def get(
        self, key: str, prototype: BufferPrototype, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return a file; None for metadata that are missing."""
        value = await super().get(key, prototype, byte_range)
        if value is None and _CHUNK.fullmatch(key):
            raise InputError(f"{self._store}: lacks the chunk {key}")
        return value
