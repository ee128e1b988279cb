"""Results by the CF conventions 1.11, and their alignment."""

from __future__ import annotations

import re
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import xarray as xr

import pendmap
from pendmap import Effect, Grid, Pendulum, Rig

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

SI = Rig(
    w0=6.2,
    c_over_m=0.6,
    Tr=0.1,
    p=0.9,
    Omega=12.0,
    effects=(Effect("quadratic_drag", {"q": 0.012}),),
)
NOTES = {"covariance": {"names": ["c_over_m", "p"], "matrix": [[1e-4, 0.0], [0.0, 1e-4]]}}
DRAWN = Rig(w0=6.2, c_over_m=0.6, p=1.2, Omega=12.4, notes=NOTES)
BARE = Pendulum(p=0.6)
PLANE = {"p": (0.3, 1.2, 2), "omega": (1.8, 2.0, 2)}
RESULTS: dict[str, Callable[[], xr.Dataset]] = {
    "basins": lambda: pendmap.basins(DRAWN, Grid.square(10, 6.2), draws=2),
    "basins of a list": lambda: pendmap.basins_of(SI, [0.0, 1.0], [0.1, 2.5]),
    "basin_sweep": lambda: pendmap.sweep(SI, {"quadratic_drag.q": (0.01, 0.02, 2)}, grid=8),
    "bifurcation": lambda: pendmap.bifurcation(SI, {"stroke_mm": (20, 40, 3)}, starts=2),
    "lifetime": lambda: pendmap.lifetime(DRAWN, starts=100, draws=2),
    "lyapunov": lambda: pendmap.lyapunov(SI),
    "melnikov": lambda: pendmap.melnikov(BARE, [1.0, 2.0]),
    "orbits": lambda: pendmap.orbit(DRAWN, 1, 1, Grid.square(20, 6.2)),
    "parameter_map": lambda: pendmap.parameter_map(DRAWN, PLANE, starts=2, draws=2, curves=True),
    "tongues": lambda: pendmap.tongues(DRAWN, [1.9, 2.0]),
    "trajectory": lambda: pendmap.simulate(SI, 1.0, 0.0, 3.0, lyapunov=True),
}
UNITS = {"1", "rad", "rad/s", "rad/s2", "1/s", "1/rad", "s", "m/s2", "mm"}
"""Units of results; UDUNITS-2 reads each."""
WORD = re.compile(r"[A-Za-z0-9_.@+-]+")  # A meaning of a flag, by CF


