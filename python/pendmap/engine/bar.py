"""Progress of a computation as a bar, in terminals and notebooks."""

from __future__ import annotations

import shutil
import sys
from typing import Any, Final, Self

from pendmap.formatting import WIDTH

_FORMAT: Final = "{desc}{percentage:3.0f} %|{bar}| {elapsed} passed, {remaining} left"


class ProgressBar:
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
        self._look = {"desc": f"{name} " * bool(name), "leave": leave, "bar_format": _FORMAT}
        self._bar: Any = None

    def __call__(self, done: int, total: int) -> None:
        """Show ``done`` of ``total`` units of work, where it is not known yet 0."""
        done, total = (done, total) if total > 0 else (0, 1)
        if self._bar is None:
            from tqdm.auto import tqdm  # noqa: PLC0415 (when a bar is shown)

            shown = sys.stderr.isatty() or "ipykernel" in sys.modules
            wide = min(WIDTH, shutil.get_terminal_size().columns)
            form: Any = {"miniters": 1, "ncols": wide, "nrows": 24, "disable": not shown}
            self._bar = tqdm(total=total, **form, **self._look)
        elif total != self._bar.total or done < self._bar.n:  # work begins anew
            self._bar.reset(total)
        self._bar.update(done - self._bar.n)
        if done in {0, total}:
            self._bar.refresh()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the bar."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def write(self, text: str) -> None:
        """Write a line above the bar."""
        import tqdm  # noqa: PLC0415 (when a bar is shown)

        tqdm.tqdm.write(text, file=sys.stderr)
