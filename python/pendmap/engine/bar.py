"""Progress of a computation as a bar, in terminals and notebooks."""

from __future__ import annotations

import shutil
import sys
from typing import Any, Final

from tqdm.auto import tqdm

from pendmap.formatting import WIDTH

_FORMAT: Final = "{desc}{percentage:3.0f} %|{bar}| {elapsed} passed, {remaining} left"


class ProgressBar(tqdm):  # type: ignore[misc, unused-ignore]
    """Progress of a computation as a bar: the share done, the time passed and left.

    It is the ``progress`` of :class:`pendmap.RunOptions`, ``identify`` and ``diagnose``: a bar of
    tqdm, in a terminal on stderr, in a notebook below the cell. It is not shown in a file.

    Parameters
    ----------
    name : str, optional
        Text before the bar.
    leave : bool, optional
        Whether the bar stays when the work is done.

    Examples
    --------
    >>> import pendmap
    >>> bar = pendmap.ProgressBar("basins")
    >>> run = pendmap.RunOptions(progress=bar)
    >>> result = pendmap.basins(pendmap.Pendulum(p=0.6), 20, run=run)
    """

    def __init__(self, name: str = "", *, leave: bool = True) -> None:
        shown = sys.stderr.isatty() or "ipykernel" in sys.modules
        wide = min(WIDTH, shutil.get_terminal_size().columns)
        form: Any = {"total": 1, "miniters": 1, "ncols": wide, "nrows": 24, "bar_format": _FORMAT}
        super().__init__(desc=f"{name} " * bool(name), leave=leave, disable=not shown, **form)

    def __call__(self, done: int, total: int) -> None:
        """Show ``done`` of ``total`` units of work, where it is not known yet 0."""
        done, total = (done, total) if total > 0 else (0, 1)
        if total != self.total or done < self.n:  # work begins anew
            self.reset(total)
        self.update(done - self.n)
        if done in {0, total}:
            self.refresh()
