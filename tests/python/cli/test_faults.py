"""Full disks, signals at any moment and missing libraries, on real processes."""

from __future__ import annotations

import os
import random
import resource
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import pytest
import xarray as xr

import pendmap
from conftest import COMMAND
from interrupted import started
from pendmap import Grid, InputError, Pendulum, cli
from pendmap.files import check_room, whole_file

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

SMALL = ("basins", "--p", "0.6", "--grid", "20")


@pytest.fixture(scope="module")
def result() -> xr.Dataset:
    return pendmap.basins(Pendulum(p=0.6), Grid.square(8))


def bounded(words: tuple[str, ...], folder: Path, most: int) -> subprocess.CompletedProcess[str]:
    """Run a command with a limit on the size of its files in bytes, as ``ulimit -f`` sets it."""
    return subprocess.run(
        [str(COMMAND), *words],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        # Python does not notice that a file of bytecode was cut, and later reads what is left.
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, most)),
    )


def test_a_full_disk_is_reported_on_one_line(tmp_path: Path) -> None:
    files = ("m.nc", "m.png", "m.rrd")
    options = dict(zip(files, ("--out", "--plot", "--rerun"), strict=False))
    words = [word for file, option in options.items() for word in (option, file)]
    run = bounded((*SMALL, *words), tmp_path, 8192)
    assert run.returncode == 1
    missed = "; ".join(f"cannot write {file}: File too large" for file in files)
    assert run.stderr.splitlines() == [f"pendmap: {missed}; written: nothing"]
    assert "oscillation 2:0" in run.stdout
    assert list(tmp_path.iterdir()) == []


def test_the_unexpected_end_of_a_file_is_no_interrupt(monkeypatch: pytest.MonkeyPatch) -> None:
    def cut(*_: object, **__: object) -> None:
        raise EOFError("marshal data too short")

    monkeypatch.setattr("pendmap.analysis.basins.basins", cut)
    monkeypatch.setattr(sys, "argv", ["pendmap", *SMALL])
    with pytest.raises(EOFError, match="too short"):
        cli.run()


def test_files_written_before_the_disk_is_full_are_kept(tmp_path: Path) -> None:
    files = ("--out", "m.nc", "--plot", "m.png", "--rerun", "m.rrd")
    (tmp_path / "m.png").write_bytes(b"old")
    run = bounded((*SMALL, *files, "--overwrite"), tmp_path, 64 * 1024)
    assert run.returncode == 1
    assert run.stderr.endswith("written: m.nc\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m.nc", "m.png"]
    assert (tmp_path / "m.png").read_bytes() == b"old"
    assert pendmap.load(tmp_path / "m.nc").sizes["theta"] == 20


