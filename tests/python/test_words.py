"""Numbers with their errors as text: no small value is rounded away; names of variables."""

from __future__ import annotations

import ast
import math
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

import pendmap
from pendmap.formatting import columns, with_error, wrapped, written

if TYPE_CHECKING:
    from collections.abc import Iterator

PACKAGE = Path(__file__).resolve().parents[2] / "python" / "pendmap"
VAGUE = {"found", "own", "said", "kept", "told", "each"}

sizes = st.floats(-12, 6).map(lambda power: 10.0**power)


@given(value=sizes, negative=st.booleans(), error=sizes)
def test_a_number_is_written_to_a_tenth_of_its_error(
    *, value: float, negative: bool, error: float
) -> None:
    value = -value if negative else value
    said, apart = (float(part) for part in with_error(value, error).split(" +- "))
    assert said == pytest.approx(value, abs=max(0.06 * error, 0.5), rel=5e-3) if error > 1 else True
    if error <= 1:
        assert abs(said - value) <= max(0.06 * error, 5e-3 * abs(value))
        assert apart == pytest.approx(error, rel=0.06)
    assert not written(value, error).startswith("-0.0") or said != 0


@given(value=sizes, negative=st.booleans(), error=st.sampled_from([0.0, math.nan, math.inf]))
def test_without_an_error_there_are_five_digits(
    *, value: float, negative: bool, error: float
) -> None:
    value = -value if negative else value
    assert float(with_error(value, error)) == pytest.approx(value, rel=5e-5)


def test_small_exponents_are_in_summaries() -> None:
    model = pendmap.Pendulum(gamma=2e-5, p=0.0, torque=0.0)
    found = pendmap.lyapunov(model, 0.1, 0.0, max_periods=200)
    result = pendmap.basins(pendmap.Pendulum(gamma=2e-4, p=0.6), pendmap.Grid.square(6))
    text = found.attrs["summary"] + result.attrs["summary"]
    assert "0.0000" not in text
    for exponent in result["exponent"].values:
        assert f"exponent {exponent:.5g}" in result.attrs["summary"]


@given(st.text(alphabet="ab -=%1,:\n", max_size=400))
def test_text_is_broken_between_words_and_keeps_them(text: str) -> None:
    said = wrapped(text, 30)
    assert said.split() == text.split()
    longest = max(map(len, text.split()), default=0) + 4
    assert all(len(line) <= max(30, longest + 8) for line in said.split("\n"))
    assert wrapped(said, 200) == said


def test_a_number_and_its_unit_stay_together() -> None:
    said = wrapped("Of the starts 45.4 % +- 0.1 % end here, and p = 1.7 stands", 20)
    assert said.split("\n") == [
        "Of the starts 45.4 %",
        "  +- 0.1 % end here,",
        "  and p = 1.7 stands",
    ]


def test_a_wide_table_goes_on_below_with_its_first_column() -> None:
    said = columns(["name", "a", "b"], [["x", "1" * 10, "2" * 10]], 20)
    assert said == f"name  a\nx     {'1' * 10}\n\nname  b\nx     {'2' * 10}\n"
    assert columns(["name", "a"], [["x", "1"]]) == "name  a\nx     1\n"
    assert columns(["name", "none", "a"], [["x", "", "1"]]) == "name  a\nx     1\n"


def stored_names(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield line and name of each parameter and variable, without the fields of classes."""
    bodies = [node.body for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    fields = {
        target
        for statement in (line for body in bodies for line in body)
        for target in ast.iter_child_nodes(statement)
        if isinstance(statement, ast.Assign | ast.AnnAssign)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.arg):
            yield node.lineno, node.arg
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node not in fields:
            yield node.lineno, node.id


def test_variables_are_named_by_what_they_hold() -> None:
    vague = [
        f"{path.relative_to(PACKAGE)}:{line}: {name}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for line, name in stored_names(ast.parse(path.read_text("utf-8")))
        if name in VAGUE
    ]
    assert not vague, "names must say what a variable holds:\n" + "\n".join(vague)
