"""Adaptive basin maps: blocks of cells inside which every label follows from those around it.

A block is a square of the grid's cells with its rim, whose cells it shares with its neighbours; its
side, the distance between opposite rims, is 40 cells first. Where all cells of the rim have one
label, the cells inside get it: they are filled. Else the block is split into four, down to a side
of 5 cells, of which all cells are computed. So are those of a block whose four quarters have
several labels on their rims each: a smooth boundary that crosses a block misses one of its
quarters. What is undecided or failed is never filled. (Rims before insides: the algorithm of
Mariani & Silver; A. K. Dewdney 1989, Scientific American 260 (2), 108.)

Blocks begin at multiples of 40 cells from the first cell of the grid, and what is computed in one
depends on its own cells alone: not on tiles, if those begin with a row of blocks.
"""

from pendmap.analysis.adaptive.audit import (
    COMPUTED,
    FACTS,
    FIELDS,
    HOW,
    NO_TURNS,
    Tally,
    audit_again,
    said,
)
from pendmap.analysis.adaptive.blocks import SIDE, refined, tried

__all__ = [
    "COMPUTED",
    "FACTS",
    "FIELDS",
    "HOW",
    "NO_TURNS",
    "SIDE",
    "Tally",
    "audit_again",
    "refined",
    "said",
    "tried",
]
