"""How long a command will take, told once from its progress in the first seconds."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Final

from pendmap.formatting import duration

if TYPE_CHECKING:
    from collections.abc import Callable

_LONG: Final = 60.0  # Time left that is worth a line, s
_SOON: Final = (3.0, 0.05)  # Time, s, and share of the work from which on both tell the rest
_LATE: Final = (10.0, 1e-4)  # Likewise for long work: later, and less of it


class Forecast:
    """Time that is left, from the pace of a command since its present part began.

    A part of a computation begins where the work done falls, or where its total changes.
    """

    def __init__(
        self, say: Callable[[str], object], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._say, self._clock = say, clock
        self._began = self._since = clock()
        self._total, self._first, self._done = 0, 0, 0
        self._said = False

    def report(self, done: int, total: int) -> None:
        """Take units of work done and in total; tell the time once, if it is more than a minute."""
        now = self._clock()
        if total != self._total or done < self._done:
            self._since, self._total, self._first = now, total, done
        self._done = done
        if self._said or total <= 0:
            return
        passed, share = now - self._since, (done - self._first) / total
        enough = any(passed >= seconds and share >= part for seconds, part in (_SOON, _LATE))
        if not enough:
            return
        left = passed * (total - done) / (done - self._first)
        if left > _LONG:
            self._said = True
            self._say(f"This takes about {duration(now - self._began + left)}.")
