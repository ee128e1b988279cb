"""Maps over parameters in tiles: blocks of cells, searched apart, then exchanging their attractors.

In the step ``search`` each block of 16 x 16 cells is searched on its own. Each step ``exchange-N``
searches cells again from attractors of cells nearby that they lack, and reads only what the step
before has found in the block and in those around it; the last one gains nothing.
"""

from __future__ import annotations

import dataclasses
import functools
import pickle
from typing import TYPE_CHECKING, Any, Final

from pendmap import _core
from pendmap.errors import core_errors

if TYPE_CHECKING:
    from pendmap.analysis.run import RunOptions
    from pendmap.engine import Store, Work
    from pendmap.model import Pendulum
    from pendmap.signal import Floats

_SEARCH: Final = "search"
_GAINED: Final = {False: b"-", True: b"+"}
"""First byte of a record: whether a cell has gained an attractor; alone if nothing changed."""


@dataclasses.dataclass(frozen=True)
class SurveyTiles:
    """The job of a map over two parameters, or of a diagram over one."""

    pendulum: Pendulum
    axes: tuple[list[tuple[str, list[float]]], ...]
    initial: tuple[Floats, Floats, int]
    limits: tuple[float, int | None]
    """Tolerance and bound as passed to the core."""
    threads: int = 1
    """Threads of a block."""
    at_once: int = 1
    """Number of blocks that this process computes at once."""

    def survey(self, state: bytes | None) -> _core.Survey:
        """Return the survey whose steps ``state`` has, or measure them."""
        with core_errors():
            return _core.Survey(
                self.pendulum, self.axes, *self.initial, *self.limits, self.threads, state
            )

    def inputs(self, store: Store, step: str, tile: int) -> dict[int, bytes]:
        """Return what the step before has found in a block and in those around it."""
        if step == _SEARCH:
            return {}
        number, state = _number(step), store.get("survey") or b""
        around = _restored(pickle.dumps(self), state).around(tile)
        return {block: _found(store, number - 1, block) for block in around}

    def tile(
        self,
        step: str,
        state: bytes,
        tile: int,
        inputs: dict[int, bytes],
        progress: Any = None,  # noqa: ANN401
    ) -> bytes:
        """Search a block, or exchange with the blocks around it."""
        survey, number = _restored(pickle.dumps(self), state), _number(step)
        with core_errors():
            if step == _SEARCH:
                return _GAINED[True] + survey.search(tile, progress=progress)
            exchanged = survey.exchange(number, tile, inputs, progress=progress)
            gained = survey.gained(number, tile, exchanged or inputs[tile])
        return _GAINED[gained] + (exchanged or b"")

    def run(self, work: Work, run: RunOptions) -> tuple[_core.Survey, list[bytes]]:
        """Compute the blocks that are missing; return the survey and the last result of each."""
        whole = dataclasses.replace(self, threads=run.workers)
        state = work.once("survey", lambda: whole.survey(None).state)
        survey = whole.survey(state)
        threads, at_once = run.tiles(survey.blocks)
        work.job = dataclasses.replace(self, threads=threads, at_once=at_once)
        every = range(survey.blocks)
        for _ in work.each(_SEARCH, "survey", every):
            pass
        last = 0
        for number in range(1, survey.passes + 1):
            records = work.each(f"exchange-{number}", "survey", every)
            gained = [record[:1] == _GAINED[True] for _, record in records]
            last = number
            if not any(gained):
                break
        return survey, [_found(work.store, last, block) for block in every]


def _number(step: str) -> int:
    """Return the number of an exchange, 0 for the search."""
    return 0 if step == _SEARCH else int(step.removeprefix("exchange-"))


def _found(store: Store, number: int, block: int) -> bytes:
    """Return the result of a block after a step."""
    for step in range(number, -1, -1):
        record = store.get(f"exchange-{step}/{block}" if step else f"{_SEARCH}/{block}") or b""
        if len(record) > 1:
            return record[1:]
    raise RuntimeError(f"block {block} is not in the store")


@functools.lru_cache(maxsize=2)
def _restored(job: bytes, state: bytes) -> _core.Survey:
    """Return the survey of a job, made once in each process."""
    tiles: SurveyTiles = pickle.loads(job)  # noqa: S301 (of this process)
    return tiles.survey(state)
