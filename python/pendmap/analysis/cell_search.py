"""Search for attractors in each of many models: over two parameters, or along one.

Its tiles are blocks of 16 x 16 cells. In the step ``search-0`` each block is searched on its own.
Each step ``search-N`` searches cells again from attractors of cells nearby that they lack, and
reads only what the step before has found in the block and in those around it; the last one gains
nothing.
"""

from __future__ import annotations

import dataclasses
import functools
import pickle
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap import _core
from pendmap.analysis import result, varied
from pendmap.analysis.grid import Grid
from pendmap.analysis.orbit_table import DESCRIBED, described
from pendmap.analysis.result import Field, Found
from pendmap.analysis.summary import cost, undecided, window_said
from pendmap.errors import MOST_CELLS, check_type, check_whole, core_errors
from pendmap.files import facts
from pendmap.files.variables import variable
from pendmap.formatting import counted, percent
from pendmap.model import without_dimensions
from pendmap.units import RATE, VELOCITY, Units

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Mapping, Sequence

    import xarray as xr

    from pendmap.analysis.result import Schema
    from pendmap.analysis.run import Numerics, RunOptions
    from pendmap.engine import Store, Work
    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats

    Made = tuple[_core.ParameterMap, xr.Dataset, dict[str, Any]]
    """The core's result, the dataset, facts."""

UNDECIDED: Final = "undecided"  # Kind of a cell in which no attractor was found
_SPREAD: Final = 1000  # Cells on each side of the default box, without effect
_PLASTIC: Final = 1.324717957244746  # Its powers give an even additive recurrence in the plane
_CELLS: Final = 61  # Cells after which starts repeat: a prime, so that columns differ too
_STEP: Final = "search-"  # Beginning of the names of steps
_GAINED: Final = {False: b"-", True: b"+"}
"""First byte of a record: whether a cell has gained an attractor; alone if nothing changed."""

SEARCH: Final = (
    Field("starts", "1", "initial conditions of each pendulum"),
    Found("missed", "1", "share of the box that all starts of a cell miss at a chance of 5 %"),
    Found("undecided", "1", "share of the starts not captured", variable="undecided_share"),
    Found("failed", "1", "share of the starts that failed or diverged", variable="failed_share"),
    Found("chaos_periods", "periods", "least; 0: no chaos", variable="least_chaos_periods"),
    *varied.DRIVE,
    *result.TIMED,
    result.REACHED,
    *result.END,
    result.SECTION,
    *result.BOX,
    result.TOL.hidden,
    result.SEED.hidden,
    *result.VERSIONS,
)
"""Fields of a search for attractors in many pendulums."""


def spread(grid: Grid, count: int, seed: int = 0) -> tuple[Floats, ...]:
    """Return angles and velocities that cover a box evenly; no two are mirror images."""
    shift = 0.5 + (seed * 0.6180339887498949) % 1.0
    # k = 0 may be the centre, where a pendulum at rest stays even if that is unstable.
    k = 1 + np.arange(count)
    parts = [(shift + k / _PLASTIC**power) % 1.0 for power in (1, 2)]
    ends = [(axis.low, axis.high - axis.low) for axis in (grid.theta, grid.velocity)]
    theta, velocity = (low + width * part for (low, width), part in zip(ends, parts, strict=True))
    return theta, velocity


class CellSearch:
    """A search in each model along one or two axes, in a box, by default that of basins."""

    def __init__(
        self,
        model: Pendulum | Rig,
        axes: Sequence[varied.Varied],
        starts: int,
        box: Grid | None,
        numerics: Numerics,
    ) -> None:
        self.model, self.axes, self.numerics = model, axes, numerics
        self.starts = check_whole("starts", starts, 1, MOST_CELLS)
        self.box = Grid.square(_SPREAD, model.units.given(1.0, VELOCITY)) if box is None else box
        check_type("box", self.box, Grid, "Grid.square(100)")

    def result(
        self,
        schema: Schema,
        make: Callable[[_core.Survey, list[bytes]], Made],
        summary: Callable[[xr.Dataset], list[str]],
        request: Mapping[str, Any],
    ) -> xr.Dataset:
        """Return the result that ``make`` makes of the blocks; ``request`` has more arguments."""
        bare, units = without_dimensions(self.model)
        numerics, run = self.numerics, self.numerics.run
        theta, velocity = spread(self.box, _CELLS * self.starts, run.seed)
        initial = theta, units.bare(velocity, VELOCITY), self.starts
        limits = numerics.tol, numerics.max_periods
        job = _Blocks(bare, tuple(axis.kernel for axis in self.axes), initial, limits)

        def compute(work: Work) -> xr.Dataset:
            with core_errors():
                raw, dataset, values = make(*job.run(work, run))
            values |= {
                **numerics.provenance(),
                **self.box.attributes,
                "starts": self.starts,
                "missed": result.missed(self.starts),
                "undecided": float(raw.undecided.mean()),
                "chaos_periods": min((int(n) for n in raw.chaos_periods if n), default=0),
                "failed": float(raw.failed.mean()),
            }
            varied.complete(
                *(schema, dataset, self.model, self.axes, values, raw),
                summary=lambda one: [*summary(one), *self._findings(one)],
                what="attractors are",
            )
            return dataset

        arguments = {"ranges": [axis.request for axis in self.axes], **numerics.request, **request}
        arguments |= {"starts": self.starts, "box": self.box}
        return run.complete(schema.kind, self.model, arguments, job, compute)

    def _findings(self, dataset: xr.Dataset) -> list[str]:
        """Return summary lines on what the starts may have missed, chaos, undecided starts."""
        a, box = facts(dataset), self.box
        cells, cell = dataset["undecided"].size, "value" if len(self.axes) == 1 else "cell"
        one, every = (percent(100 * result.missed(n * self.starts)) for n in (1, cells))
        starts = f"{counted(self.starts, 'start')} a {cell}"
        lines = [f"{starts} may miss attractors with {one} of the box, all with {every} (95 %)."]
        if a["least_chaos_periods"]:
            periods = counted(a["least_chaos_periods"], "period")
            lines.append(
                f"Chaos: not captured within {periods}; a longer transient looks the same."
            )
        window = window_said(box.theta.as_tuple, box.velocity.as_tuple, Units.of(a))
        return [*lines, *undecided(a, ending="_share"), f"The box is {window}; {cost(a)}"]


