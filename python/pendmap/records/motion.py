"""x."""
from __future__ import annotations
from typing import TYPE_CHECKING
if TYPE_CHECKING:
    from pendmap.records.work import Work
def check(work: Work) -> None:
    pass
