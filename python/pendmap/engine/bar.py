"""Progress of a computation as a bar, in terminals and notebooks."""

from __future__ import annotations

import importlib.util
import shutil
import sys
import threading
from typing import TYPE_CHECKING, Any, Final, Self

from pendmap.formatting import WIDTH

if TYPE_CHECKING:
    from types import TracebackType

_FORMAT: Final = "{desc}{percentage:3.0f} %|{bar}| {elapsed} passed, {remaining} left"
_OFTEN: Final = 0.1  # Time between two pictures of the bar, s
_SECOND: Final = 1.0


class ProgressBar:
    """Progress of a computation as a bar: the share done, the time passed and left.

    It is the ``progress`` of :class:`pendmap.RunOptions`, ``identify`` and ``diagnose``. In a
    terminal the bar is on stderr; in a notebook below the cell, a widget where ipywidgets is
    installed. It is not shown where stderr is a file.

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
        self._name, self._leave = name, leave
        self._bar: Any = None
        self._total = 0
        self._ended = threading.Event()

    def __call__(self, done: int, total: int) -> None:
        """Show ``done`` of ``total`` units of work; where they begin anew, the bar does too.

        Where the total is not known yet, 0, only the time passes.
        """
        if total <= 0:
            done, total = 0, 1
        before, self._total = self._total, total
        if self._bar is None:
            self._bar = self._begun(total)
            self._ended.clear()
            threading.Thread(target=self._tick, args=[self._bar], daemon=True).start()
        elif total != before or done < self._bar.n:
            self._bar.reset(total)
        self._bar.update(done - self._bar.n)
        if done in {0, total}:
            self._bar.refresh()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        where: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the bar."""
        self._ended.set()
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def write(self, text: str) -> None:
        """Write a line above the bar."""
        import tqdm  # noqa: PLC0415 (when a bar is shown)

        tqdm.tqdm.write(text, file=sys.stderr)

    def _tick(self, bar: Any) -> None:  # noqa: ANN401 (of tqdm)
        """Let the time on the bar pass while nothing is reported."""
        while not self._ended.wait(_SECOND):
            if bar.n < self._total:
                bar.refresh()

    def _begun(self, total: int) -> Any:  # noqa: ANN401 (of tqdm)
        import tqdm  # noqa: PLC0415 (when a bar is shown)

        make: Any = tqdm.tqdm
        more: dict[str, bool | None] = {"disable": None}
        if _in_notebook():
            more = {"disable": False}
            if importlib.util.find_spec("ipywidgets") is not None:
                import tqdm.notebook  # noqa: PLC0415 (an extra of notebooks)

                make = tqdm.notebook.tqdm
        return make(
            total=total,
            desc=f"{self._name} " if self._name else None,
            bar_format=_FORMAT,
            ncols=min(WIDTH, shutil.get_terminal_size((WIDTH, 24)).columns),
            nrows=24,
            mininterval=_OFTEN,
            miniters=1,
            leave=self._leave,
            **more,
        )


def _in_notebook() -> bool:
    """Return whether this process is the kernel of a notebook."""
    shell = sys.modules.get("IPython")
    interpreter = shell.get_ipython() if shell is not None else None
    return interpreter is not None and getattr(interpreter, "kernel", None) is not None
