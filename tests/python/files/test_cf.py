"""Results by the CF conventions 1.11, and their alignment."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import xarray as xr

import pendmap
from pendmap import Effect, Grid, Pendulum, Rig, RunOptions

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

DRAG = Effect("quadratic_drag", {"q": 0.012})
SI = Rig(w0=6.2, c_over_m=0.6, Tr=0.1, p=0.9, Omega=12.0, effects=(DRAG,))
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
    "backbone": lambda: pendmap.backbone(BARE, count=3),
    "orbits": lambda: pendmap.orbit(DRAWN, 1, 1, Grid.square(20, 6.2)),
    "parameter_map": lambda: pendmap.parameter_map(DRAWN, PLANE, starts=2, draws=2, curves=True),
    "tongues": lambda: pendmap.tongues(DRAWN, [1.9, 2.0]),
    "trajectory": lambda: pendmap.simulate(SI, 1.0, 0.0, 3.0, lyapunov=True),
}
UNITS = {"1", "rad", "rad/s", "rad/s2", "1/s", "1/rad", "s", "m/s2", "mm"}
WORD = re.compile(r"[A-Za-z0-9_.@+-]+")  # A meaning of a flag, by CF


@pytest.fixture(scope="module", params=RESULTS)
def saved(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:  # noqa: ANN401
    result = RESULTS[request.param]()
    return result, pendmap.save(result, tmp_path_factory.mktemp("cf") / "result.nc")


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
    model = saved[1].with_suffix(".toml")
    model.write_text(a["model"], encoding="utf-8")
    assert pendmap.load_model(model) == pendmap.pendulum_of(saved[0])
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


def test_a_result_is_a_table_with_rows(saved: tuple[xr.Dataset, Path]) -> None:
    result, _ = saved
    table = result.pendmap.to_dataframe()
    names = table.index.names
    assert len(table) == np.prod([result.sizes[name] for name in names]) > 0
    assert table.dtypes.map(str).ne("object").all()
    assert {"multipliers_1_re", "multipliers_2_im"} <= set(table.columns) or names != ["orbit"]
    for name in set(table.columns) & set(result.data_vars):
        np.testing.assert_array_equal(table[name].to_numpy(), result[name].values.ravel())


def test_other_tools_read_a_file_without_a_warning(tmp_path: Path) -> None:
    result = pendmap.basins(Pendulum(gamma=0), 8, run=RunOptions(store=tmp_path / "b.zarr"))
    pendmap.save(result, tmp_path / "a.zarr")
    for name in ("a.zarr", "b.zarr"):  # a warning is an error in tests
        with xr.open_zarr(tmp_path / name, chunks=None) as opened:
            assert set(opened.variables) >= {"label", "theta", "fraction"}
            np.testing.assert_array_equal(opened["label"].values, result["label"].values)
    with xr.open_dataset(pendmap.save(result, tmp_path / "a.nc")) as opened:
        assert np.isnan(opened["settle_periods"].values).all()  # none ever settled
    assert (pendmap.load(tmp_path / "a.nc")["settle_periods"] == -1).all()


def test_the_history_is_reproducible(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1234567890")
    history = f"2009-02-13T23:31:30Z pendmap {pendmap.__version__}: pendmap.melnikov"
    result = pendmap.melnikov(BARE, [1.0])
    assert result.attrs["history"] == history
    monkeypatch.delenv("SOURCE_DATE_EPOCH")
    again = pendmap.load(pendmap.save(result, tmp_path / "a.nc"))
    assert pendmap.load(pendmap.save(again, tmp_path / "b.nc")).attrs["history"] == history
