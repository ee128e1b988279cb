"""One run a store: a lock of the system at a path, a lease that expires at an address.

The file ``map.zarr.lock`` beside the store names the run that holds it. At a path the system frees
the lock when the process ends. An object at an address is renewed while its run lives; a run that
was stopped for longer holds it no more, and asks before it removes or publishes anything.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import sys
import threading
import time
import uuid
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final

from pendmap.errors import InputError, NotWrittenError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import fsspec

if sys.platform == "win32":
    import msvcrt

    _FAR: Final = 2**30  # A byte that the file does not have: others can read it

    def _lock(file: IO[bytes]) -> None:
        file.seek(_FAR)
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(file: IO[bytes]) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


_EXPIRES: Final = 60.0  # Time after which a lease that is not renewed is free, s
_HELD: Final[set[IO[bytes]]] = set()  # Locked files of this process


def _forked() -> None:
    """Leave the locks to the parent: a child that outlives it must not hold them."""
    while _HELD:
        _HELD.pop().close()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forked)


@contextlib.contextmanager
def held(
    name: str,
    system: fsspec.AbstractFileSystem,
    path: str,
    *,
    local: bool,
) -> Iterator[Callable[[], None]]:
    """Hold a store; yield a function that raises NotWrittenError if another run holds it.

    Raises InputError if another run holds it at the beginning.
    """
    record = {"run": uuid.uuid4().hex, "pid": os.getpid(), "host": socket.gethostname()}
    record["since"] = time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime())
    if local and (file := _locked(name, Path(path), record)) is not None:

        def check() -> None:
            if not _same(file, Path(path)):
                raise NotWrittenError(f"{name}: its lock was removed: this run ends")

        _HELD.add(file)
        try:
            yield check
        finally:
            _HELD.discard(file)
            with contextlib.suppress(OSError):  # Windows removes no open file
                if _same(file, Path(path)):
                    Path(path).unlink()
            file.close()
        return
    lease = _Lease(name, system, path, record)
    try:
        yield lease.check
    finally:
        lease.end()


def _locked(name: str, path: Path, record: dict[str, Any]) -> IO[bytes] | None:
    """Return the locked file; None on a file system without locks."""
    while True:
        file = path.open("a+b")
        try:
            _lock(file)
        except (BlockingIOError, PermissionError):
            file.seek(0)
            with file:
                raise _refused(name, file.read(), "until its process ends") from None
        except OSError:
            file.close()
            return None
        if _same(file, path):  # no other run has removed it meanwhile
            break
        file.close()
    file.truncate(0)
    file.write(json.dumps(record).encode())
    file.flush()
    return file


def _same(file: IO[bytes], path: Path) -> bool:
    """Return whether a path still leads to an open file."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


def _refused(name: str, data: bytes, until: str) -> InputError:
    try:
        record = json.loads(data)
        who = f"process {record['pid']} on {record['host']} since {record['since']}"
    except (ValueError, LookupError, TypeError):
        who = "another process"
    return InputError(f"{name}: is held by a run, {who}, {until}: a store has one run at a time")


class _Lease:
    """An object that names the run; a thread renews it."""

    def __init__(
        self, name: str, system: fsspec.AbstractFileSystem, path: str, record: dict[str, Any]
    ) -> None:
        self._name, self._system, self._path, self._record = name, system, path, record
        self._over = threading.Event()
        self._take()
        self._thread = threading.Thread(target=self._renew, daemon=True)
        self._thread.start()

    def _take(self) -> None:
        for _ in range(3):
            with contextlib.suppress(FileExistsError):
                self._put(mode="create")
            try:
                data = self._system.cat_file(self._path)
            except FileNotFoundError:  # the other run has ended meanwhile
                continue
            record = _parsed(data)
            if record.get("run") == self._record["run"]:
                return
            left = _EXPIRES - (time.time() - record.get("renewed", 0.0))
            if left > 0:
                raise _refused(self._name, data, f"{round(left)} s more if it does not live")
            self._system.rm_file(self._path)
        raise InputError(f"{self._name}: other runs take the store at the same moment")

    def _put(self, **mode: str) -> None:
        renewed = time.time()
        data = json.dumps({**self._record, "renewed": renewed}).encode()
        self._system.pipe_file(self._path, data, **mode)
        self._renewed = renewed

    def _mine(self) -> bool:
        """Return whether no time has come at which another run may have taken the store."""
        if time.time() - self._renewed > _EXPIRES:
            return False
        try:
            record = _parsed(self._system.cat_file(self._path))
        except FileNotFoundError:
            return False
        return bool(record.get("run") == self._record["run"])

    def _renew(self) -> None:
        while not self._over.wait(_EXPIRES / 4):
            with contextlib.suppress(Exception):  # the next time may be better
                if not self._mine():
                    return
                self._put()

    def check(self) -> None:
        """Raise NotWrittenError if another run may hold the store."""
        if not self._mine():
            raise NotWrittenError(
                f"{self._name}: this run was stopped for long, another may hold the store: it ends"
            )

    def end(self) -> None:
        """Free the store."""
        self._over.set()
        self._thread.join(_EXPIRES / 4)
        with contextlib.suppress(Exception):  # it expires by itself
            if self._mine():
                self._system.rm_file(self._path)


def _parsed(data: bytes) -> dict[str, Any]:
    """Return the record of a lease; an empty one for what is none."""
    try:
        record = json.loads(data)
    except ValueError:
        return {}
    return record if isinstance(record, dict) else {}
