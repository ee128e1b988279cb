"""Computations in tiles: their steps, who computes them, where their records are kept."""

from pendmap.engine.work import FileStore, Store, Work, pack, rounding, unpack

__all__ = ["FileStore", "Store", "Work", "pack", "rounding", "unpack"]
