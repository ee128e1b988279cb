"""Files of results: they read back identical; files of others are refused."""

from __future__ import annotations

import hashlib
import importlib
import json
import os
import re
import tomllib
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import pytest
import xarray as xr

import pendmap
from decays import decay, record
from pendmap import InputError, Pendulum, Run
from pendmap.charts.registry import kinds
from pendmap.cli.analysis import command_of
from pendmap.files import toml_text
from pendmap.files.dataset import KINDS

if TYPE_CHECKING:
    from pathlib import Path


def made(name: str, release: float, seed: int) -> Run:
    """Return a record of an independent integration with noise."""
    time, theta = record(decay(release=release, until=30.0), seconds=20, seed=seed)
    return Run(name, f"{name}.csv", "free", time, theta, np.ones(time.size, bool))


@pytest.fixture(scope="module", params=["identify", "compare", "diagnose"])
def result(request: pytest.FixtureRequest) -> Any:  # noqa: ANN401
    runs = [made("a", 2.0, 1), made("b", 1.0, 2)]
    if request.param == "compare":
        return pendmap.compare(pendmap.Rig(w0=6.2, c_over_m=0.0496, Tr=0.08), runs)
    return getattr(pendmap, request.param)(runs)


def test_a_result_of_records_has_named_variables(result: Any, tmp_path: Path) -> None:  # noqa: ANN401
    dataset = result.to_dataset()
    for name, values in dataset.variables.items():
        assert values.attrs["long_name"], name
        assert not str(name)[-1].isdigit() or name == "parameter_2"
        known = {"units", "flag_values"} & set(values.attrs)
        assert known or values.dtype.kind == "U" or values.dims[0] == result.ROWS, name
    longest = max(re.findall(r"\[[-+.,\w ]*\]", dataset.attrs["content"]), key=len)
    assert longest.count(",") < 100  # covariances
    table = result.to_dataframe()
    assert len(table) > 0
    assert table.dtypes.map(str).ne("object").all()
    assert table.unit.dtype == "string"
    with xr.open_dataset(pendmap.save(result, tmp_path / "a.nc")) as opened:
        assert opened["sample_of"].attrs["flag_meanings"] == "a b"
        theta = opened["runs_theta"].values[opened["sample_of"].values == 1]
        assert np.array_equal(theta, made("b", 1.0, 2).theta)
        assert opened.attrs["summary"] == str(result)
        if isinstance(result, pendmap.identification.IdentificationReport):
            one = opened.isel(reading=opened["reading_of"].values == 1)
            assert opened["reading_of"].attrs["flag_meanings"] == "a b"
            assert np.array_equal(one["time"], result.runs[1].time)
            known = result.residual["b"].notnull().values
            assert np.array_equal(one["residuals"][known], result.residual["b"][known])


@pytest.mark.parametrize("suffix", [".nc", ".zarr"])
def test_a_result_of_records_is_read_back_and_leaves_nothing_else(
    result: Any,  # noqa: ANN401
    suffix: str,
    tmp_path: Path,
) -> None:
    for one in (pendmap.simulate(Pendulum(), 1, 0, 20), result):  # the second replaces the first
        file = pendmap.save(one, tmp_path / f"a{suffix}")
    again = pendmap.load(file)
    assert again.to_dataset().identical(result.to_dataset())
    assert again._repr_html_() == result._repr_html_()
    assert [path.name for path in tmp_path.iterdir()] == [file.name]


FOREIGN = xr.Dataset({"x": ("t", [1.0, 2.0])})
ZARR_2 = FOREIGN.assign_attrs({"kind": "basins", "format_version": 2})


@pytest.mark.parametrize(
    ("name", "data", "text"),
    [
        ("a.nc", b"\x89HDF\r\n\x1a\n and then nothing", "cannot be read"),
        ("a.nc", FOREIGN, "is not a result of pendmap"),
        ("a.nc", {"format_version": 4}, "has format 4, this pendmap reads format 3"),
        ("a.nc", None, "a.nc"),
        ("a.zarr", None, r"must be a result .* in format 3, it lacks pendmap\.json"),
        ("a.zarr", ZARR_2, "cannot be read as a result of pendmap"),
        ("a.csv", b"", "suffix must be .nc or .zarr, got '.csv'"),
    ],
)
def test_files_that_are_no_results_are_refused(
    tmp_path: Path, name: str, data: object, text: str
) -> None:
    file = tmp_path / name
    match data:
        case bytes():
            file.write_bytes(data)
        case xr.Dataset() if file.suffix == ".zarr":
            data.to_zarr(file, zarr_format=2)
            (file / "pendmap.json").write_text('{"request": null, "files": {}}')
        case xr.Dataset():
            data.to_netcdf(file, engine="netcdf4")
        case dict():
            pendmap.save(pendmap.melnikov(Pendulum(p=1.0)).assign_attrs(data), file)
    with pytest.raises((InputError, FileNotFoundError), match=text):
        pendmap.load(file)


