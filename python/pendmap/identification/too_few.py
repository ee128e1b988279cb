"""What a method of peaks says where a record has too few of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pendmap.identification.result import Identification
from pendmap.words import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["too_few"]


def too_few(  # noqa: PLR0913 (what is counted, and how it is said)
    method: str,
    count: int,
    least: int,
    *,
    of: int | None = None,
    where: str = "",
    warnings: Sequence[str] = (),
    because: str = "",
) -> Identification:
    """Return a method that cannot be applied, and how many peaks it lacks.

    Parameters
    ----------
    method : str
        Its name.
    count, least : int
        Peaks that it could use, and how many it needs.
    of : int, optional
        Peaks that the record has, where some of them lie outside what the method may use.
    where : str
        What the method may use, in words, like ``under 12 degrees``.
    warnings : sequence of str
        What was said before.
    because : str
        Why there are no more, in words.
    """
    peaks = counted(count, "peak") if of is None else f"{count} of {counted(of, 'peak')}"
    text = " ".join(part for part in (peaks, where) if part)
    text = f"not applicable: {text}, {least} are needed" + (f": {because}" if because else "")
    return Identification(method, warnings=(*warnings, text), applicable=False)
