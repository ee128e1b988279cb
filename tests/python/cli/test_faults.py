"""Full disks, signals, little memory and missing libraries, on real processes."""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
import xarray as xr

import fuzz
import pendmap
from conftest import COMMAND, Run, run_command
from interrupted import started, until
from pendmap import Grid, InputError, Pendulum, cli
from pendmap.files import check_room, whole_file

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

RUN = ("-m", "pendmap")
SMALL = ("basins", "--p", "0.6", "--grid", "20")
ALL = ("--out", "m.nc", "--plot", "m.png", "--rerun", "m.rrd")
MEMORY = 6 * 2**30
NOTHING = "pendmap: interrupted, nothing was written"


@pytest.fixture(scope="module")
def result() -> xr.Dataset:
    return pendmap.basins(Pendulum(p=0.6), Grid.square(8))


def bounded(
    words: Sequence[str], folder: Path, most: int, limit: int = resource.RLIMIT_FSIZE
) -> subprocess.CompletedProcess[str]:
    """Run Python with a limit in bytes, as ``ulimit`` sets it, by default on the size of files."""
    return subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        # Python does not notice that a file of bytecode was cut, and later reads what is left.
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
        preexec_fn=lambda: resource.setrlimit(limit, (most, most)),
    )


def killed(code: str, path: Path) -> None:
    """Run Python that kills itself, with a path as its argument."""
    code = f"import os, pathlib, signal, sys; from pendmap.files import *\n{code}"
    subprocess.run([sys.executable, "-c", code, str(path)], check=False)


@pytest.mark.parametrize(("most", "written"), [(8192, []), (65536, ["m.nc"])])
def test_a_full_disk_is_reported_on_one_line(tmp_path: Path, most: int, written: list[str]) -> None:
    (tmp_path / "m.png").write_bytes(b"old")
    run = bounded((*RUN, *SMALL, *ALL, "--overwrite"), tmp_path, most)
    missed = [f"cannot write {f}: File too large" for f in ALL[1::2] if f not in written]
    text = f"pendmap: {'; '.join(missed)}; written: {', '.join(written) or 'nothing'}\n"
    assert (run.returncode, run.stderr) == (1, text)
    assert "oscillation 2:0" in run.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*written, "m.png"])
    assert (tmp_path / "m.png").read_bytes() == b"old"
    assert not written or pendmap.load(tmp_path / "m.nc").sizes["theta"] == 20


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("basins --p 0.6 --grid 20000 --quiet", 2),
        ("map --p 0:1:3000 --omega 1:2:3000", 2),
        ("orbit --n 2 --w 0 --grid 100000", 2),
        ("simulate --until 5e6 --samples 100 --lyapunov --json", 2),
        ("basins --p 0.6 --grid 12 --threads 256 --json", 0),
    ],
)
def test_a_command_that_asks_for_too_much_memory_is_refused(
    words: str, code: int, tmp_path: Path
) -> None:
    ended = bounded((*RUN, *words.split()), tmp_path, MEMORY, resource.RLIMIT_AS)
    assert ended.returncode == code, ended.stderr
    if code:
        assert (ended.stdout, ended.stderr.count("\n")) == ("", 1)
        assert ended.stderr.startswith("pendmap: not enough memory: ")
        assert not list(tmp_path.iterdir())


def without(modules: str, folder: Path) -> dict[str, str]:
    """Return the environment of a Python that lacks modules."""
    hide = f"import sys\nsys.modules |= dict.fromkeys({modules.split()})\n"
    (folder / "sitecustomize.py").write_text(hide)
    return {"PYTHONPATH": os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])}


def test_a_recording_by_default_is_left_out_and_named(tmp_path: Path) -> None:
    (tmp_path / "here").mkdir()
    run = run_command(tmp_path / "here", *SMALL, env=without("rerun pyarrow", tmp_path))
    assert (run.returncode, run.stderr) == (0, "")
    names = {path.name for path in (tmp_path / "here").iterdir()}
    assert names == {"basins.nc", "basins.png"}
    assert run.stdout.endswith("Left out: basins.rrd, which needs the extra pendmap[viewer]\n")


@pytest.mark.parametrize(
    ("modules", "words", "needs"),
    [
        ("rerun pyarrow", "basins --view", "viewer need the extra pendmap[viewer] ("),
        ("rerun pyarrow", "simulate --live", "viewer need the extra pendmap[viewer] ("),
        ("rerun pyarrow", "view x.rrd", "viewer need the extra pendmap[viewer] ("),
        ("rerun pyarrow", "diagnose a.csv --rerun x.rrd", "need the extra pendmap[viewer] ("),
        ("rerun pyarrow", "look a.parquet", "a Parquet file needs the extra pendmap[viewer] ("),
        ("zarr", "basins --out m.zarr", "pendmap[zarr]"),
        ("matplotlib", "basins --plot m.png", "matplotlib"),
    ],
)
def test_a_missing_library_is_reported_before_the_computation(
    modules: str, words: str, needs: str, tmp_path: Path
) -> None:
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "a.parquet").write_bytes(b"PAR1")
    run = run_command(tmp_path / "here", *words.split(), env=without(modules, tmp_path))
    assert (run.returncode, run.stdout, len(run.stderr.splitlines())) == (2, "", 1)
    assert needs in run.stderr
    assert [path.name for path in (tmp_path / "here").iterdir()] == ["a.parquet"]


def test_no_backend_of_matplotlib_is_needed(pendmap_command: Run) -> None:
    run = pendmap_command(*SMALL, "--plot", "m.png", env={"MPLBACKEND": "nonsense"})
    assert run.returncode == 0, run.stderr


