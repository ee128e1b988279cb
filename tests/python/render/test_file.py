"""Files of figures: complete or absent, reproducible; bad input is refused."""

from __future__ import annotations

import math
import struct
import subprocess
import sys
import tracemalloc
from typing import TYPE_CHECKING

import numpy as np
import pytest

import synthetic
from drawn import titles
from pendmap import InputError, render

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr


@pytest.mark.parametrize(
    ("suffix", "magic"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")]
)
def test_files_are_complete_and_reproducible(tmp_path: Path, suffix: str, magic: bytes) -> None:
    dataset = synthetic.painted()
    first = render.draw(dataset, tmp_path / f"a.{suffix}")
    second = render.draw(dataset, str(tmp_path / f"b.{suffix}"))
    assert first.read_bytes().startswith(magic)
    assert first.read_bytes() == second.read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"a.{suffix}", f"b.{suffix}"]


@pytest.mark.parametrize("size", [(7.5, 5.0), (0.5, 1.0), (100.0, 2.0)])
def test_size_and_resolution_are_as_requested(tmp_path: Path, size: tuple[float, float]) -> None:
    file = render.draw(synthetic.painted(), tmp_path / "a.png", size=size, dpi=80)
    assert struct.unpack(">II", file.read_bytes()[16:24]) == (80 * size[0], 80 * size[1])


def test_one_layer_is_drawn_alone_in_a_colour_map() -> None:
    for name in (None, "cividis"):
        figure = render.figure_of(synthetic.painted(), layer="settle", colormap=name)
        assert len(titles(figure)) == 1
        assert figure.axes[0].images[-1].cmap.name == name or "viridis"


@pytest.mark.parametrize(
    ("name", "options", "says"),
    [
        ("a.jpg", {}, r"suffix must be \.png or \.svg or \.pdf, got '\.jpg'"),
        ("a", {}, r"suffix must be .*, got ''"),
        ("a.png", {"layer": "exponent"}, "'exponent'.*labels, settle, turns"),
        ("a.png", {"colormap": "rainbowish"}, "'rainbowish'.*viridis"),
        ("a.png", {"layer": "labels", "colormap": "viridis"}, "attractor"),
        ("a.png", {"size": (math.nan, 5.0)}, "nan"),
        ("a.png", {"size": (30.0, 5.0), "dpi": 1000}, "20000 pixels"),
        ("a.png", {"dpi": 5}, "dpi 5"),
        ("no/a.png", {}, "folder does not exist"),
        ("a.png", {"dpi": math.nan}, "dpi nan"),
    ],
)
def test_bad_input_is_refused_and_leaves_nothing(
    tmp_path: Path, name: str, options: dict[str, object], says: str
) -> None:
    with pytest.raises((InputError, FileNotFoundError), match=says):
        render.draw(synthetic.painted(), tmp_path / name, **options)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_large_maps_are_converted_in_parts(tmp_path: Path) -> None:
    peaks = []
    for side in (1200, 2600):
        dataset = enlarged(synthetic.painted(synthetic.USUAL[:3], (10, 10), undecided=4), side)
        render.draw(dataset, tmp_path / "warm.png")
        tracemalloc.start()
        render.draw(dataset, tmp_path / "a.png")
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 2600 * 2600, "more than one byte a cell beyond the thinned map"


def enlarged(dataset: xr.Dataset, side: int) -> xr.Dataset:
    """Return a map of ``side`` squared cells, with its arrays in memory."""
    index = np.arange(side) * dataset.sizes["theta"] // side
    return (
        dataset.isel(theta=index, velocity=index)
        .assign_coords(
            theta=synthetic.centres(-math.pi, math.pi, side),
            velocity=synthetic.centres(-3, 3, side),
        )
        .load()
    )


def test_neither_library_is_loaded_before_it_is_needed() -> None:
    code = (
        "import sys; from pendmap.charts import legend, palette, plane;"
        "assert not {'matplotlib', 'rerun'} & set(sys.modules);"
        "from pendmap import render;"
        "assert not {'matplotlib.pyplot', 'rerun'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
