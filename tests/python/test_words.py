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

sizes = st.tuples(st.floats(-12, 6), st.sampled_from([-1, 1])).map(lambda x: x[1] * 10.0 ** x[0])


@given(value=sizes, error=sizes.map(abs))
def test_a_number_is_written_to_a_tenth_of_its_error(value: float, error: float) -> None:
    shown, apart = (float(part) for part in with_error(value, error).split(" +- "))
    if error > 1:
        assert shown == pytest.approx(value, abs=max(0.06 * error, 0.5), rel=5e-3)
    else:
        assert abs(shown - value) <= max(0.06 * error, 5e-3 * abs(value))
        assert apart == pytest.approx(error, rel=0.06)
    assert not written(value, error).startswith("-0.0") or shown != 0


@given(value=sizes, error=st.sampled_from([0.0, math.nan, math.inf]))
def test_without_an_error_there_are_five_digits(value: float, error: float) -> None:
    assert float(with_error(value, error)) == pytest.approx(value, rel=5e-5)


def test_small_exponents_are_in_summaries() -> None:
    result = pendmap.basins(pendmap.Pendulum(gamma=2e-4, p=0.6), pendmap.Grid.square(6))
    assert "0.0000" not in result.attrs["summary"]
    for exponent in result["exponent"].values:
        assert f"exponent {exponent:.5g}" in result.attrs["summary"]


@given(st.text(alphabet="ab -=%1,:\n", max_size=400))
def test_text_is_broken_between_words_and_keeps_them(text: str) -> None:
    lines = wrapped(text, 30)
    assert lines.split() == text.split()
    longest = max(map(len, text.split()), default=0) + 4
    assert all(len(line) <= max(30, longest + 8) for line in lines.split("\n"))
    assert wrapped(lines, 200) == lines
    # A number and its unit stay together.
    lines = wrapped("Of the starts 45.4 % +- 0.1 % end here, and p = 1.7 stands", 20)
    assert lines == "Of the starts 45.4 %\n  +- 0.1 % end here,\n  and p = 1.7 stands"


def test_a_wide_table_goes_on_below_with_its_first_column() -> None:
    wide = columns(["name", "a", "b"], [["x", "1" * 10, "2" * 10]], 20)
    assert wide == f"name  a\nx     {'1' * 10}\n\nname  b\nx     {'2' * 10}\n"
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