def test_the_unexpected_end_of_a_file_is_no_interrupt(monkeypatch: pytest.MonkeyPatch) -> None:
    def cut(*_: object, **__: object) -> None:
        raise EOFError("marshal data too short")

    monkeypatch.setattr("pendmap.analysis.basins.basins", cut)
    monkeypatch.setattr(sys, "argv", ["pendmap", *SMALL])
    with pytest.raises(EOFError, match="too short"):
        cli.run()


@pytest.mark.parametrize(("option", "file"), [*zip(ALL[::2], ALL[1::2], strict=True)])
def test_ctrl_c_waits_for_the_file_being_written(tmp_path: Path, option: str, file: str) -> None:
    words = [str(COMMAND), "basins", "--p", "0.6", "--grid", "1500", option, file]
    seen: list[Path] = []

    def writing() -> bool:
        # A trial write of 4096 bytes comes before the computation.
        with contextlib.suppress(FileNotFoundError):
            parts = tmp_path.glob(".pendmap-*.part/m.*")
            seen.extend(part for part in parts if part.stat().st_size != 4096)
        return len(seen) > len(set(seen))

    with started(words, cwd=tmp_path, stderr=subprocess.PIPE) as process:
        until(process, writing, step=0.005)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert f"interrupted, {file} written" in err
    assert [path.name for path in tmp_path.iterdir()] == [file]
    assert option != "--out" or pendmap.load(tmp_path / file).sizes["theta"] == 1500


def test_an_error_that_a_library_raises_on_a_signal_is_an_interrupt(tmp_path: Path) -> None:
    # A module in C that is interrupted during its import raises ImportError.
    (tmp_path / "here").mkdir()
    (tmp_path / "matplotlib.py").write_text(
        "import os, signal\n"
        "try: os.kill(os.getpid(), signal.SIGTERM)\n"
        "except KeyboardInterrupt: raise ImportError('initialization failed')\n"
    )
    run = run_command(tmp_path / "here", *SMALL, env=without("", tmp_path))
    assert (run.returncode, run.stderr) == (130, f"{NOTHING}\n")
    assert list((tmp_path / "here").iterdir()) == []


def test_ctrl_c_at_the_start_is_no_traceback(tmp_path: Path) -> None:
    # Before pendmap is imported at all it is Python that is interrupted.
    words = [sys.executable, "-X", "importtime", "-m", "pendmap", *SMALL]
    for moment in ("pendmap.errors", "click", "pendmap.cli.main", "numpy", "xarray"):
        with started(words, cwd=tmp_path, stderr=subprocess.PIPE) as process:
            assert process.stderr is not None
            for line in process.stderr:
                if line.rstrip().endswith(f" {moment}"):
                    break
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=30)
        lines = [line for line in err.splitlines() if not line.startswith("import time:")]
        assert (process.returncode, lines) == (130, [NOTHING]), moment
    assert list(tmp_path.iterdir()) == []


def test_only_files_of_a_killed_run_are_removed(tmp_path: Path, result: xr.Dataset) -> None:
    for _ in range(2):
        killed(
            "with whole_file(sys.argv[1], ['.nc']) as part:\n"
            "    part.write_bytes(bytes(100)); os.kill(os.getpid(), signal.SIGKILL)",
            tmp_path / "m.nc",
        )
    foreign = [".pendmap-notes.part", ".m-577126b3.part.nc", f".pendmap-{'0' * 32}.part"]
    for name in foreign:
        (tmp_path / name).mkdir()
        (tmp_path / name / "data").write_text("mine")
    assert len(list(tmp_path.iterdir())) == 4  # the second run swept the first one's
    with whole_file(tmp_path / "other.nc", [".nc"]) as alive:
        pendmap.save(result, tmp_path / "m.nc")
        assert alive.exists()  # a live process keeps its files
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == sorted([*foreign, "m.nc", "other.nc"])


def test_a_folder_is_restored_after_its_replacement_was_killed(tmp_path: Path) -> None:
    old = tmp_path / "m.zarr"
    old.mkdir()
    (old / "data").write_text("old")
    killed(
        "rename = pathlib.Path.rename\n"
        "def stop(self, target):\n"
        "    if self.parent.name == 'new': os.kill(os.getpid(), signal.SIGKILL)\n"
        "    return rename(self, target)\n"
        "pathlib.Path.rename = stop\n"
        "with whole_folder(sys.argv[1]) as part:\n"
        "    part.mkdir()",
        old,
    )
    assert not old.exists()
    check_room(tmp_path / "x.nc")
    assert (old / "data").read_text() == "old"
    assert list(tmp_path.iterdir()) == [old]


def test_a_zarr_replaces_nothing_but_a_result(tmp_path: Path, result: xr.Dataset) -> None:
    target = tmp_path / "m.zarr"
    target.write_text("a file")
    with pytest.raises(InputError, match="is a file"):
        pendmap.save(result, target)
    target.unlink()
    target.mkdir()
    pendmap.save(result, target)  # an empty folder holds nothing
    for name in ("label/notes.txt", "photos/.hidden"):
        (target / name).parent.mkdir(exist_ok=True)
        (target / name).write_text("mine")
        with pytest.raises(InputError, match="no part of a result"):
            pendmap.save(result, target)
        assert (target / name).read_text() == "mine"
        (target / name).unlink()
    others = xr.Dataset({"x": ("t", [1.0])}, attrs={"format_version": 3, "kind": "raw"})
    others.to_zarr(tmp_path / "b.zarr", zarr_format=2)
    with pytest.raises(InputError, match="does not contain a result"):
        pendmap.save(result, tmp_path / "b.zarr")


def test_drawn_cases_end_well() -> None:
    words = [fuzz.__file__, "--seed", "2", "--count", "48"]
    run = subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.endswith("48 cases of seed 2, 0 failed\n")
