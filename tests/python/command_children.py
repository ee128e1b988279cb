"""Commands in children of one process that has imported pendmap: a command without its start.

A command of its own takes a second to import what it needs; a child of :class:`Commands` begins
after these imports, and shares nothing else with other commands.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import json
import os
import select
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import Final

LIMIT: Final = 600.0
"""Seconds after which a command hangs; a loaded machine may take minutes."""

IMPORTED: Final = (  # not rerun, which starts threads
    "pendmap.cli.main",
    "pendmap.analysis.basins",
    "pendmap.diagnosis",
    "pendmap.identification",
    "pendmap.records",
    "pendmap.render",
    "pendmap.report",
    "pendmap.virtual_rig",
    "matplotlib.backends.backend_agg",
    "pandas",
    "scipy.optimize",
    "xarray",
)


class Commands:
    """A process that runs commands, each in a child."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()

    def run(
        self, words: list[str], folder: Path, environment: dict[str, str]
    ) -> subprocess.CompletedProcess[str]:
        """Run ``pendmap`` with these words in a folder to its end."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with tempfile.TemporaryDirectory() as own:
            outputs = [Path(own) / "out", Path(own) / "err"]
            request = {
                "words": words,
                "folder": str(folder),
                "environment": environment,
                "outputs": [str(path) for path in outputs],
            }
            self._process.stdin.write(f"{json.dumps(request)}\n")
            self._process.stdin.flush()
            child = int(self._process.stdout.readline())
            if not select.select([self._process.stdout], [], [], LIMIT)[0]:
                os.kill(child, 9)
                raise subprocess.TimeoutExpired(words, LIMIT)
            code = int(self._process.stdout.readline())
            out, err = (path.read_text(encoding="utf-8") for path in outputs)
        return subprocess.CompletedProcess(words, code, out, err)


def _command(words: list[str], folder: str, environment: dict[str, str], outputs: list[str]) -> int:
    """Run a command in this process; return its exit code."""
    from pendmap import cli  # noqa: PLC0415 (imported by the parent)

    nothing = os.open(os.devnull, os.O_RDONLY)
    files = [os.open(path, os.O_WRONLY | os.O_CREAT) for path in outputs]
    for descriptor, file in enumerate([nothing, *files]):
        os.dup2(file, descriptor)
        os.close(file)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = ["pendmap", *words]
    try:
        cli.run()
    except SystemExit as end:
        code = end.code
        if isinstance(code, str):
            sys.stderr.write(f"{code}\n")
        return code if isinstance(code, int) else int(code is not None)
    return 0


def _answer(number: int) -> None:
    sys.stdout.write(f"{number}\n")
    sys.stdout.flush()


def _serve() -> None:
    """Run the commands that standard input names."""
    import importlib  # noqa: PLC0415 (of the process alone)

    for name in IMPORTED:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    gc.collect()
    gc.freeze()  # a collection in a child copies no page of these imports
    for line in sys.stdin:
        request = json.loads(line)
        child = os.fork()
        if child == 0:
            code = 1
            try:
                code = _command(**request)
            except BaseException:  # noqa: BLE001 (as at the end of a process)
                import traceback  # noqa: PLC0415 (of a failure alone)

                traceback.print_exc()
            # What the end of a process does, but for the destruction of every module, which takes
            # longer than most commands.
            for thread in threading.enumerate():
                if thread is not threading.main_thread() and not thread.daemon:
                    thread.join()
            atexit._run_exitfuncs()  # noqa: SLF001 (no public name)
            for stream in (sys.stdout, sys.stderr):
                with contextlib.suppress(OSError, ValueError):
                    stream.flush()
            os._exit(code)
        _answer(child)
        _, status = os.waitpid(child, 0)
        _answer(os.waitstatus_to_exitcode(status))


if __name__ == "__main__":
    _serve()
