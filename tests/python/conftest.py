"""Shared fixtures: reference values, the command line, strict recordings."""

from __future__ import annotations

import contextlib
import functools
import io
import json
import os
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest import mock

import pytest
from hypothesis import HealthCheck, settings

import hidden
from pendmap import cli

if TYPE_CHECKING:
    from collections.abc import Iterator

HERE = Path(__file__).resolve().parent
COMMAND = Path(sys.executable).with_name("pendmap")

# The load of the machine fails no test; files of one example are overwritten by the next.
settings.register_profile(
    "steady",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("steady")


@pytest.fixture(scope="session", autouse=True)
def known_diagnoses(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of `hidden.diagnosed`, shared by all processes of this test run."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "diagnoses"
    folder.mkdir(exist_ok=True)
    hidden.KNOWN[:] = [folder]
    return folder


@pytest.fixture(scope="session")
def truths() -> dict[str, Any]:
    """Return reference values from independent tools; tests/truths.json states which."""
    content: dict[str, Any] = json.loads((HERE.parent / "truths.json").read_text(encoding="utf-8"))
    return content


Run = Callable[..., "subprocess.CompletedProcess[str]"]
"""The command line, run in a folder of its own: a function of words, and `env`."""


def run_command(
    folder: Path, *words: object, env: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run `pendmap` in a folder, without a display; with `env` in a process of its own."""
    typed = [str(word) for word in words]
    clean = {k: v for k, v in os.environ.items() if k not in {"DISPLAY", "WAYLAND_DISPLAY"}}
    if env is not None:
        return subprocess.run(
            [str(COMMAND), *typed],
            capture_output=True,
            text=True,
            check=False,
            timeout=600,  # s: limit for a command that hangs; a loaded machine may take minutes
            cwd=folder,
            env=clean | env,
        )
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8") for _ in range(2))
    with (
        contextlib.chdir(folder),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        mock.patch.dict(os.environ, clean, clear=True),
        mock.patch.object(sys, "argv", ["pendmap", *typed]),
        warnings.catch_warnings(),
        pytest.raises(SystemExit) as end,
    ):
        cli.run()
    texts = []
    for stream in (out, err):
        stream.seek(0)
        texts.append(stream.read())
    return subprocess.CompletedProcess(typed, int(end.value.code or 0), *texts)


@pytest.fixture
def pendmap_command(tmp_path: Path) -> Run:
    """Return a function that runs `pendmap` in `tmp_path`."""
    return functools.partial(run_command, tmp_path)


@pytest.fixture
def rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Return a function that runs `pendmap rig` in `tmp_path`, the current folder."""
    monkeypatch.chdir(tmp_path)
    return functools.partial(run_command, tmp_path, "rig")


@pytest.fixture
def strict_recordings() -> Iterator[None]:
    """Make Rerun raise errors that it would only warn of."""
    import rerun as rr  # noqa: PLC0415 (few tests need it)

    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)