GRID = {"name": "regular", "configuration": {"chunk_shape": [1, 1]}}


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"codecs": [{"name": "bytes"}, {"name": "blosc"}]}, "codecs of label must be .* blosc"),
        ({"codecs": [{"name": "numcodecs.zlib"}]}, r"codecs of label must be .* numcodecs\.zlib"),
        ({"shape": [10**6, 1], "chunk_grid": GRID}, "label must have 1000000 chunks, got 1"),
        ({"shape": [10**15, 1], "chunk_grid": GRID}, "label must have 10{15} chunks, got 1"),
    ],
)
def test_forged_metadata_of_a_store_are_refused(
    changes: dict[str, Any], text: str, tmp_path: Path
) -> None:
    store = pendmap.save(pendmap.basins(Pendulum(p=0.6), 4, check=False), tmp_path / "a.zarr")
    root, seal = store / "zarr.json", store / "pendmap.json"
    content = json.loads(root.read_bytes())
    content["consolidated_metadata"]["metadata"]["label"] |= changes
    root.write_text(json.dumps(content))
    content = json.loads(seal.read_bytes())
    content["files"]["zarr.json"] = hashlib.sha256(root.read_bytes()).hexdigest()
    seal.write_text(json.dumps(content))
    with pytest.raises(InputError, match=text):
        pendmap.load(store)


def test_a_kind_of_result_has_one_name_in_functions_modules_and_commands() -> None:
    assert set(KINDS) == set(kinds())
    assert all(callable(getattr(pendmap, name)) for names in KINDS.values() for name in names)
    with pytest.raises(InputError, match="dataset is not a result of pendmap"):
        pendmap.save(xr.Dataset(), "a.nc")
    for kind, (command, *_) in pendmap.ANALYSES.items():
        assert command_of(command).name == command
        assert importlib.import_module(f"pendmap.analysis.{kind}").SCHEMA.kind == kind


DEEP = {"deep": [{"z": [1, {"q": '\n"'}]}], "after": True, "e": {}, "l": []}
RUN = {"file": "run_00.csv", "drive": {"p": 0.2, "phi": -1.5}, "ends": [0.5, 2]}
RUN_TEXT = """version = 1

[rig]
w0 = 6.2

[[run]]
file = "run_00.csv"
drive = { p = 0.2, phi = -1.5 }
ends = [0.5, 2]

[[run]]
file = "b"
"""


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ({}, ""),
        ({"a b": 1, "x": [DEEP, {}, DEEP], "t": {"u": [{"v": 1}]}, "n": [[1, 2], [{}]]}, None),
        ({"version": 1, "rig": {"w0": 6.2}, "run": [RUN, {"file": "b"}]}, RUN_TEXT),
    ],
)
def test_written_toml_reads_back(content: dict[str, Any], text: str | None) -> None:
    assert tomllib.loads(toml_text(content)) == content
    assert text in {None, toml_text(content)}


@pytest.mark.parametrize("name", ["link", "storage", "virtual", "group"])
def test_a_netcdf_that_leads_to_another_file_is_not_opened(name: str, tmp_path: Path) -> None:
    # The other file is a pipe: whoever opens it waits for ever.
    other = tmp_path / "other"
    os.mkfifo(other)
    with h5py.File(tmp_path / "a.nc", "w") as file:
        if name == "link":
            file["theta"] = h5py.ExternalLink(other, "theta")
        elif name == "storage":
            file.create_dataset("theta", (4,), "f8", external=[(other, 0, 32)])
        elif name == "virtual":
            layout = h5py.VirtualLayout((4,), "f8")
            layout[:] = h5py.VirtualSource(other, "theta", (4,))
            file.create_virtual_dataset("theta", layout)
        else:
            file.create_group("theta")
    with pytest.raises(InputError, match="theta must be in this file"):
        pendmap.load(tmp_path / "a.nc")
