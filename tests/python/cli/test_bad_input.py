"""Bad input and untrusted files: refused on one line, no file made, nothing waited for."""

from __future__ import annotations

import math
import os
import shlex
import subprocess
import sys
import time
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Final

import netCDF4
import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

import pendmap
from pendmap import Axis, Grid, InputError, Pendulum, virtual_rig
from pendmap.tables.table import MOST_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from conftest import Run

CHIRP: Final = b"""[pendulum]\ngamma = 0.1\np = 0.6\nomega = 2.0
[[effect]]\nname = "drive_chirp"\nparameters = { r = 0.01 }
"""
DIRECT: Final = b"""[pendulum]\ngamma = 0.5\nomega = 0.6667
[[formula]]\nname = "drive"\nterm = "f*cos(phase)"\nparameters = { f = { power = 2 } }
[[effect]]\nname = "drive"\nparameters = { f = 0.3 }
"""


def unpacked_table(path: Path) -> None:
    """Write a Parquet file of a megabyte that unpacks to more than a gigabyte."""
    rows = pa.array(np.zeros(10**6))
    schema = pa.schema([("t_s", pa.float64()), ("theta_rad", pa.float64())])
    with parquet.ParquetWriter(path, schema) as writer:
        for _ in range(80):
            writer.write_table(pa.table([rows, rows], schema=schema))
    assert path.stat().st_size < 2**20


def unpacked_result(path: Path) -> None:
    """Write a small result that unpacks to more than the memory."""
    with netCDF4.Dataset(path, "w") as made:
        made.setncatts({"format_version": 3, "kind": "basins"})
        made.createDimension("theta", 2**40)
        made.createVariable("label", "f8", ("theta",), zlib=True)
    assert path.stat().st_size < 2**16


def result(path: Path) -> None:
    pendmap.save(pendmap.melnikov(pendmap.Pendulum(), [1.0]), path)


def endless(path: Path) -> None:
    path.symlink_to("/dev/zero")


def content(data: bytes) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(data)


