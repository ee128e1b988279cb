"""Run commands on bad input, each drawn from (seed, kind, number), and see that they end well.

    python tests/python/fuzz.py --seed 1 --count 1000 [--kinds result,table] [--only 17]

A command ends well with exit 0; with exit 2 and one line ``pendmap: ...`` on stderr, no file made;
with exit 1 and such a line where the disk was full; with 130 where it was interrupted. It never
shows a traceback, takes 10 s of the processor, changes what it reads, leaves anything hidden or
prints control characters; ``--json`` gives strict JSON. What failed is kept under --keep.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import importlib
import json
import os
import random
import resource
import shlex
import shutil
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import click

import fuzz_cases
from pendmap.cli import run as run_command
from pendmap.cli.main import command

if TYPE_CHECKING:
    from collections.abc import Iterator

LIMIT = 10.0
"""Limit on the processor time of a command, s; its wall time may be twelve times as long."""

MEMORY = 8 * 2**30
"""Limit on the address space of a command, bytes."""

SEEDS = {
    "basins": ["--grid=12"],
    "simulate": ["--until=20"],
    "map": ["--p=0.5:1:3", "--omega=1.8:2:2"],
    "bifurcation": ["--p=0.5:1:5"],
    "tongues": ["--omega=1.8:2.2:5"],
    "melnikov": [],
    "orbit": ["--grid=12"],
    "lyapunov": ["--p=0.6", "--precision=0.1", "--max-periods=50"],
    "lifetime": ["--starts=100", "--max-periods=50"],
}
"""Commands that make the results from which cases are drawn."""


def make_seeds(folder: Path) -> None:
    """Write a result of each kind with pendmap, in forks as for the cases."""
    for name, words in SEEDS.items():
        file = folder / f"{name}.nc"
        pid = os.fork()
        if pid == 0:
            child(folder, fuzz_cases.Case([name, *words, "--quiet", f"--out={file}"]))
        os.waitpid(pid, 0)
        fuzz_cases.SEEDS[file.name] = file.read_bytes()


def import_all() -> None:
    """Import the modules of the cases once; every case is a fork of this process."""
    os.environ["MPLBACKEND"] = "agg"
    for name in fuzz_cases.SMALL:
        command.get_command(click.Context(command), name)
    for name in ("render", "viewer", "identification", "diagnosis", "virtual_rig", "records"):
        importlib.import_module(f"pendmap.{name}")
    for name in ("zarr", "scipy.signal", "scipy.optimize", "pyarrow.parquet"):
        importlib.import_module(name)


def make_files(folder: Path, files: dict[str, bytes | str]) -> None:
    for name, content in files.items():
        place = folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        if content == "pipe":
            os.mkfifo(place)
        elif content == "endless":
            place.symlink_to("/dev/zero")
        else:
            assert isinstance(content, bytes)
            place.write_bytes(content)


def child(folder: Path, case: fuzz_cases.Case) -> NoReturn:
    """Run the command in this process, which ends with it."""
    os.chdir(folder)
    os.setsid()
    for number, name in enumerate(("/dev/null", "../stdout", "../stderr")):
        os.dup2(os.open(name, os.O_RDWR | os.O_CREAT), number)
    sys.stdout = os.fdopen(1, "w", encoding="utf-8", errors="surrogateescape")
    sys.stderr = os.fdopen(2, "w", encoding="utf-8", errors="backslashreplace")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    if case.most is not None:
        # Python does not notice that a file of bytecode was cut, and later reads what is left.
        sys.dont_write_bytecode = True
        resource.setrlimit(resource.RLIMIT_FSIZE, (case.most, case.most))
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.argv = ["pendmap", *case.words]
    code = 99
    try:
        run_command()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0
    except BaseException:  # noqa: BLE001 (a traceback is the fault sought)
        traceback.print_exc()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):
            stream.flush()
    os._exit(code)


def spent(pid: int) -> float:
    """Return the processor time of a child, s."""
    with contextlib.suppress(OSError):
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return 0.0


def ended(pid: int, case: fuzz_cases.Case) -> int | None:
    """Wait for a child; return its exit status, ``None`` if it took too long."""
    begun, stopped = time.monotonic(), case.stop is None
    while time.monotonic() - begun < 12 * LIMIT and spent(pid) < LIMIT:
        if not stopped and time.monotonic() - begun > case.after:
            os.kill(pid, getattr(signal, case.stop or ""))
            stopped = True
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.003)
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    return None


def contents(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        if path.is_file()
        else "none"
        for path in sorted(folder.rglob("*"))
    }


def strict(text: str) -> bool:
    """Return whether a text is one JSON object without NaN."""

    def refuse(constant: str) -> NoReturn:
        raise ValueError(constant)

    try:
        return isinstance(json.loads(text, parse_constant=refuse), dict)
    except ValueError:
        return False


def faults_of(place: Path, case: fuzz_cases.Case) -> Iterator[str]:
    """Run a case in a folder; return a description of each violated rule."""
    shutil.rmtree(place, ignore_errors=True)
    folder = place / "in"
    folder.mkdir(parents=True)
    make_files(folder, case.files)
    before = contents(folder)
    pid = os.fork()
    if pid == 0:
        child(folder, case)
    code = ended(pid, case)
    after = contents(folder)
    said, heard = ((place / n).read_text("utf-8", "replace") for n in ("stderr", "stdout"))
    if code is None:
        yield "takes too long"
        return
    yield from _said_wrong(code, case, said, heard)
    new = sorted(after.keys() - before.keys())
    if code == 2 and new:
        yield f"refused, and left {new[:3]}"
    if any(part.startswith(".pendmap") for name in new for part in Path(name).parts):
        yield f"left {new[:3]}"
    lost = [name for name in before if after.get(name) != before[name]]
    if lost and not (code == 0 and _named(lost, case)):
        yield f"changed {lost[:3]}"


def _said_wrong(code: int, case: fuzz_cases.Case, said: str, heard: str) -> Iterator[str]:
    """Describe what is wrong with an exit code and the printed text."""
    killed = case.stop is not None and -code == getattr(signal, case.stop)  # before pendmap began
    allowed = {0, 2} | ({1} if case.most else set()) | ({130} if case.stop else set())
    if code not in allowed and not killed:
        yield f"exit {code}"
    if "Traceback" in said or "panicked" in said or "Warning" in said:
        yield "traceback, panic or warning"
    if code in {1, 2} and not (said.startswith("pendmap: ") and len(said.splitlines()) == 1):
        yield "not one line"
    if code in {1, 2} and len(said) > 600:
        yield "long line"
    if any(not c.isprintable() and c not in "\n\t" for c in said + heard):
        yield "control characters"
    if code == 0 and "--json" in case.words and not strict(heard):
        yield "no strict JSON"


def _named(lost: list[str], case: fuzz_cases.Case) -> bool:
    """Return whether all changed files were named as outputs, which may be replaced."""
    outputs = [word.partition("=")[2] for word in case.words if "=" in word]
    return all(name in outputs for name in lost)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=100, help="cases of all kinds together")
    parser.add_argument("--kinds", default=",".join(fuzz_cases.KINDS))
    parser.add_argument("--only", type=int, help="the case of this number alone")
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "pendmap-fuzz")
    given = parser.parse_args()
    kinds = given.kinds.split(",")
    failed = 0
    with tempfile.TemporaryDirectory() as made:
        os.chdir(made)
        import_all()
        (Path(made) / "seeds").mkdir()
        make_seeds(Path(made) / "seeds")
        count = -(-given.count // len(kinds))
        for kind in kinds:
            for number in range(count) if given.only is None else [given.only]:
                case = fuzz_cases.KINDS[kind](random.Random(f"{given.seed}-{kind}-{number}"))
                case.words = [word.replace("\0", "") for word in case.words]
                place = Path(made) / "case"
                wrong = list(faults_of(place, case))
                if wrong:
                    failed += 1
                    kept = given.keep / f"{given.seed}-{kind}-{number}"
                    shutil.rmtree(kept, ignore_errors=True)
                    shutil.copytree(place, kept, symlinks=True, copy_function=_copy)
                    words = shlex.join(case.words)[:300]
                    print(f"{kind} {number}: {'; '.join(wrong)}: pendmap {words}", flush=True)
        print(f"{count * len(kinds)} cases of seed {given.seed}, {failed} failed", flush=True)
    sys.exit(bool(failed))


def _copy(source: str, target: str) -> None:
    if Path(source).is_file():
        shutil.copyfile(source, target)


if __name__ == "__main__":
    main()
