"""Run commands on bad input and under faults, each drawn from (seed, kind, number).

    python tests/python/fuzz.py --seed 1 --count 1000 [--kinds result,table] [--only 17]

A command ends well with exit 0; with exit 2 and one line ``pendmap: ...`` on stderr, no file made;
with exit 1 and such a line where the disk was full; with 130 where it was interrupted, 141 where
nobody reads. It never shows a traceback, takes 10 s of the processor, changes what it reads, leaves
anything hidden or half written, or prints control characters; ``--json`` gives strict JSON. With
--only the files of the case stay.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import importlib
import json
import math
import os
import random
import re
import resource
import shlex
import shutil
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, Final, NoReturn

import click
import netCDF4

import pendmap
from damages import DAMAGES, DESCRIPTIONS, sound
from pendmap import cli
from pendmap.cli.main import command

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@dataclasses.dataclass
class Case:
    """A command, its input files, and a fault that meets it."""

    words: list[str]
    files: dict[str, bytes] = dataclasses.field(default_factory=dict)
    most: int | None = None  # size of a file, bytes
    stop: str | None = None  # signal, sent after some seconds
    after: float = 0.0
    stdout: str = "../stdout"


# What is drawn

UNREAD: Final = "/dev/zero"
"""Place of an stdout that is replaced by a pipe that nobody reads."""
RESULTS: Final[dict[str, bytes]] = {}
"""Results by name, written by pendmap."""
NUMBERS: Final = [
    *"nan inf -inf 0 -0 -1 1e-320 1e-12 0.1 1 3.7 1e3 1e16 1e300 -1e308 1e309".split(),
    *"9007199254740993 pi/0 1e400pi 0x10 1_000 1,5 --1 \u0661\u0662 None \u00bd".split(),
    *("", " ", "1\n2", "9" * 5000),
]
WHOLES: Final = [*"0 -1 1 2 3 1.0 1e3 nan".split(), "", str(2**31), str(2**63), "1" + "0" * 4400]
AXES: Final = [
    *"1:2:3 -pi:pi:8 0:0:3 3:1:4 nan:1:3 0:inf:3 0:1:0 0:1:-3 0:1:1 0:1 ::: -1e308:1e308:4".split(),
    *"0:1e-320:4 1:1.0000000000000002:5 -1e18:1e18:5".split(),
    "",
]
PLACES: Final = [
    *"a ../x / /dev/full /proc/self/mem nowhere/x.nc x.nc -x.nc .nc x.png x.pdf x.rrd".split(),
    *"x.toml x.html kept.zarr kept in.nc run.csv pipe.csv pipe.nc".split(),
    *("", "x" * 300 + ".nc", "\u202e.nc", "\x1b[31m.nc", "a\nb.nc"),
]
VALUES: Final = (
    *("nan", "inf", "0", "-1", "1e308", "-1e-320", "true", "[]", "{}", "''", '"x"', "1979-05-27"),
    *("[1, 2]", "99999999999999999999", '"\\u001b[31m"', '"../../../etc/passwd"', "07:32:00"),
    *("[" * 60 + "]" * 60, '"' + "y" * 3000 + '"', "9" * 5000),
)
TERMS: Final = (
    *("", "(" * 1000, "(" * 100 + "k*v" + ")" * 100, "-" * 900 + "k*v", "k*v" + "^2" * 300),
    *("k*v/0", "k*v/theta", "k*log(0)", "k*exp(exp(exp(theta)))", "k*v\0", "k*1e308*v*1e308"),
    *("k*cos(1/theta)", "min(" * 60 + "k*v" + ",v)" * 60, "k*tanh(v/1e-300)", "k*sign(v)/v"),
    *("k", "v", "k*v;import os"),
)
SMALL: Final = {
    "basins": ["--grid=8"],
    "bifurcation": ["--p=0.5:1:4"],
    "compare": ["rig.toml", "run.csv"],
    "diagnose": ["run.csv", "--max-effects=0"],
    "effects": [],
    "identify": ["run.csv", "--method=logarithmic"],
    "info": [],
    "lifetime": ["--starts=100", "--max-periods=50"],
    "look": ["run.csv"],
    "lyapunov": ["--precision=0.1", "--max-periods=50"],
    "map": ["--p=0.5:1:3", "--omega=1.8:2:2"],
    "melnikov": [],
    "backbone": [],
    "orbit": ["--grid=12"],
    "paper": ["3"],
    "plot": ["in.nc"],
    "rig": ["free_decay", "--duration=3"],
    "simulate": ["--until=10"],
    "tongues": ["--omega=1.8:2.2:4"],
    "view": ["x.rrd"],
}
"""Options by command that keep its computation small."""
MAPS: Final = [name for name, *_ in pendmap.ANALYSES.values() if name in SMALL]
MODEL: Final = """[pendulum]
w0 = 6.2
c_over_m = 0.05
Tr = 0.08
stroke_mm = 20
frequency_hz = 1.9
[[effect]]
name = "quadratic_drag"
parameters = { q = 0.01 }
[[formula]]
name = "root_drag"
term = "-k*sqrt(abs(v))*sign(v)"
parameters = { k = { power = 1.5, typical = [1e-4, 0.3] } }
"""


def given_files() -> dict[str, bytes]:
    return {
        "run.csv": sound().encode(),
        "rig.toml": MODEL.encode(),
        "in.nc": RESULTS["basins.nc"],
        "kept.zarr/thesis.tex": b"mine",
        "kept/thesis.tex": b"mine",
    }


def mangled(rng: random.Random, data: bytes) -> bytes:
    """Return bytes of which some are changed, lost, doubled or cut off."""
    out = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 5, 30])):
        at, count = rng.randrange(len(out) + 1), rng.choice([1, 1, 2, 8, 100])
        new = [
            rng.randbytes(count),
            b"",
            out[at : at + count] * rng.choice([2, 20]),
            rng.choice([b"\0", b"\xff\xfe", b"nan", b"1e400", b"\r", b'"', b"[", b"=", b"\x1b[2J"]),
        ]
        out[at : at + count] = rng.choice(new)
        if rng.random() < 0.1:
            del out[at:]
    return bytes(out)


def spoiled(rng: random.Random, text: str) -> bytes:
    """Return TOML with values replaced, lines lost or doubled; sometimes bytes are changed."""
    if rng.random() < 0.25:
        return mangled(rng, text.encode())
    lines = text.splitlines()
    for _ in range(rng.choice([1, 1, 2, 3])):
        at = rng.randrange(len(lines))
        parts = re.split(r"(=\s*)([^=,{}\[\]\s][^=,{}\[\]]*)", lines[at])
        if len(parts) > 1 and rng.random() < 0.75:
            parts[rng.choice(range(2, len(parts), 3))] = rng.choice(VALUES)
            lines[at] = "".join(parts)
        else:
            lines[at : at + 1] = lines[at : at + 1] * rng.choice([0, 2])
            lines = lines or [""]
    return "\n".join(lines).encode()


def options(rng: random.Random) -> Case:
    """Draw options of a command with values of all kinds."""
    name = rng.choice(sorted(SMALL))
    loaded = command.get_command(click.Context(command), name)
    assert loaded is not None
    words = [name, *SMALL[name]]
    if len(words) > 1 and not words[1].startswith("-") and rng.random() < 0.3:
        words[1] = rng.choice(PLACES)
    known = [p for p in loaded.params if isinstance(p, click.Option) and p.name != "live"]
    for option in rng.sample(known, min(len(known), rng.choice([1, 1, 2, 3]))):
        flag, kind = option.opts[0], option.type.name
        pools = {"number": NUMBERS, "A:B:N": AXES, "number|A:B:N": AXES + NUMBERS}
        pool = WHOLES if kind.startswith("integer") else pools.get(kind, PLACES)
        if option.is_flag:
            words.append(flag)
        elif option.nargs == 2:
            words += [flag, rng.choice(["p", "x", "", "quadratic_drag.q"]), rng.choice(AXES)]
        else:
            words.append(f"{flag}={rng.choice(pool)}")
    return Case(words, given_files())


def model(rng: random.Random) -> Case:
    """Draw an invalid model file, or one with a formula of its own."""
    name = rng.choice(["simulate", "basins", "tongues", "orbit"])
    term = json.dumps(rng.choice(TERMS))
    changed = re.sub("^term = .*", lambda _: f"term = {term}", MODEL, flags=re.MULTILINE).encode()
    files = {"m.toml": changed if rng.random() < 0.3 else spoiled(rng, MODEL)}
    return Case([name, *SMALL[name], "--model=m.toml", "--json"], files)


def experiment(rng: random.Random) -> Case:
    """Draw the description of an experiment."""
    text, _ = rng.choice(list(DESCRIPTIONS.values()))
    files = {"lab/experiment.toml": spoiled(rng, text), "lab/run.csv": sound().encode()}
    return Case(["look", "lab", "--json"], files)


def table(rng: random.Random) -> Case:
    """Draw a damaged record, sometimes with bytes changed."""
    damage = DAMAGES[rng.choice(sorted(DAMAGES))]
    made = damage.make(sound())
    data = made if isinstance(made, bytes) else made.encode()
    if rng.random() < 0.4:
        data = mangled(rng, data)
    name = rng.choice([f"run{damage.suffix}", f"run{damage.suffix}", "run"])
    what = ["look --json", "look --plot=x.png", "identify --json --method=logarithmic"]
    return Case([*rng.choice(what).split(), name], {name: data})


def result(rng: random.Random) -> Case:
    """Draw a damaged result to plot: bytes changed, or impossible attributes and numbers."""
    data = RESULTS[rng.choice(sorted(RESULTS))]
    if rng.random() < 0.3:
        data = mangled(rng, data)
    else:
        place = Path("drawn.nc")
        place.write_bytes(data)
        with netCDF4.Dataset(place, "a") as content:
            impossible(rng, content)
        data = place.read_bytes()
    layer = rng.choice([[], ["--layer=settle"], ["--layer=theta"], ["--layer=exponent"]])
    size = rng.choice(["11x9", "11x9", "4x3", "nanxnan", "100x1"])
    out = rng.choice(["--out=p.png", "--out=p.svg"])
    return Case(["plot", "r.nc", out, "--dpi=30", f"--size={size}", *layer], {"r.nc": data})


def impossible(rng: random.Random, content: netCDF4.Dataset) -> None:
    """Change an attribute or the numbers of a variable of an open file."""
    if rng.random() < 0.5:
        key = rng.choice(content.ncattrs())
        new = [math.nan, "x", "", -1, [1.0, 2.0], 1e308, "{", "[]", "null", "\x1b[31m", 2**40]
        content.setncattr(key, rng.choice(new))
        return
    variable = content.variables[rng.choice(sorted(content.variables))]
    if variable.dtype is str:
        content.renameVariable(variable.name, "other")
    else:
        floats = [math.nan, math.inf, 1e308, -1.0, 0.0, 1e-320]
        variable[...] = rng.choice(floats if variable.dtype.kind == "f" else [99, 0, 120, -1])


def fault(rng: random.Random) -> Case:
    """Draw a full disk, a pipe that nobody reads or a signal, for a command that writes."""
    name = rng.choice(["basins", "simulate", "map", "melnikov", "rig", "identify", "bifurcation"])
    words = [name, *SMALL[name], *(["--out=lab"] if name == "rig" else [])]
    if name in ("basins", "simulate") and rng.random() < 0.5:
        words.append("--out=m.zarr")
    stop = rng.choice(["SIGTERM", "SIGINT", "SIGHUP"])
    return rng.choice(
        [
            Case(words, given_files(), most=int(2 ** rng.uniform(8, 19))),
            Case(words, given_files(), stop=stop, after=rng.uniform(0, 1.5)),
            Case([*words, "--json"], given_files(), stdout=rng.choice([UNREAD, "/dev/full"])),
        ]
    )


KINDS: Final[dict[str, Callable[[random.Random], Case]]] = {
    kind.__name__: kind for kind in (options, model, experiment, table, result, fault)
}


# How a case is run and judged


def child(folder: Path, case: Case) -> NoReturn:
    """Run the command in this process, which ends with it."""
    os.chdir(folder)
    for number, name in enumerate(("/dev/null", case.stdout, "../stderr")):
        os.dup2(os.open(name, os.O_RDWR | os.O_CREAT), number)
    if case.stdout == UNREAD:
        reader, writer = os.pipe()
        os.dup2(writer, 1)
        os.close(reader)
    sys.stdout = os.fdopen(1, "w", encoding="utf-8", errors="surrogateescape")
    sys.stderr = os.fdopen(2, "w", encoding="utf-8", errors="backslashreplace")
    resource.setrlimit(resource.RLIMIT_CPU, (10, 10))  # s of the processor
    resource.setrlimit(resource.RLIMIT_AS, (2**33, 2**33))  # bytes of addresses
    signal.alarm(120)
    if case.most is not None:
        # Python does not notice that a file of bytecode was cut, and later reads what is left.
        sys.dont_write_bytecode = True
        resource.setrlimit(resource.RLIMIT_FSIZE, (case.most, case.most))
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.argv = ["pendmap", *case.words]
    code = 99
    try:
        cli.run()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0
    except BaseException:  # noqa: BLE001 (a traceback is the fault sought)
        traceback.print_exc()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):
            stream.flush()
    os._exit(code)


def ended(folder: Path, case: Case) -> int:
    """Run a case in a fork of this process; return its exit code."""
    pid = os.fork()
    if pid == 0:
        child(folder, case)
    if case.stop is not None:
        time.sleep(case.after)
        os.kill(pid, getattr(signal, case.stop))
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def contents(folder: Path) -> dict[str, bytes | None]:
    paths = sorted(folder.rglob("*"))
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else None for p in paths}


def strict(text: str) -> bool:
    """Return whether a text is one JSON object without NaN."""
    try:
        return isinstance(json.loads(text, parse_constant=int), dict)
    except ValueError:
        return False


def whole(path: Path) -> bool:
    """Return whether a result is complete."""
    try:
        pendmap.load(path)
    except (pendmap.InputError, OSError):
        return False
    return True


def wrongs(place: Path, case: Case) -> Iterator[str]:
    """Run a case in a folder; describe each violated rule."""
    shutil.rmtree(place, ignore_errors=True)
    folder = place / "in"
    for name, content in case.files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    for name in ("stdout", "stderr"):
        (place / name).touch()
    os.mkfifo(folder / "pipe.csv")
    (folder / "pipe.nc").symlink_to("/dev/zero")
    before = contents(folder)
    code = ended(folder, case)
    after = contents(folder)
    err, out = ((place / name).read_text("utf-8", "replace") for name in ("stderr", "stdout"))
    new = sorted(after.keys() - before.keys())
    lost = [name for name in before if after.get(name) != before[name]]
    outputs = [word.partition("=")[2] for word in case.words if "=" in word]
    allowed = {0, 2, case.most and 1, case.stop and 130}
    allowed |= {UNREAD: {141}, "/dev/full": {1}}.get(case.stdout, set())
    if case.stop is not None:  # the signal may come before pendmap begins
        allowed.add(-getattr(signal, case.stop))
    refused = code in {1, 2}
    rules = {
        f"exit {code}": code in allowed,
        "traceback, panic or warning": not re.search("Traceback|panicked|Warning", err),
        "not one line": not refused or re.fullmatch("pendmap: .*\n", err) is not None,
        "long line": not refused or len(err) <= 600,
        "control characters": all(c.isprintable() or c in "\n\t" for c in err + out),
        "no strict JSON": code != 0 or "--json" not in case.words or strict(out),
        f"refused, and left {new[:3]}": code != 2 or not new,
        f"left {new[:3]}": not any(".pendmap" in name for name in new),
        "half a result": all(whole(folder / name) for name in new if name.endswith(".nc")),
        f"changed {lost[:3]}": not lost or (code == 0 and set(lost) <= set(outputs)),
    }
    yield from (text for text, holds in rules.items() if not holds)


def begin(folder: Path) -> None:
    """Import what the cases need, once, and write the results from which they are drawn.

    No thread of this work may be missed by a fork.
    """
    os.environ["MPLBACKEND"] = "agg"
    for name in SMALL:
        command.get_command(click.Context(command), name)
    for name in ("render", "viewer", "identification", "diagnosis", "virtual_rig", "records"):
        importlib.import_module(f"pendmap.{name}")
    for name in ("zarr", "scipy.signal", "scipy.optimize", "pyarrow.parquet"):
        importlib.import_module(name)
    for name in MAPS:
        file = folder / f"{name}.nc"
        sys.argv = ["pendmap", name, *SMALL[name], "--quiet", f"--out={file}"]
        with contextlib.suppress(SystemExit):
            cli.run()
        RESULTS[file.name] = file.read_bytes()
    pendmap.save(pendmap.load(folder / "basins.nc"), folder / "basins.zarr")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=100, help="cases of all kinds together")
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--only", type=int, help="the case of this number alone")
    asked = parser.parse_args()
    kinds = asked.kinds.split(",")
    numbers = range(-(-asked.count // len(kinds))) if asked.only is None else [asked.only]
    failed = 0
    made = Path(tempfile.mkdtemp())
    os.chdir(made)
    (made / "results").mkdir()
    begin(made / "results")
    for kind, number in ((kind, number) for kind in kinds for number in numbers):
        case = KINDS[kind](random.Random(f"{asked.seed}-{kind}-{number}"))
        case.words = [word.replace("\0", "") for word in case.words]
        if wrong := list(wrongs(made / "case", case)):
            failed += 1
            words = shlex.join(case.words)[:300]
            print(f"{kind} {number}: {'; '.join(wrong)}: pendmap {words}", flush=True)
    print(f"{len(numbers) * len(kinds)} cases of seed {asked.seed}, {failed} failed", flush=True)
    if asked.only is None:
        shutil.rmtree(made)
    else:
        print(f"Files: {made / 'case'}")
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