def columns(count: int, cell: str) -> Callable[[Path], object]:
    row = ",".join([cell or "1.5", *[cell] * (count - 1)])
    return content("\n".join([row] * max(3_000_000 // count, 3)).encode())


FILES: Final[dict[str, Callable[[Path], object]]] = {
    "chirp.toml": content(CHIRP),
    "direct.toml": content(DIRECT),
    "text.rrd": content(b"text"),
    "result.nc": result,
    **{f"pipe.{end}": os.mkfifo for end in ("csv", "parquet", "toml", "nc", "zarr", "rrd")},
    **{f"endless.{end}": endless for end in ("csv", "parquet", "toml", "nc", "rrd")},
    **{f"folder.{end}": os.mkdir for end in ("csv", "toml", "nc", "rrd")},
    "large.toml": content(b"#" * (2**22 + 1)),
    "deep1.toml": content(b".".join([b"a"] * 30_000) + b".b = 1"),
    "deep2.toml": content(b"[" + b".".join([b'"a"'] * 30_000) + b"]"),
    "deep3.toml": content(b"x = { " + b".".join([b'"\\""'] * 30_000) + b".b = 1 }"),
    "flat.toml": content(b"# " + b"a" * 10**6 + b"\n[a.b]"),
    "wide.csv": columns(MOST_COLUMNS + 1, "0.5"),
    "wider.csv": columns(1_000_000, ""),
    "unpacked.parquet": unpacked_table,
    "unpacked.nc": unpacked_result,
}
"""Files that a row names, each with what makes it."""


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("basins --p nan", "must be a finite number, got 'nan'"),
        ("basins --p pi/0", "'pi/0' is not a number (pi is understood)"),
        ("basins --gamma=-1", "Invalid value for '--gamma': must be 0 or more, got -1"),
        ("basins --omega 0", "Invalid value for '--omega': must be a number above 0, got 0"),
        ("basins --grid 0", "0"),
        ("basins --theta 1:2", "A:B:N"),
        ("basins --theta 2:1:9", "lower one first"),
        ("basins --theta 0:1:0", "must have 1 to 100000 cells, got 0: '0:1:0'"),
        ("basins --grid 5 --theta 0:1:5", "--grid"),
        ("basins --tol 1e-30", "'--tol'"),
        ("basins --max-periods 99999999999999", "from 1 to 2147483647"),
        ("basins --seed -1", "from 0 to 9223372036854775807"),
        ("simulate --samples 10001", "from 1 to 10000"),
        ("basins --theta=-1e308:1e308:9", "finite distance"),
        ("basins --view", "--view: there is no display"),
        ("basins --plot .", "'--plot'"),
        ("basins --pp 1", "--pp"),
        ("basins --out x.docx", ".docx"),
        ("basins --plot x.nc", ".png"),
        ("basins --out no/such/x.nc", "no/such"),
        ("basins --out /proc/x.nc", "/proc"),
        ("basins --preset fig9", "fig9"),
        ("basins --threads 100000", "1 to 256"),
        ("bifurcation", "--p 0.5:2:100; got nothing"),
        ("bifurcation --p 0:1:3 --omega 1:2:3", "--p 0.5:2:100; got p, omega"),
        ("bifurcation --p 0:1:3 --theta 1", "both or neither of --theta and --velocity"),
        ("map --p 1", "--p 0.5:2:100 --omega 0.5:3:100; got nothing"),
        ("map --p 0:1:3 --vary p 0:1:4", "--vary p must be given once, got it twice"),
        ("lyapunov --precision 1", "up to 0.5"),
        ("lifetime --starts 3", "100"),
        ("melnikov --model chirp.toml", "drive_chirp can be in one trajectory, not in maps"),
        ("melnikov --model direct.toml", "not proportional to p"),
        ("tongues --model direct.toml", "a sideways drive or an effect moves it"),
        ("tongues --theta-r 0.1", "friction"),
        ("simulate --until 0", "until"),
        ("simulate --tr 0.2", "--tr must have --model"),
        ("simulate --model /proc/self/mem", "/proc/self/mem: Input/output error"),
        ("plot result.nc --layer colour", "colour"),
        ("plot result.nc --size wide", "wide"),
        ("plot absent.nc", "absent.nc"),
        ("plot chirp.toml", "suffix"),
        ("plot .", "'.': must be a result, .nc or .zarr, it is a folder"),
        ("view absent.rrd", "absent.rrd"),
        ("view text.rrd", "text.rrd"),
        ("viw", "viw"),
        *((f"look {kind}.csv", f"{kind}.csv") for kind in ("pipe", "endless", "folder")),
        *((f"look {kind}.parquet", f"{kind}.parquet") for kind in ("pipe", "endless")),
        *((f"plot {kind}.nc", f"{kind}.nc") for kind in ("pipe", "endless", "folder")),
        *((f"view {kind}.rrd", f"{kind}.rrd") for kind in ("pipe", "endless", "folder")),
        *((f"simulate --model {kind}.toml", kind) for kind in ("pipe", "endless", "folder")),
        ("plot pipe.zarr", "pipe.zarr"),
        ("effects --effects pipe.toml", "pipe"),
        ("simulate --model large.toml", "must be a file up to 4 MiB, it is larger"),
        *((f"simulate --model deep{k}.toml", "keys must have at most 20 parts") for k in "123"),
        ("simulate --model flat.toml", "is not known"),
        ("look wide.csv", "got no rows"),
        ("look wider.csv", "got no rows of numbers"),
        ("look unpacked.parquet", "unpacks to 1221 MiB"),
        ("plot unpacked.nc", "must unpack to half of this memory at most, got"),
    ],
)
def test_bad_input_gets_one_line_and_leaves_nothing(
    words: str, complaint: str, pendmap_command: Run, tmp_path: Path
) -> None:
    for name in FILES.keys() & set(words.split()):
        FILES[name](tmp_path / name)
    before = sorted(tmp_path.iterdir())
    begin = time.process_time()
    run = pendmap_command(*shlex.split(words))
    assert time.process_time() - begin < 10
    assert (run.returncode, run.stdout) == (2, "")
    assert len(run.stderr.strip().splitlines()) == 1
    assert complaint in run.stderr
    assert sorted(tmp_path.iterdir()) == before


# What is read

TIME = np.arange(300) * 0.03
SWING = 0.1 * np.exp(-0.05 * TIME) * np.cos(6 * TIME)


def test_as_many_columns_as_are_allowed_are_read(tmp_path: Path) -> None:
    rest = ",0.25" * (MOST_COLUMNS - 2)
    names = ["t_s", "theta_rad", *(f"c{k}" for k in range(MOST_COLUMNS - 2))]
    rows = zip(TIME, SWING, strict=True)
    lines = [",".join(names), *(f"{a:.4f},{b:.6f}{rest}" for a, b in rows)]
    lines[150:150] = ["9," * 10**6]  # a broken line is left out, however long
    (tmp_path / "wide.csv").write_text("\n".join(lines))
    experiment = pendmap.read_experiment(tmp_path / "wide.csv")
    assert experiment.runs[0].theta == pytest.approx(SWING, abs=1e-6)
    assert "unreadable-lines" in {finding.what for finding in experiment.runs[0].findings}


def test_texts_of_a_parquet_are_unpacked_once(tmp_path: Path) -> None:
    long = pa.DictionaryArray.from_arrays(pa.array([0] * 300), pa.array(["9" * 4 * 10**5]))
    columns = {"t_s": TIME, "theta_rad": SWING, "note": long.cast(pa.string())}
    parquet.write_table(pa.table(columns), tmp_path / "run.parquet")
    run = pendmap.read_experiment(tmp_path / "run.parquet").runs[0]
    assert run.theta == pytest.approx(SWING)


def test_a_parquet_file_with_one_byte_wrong_ends_no_process(tmp_path: Path) -> None:
    parquet.write_table(pa.table({"t_s": TIME, "theta_rad": SWING}), tmp_path / "a.parquet")
    # A separate process, as a library that aborts would end this one.
    code = (
        "from pathlib import Path; import pendmap\n"
        "path = Path('a.parquet'); whole = path.read_bytes()\n"
        "footer = int.from_bytes(whole[-8:-4], 'little')\n"
        "for k in range(len(whole) - 8 - footer, len(whole) - 8):\n"
        "    path.write_bytes(whole[:k] + bytes([(whole[k] + 1) % 256]) + whole[k + 1 :])\n"
        "    try: pendmap.read_experiment(path)\n"
        "    except pendmap.InputError: pass\n"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)


def test_names_reach_the_terminal_escaped(pendmap_command: Run, tmp_path: Path) -> None:
    wild = "an\x1b]0;title\x07\x9b31m\u202e\rgle"
    rows = "\n".join(f"{a:.4f},{b:.6f},{b / 9:.6f}" for a, b in zip(TIME, SWING, strict=True))
    record, folder = f"re{wild}.csv", tmp_path / f"fo{wild}"
    folder.mkdir()
    for path in (tmp_path / record, folder / record):
        path.write_text(f't_s,theta_rad,"{wild}"\n{rows}\n', newline="")
    commands = (
        ("look", record),
        ("look", folder.name),
        ("identify", record, "--out", f"{wild}.nc", "--out", "model.toml"),
        ("compare", "model.toml", record, "--out", f"{wild}.png"),
        ("plot", f"{wild}.nc", "--out", f"other{wild}.png"),
        ("plot", f"missing{wild}.nc"),
        ("simulate", "--model", f"missing{wild}.toml"),
    )
    for words in commands:
        run = pendmap_command(*words)
        assert run.returncode == (2 if "missing" in words[-1] else 0), run.stderr
        assert r"\x1b]0;title" in run.stdout + run.stderr, words
        assert all(c.isprintable() or c == "\n" for c in run.stdout + run.stderr), words


# Arguments from Python


@pytest.mark.parametrize("p", [np.float32(0.5), np.int64(1), np.array(0.5), Fraction(1, 2), 1])
def test_any_real_number_is_a_parameter(p: Any) -> None:  # noqa: ANN401
    pendulum = Pendulum(p=p)
    assert type(pendulum.p) is float
    assert pendulum.p == p


def test_whole_numbers_may_be_those_of_numpy() -> None:
    two: Any = np.int64(2)
    grid = Grid((0, 1, 5), (np.float32(0), 1, np.int32(5)))  # type: ignore[arg-type]
    assert grid == Grid(Axis(0, 1, 5), Axis(0, 1, 5))
    assert type(grid.velocity.count) is int
    run = pendmap.RunOptions(threads=two, seed=two)
    result = pendmap.basins(Pendulum(), Grid.square(np.int16(4)), max_periods=two, run=run)
    assert result.attrs["max_periods"] == result.attrs["threads"] == result.attrs["seed"] == 2


def basins(**given: Any) -> None:  # noqa: ANN401
    pendmap.basins(**({"pendulum": Pendulum(), "grid": Grid.square(5)} | given))


def simulate(**given: Any) -> None:  # noqa: ANN401
    pendmap.simulate(**({"pendulum": Pendulum(), "theta": 1, "velocity": 0, "until": 9} | given))


def sweep(start: Any) -> None:  # noqa: ANN401
    pendmap.bifurcation(Pendulum(), {"p": (0.5, 0.6, 2)}, start=start)


def plan(*state: Any) -> None:  # noqa: ANN401
    virtual_rig.Request("hidden", plans=(virtual_rig.RunPlan(*state),))


def lists(theta: Any) -> None:  # noqa: ANN401
    with pytest.raises(InputError, match="theta"):
        pendmap.advance(Pendulum(), theta, [0.0, 0.0], 1)
    pendmap.basins_of(Pendulum(), theta, [0.0, 0.0])


PARAMETERS = [10**400, 10**5000, 1j, np.True_, None, [1.0], "1" * 500]
AXES = [
    *((0, 1, 2.5), (0, 1, True), (0, 1, "5"), ("0", 1, 5), (-1e308, 1e308, 5), (1, 1, 5)),
    *((2, 1, 5), (math.nan, 1, 5), (0, 1, 0), (0, 1, 10**6)),
]
STARTS = [3, (1.0,), (1.0, 2.0, 3.0), ("a", 1.0), ((1.0, 2.0), 3.0)]
THETAS = ["pi", ["a", "b"], 1.0, [[1.0, 2.0]], [math.nan, 1.0], [1.0]]
REFUSED: list[tuple[Callable[[], object], str]] = [
    *((lambda p=p: Pendulum(p=p), r"p must be .*, got ") for p in PARAMETERS),
    *((lambda axis=axis: Axis(*axis), "must be") for axis in AXES),
    *((lambda start=start: sweep(start), "start must be") for start in STARTS),
    *((lambda theta=theta: lists(theta), "theta") for theta in THETAS),
    (lambda: Grid(Axis(0, 1, 5), 5), r"velocity must be an Axis, like .*, got 5"),  # type: ignore[arg-type]
    (lambda: basins(grid=1.5), r"grid must be a Grid, like 100, Grid\.square\(100\) .*, got 1\.5"),
    (lambda: basins(pendulum=0.6), "pendulum must be a Pendulum, .*, got 0.6"),
    (lambda: basins(tol="a"), "tol must be a number, got 'a'"),
    (lambda: basins(max_periods=10**14), "max_periods must be a whole number from 1 to 2147.*"),
    (lambda: basins(layer_periods=0), "layer_periods must be .*, got 0"),
    (lambda: basins(check="no"), "check must be True or False, got 'no'"),
    (lambda: simulate(theta="pi"), "theta must be a number, got 'pi'"),
    (lambda: simulate(until=None), "until must be .*, got None"),
    (lambda: simulate(until=1e12), r"until must be up to .* periods of 1 samples, got 3.18e\+11"),
    (lambda: simulate(samples=2.5), "samples must be .*, got 2.5"),
    (lambda: simulate(lyapunov=1), "lyapunov must be .*, got 1"),
    (lambda: plan("fre", 1, 0, 9), "^kind of plan 0 must be free or forced, got 'fre'$"),
    (lambda: plan("free", math.nan, 0, 9), "^theta of plan 0 must be a finite number, got nan$"),
    (lambda: plan("free", 1, 0, 0.5), "^duration of plan 0 must be 1 to 3600 s, got 0.5$"),
]


@pytest.mark.parametrize(("call", "complaint"), REFUSED)
def test_what_is_refused_is_named_on_one_short_line(
    call: Callable[[], object], complaint: str
) -> None:
    with pytest.raises(InputError, match=complaint) as error:
        call()
    assert len(str(error.value)) < 200


def test_a_missed_tolerance_is_reported() -> None:
    # Rounding errors, magnified by chaos, exceed it.
    missed = pendmap.simulate(Pendulum(p=5, omega=0.5), 1, 0, 100, tol=1e-13)
    assert missed["reached_error"].item() > 1e-13
    assert "THE TOLERANCE 1e-13 WAS NOT REACHED" in missed.attrs["summary"]
    # Whole turns of the start cause no error.
    far, near = (pendmap.simulate(Pendulum(), 1 + turns, 0, 10) for turns in (2000 * math.pi, 0))
    assert abs(far.theta[-1] - near.theta[-1] - 2000 * math.pi) < 1e-8
    assert "TOLERANCE" not in near.attrs["summary"]
