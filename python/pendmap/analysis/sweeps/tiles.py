"""Sweeps of basin maps in tiles: blocks of neighbouring models, each continued from the one before.

In the step ``map`` the first model of a block is searched as one alone; each further one, in a path
along neighbours, starts from the attractors of the model before it. Blocks are fixed: 16 models
along one parameter, 8 x 8 over two.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap import _core
from pendmap.analysis.fractality import uncertainty_exponent
from pendmap.analysis.orbit_table import DESCRIBED
from pendmap.analysis.run import part
from pendmap.analysis.varied import with_values
from pendmap.engine import pack, unpack
from pendmap.errors import InputError, core_errors

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from pendmap.analysis.basin_tiles import Axes
    from pendmap.engine import Store, Work
    from pendmap.model import Pendulum
    from pendmap.signal import Floats

    Place = tuple[int, ...]
    """Index of a model along each parameter."""

STEP: Final = "map"
_STATE: Final = "sweep"  # Record that all blocks need: there is nothing in it
SIDES: Final = {1: (16,), 2: (8, 8)}
"""Models of a block along each parameter: one search alone among 16, or 64."""
_POINTS: Final = 128  # Largest number of points of an attractor that are kept
PLANES: Final = ("basins", "only_chaos", "conservative")
MEASURES: Final = (
    "basin_entropy",
    "boundary_basin_entropy",
    "boundary_stderr",
    "boundary_boxes",
    "neighbours_agree",
    "exponent",
    "exponent_stderr",
    "undecided",
    "failed",
    "plane",
    "bound",
    "chaos_bound",
    "layer_periods",
    "searched",
    "steps",
    "reached_error",
    "periods",
    "unreliable",
    "unreliable_half_step",
    "unreliable_mirror",
    "labels_sampled",
)
"""Numbers of one map, NaN where it has none; ``exponent`` is that of uncertainty."""


@dataclasses.dataclass(frozen=True)
class SweepTiles:
    """The job of a sweep."""

    pendulum: Pendulum
    varied: tuple[list[tuple[str, list[float]]], ...]
    """Names and values of the parameters along each axis, as passed to the core."""
    axes: Axes
    choices: _core._Choices
    at_once: int = 1
    """Number of blocks that this process computes at once."""

    def on(self, threads: int, at_once: int) -> SweepTiles:
        """Return the job with these threads of a block, and blocks at once."""
        choices: _core._Choices = {**self.choices, "threads": threads}
        return dataclasses.replace(self, choices=choices, at_once=at_once)

    @property
    def shape(self) -> Place:
        """Number of values of each parameter."""
        return tuple(len(axis[0][1]) for axis in self.varied)

    @property
    def side(self) -> Place:
        """Number of models of a block along each parameter."""
        return SIDES[len(self.varied)]

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return math.prod(self._blocks)

    @property
    def _blocks(self) -> Place:
        return tuple(-(-n // side) for n, side in zip(self.shape, self.side, strict=True))

    def places(self, tile: int) -> list[Place]:
        """Return the models of a block in the order of their maps: along a snake."""
        corner = np.unravel_index(tile, self._blocks)
        spans = [
            range(int(at) * side, min((int(at) + 1) * side, n))
            for at, side, n in zip(corner, self.side, self.shape, strict=True)
        ]
        if len(spans) == 1:
            return [(k,) for k in spans[0]]
        rows = ([(k, m) for m in (spans[1] if k % 2 == 0 else spans[1][::-1])] for k in spans[0])
        return [*itertools.chain.from_iterable(rows)]

    def model(self, place: Sequence[float]) -> Pendulum:
        """Return the model at a place; between two values where it is no whole number."""
        values: dict[str, float] = {}
        for at, axis in zip(place, self.varied, strict=True):
            for name, levels in axis:  # what two axes have is a product, as in the core
                here = float(np.interp(at, np.arange(len(levels)), levels))
                values[name] = values.get(name, 1.0) * here
        return with_values(self.pendulum, values)  # type: ignore[return-value]

    def inputs(self, store: Store, step: str, tile: int) -> None:
        """Return nothing: a block needs no other one."""

    def tile(
        self,
        step: str,  # noqa: ARG002 (there is one)
        state: bytes,  # noqa: ARG002
        tile: int,
        inputs: Any,  # noqa: ANN401, ARG002
        progress: Any = None,  # noqa: ANN401
    ) -> dict[str, NDArray[Any]]:
        """Map the basins of all models of a block."""
        places, plan = self.places(tile), None
        maps: list[_Map] = []
        for k, place in enumerate(places):
            search, labels = (part(progress, 2 * k + half, 2 * len(places)) for half in (0, 1))
            if search is not None:
                search(0, 1)
            one, model = _Map((self.axes[1][2], self.axes[0][2])), self.model(place)
            with core_errors():
                plan = _core.BasinPlan(model, self.axes, self.choices, None, search, plan)
                one.take(plan, labels, check=self.choices["check"] and k == 0)
            maps.append(one)
        return _packed(maps)

    def run(self, work: Work) -> dict[Place, Mapped]:
        """Compute the blocks that are missing; return the maps of all by their places."""
        work.once(_STATE, lambda: b"none")
        maps: dict[Place, Mapped] = {}
        for tile, record in work.each(STEP, _STATE, range(self.blocks)):
            maps |= _of_block(self, tile, record)
        return {place: maps[place] for tile in range(self.blocks) for place in self.places(tile)}

    def labels(self, store: Store) -> Iterator[tuple[Place, NDArray[np.int16]]]:
        """Yield the labels of all maps by their places."""
        for tile in range(self.blocks):
            label = unpack(store.get(f"{STEP}/{tile}") or {})["label"]
            yield from zip(self.places(tile), label, strict=True)


class _Map:
    """The map of one model over rows and columns of starts."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = shape

    def take(self, plan: _core.BasinPlan, progress: Any, *, check: bool) -> None:  # noqa: ANN401
        """Compute it."""
        cells, texture = plan.map(progress)
        counts = np.bincount(cells.label + 1, minlength=2)
        measures: dict[str, float | None] = dict.fromkeys(MEASURES, math.nan)
        labelled = plan.plane == PLANES[0]
        if labelled and check:
            reliable = plan.reliability(cells.label[plan.checked_starts()])
            measures |= {name: getattr(reliable, name) for name in MEASURES[-4:]}
        attractors, moved = plan.finish(np.ascontiguousarray(counts[2:]))
        self.label = np.concatenate([[-1, 0], moved]).astype(np.int16)[cells.label + 1]
        self.attractors = attractors
        size = cells.label.size
        measures |= {name: getattr(texture, name) for name in MEASURES[:5]}
        if labelled:
            measures |= self._exponent(self.shape)
        measures |= {
            "undecided": 1.0 if plan.plane == PLANES[2] else counts[1] / size,
            "failed": counts[0] / size,
            "plane": PLANES.index(plan.plane),
            "bound": plan.bound,
            "chaos_bound": plan.chaos_bound,
            "layer_periods": plan.layer_periods,
            "searched": plan.searched_starts,
            "steps": plan.steps_per_period,
            "reached_error": plan.reached_error,
            "periods": cells.work / size,
        }
        self.measures = [math.nan if x is None else float(x) for x in measures.values()]

    def _exponent(self, shape: tuple[int, int]) -> dict[str, float | None]:
        """Return the uncertainty exponent of the labels, if they have a boundary."""
        try:
            law = uncertainty_exponent(self.label.reshape(shape))
        except InputError:
            return {}
        return {"exponent": law.value, "exponent_stderr": law.stderr}


