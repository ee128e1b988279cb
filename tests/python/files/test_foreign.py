"""Files of others: nothing in them is run, and they lead to no other file."""

from __future__ import annotations

import base64
import hashlib
import json
import pickle
import zlib
from typing import TYPE_CHECKING

import netCDF4
import numpy as np
import pytest
import xarray as xr

import pendmap
from pendmap import InputError, Pendulum

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

LEADING = {  # of h5py, compressed
    "storage": (
        "c-rgqaB<`1lHy|K;9!7(|4{Iq5yCfsiZ9I(_4W5~31VWXU=l)B2m@S93_vYxJPbgJv0^jKJP!t{fy|#W"
        "HDD(IEnpO3U|?coWE6nP!Dwb42Cx{!^&AYWKvywyv1<TzfJGS@_Cr0!fo3|)1P-9@m>FTdf{8NpFbpd2"
        "wsp6ahpS@%h%EsXgL;hNJ|n8y;?(4#)Dpd<%sdDm0Gu*4M*"
    ),
    "link": (
        "c-rgqaB<`1lHy|K;9!7(|4^_Q$~S=0Q$xeL{XJZQm>4RUgpd`&02dPjBLf4Q2m=EnhXZ2;F9Sn<Nk(ds"
        "UWO@yei;LU0|UjtB5X%80J&HsYy"
    ),
    "virtual": (
        "c-rgqaB<`1lHy|K;9!7(|4_gn0pS}!#T`34+5J6Sf|wX8n1qlO!T=W&10w?i8xI4JVyxH<GtYy8Y9RBc"
        "ObyrxiusIO*~plIkx_(!fr*ikkrk>IMl*{rFbXQzGeA7(z+l47VDg_CC=YZkGdBkx0|N^)R1)NT28JyR"
        "LlWE!4x7v{3P!;w7zLwX6c7X4o&9~lm7V}n1qcLoFa<Dy{F02+BE1Y#hB5|bBw-L>0#&jgF(yW+7Diy@"
        "tLese5us)Q|7ci`f>AIEM!_f;1*2dTjDk@x3P!;w7zG0b08!{MvH"
    ),
}


class Touch:
    """An object that makes a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[str, str]]:
        return (open, (str(self.path), "w"))


@pytest.mark.parametrize("name", [*LEADING])
def test_a_netcdf_that_leads_to_another_file_is_not_opened(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "a.nc"
    file.write_bytes(zlib.decompress(base64.b85decode(LEADING[name])))
    monkeypatch.setattr(netCDF4, "Dataset", lambda *_, **__: pytest.fail("it was opened"))
    with pytest.raises(InputError, match="cannot be read: it refers to other files"):
        pendmap.load(file)


def test_a_netcdf_of_ones_own_is_opened(tmp_path: Path) -> None:
    run = pendmap.simulate(Pendulum(), 1.0, 0.0, 300.0)
    assert pendmap.load(pendmap.save(run, tmp_path / "a.nc")).equals(run)
    assert pendmap.load(f"file://{tmp_path}/a.nc").equals(run)


def test_a_store_of_zarr_2_runs_no_code(tmp_path: Path, pendmap_command: Run) -> None:
    store = tmp_path / "a.zarr"
    (store / "label").mkdir(parents=True)
    attributes = {"kind": "basins", "format_version": 2}
    (store / ".zgroup").write_text('{"zarr_format": 2}')
    (store / ".zattrs").write_text(json.dumps(attributes))
    array = {"zarr_format": 2, "shape": [1], "chunks": [1], "dtype": "<i2", "order": "C"}
    more = {"fill_value": 0, "filters": None, "compressor": {"id": "pickle", "protocol": 5}}
    (store / "label" / ".zarray").write_text(json.dumps(array | more))
    (store / "label" / ".zattrs").write_text('{"_ARRAY_DIMENSIONS": ["theta"]}')
    (store / "label" / "0").write_bytes(pickle.dumps(Touch(tmp_path / "run")))
    for said in (r"must be a result .* in format 3, it lacks pendmap\.json", "cannot be read"):
        with pytest.raises(InputError, match=said):
            pendmap.load(store)
        (store / "pendmap.json").write_text('{"request": null, "files": {}}')
    plotted = pendmap_command("plot", "a.zarr")
    assert plotted.returncode == 2
    assert len(plotted.stderr.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]


def forged(store: Path, name: str, **changes: object) -> None:
    """Change the metadata of an array, with their digest, as a forger may."""
    root, seal = store / "zarr.json", store / "pendmap.json"
    content = json.loads(root.read_bytes())
    content["consolidated_metadata"]["metadata"][name] |= changes
    root.write_text(json.dumps(content))
    content = json.loads(seal.read_bytes())
    content["files"]["zarr.json"] = hashlib.sha256(root.read_bytes()).hexdigest()
    seal.write_text(json.dumps(content))


@pytest.mark.parametrize("codec", ["blosc", "numcodecs.zlib"])
def test_only_known_codecs_are_opened(codec: str, tmp_path: Path) -> None:
    store = pendmap.save(pendmap.melnikov(Pendulum(p=1.0)), tmp_path / "a.zarr")
    forged(store, "p_melnikov", codecs=[{"name": "bytes"}, {"name": codec}])
    with pytest.raises(InputError, match=rf"codecs of p_melnikov must be among .* {codec}"):
        pendmap.load(store)


def test_other_programs_read_a_store(tmp_path: Path) -> None:
    result = pendmap.melnikov(Pendulum(p=1.0), [1.0, 2.0])
    with xr.open_zarr(pendmap.save(result, tmp_path / "a.zarr")) as plain:
        for name, values in result.data_vars.items():
            np.testing.assert_array_equal(plain[name].values, values.values)


@pytest.mark.parametrize("count", [10**6, 10**15])
def test_a_store_of_a_million_chunks_is_not_loaded(count: int, tmp_path: Path) -> None:
    result = pendmap.basins(Pendulum(p=0.6), 4, check=False)
    store = pendmap.save(result, tmp_path / "a.zarr")
    grid = {"name": "regular", "configuration": {"chunk_shape": [1, 1]}}
    forged(store, "label", shape=[count, 1], chunk_grid=grid)
    with pytest.raises(InputError, match=f"label must have {count} chunks, got 1"):
        pendmap.load(store)
