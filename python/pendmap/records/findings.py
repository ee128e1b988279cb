"""Findings by their keys; what each says stands in ``findings.toml``."""

from __future__ import annotations

import functools
import tomllib
from importlib import resources

from pendmap.records.experiment import Finding


@functools.cache
def texts() -> dict[str, tuple[str, bool]]:
    """Return the text of each finding, and whether the record is corrected."""
    content = resources.files("pendmap.records").joinpath("findings.toml").read_text("utf-8")
    tables = tomllib.loads(content).items()
    return {key: (text, kind == "mended") for kind, table in tables for key, text in table.items()}


def finding_of(
    key: str, *, where: str = "", span: tuple[float, float] | None = None, **values: object
) -> Finding:
    """Return a finding, with values in the braces of its text, over a span of time in s."""
    text, mended = texts()[key]
    low, high = span or (None, None)
    return Finding(key.partition(".")[0], text.format(**values), mended, where, low, high)
