"""A store of zarr in which a chunk that is missing is an error, and that knows its checksums."""

from __future__ import annotations

import hashlib
import re
from typing import TYPE_CHECKING, Any, Final

from zarr.storage import LocalStore, WrapperStore

from pendmap.errors import InputError
from pendmap.files.atomic import check_regular

if TYPE_CHECKING:
    from zarr.abc.store import ByteRequest
    from zarr.core.buffer import Buffer, BufferPrototype

_CHUNK: Final = re.compile(r"(.*/)?c(/\d+)*")


_CHECK: Final = 4  # Bytes at the end of a chunk: its CRC-32C


class StrictStore(WrapperStore[Any]):
    """A store that has no fill values."""

    def __init__(self, store: Any) -> None:  # noqa: ANN401 (any store of zarr)
        super().__init__(store)
        self.checks: dict[str, bytes] = {}
        """Checksum of each chunk that was read or written, by its key."""

    def _with_store(self, store: Any) -> StrictStore:  # noqa: ANN401 (any store of zarr)
        """Return the same store in another mode, with the same checksums."""
        other = StrictStore(store)
        other.checks = self.checks
        return other

    def digest(self) -> str:
        """Return a digest of the keys and checksums of all known chunks."""
        known = (key.encode() + self.checks[key] for key in sorted(self.checks))
        return hashlib.sha256(b"".join(known)).hexdigest()

    def _note(self, key: str, value: Buffer) -> None:
        if _CHUNK.fullmatch(key):
            self.checks[key] = value.to_bytes()[-_CHECK:]

    async def set(self, key: str, value: Buffer) -> None:
        """Write a file."""
        await super().set(key, value)
        self._note(key, value)

    async def get(
        self, key: str, prototype: BufferPrototype, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return a file; None for metadata that are missing."""
        if isinstance(self._store, LocalStore) and (file := self._store.root / key).exists():
            check_regular(file)
        value = await super().get(key, prototype, byte_range)
        if value is None and _CHUNK.fullmatch(key):
            raise InputError(f"{self._store}: lacks the chunk {key}")
        if value is not None:
            self._note(key, value)
        return value
