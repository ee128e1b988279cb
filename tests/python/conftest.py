"""Shared fixtures: reference values, the command line, strict recordings."""

from __future__ import annotations

import atexit
import functools
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import pytest
from hypothesis import HealthCheck, settings

import hidden
from command_children import Commands
from pendmap import cli

if TYPE_CHECKING:
    from collections.abc import Iterator

HERE = Path(__file__).resolve().parent
COMMAND = Path(sys.executable).with_name("pendmap")
CURRENT = "PYTEST_CURRENT_TEST"
AT_START = {k: v for k, v in os.environ.items() if k not in {"DISPLAY", "WAYLAND_DISPLAY", CURRENT}}
"""The environment of this process before any test has changed it."""

# The load of the machine fails no test; files of one example are overwritten by the next.
settings.register_profile(
    "steady",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("steady")


@functools.cache
def _commands() -> Commands:
    """Return the process that runs commands, one of each process of this test run."""
    commands = Commands()
    atexit.register(commands.close)
    return commands


@pytest.fixture(scope="session", autouse=True)
def known_diagnoses(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of `hidden.diagnosed`, shared by all processes of this test run."""
    own = tmp_path_factory.getbasetemp()
    folder = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "diagnoses"
    folder.mkdir(exist_ok=True)
    hidden.KNOWN[:] = [folder]
    return folder


@pytest.fixture(scope="session")
def truths() -> dict[str, Any]:
    """Return reference values from independent tools; tests/truths.json states which."""
    content: dict[str, Any] = json.loads((HERE.parent / "truths.json").read_text(encoding="utf-8"))
    return content


class Run(Protocol):
    """The command line, run in a folder of its own."""

    def __call__(
        self, *words: object, env: dict[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]:
        """Run the command to its end."""
        ...


def run_command(
    folder: Path, *words: object, env: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run `pendmap` with the given words in a folder, without a display.

    A command with an environment of its own is a process of its own; others are children of one.
    """
    clean = {k: v for k, v in os.environ.items() if k not in {"DISPLAY", "WAYLAND_DISPLAY"}}
    own = env is not None or {k: v for k, v in clean.items() if k != CURRENT} != AT_START
    if not own and hasattr(os, "fork"):
        return _commands().run([*map(str, words)], folder, clean)
    return subprocess.run(
        [str(COMMAND), *map(str, words)],
        capture_output=True,
        text=True,
        check=False,
        timeout=600,  # s: limit for a command that hangs; a loaded machine may take minutes
        cwd=folder,
        env=clean | (env or {}),
    )


@pytest.fixture
def pendmap_command(tmp_path: Path) -> Run:
    """Return a function that runs `pendmap` in `tmp_path`, without a display."""
    return functools.partial(run_command, tmp_path)


@pytest.fixture
def strict_recordings() -> Iterator[None]:
    """Make Rerun raise errors that it would only warn of."""
    import rerun as rr  # noqa: PLC0415 (few tests need it)

    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


@pytest.fixture
def rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Return a function that runs `pendmap rig` in `tmp_path`, within this process for speed."""
    monkeypatch.chdir(tmp_path)

    def run(*words: object, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
        assert env is None
        monkeypatch.setattr(sys, "argv", ["pendmap", "rig", *map(str, words)])
        with pytest.raises(SystemExit) as end:
            cli.run()
        out, err = capsys.readouterr()
        return subprocess.CompletedProcess(words, int(end.value.code or 0), out, err)

    return run
