"""Results of records as datasets: named variables, and one attribute of JSON."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import xarray as xr

import pendmap
from decays import decay, record
from pendmap import Run

if TYPE_CHECKING:
    from collections.abc import Iterator
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


def nodes(node: Any) -> Iterator[dict[str, Any]]:  # noqa: ANN401 (JSON)
    """Yield all objects of a JSON value."""
    if isinstance(node, dict):
        yield node
    for part in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        yield from nodes(part)


def test_every_variable_has_a_name_a_meaning_and_a_unit(result: Any) -> None:  # noqa: ANN401
    dataset = result.to_dataset()
    for name, values in dataset.variables.items():
        assert values.attrs["long_name"], name
        assert not str(name)[-1].isdigit() or name == "parameter_2"
        known = {"units", "flag_values"} & set(values.attrs)
        assert known or values.dtype.kind == "U" or values.dims[0] == result.ROWS, name
    # Arrays in the JSON are covariances.
    content = json.loads(dataset.attrs["content"])
    arrays = [node for node in nodes(content) if node.get("is") == "array" and "from" not in node]
    assert all(np.prod(node["shape"]) < 100 for node in arrays)


def test_a_table_has_rows_and_plain_columns(result: Any) -> None:  # noqa: ANN401
    table = result.to_dataframe()
    assert len(table) > 0
    assert table.dtypes.map(str).ne("object").all()
    assert table.unit.dtype == "string"


def test_a_dataset_has_records_and_residuals_run_by_run(
    result: Any,  # noqa: ANN401
    tmp_path: Path,
) -> None:
    with xr.open_dataset(pendmap.save(result, tmp_path / "a.nc")) as dataset:
        assert dataset["sample_of"].attrs["flag_meanings"] == "a b"
        theta = dataset["runs_theta"].values[dataset["sample_of"].values == 1]
        assert np.array_equal(theta, made("b", 1.0, 2).theta)
        assert dataset.attrs["summary"] == str(result)
        if isinstance(result, pendmap.identification.IdentificationReport):
            one = dataset.isel(reading=dataset["reading_of"].values == 1)
            assert dataset["reading_of"].attrs["flag_meanings"] == "a b"
            assert np.array_equal(one["time"], result.runs[1].time)
            known = result.residual["b"].notnull().values
            assert np.array_equal(one["residuals"][known], result.residual["b"][known])


@pytest.mark.parametrize("suffix", [".nc", ".zarr"])
def test_a_file_is_read_back_identical(
    result: Any,  # noqa: ANN401
    suffix: str,
    tmp_path: Path,
) -> None:
    for _ in range(2):  # the second time replaces the first
        file = pendmap.save(result, tmp_path / f"a{suffix}")
    again = pendmap.load(file)
    assert again.to_dataset().identical(result.to_dataset())
    assert again._repr_html_() == result._repr_html_()