def _packed(maps: list[_Map]) -> dict[str, NDArray[Any]]:
    """Return the maps of a block as a record."""
    every = [(k, a) for k, one in enumerate(maps) for a in one.attractors]
    number = [k + 1 for one in maps for k in range(len(one.attractors))]
    groups = [_spread(a.points, a.n) for _, a in every]
    points = np.array([p for group in groups for p in group], dtype=float).reshape(-1, 2)
    columns = {
        name: np.array([getattr(a, name) for _, a in every])
        for name in ("kind", "exponent", "exponent_stderr", "fraction")
    }
    whole = {
        name: np.array([getattr(a, name) or 0 for _, a in every], dtype=np.int32)
        for name in (*DESCRIBED, "twin")
    }
    return pack(
        label=np.stack([one.label for one in maps]),
        measures=np.array([one.measures for one in maps]),
        owner=np.array([k for k, _ in every], dtype=np.int32),
        number=np.array(number, dtype=np.int32),
        count=np.array([len(group) for group in groups], dtype=np.int32),
        points=points,
        **columns,
        **whole,
    )


def _spread(points: Sequence[tuple[float, float]], n: int | None) -> Sequence[tuple[float, float]]:
    """Return all points of an orbit, or some of a chaotic attractor, evenly from their list."""
    few = min(len(points), _POINTS)
    return points if n is not None else [points[k * len(points) // few] for k in range(few)]


@dataclasses.dataclass(frozen=True)
class Found:
    """An attractor of one of the models."""

    kind: str
    n: int
    """Period in forcing periods; 0 if meaningless."""
    w: int
    lean: int
    turn: int
    number: int
    """Number in its model, from 1."""
    twin: int
    """Number of the mirror image from 1, 0 if there is none."""
    exponent: float
    exponent_stderr: float
    fraction: float
    points: Floats
    """Stroboscopic points, shape (M, 2)."""

    @property
    def described(self) -> tuple[str, int, int, int, int]:
        """What names it: kind, period, turns, side and turn."""
        return self.kind, self.n, self.w, self.lean, self.turn

    @property
    def symmetric(self) -> bool | None:
        """Whether it is its own mirror image, None if that is not known."""
        return self.twin == self.number if self.twin else None


@dataclasses.dataclass(frozen=True)
class Mapped:
    """The map of one of the models without its labels, which stay in the store."""

    measures: dict[str, float]
    found: list[Found]


def _of_block(
    job: SweepTiles,
    tile: int,
    data: Any,  # noqa: ANN401 (a record)
) -> Iterator[tuple[Place, Mapped]]:
    read = unpack(data)
    ends = np.cumsum(read["count"])
    keys = [field.name for field in dataclasses.fields(Found)][:-1]
    columns = [read[key].tolist() for key in keys]
    points = np.split(read["points"], ends[:-1]) if ends.size else []
    every = [
        Found(**dict(zip(keys, values, strict=True)), points=states)
        for *values, states in zip(*columns, points, strict=True)
    ]
    for k, place in enumerate(job.places(tile)):
        attractors = [every[m] for m in np.flatnonzero(read["owner"] == k)]
        measures = dict(zip(MEASURES, read["measures"][k].tolist(), strict=True))
        yield place, Mapped(measures, attractors)
