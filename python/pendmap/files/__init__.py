"""File access: atomic writing, TOML, and results as NetCDF or Zarr (``files.dataset``)."""

from pendmap.files.atomic import (
    COMPLETE,
    STOPS,
    check_regular,
    check_room,
    held_interrupts,
    move_folder,
    read_whole,
    whole_file,
    whole_folder,
)
from pendmap.files.scalars import facts, with_facts
from pendmap.files.toml import read_toml, toml_text

__all__ = [
    "COMPLETE",
    "STOPS",
    "check_regular",
    "check_room",
    "facts",
    "held_interrupts",
    "move_folder",
    "read_toml",
    "read_whole",
    "toml_text",
    "whole_file",
    "whole_folder",
    "with_facts",
]