def variables(
    raw: _core.ParameterMap, dims: tuple[Hashable, ...], shape: tuple[int, ...], units: Units
) -> dict[str, Any]:
    """Return shares of starts over ``dims``, all kinds, and all attractors over ``entry``."""
    one, rate = "entry", units.of_rate
    velocity = units.given(raw.velocity, VELOCITY)
    growth, error = (units.given(values, RATE) for values in (raw.exponent, raw.exponent_stderr))
    of_cells = raw.undecided, raw.failed, raw.chaos_periods
    lost, failed, watched = (values.reshape(shape) for values in of_cells)
    names = [kind.name for kind in raw.kinds]
    place, chaos = "cell of the whole result, row by row", "time for which chaos was not captured"
    kind = variable(one, raw.kind, "", "kind of attractor", flags=dict(enumerate(names)))
    return {
        "undecided": variable(dims, lost, "1", "share of the starts that no attractor captured"),
        "failed": variable(dims, failed, "1", "share of the starts that failed or diverged"),
        "chaos_periods": variable(dims, watched, "periods", chaos, "0: no chaos"),
        "kind": variable("kind", np.array(names, dtype=str), long_name="kind of attractor"),
        **described(raw.kinds, "kind", "kind_"),
        "entry_cell": variable(one, raw.cell, "1", place),
        "entry_kind": kind,
        "entry_n": variable(one, raw.n, *DESCRIBED["n"]),
        "entry_w": variable(one, raw.w, *DESCRIBED["w"]),
        **result.point(one, raw.theta, velocity, units.of_velocity, "entry_{}"),
        "entry_exponent": variable(one, growth, rate, "largest Lyapunov exponent"),
        "entry_exponent_stderr": variable(one, error, rate, "standard error of the exponent"),
        "entry_share": variable(one, raw.share, "1", "share of the starts"),
    }


@dataclasses.dataclass(frozen=True)
class _Blocks:
    """The job of a search."""

    pendulum: Pendulum
    axes: tuple[list[tuple[str, list[float]]], ...]
    initial: tuple[Floats, Floats, int]
    limits: tuple[float, int | None]
    """Tolerance and bound as passed to the core."""
    threads: int = 1  # Threads of a block
    at_once: int = 1  # Number of blocks that this process computes at once

    def survey(self, state: bytes | None) -> _core.Survey:
        """Return the survey whose steps ``state`` has, or measure them."""
        many = *self.initial, *self.limits, self.threads, state
        with core_errors():
            return _core.Survey(self.pendulum, self.axes, *many)

    def inputs(self, store: Store, step: str, tile: int) -> dict[int, bytes]:
        """Return what the step before has found in a block and in those around it."""
        number, state = int(step.removeprefix(_STEP)), store.get("survey") or b""
        around = _restored(pickle.dumps(self), state).around(tile) if number else []
        return {block: _last(store, number - 1, block) for block in around}

    def tile(
        self,
        step: str,
        state: bytes,
        tile: int,
        inputs: dict[int, bytes],
        progress: Any = None,  # noqa: ANN401
    ) -> bytes:
        """Search a block, or exchange with the blocks around it."""
        survey, number = _restored(pickle.dumps(self), state), int(step.removeprefix(_STEP))
        with core_errors():
            if number == 0:
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
        every, last = range(survey.blocks), 0
        for last in range(survey.passes + 1):
            records = work.each(f"{_STEP}{last}", "survey", every)
            gained = [record[:1] == _GAINED[True] for _, record in records]
            if not any(gained):
                break
        return survey, [_last(work.store, last, block) for block in every]


def _last(store: Store, number: int, block: int) -> bytes:
    """Return the result of a block after a step."""
    for step in range(number, -1, -1):
        record = store.get(f"{_STEP}{step}/{block}") or b""
        if len(record) > 1:
            return record[1:]
    raise RuntimeError(f"block {block} is not in the store")


@functools.lru_cache(maxsize=2)
def _restored(job: bytes, state: bytes) -> _core.Survey:
    """Return the survey of a job, made once in each process."""
    blocks: _Blocks = pickle.loads(job)  # noqa: S301 (of this process)
    return blocks.survey(state)
