"""Tiles of the tests in this folder are small."""

from __future__ import annotations

import pytest

import tiled


@pytest.fixture(autouse=True)
def _small_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("basins", "lifetime"):
        monkeypatch.setattr(f"pendmap.analysis.{module}.TILE", tiled.TILE)
