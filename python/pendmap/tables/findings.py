"""Findings about files and records; their texts stand in ``findings.toml``."""

from __future__ import annotations

import dataclasses
import functools

from pendmap.files.toml import packaged


@dataclasses.dataclass(frozen=True)
class Finding:
    """Fault of a record, or assumption made about it.

    Parameters
    ----------
    what : str
        Stable key, like ``"time-gap"``.
    text : str
        One line of plain text.
    mended : bool
        Whether the arrays of the run are corrected; otherwise they are as in the file.
    where : str
        Run, rows of the file or times, if known.
    from_s, to_s : float or None
        Time span, s, if the finding has one.
    """

    what: str
    text: str
    mended: bool = False
    where: str = ""
    from_s: float | None = None
    to_s: float | None = None


@functools.cache
def texts() -> dict[str, tuple[str, bool]]:
    """Return the text of each finding, and whether the record is corrected."""
    tables = packaged("tables/findings.toml").items()
    return {key: (text, kind == "mended") for kind, table in tables for key, text in table.items()}


def finding_of(
    key: str, *, where: str = "", span: tuple[float, float] | None = None, **values: object
) -> Finding:
    """Return a finding, with values in the braces of its text, over a span of time in s."""
    text, mended = texts()[key]
    low, high = span or (None, None)
    return Finding(key.partition(".")[0], text.format(**values), mended, where, low, high)
