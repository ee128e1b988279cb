"""TOML text: it reads back unchanged, with a table for each entry of a list."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest

from pendmap.files import toml_text

DEEP = {
    "deep": [{"z": [1, {"q": '\n"'}]}],
    "long": {f"{'y' * 10}{i}": {"m": i / 3} for i in range(9)},
    "after": True,
    "e": {},
    "l": [],
}
RUN = {"file": "run_00.csv", "drive": {"p": 0.2, "phi": -1.5}, "ends": [0.5, 2]}


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ({}, ""),
        ({"a b": 1, "x": [DEEP, {}, DEEP], "t": {"u": [{"v": 1}]}, "n": [[1, 2], [{}]]}, None),
        ({"only": [{"name": "a", "of long": {str(i): float(i) for i in range(40)}}]}, None),
        ({"none": [], "mixed": [1, {"a": 2}], "last": 3}, None),
        (
            {"version": 1, "rig": {"w0": 6.2}, "run": [RUN, {"file": "b"}]},
            (
                "version = 1\n"
                "\n[rig]\nw0 = 6.2\n"
                '\n[[run]]\nfile = "run_00.csv"\ndrive = { p = 0.2, phi = -1.5 }\nends = [0.5, 2]\n'
                '\n[[run]]\nfile = "b"\n'
            ),
        ),
    ],
)
def test_written_toml_reads_back(content: dict[str, Any], text: str | None) -> None:
    assert tomllib.loads(toml_text(content)) == content
    assert text in {None, toml_text(content)}


def test_values_that_toml_cannot_hold_are_refused() -> None:
    with pytest.raises(TypeError):
        toml_text({"effect": [{"name": object()}]})
