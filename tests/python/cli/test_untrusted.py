"""Untrusted files: pipes, devices, decompression bombs, damage; refused at once, on one line."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import unicodedata
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from pyarrow import parquet

import fuzz_cases
import pendmap
from pendmap import InputError, viewer
from pendmap.errors import one_line
from pendmap.records.description import read_description
from pendmap.records.tables import MOST_COLUMNS

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

READERS = {
    ".csv": pendmap.read_experiment,
    ".parquet": pendmap.read_experiment,
    ".toml": pendmap.load_model,
    ".nc": pendmap.load,
    ".zarr": pendmap.load,
    ".rrd": viewer.open_viewer,
}


@pytest.mark.parametrize("suffix", READERS)
@pytest.mark.parametrize("kind", ["pipe", "endless", "folder"])
def test_pipes_and_devices_are_refused_without_waiting(
    tmp_path: Path, suffix: str, kind: str
) -> None:
    source = tmp_path / f"x{suffix}"
    if kind == "pipe":
        os.mkfifo(source)
    elif kind == "folder":
        source.mkdir()
    else:
        source.symlink_to("/dev/zero")
    with pytest.raises((InputError, IsADirectoryError)):
        READERS[suffix](source)


@pytest.mark.skipif(not os.path.exists("/proc/self/mem"), reason="needs a file that fails")  # noqa: PTH110
def test_a_file_that_cannot_be_read_is_named() -> None:
    with pytest.raises(OSError, match="error") as failed:
        pendmap.load_model("/proc/self/mem")
    assert failed.value.filename == "/proc/self/mem"


def test_formulas_and_descriptions_are_files_too(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "experiment.toml")
    with pytest.raises(InputError):
        pendmap.read_experiment(tmp_path)
    with pytest.raises(InputError, match="pipe"):
        pendmap.load_formulas(tmp_path / "experiment.toml")
    (tmp_path / "large.toml").write_bytes(b"#" * (2**22 + 1))
    with pytest.raises(InputError, match="must be a file up to 4 MiB, it is larger"):
        pendmap.load_model(tmp_path / "large.toml")


@pytest.mark.parametrize(
    ("part", "form"),
    [("a", "{}.b = 1"), ('"a"', "[{}.b]"), ('"\\""', "x = {{ {}.b = 1 }}"), ("a ", "[[{}]]")],
)
def test_a_key_has_no_more_parts_than_are_read(tmp_path: Path, part: str, form: str) -> None:
    path = tmp_path / "deep.toml"
    path.write_text(form.format(".".join([part] * 30_000)))
    with pytest.raises(InputError, match="keys must have at most 20 parts"):
        pendmap.load_model(path)
    path.write_text("# " + "a" * 10**6 + "\n" + form.format(".".join([part] * 3)))
    with pytest.raises(InputError, match="is not known"):
        pendmap.load_model(path)


@pytest.mark.parametrize(("columns", "cell"), [(MOST_COLUMNS + 1, "0.5"), (1_000_000, "")])
def test_a_table_has_no_more_columns_than_are_read(tmp_path: Path, columns: int, cell: str) -> None:
    row = ",".join([cell or "1.5", *[cell] * (columns - 1)])
    file = tmp_path / "wide.csv"
    file.write_text("\n".join([row] * max(3_000_000 // columns, 3)))
    begin = time.process_time()
    with pytest.raises(InputError, match=r"wide\.csv: must be .*, got (no rows|lines of more)"):
        pendmap.read_experiment(file)
    assert time.process_time() - begin < 10


def test_as_many_columns_as_are_allowed_are_read(tmp_path: Path) -> None:
    t = np.arange(300) * 0.03
    x = 2 * np.exp(-0.05 * t) * np.cos(6 * t)
    rest = ",0.25" * (MOST_COLUMNS - 2)
    names = ["t_s", "theta_rad", *(f"c{k}" for k in range(MOST_COLUMNS - 2))]
    lines = [",".join(names), *(f"{a:.4f},{b:.6f}{rest}" for a, b in zip(t, x, strict=True))]
    lines[150:150] = ["9," * 10**6]  # a broken line is left out, however long
    (tmp_path / "wide.csv").write_text("\n".join(lines))
    experiment = pendmap.read_experiment(tmp_path / "wide.csv")
    assert experiment.runs[0].theta == pytest.approx(x, abs=1e-6)
    assert "unreadable-lines" in {found.what for found in experiment.runs[0].findings}


def test_a_small_parquet_does_not_unpack_to_gigabytes(tmp_path: Path) -> None:
    file = tmp_path / "bomb.parquet"
    rows = pa.array(np.zeros(10**6))
    schema = pa.schema([("t_s", pa.float64()), ("theta_rad", pa.float64())])
    with parquet.ParquetWriter(file, schema) as writer:
        for _ in range(80):
            writer.write_table(pa.table([rows, rows], schema=schema))
    assert file.stat().st_size < 2**20
    with pytest.raises(InputError, match="unpacks to 1221 MiB"):
        pendmap.read_experiment(file)


def test_texts_of_a_parquet_are_unpacked_once(tmp_path: Path) -> None:
    t = np.arange(1000) * 0.01
    long = pa.DictionaryArray.from_arrays(pa.array([0] * 1000), pa.array(["9" * 10**5]))
    columns = {"t_s": t, "theta_rad": 2 * np.exp(-0.05 * t) * np.cos(6 * t)}
    table = pa.table(columns | {"note": long.cast(pa.string()), "as_text": [f"{v}" for v in t]})
    parquet.write_table(table, tmp_path / "run.parquet")
    run = pendmap.read_experiment(tmp_path / "run.parquet").runs[0]
    assert run.theta == pytest.approx(columns["theta_rad"])


def test_a_small_result_does_not_unpack_to_more_than_the_memory(tmp_path: Path) -> None:
    import netCDF4  # noqa: PLC0415 (the library itself: xarray would make the array)

    file = tmp_path / "bomb.nc"
    with netCDF4.Dataset(file, "w") as made:
        made.setncatts({"format_version": 3, "kind": "basins"})
        made.createDimension("theta", 2**40)
        made.createVariable("label", "f8", ("theta",), zlib=True)
    assert file.stat().st_size < 2**16
    with pytest.raises(InputError, match="must unpack to half of this memory at most, got"):
        pendmap.load(file)


@pytest.mark.parametrize("version", [0, 2, 4, "1", float("nan")])
def test_an_unknown_format_is_refused(tmp_path: Path, version: object) -> None:
    attrs = {"format_version": version, "kind": "basins"}
    xr.Dataset({"x": ("t", [1.0])}, attrs=attrs).to_netcdf(tmp_path / "r.nc", engine="netcdf4")
    with pytest.raises(InputError, match="has format"):
        pendmap.load(tmp_path / "r.nc")


def test_a_foreign_result_is_not_drawn(pendmap_command: Run, tmp_path: Path) -> None:
    attrs = {"format_version": 1, "kind": "tongues", "title": "\x1b[31mred\x07" + "x" * 5000}
    foreign = xr.Dataset({"x": ("t", [1.0])}, attrs=attrs)
    foreign.to_netcdf(tmp_path / "r.nc", engine="netcdf4")
    run = pendmap_command("plot", "r.nc")
    assert run.returncode == 2
    assert len(run.stderr.splitlines()) == 1
    assert run.stderr.startswith("pendmap: r.nc: ")
    assert "\x1b" not in run.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["r.nc"]


@settings(max_examples=200)
@given(st.text(st.characters(), max_size=2000))
def test_messages_are_short_and_shown_as_they_are(text: str) -> None:
    for message in (one_line(text), str(InputError(text))):
        assert len(message) <= 500
        assert not [c for c in message if unicodedata.category(c)[0] == "C"]
    if len(text) <= 500 and text.isprintable() and "  " not in text:
        assert one_line(text) == text.strip()


def test_a_description_is_read_or_refused_whatever_its_values(tmp_path: Path) -> None:
    file = tmp_path / "experiment.toml"
    keys = {line.partition(" =")[0]: line for line in fuzz_cases.EXPERIMENT.decode().split("\n")}
    keys |= {"kind": 'kind = "free"', "decimal": 'decimal = "."', "hold_out": "hold_out = true"}
    said: list[str] = []
    for key in (key for key in keys if key and not key.startswith("[")):
        table = {"gravity": "rig", "encoder_counts": "rig", "time": "columns", "angle": "columns"}
        where = table.get(key, "reader" if key in {"delimiter", "decimal", "skip_rows"} else "run")
        for value in fuzz_cases.VALUES:
            lines = [f"{key} = {value}"] if where == "run" else []
            text = ["[[run]]", *([] if key == "file" else ['file = "run.csv"']), *lines]
            text += [] if where == "run" else [f"[{where}]", f"{key} = {value}"]
            file.write_text("\n".join(text), encoding="utf-8")
            try:
                read_description(file)
            except InputError as refused:
                said.append(str(refused))
    assert len(said) > 100
    assert max(map(len, said)) <= 500


def test_a_parquet_file_with_one_byte_wrong_ends_no_process(tmp_path: Path) -> None:
    # A separate process, as a library that aborts would end this one.
    code = (
        "import sys, numpy as np, pyarrow as pa\n"
        "from pyarrow import parquet\n"
        "from pendmap import InputError, read_experiment\n"
        "time = np.arange(60) / 20\n"
        "parquet.write_table(pa.table({'t_s': time, 'theta_rad': np.cos(6 * time)}), sys.argv[1])\n"
        "whole, refused = open(sys.argv[1], 'rb').read(), 0\n"
        "footer = int.from_bytes(whole[-8:-4], 'little')\n"
        "for place in range(len(whole) - 8 - footer, len(whole) - 8):\n"
        "    data = bytearray(whole)\n"
        "    data[place] = (data[place] + 1) % 256\n"
        "    open(sys.argv[1], 'wb').write(data)\n"
        "    try: read_experiment(sys.argv[1])\n"
        "    except InputError: refused += 1\n"
        "print(refused)\n"
    )
    words = [sys.executable, "-c", code, str(tmp_path / "run.parquet")]
    run = subprocess.run(words, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert int(run.stdout) > 40


def test_names_reach_the_terminal_escaped(pendmap_command: Run, tmp_path: Path) -> None:
    """Control characters of files and columns are shown as escapes by every command."""
    wild = "an\x1b]0;title\x07\x9b31m\u202e\rgle"
    t = np.arange(0, 60, 0.02)
    x = 1.2 * np.exp(-0.03 * t) * np.cos(6.1 * t)
    rows = "\n".join(f"{a:.4f},{b:.6f},{b / 9:.6f}" for a, b in zip(t, x, strict=True))
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
        ("basins", "--grid", "4", "--out", f"map{wild}.nc"),
        ("simulate", "--model", f"missing{wild}.toml"),
    )
    for words in commands:
        run = pendmap_command(*words)
        assert run.returncode == (2 if "missing" in words[-1] else 0), run.stderr
        assert r"\x1b]0;title" in run.stdout + run.stderr, words
        shown = set(run.stdout + run.stderr) - {"\n"}
        assert all(c.isprintable() for c in shown), (words, shown)