@pytest.fixture(scope="module", params=RESULTS)
def saved(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:  # noqa: ANN401
    """Return a result of each kind, and its file."""
    result = RESULTS[request.param]()
    return result, pendmap.save(result, tmp_path_factory.mktemp("cf") / "result.nc")


def written(beside: Path, text: str) -> Path:
    file = beside.with_suffix(".toml")
    file.write_text(text, encoding="utf-8")
    return file


def test_a_file_follows_the_conventions(saved: tuple[xr.Dataset, Path]) -> None:
    with xr.open_dataset(saved[1], decode_cf=False) as opened:
        stored = opened.load()
    a = stored.attrs
    assert a["Conventions"] == "CF-1.11"
    assert a["source"] == f"pendmap {pendmap.__version__}"
    assert "doi:10.1098/rsta.2007.2126" in a["references"]
    assert all(a[name] for name in ("title", "history", "comment"))
    for value in a.values():
        assert isinstance(value, str | int | float | np.number)
        assert not isinstance(value, str) or not value.startswith(("{", "["))
    assert pendmap.load_model(written(saved[1], a["model"])) == pendmap.pendulum_of(saved[0])
    bounds = {one.attrs.get("bounds") for one in stored.variables.values()}
    for name, one in stored.variables.items():
        if name in bounds:
            assert not set(one.attrs) & {"units", "long_name", "_FillValue"}, name
            continue
        assert one.attrs["long_name"], name
        if "flag_values" in one.attrs:
            words = one.attrs["flag_meanings"].split(" ")
            values = np.atleast_1d(one.attrs["flag_values"])
            assert values.dtype == one.dtype, name
            assert len(words) == values.size, name
            assert all(WORD.fullmatch(word) for word in words), words
            assert set(np.unique(one.values)) <= set(values.tolist()), name
        elif one.dtype.kind in "iuf" and name != "drawn":  # its parameters have units of their own
            assert one.attrs["units"] in UNITS, (name, one.attrs["units"])
        fill = one.attrs.get("_FillValue")
        assert fill is None or np.asarray(fill).dtype == one.dtype, name
    for name in stored.dims:  # coordinates are numbers without gaps
        if name in stored.variables:
            assert stored[name].dtype.kind in "iuf", name
            assert "_FillValue" not in stored[name].attrs, name
            steps = np.diff(stored[name].values)
            assert (steps > 0).all() or (steps < 0).all(), name
        else:
            assert f"{name}_name" in stored.variables or name in ("bound", "eigenvalue", "part")


ROWS = {
    "basins": "velocity theta",
    "basin_sweep": "velocity theta",
    "bifurcation": "entry",
    "lifetime": "start",
    "lyapunov": "attractor",
    "melnikov": "omega branch",
    "orbits": "orbit",
    "parameter_map": "",
    "tongues": "critical",
    "trajectory": "time",
}
"""What a row of the table of each kind is; of planes of parameters also a value of each."""


def test_a_result_is_a_table_with_rows(saved: tuple[xr.Dataset, Path]) -> None:
    result, _ = saved
    table = result.pendmap.to_dataframe()
    names = table.index.names
    assert " ".join(names).endswith(ROWS[result.attrs["kind"]]) or names == ["start"]
    assert len(table) == np.prod([result.sizes[name] for name in names]) > 0
    assert table.dtypes.map(str).ne("object").all()
    assert {"multipliers_1_re", "multipliers_2_im"} <= set(table.columns) or names != ["orbit"]
    for name in set(table.columns) & set(result.data_vars):
        np.testing.assert_array_equal(table[name].to_numpy(), result[name].values.ravel())


def test_other_tools_see_that_a_start_never_settled(tmp_path: Path) -> None:
    result = pendmap.basins(Pendulum(gamma=0), 8)
    with xr.open_dataset(pendmap.save(result, tmp_path / "a.nc")) as opened:
        assert np.isnan(opened["settle_periods"].values).all()
    assert (pendmap.load(tmp_path / "a.nc")["settle_periods"] == -1).all()


def test_the_history_is_reproducible(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1234567890")
    said = f"2009-02-13T23:31:30Z pendmap {pendmap.__version__}: pendmap.melnikov"
    result = pendmap.melnikov(BARE, [1.0])
    assert result.attrs["history"] == said
    monkeypatch.delenv("SOURCE_DATE_EPOCH")
    # The history of a result is that of its computation.
    again = pendmap.load(pendmap.save(result, tmp_path / "a.nc"))
    assert pendmap.load(pendmap.save(again, tmp_path / "b.nc")).attrs["history"] == said
    assert pendmap.melnikov(BARE, [1.0]).attrs["history"][:4] == time.strftime("%Y", time.gmtime())


def test_other_tools_open_a_store_without_a_warning(tmp_path: Path) -> None:
    pytest.importorskip("zarr")
    grid = Grid.square(8)
    one = pendmap.basins(BARE, grid, run=pendmap.RunOptions(store=tmp_path / "one.zarr"))
    pendmap.save(one, tmp_path / "other.zarr")
    for name in ("one.zarr", "other.zarr"):  # a warning is an error in tests
        with xr.open_zarr(tmp_path / name, chunks=None) as opened:
            assert set(opened.variables) >= {"label", "theta", "fraction"}


def test_results_are_joined_along_a_parameter() -> None:
    values = [0.6, 1.7]
    single = [pendmap.basins(Pendulum(p=p), 10) for p in values]
    joined = xr.concat(single, dim="p", join="outer")
    assert joined["p"].values.tolist() == values
    assert joined["label"].dims == ("p", "velocity", "theta")
    for k, one in enumerate(single):
        assert joined["undecided"].values[k] == one["undecided"].item()
        for name in one["attractor"].values:
            share = joined["fraction"].sel(attractor=name).values[k]
            assert share == one["fraction"].sel(attractor=name).item()