def test_a_rig_and_a_figure_meet_a_full_disk(tmp_path: Path) -> None:
    run = bounded(("rig", "free_decay", "--duration", "9", "--out", "lab"), tmp_path, 8192)
    assert (run.returncode, len(run.stderr.splitlines())) == (1, 1)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_stdout_may_be_full(unbuffered: str) -> None:
    with open("/dev/full", "w", encoding="utf-8") as full:  # noqa: PTH123
        run = subprocess.run(
            [str(COMMAND), "info"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
        )
    assert run.returncode == 1
    assert run.stderr == "pendmap: No space left on device\n"


@pytest.mark.parametrize(
    ("module", "words", "needs"),
    [
        ("rerun", SMALL, "pendmap[viewer]"),
        ("zarr", (*SMALL, "--out", "m.zarr"), "pendmap[zarr]"),
        ("matplotlib", (*SMALL, "--plot", "m.png"), "matplotlib"),
    ],
)
def test_a_missing_library_is_reported_before_the_computation(
    pendmap_command: Run, tmp_path: Path, module: str, words: tuple[str, ...], needs: str
) -> None:
    stub = tmp_path / "stub" / module
    stub.mkdir(parents=True)
    (stub / "__init__.py").write_text(f"raise ImportError('no {module} here')")
    paths = os.pathsep.join([str(stub.parent), os.environ.get("PYTHONPATH", "")])
    run = pendmap_command(*words, env={"PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1"})
    assert run.returncode == 2
    assert len(run.stderr.splitlines()) == 1
    assert needs in run.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["stub"]


def test_no_backend_of_matplotlib_is_needed(pendmap_command: Run, tmp_path: Path) -> None:
    run = pendmap_command(*SMALL, "--plot", "m.png", env={"MPLBACKEND": "nonsense"})
    assert run.returncode == 0, run.stderr
    assert (tmp_path / "m.png").exists()


def test_sigterm_at_any_moment_leaves_whole_files_or_none(tmp_path: Path) -> None:
    seed = 7
    rng = random.Random(seed)  # noqa: S311 (moments, no secrets)
    for number in range(5):
        folder = tmp_path / str(number)
        folder.mkdir()
        with started([str(COMMAND), *SMALL], cwd=folder, stderr=subprocess.PIPE) as process:
            time.sleep(rng.uniform(0.15, 3.0))
            process.send_signal(signal.SIGTERM)
            _, said = process.communicate(timeout=30)
        names = sorted(path.name for path in folder.iterdir())
        assert "Traceback" not in said
        assert not [name for name in names if name.startswith(".")], (seed, number)
        if process.returncode == -signal.SIGTERM:  # before Python reached pendmap, or after its end
            assert not said
        else:
            assert process.returncode in {0, 130}
        if "basins.nc" in names:
            assert pendmap.load(folder / "basins.nc").sizes["theta"] == 20


def test_an_error_that_a_library_raises_on_a_signal_is_an_interrupt(
    pendmap_command: Run, tmp_path: Path
) -> None:
    # A module in C that is interrupted during its import raises ImportError.
    stub = tmp_path / "stub" / "matplotlib"
    stub.mkdir(parents=True)
    (stub / "__init__.py").write_text(
        "import os, signal\n"
        "try: os.kill(os.getpid(), signal.SIGTERM)\n"
        "except KeyboardInterrupt: raise ImportError('initialization failed')\n"
    )
    paths = os.pathsep.join([str(stub.parent), os.environ.get("PYTHONPATH", "")])
    run = pendmap_command(*SMALL, env={"PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1"})
    assert run.returncode == 130
    assert run.stderr == "pendmap: interrupted, nothing was written\n"
    assert [path.name for path in tmp_path.iterdir()] == ["stub"]


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
            _, said = process.communicate(timeout=30)
        assert process.returncode == 130, moment
        assert "Traceback" not in said, moment
        own = [line for line in said.splitlines() if not line.startswith("import time:")]
        assert own == ["pendmap: interrupted, nothing was written"]
    assert list(tmp_path.iterdir()) == []


def test_only_files_of_a_killed_run_are_removed(tmp_path: Path, result: xr.Dataset) -> None:
    code = (
        "import os, signal, sys; from pendmap.files import whole_file\n"
        "with whole_file(sys.argv[1], ['.nc']) as part:\n"
        "    part.write_bytes(bytes(100)); os.kill(os.getpid(), signal.SIGKILL)"
    )
    for _ in range(2):
        subprocess.run([sys.executable, "-c", code, str(tmp_path / "m.nc")], check=False)
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
    code = (
        "import os, signal, sys, pathlib; from pendmap.files import whole_folder\n"
        "rename = pathlib.Path.rename\n"
        "def killed(self, target):\n"
        "    if self.parent.name == 'new': os.kill(os.getpid(), signal.SIGKILL)\n"
        "    return rename(self, target)\n"
        "pathlib.Path.rename = killed\n"
        "with whole_folder(sys.argv[1]) as part:\n"
        "    part.mkdir()"
    )
    old = tmp_path / "m.zarr"
    old.mkdir()
    (old / "kept").write_text("old")
    subprocess.run([sys.executable, "-c", code, str(old)], check=False)
    assert not old.exists()
    check_room(tmp_path / "x.nc")
    assert (old / "kept").read_text() == "old"
    assert list(tmp_path.iterdir()) == [old]


def test_a_zarr_replaces_nothing_but_a_result(tmp_path: Path, result: xr.Dataset) -> None:
    target = tmp_path / "m.zarr"
    target.write_text("a file")
    with pytest.raises(InputError, match="is a file"):
        pendmap.save(result, target)
    target.unlink()
    target.mkdir()
    pendmap.save(result, target)  # an empty folder holds nothing
    pendmap.save(result, target)
    for name in ("notes.txt", "label/notes.txt", "photos/.hidden"):
        (target / name).parent.mkdir(exist_ok=True)
        (target / name).write_text("mine")
        with pytest.raises(InputError, match="no part of a result"):
            pendmap.save(result, target)
        assert (target / name).read_text() == "mine"
        (target / name).unlink()
    (tmp_path / "foreign.zarr").mkdir()
    (tmp_path / "foreign.zarr" / "thesis.tex").write_text("mine")
    with pytest.raises(InputError, match="does not contain a result"):
        pendmap.save(result, tmp_path / "foreign.zarr")
    xr.Dataset({"x": ("t", [1.0])}).to_zarr(tmp_path / "other.zarr", zarr_format=2)
    with pytest.raises(InputError, match="does not contain a result"):
        pendmap.save(result, tmp_path / "other.zarr")
    others = xr.Dataset({"x": ("t", [1.0])}, attrs={"format_version": 3, "kind": "raw"})
    others.to_zarr(tmp_path / "marked.zarr", zarr_format=2)
    with pytest.raises(InputError, match="does not contain a result"):
        pendmap.save(result, tmp_path / "marked.zarr")
    assert (tmp_path / "foreign.zarr" / "thesis.tex").read_text() == "mine"


def test_an_old_zarr_is_kept_if_the_new_one_fails(tmp_path: Path) -> None:
    words = (*SMALL, "--out", "m.zarr")
    assert bounded(words, tmp_path, 10**9).returncode == 0
    before = pendmap.load(tmp_path / "m.zarr")
    run = bounded((*SMALL[:-1], "150", "--out", "m.zarr", "--overwrite"), tmp_path, 8192)
    assert (run.returncode, len(run.stderr.splitlines())) == (1, 1)
    xr.testing.assert_identical(pendmap.load(tmp_path / "m.zarr"), before)
    told = "m.zarr.part: File too large; 0 of 1 tile are kept, --resume goes on"
    assert run.stderr == f"pendmap: {told}\n"
    assert {path.name for path in tmp_path.iterdir()} == {"m.zarr", "m.zarr.part"}
