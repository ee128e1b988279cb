"""The table of findings: each text is used, and is given the values that it needs."""

from __future__ import annotations

import ast
import string
from pathlib import Path

import pendmap
from pendmap.records.experiment import texts

PACKAGE = Path(pendmap.__file__).parent / "records"
GIVEN = {"finding": set(), "finding_of": set(), "leave_out": {"number"}, "distrust": {"number"}}


def test_each_finding_of_the_table_is_used_with_the_values_of_its_text() -> None:
    used = set()
    for path in PACKAGE.glob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        used |= {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant)} & set(texts())
        for call in (n for n in ast.walk(tree) if isinstance(n, ast.Call)):
            name = getattr(call.func, "attr", getattr(call.func, "id", ""))
            places = call.args[:2] if name in {"leave_out", "distrust"} else call.args[:1]
            keys = [n.value for n in places if isinstance(n, ast.Constant)]
            if name not in GIVEN or not keys or None in {k.arg for k in call.keywords}:
                continue
            text, _ = texts()[keys[-1]]
            wanted = {field for _, field, _, _ in string.Formatter().parse(text) if field}
            assert not wanted & {"at", "span", "where"}, keys[-1]
            assert wanted <= {k.arg for k in call.keywords} | GIVEN[name], keys[-1]
    assert used == set(texts())
