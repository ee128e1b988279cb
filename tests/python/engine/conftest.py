"""Tiles of the tests in this folder are small."""

from __future__ import annotations

import pytest

import tiled


@pytest.fixture(autouse=True)
def _small_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pendmap.analysis.basin_tiles.TILE", tiled.TILE)
