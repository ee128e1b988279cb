"""Results in files: complete or absent, and read back unchanged."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

import pytest
import xarray as xr

import pendmap
from pendmap import Grid, InputError, Pendulum
from pendmap.charts.registry import kinds
from pendmap.cli.analysis import command_of
from pendmap.files.dataset import KINDS

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="module")
def results() -> list[xr.Dataset]:
    """Return one result of each kind, with and without attractors."""
    return [
        pendmap.basins(Pendulum(p=0.6), Grid.square(12)),
        pendmap.basins(pendmap.PRESETS["fig2b"], Grid.square(8)),
        pendmap.basins(Pendulum(gamma=0), Grid.square(8)),
        pendmap.simulate(Pendulum(), 1, 0, 20),
    ]


@pytest.mark.parametrize("suffix", [".nc", ".zarr"])
def test_written_results_are_read_back(
    tmp_path: Path, results: list[xr.Dataset], suffix: str
) -> None:
    for result in results:
        file = tmp_path / f"result{suffix}"
        for _ in range(2):  # the second time replaces the first
            pendmap.save(result, file)
        again = pendmap.load(file)
        xr.testing.assert_equal(again, result)
        assert again.attrs == result.attrs | {"history": again.attrs["history"]}
        assert [p.name for p in tmp_path.iterdir()] == [file.name]
        if suffix == ".nc":
            file.unlink()
        else:
            break


def test_files_that_are_no_results_are_refused(tmp_path: Path) -> None:
    broken = tmp_path / "broken.nc"
    broken.write_bytes(b"\x89HDF\r\n\x1a\n and then nothing")
    with pytest.raises(InputError, match="cannot be read"):
        pendmap.load(broken)
    foreign = tmp_path / "foreign.nc"
    xr.Dataset({"x": ("t", [1.0, 2.0])}).to_netcdf(foreign, engine="netcdf4")
    with pytest.raises(InputError, match="is not a result of pendmap"):
        pendmap.load(foreign)
    with pytest.raises(FileNotFoundError):
        pendmap.load(tmp_path / "absent.nc")
    with pytest.raises(InputError, match="suffix"):
        pendmap.load(_touched(tmp_path / "result.csv"))


def _touched(path: Path) -> Path:
    path.touch()
    return path


def test_a_later_format_is_refused(tmp_path: Path, results: list[xr.Dataset]) -> None:
    later = results[3].assign_attrs(format_version=3)
    pendmap.save(later, tmp_path / "later.nc")
    with pytest.raises(InputError, match="has format 3"):
        pendmap.load(tmp_path / "later.nc")


def test_a_failure_leaves_the_old_file(
    tmp_path: Path, results: list[xr.Dataset], monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "result.nc"
    pendmap.save(results[0], file)
    before = file.read_bytes()

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(xr.Dataset, "to_netcdf", fail)
    with pytest.raises(OSError, match="No space"):
        pendmap.save(results[1], file)
    assert file.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["result.nc"]


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
