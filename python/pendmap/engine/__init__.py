"""Computations in tiles: where their results are kept, and who computes them."""

from pendmap.engine.executors import executor_of
from pendmap.engine.lock import held
from pendmap.engine.store import Layout, MemoryStore, Store, pack, unpack
from pendmap.engine.work import Job, Tile, Work, rounding
from pendmap.engine.zarr_store import ZarrStore

__all__ = [
    "Job",
    "Layout",
    "MemoryStore",
    "Store",
    "Tile",
    "Work",
    "ZarrStore",
    "executor_of",
    "held",
    "pack",
    "rounding",
    "unpack",
]
