"""Results in files: complete or absent, and what is no result is refused."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

import pytest
import xarray as xr

import pendmap
from pendmap import InputError, Pendulum
from pendmap.charts.registry import kinds
from pendmap.cli.analysis import command_of
from pendmap.files.dataset import KINDS

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="module")
def result() -> xr.Dataset:
    return pendmap.basins(Pendulum(p=0.6), 8, check=False)


@pytest.mark.parametrize("suffix", [".nc", ".zarr"])
def test_a_result_replaces_another_and_leaves_nothing(
    tmp_path: Path, result: xr.Dataset, suffix: str
) -> None:
    file = tmp_path / f"result{suffix}"
    pendmap.save(pendmap.simulate(Pendulum(), 1, 0, 20), file)
    pendmap.save(result, file)
    assert pendmap.load(file).identical(result)
    assert [path.name for path in tmp_path.iterdir()] == [file.name]


FOREIGN = xr.Dataset({"x": ("t", [1.0, 2.0])})


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("a.nc", b"\x89HDF\r\n\x1a\n and then nothing", "cannot be read"),
        ("a.nc", FOREIGN, "is not a result of pendmap"),
        ("a.nc", {"format_version": 4}, "has format 4, this pendmap reads format 3"),
        ("a.nc", None, "a.nc"),
        ("a.csv", b"", "suffix must be .nc or .zarr, got '.csv'"),
        ("s3://a/b.nc", None, "suffix of an address must be .zarr"),
    ],
)
def test_files_that_are_no_results_are_refused(
    tmp_path: Path, name: str, data: object, said: str, result: xr.Dataset
) -> None:
    file = name if "://" in name else tmp_path / name
    match data:
        case bytes():
            file.write_bytes(data)
        case xr.Dataset():
            data.to_netcdf(file, engine="netcdf4")
        case dict():
            pendmap.save(result.assign_attrs(data), file)
    with pytest.raises((InputError, FileNotFoundError), match=said):
        pendmap.load(file)


def test_a_failure_leaves_the_old_file(
    tmp_path: Path, result: xr.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = pendmap.save(result, tmp_path / "result.nc")
    before = file.read_bytes()

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(xr.Dataset, "to_netcdf", fail)
    with pytest.raises(OSError, match="No space"):
        pendmap.save(result, file)
    assert file.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["result.nc"]


def test_every_kind_of_result_has_its_functions_its_figure_and_its_recording() -> None:
    assert set(KINDS) == set(kinds())
    with pytest.raises(InputError) as refused:
        pendmap.save(xr.Dataset(), "a.nc")
    for functions in KINDS.values():
        for name in functions:
            assert callable(getattr(pendmap, name))
            assert f" {name}" in str(refused.value)


@pytest.mark.parametrize("kind", pendmap.ANALYSES)
def test_an_analysis_has_one_name_in_module_dataset_and_command(kind: str) -> None:
    command, *_ = pendmap.ANALYSES[kind]
    assert importlib.import_module(f"pendmap.analysis.{kind}").SCHEMA.kind == kind
    assert command_of(command).name == command
