"""Maps of a sweep in tiles, blocks of neighbouring models; attractors matched along parameters.

In the step ``map`` the first model of a block is searched as one alone; each further one, in a path
along neighbours, starts from the attractors of the model before it. Blocks are fixed: 16 models
along one parameter, 8 x 8 over two.

A branch has one number over the whole sweep. An orbit is followed from one model to the next by
Newton's method, and where that fails along its branch up to a fold; two orbits are one where that
leads from each to the other without a change of symmetry. What is not joined so, chaos and what an
orbit becomes where its period doubles, is matched by the distances of sets, as Attractors.jl does
(Datseris & Wagemakers 2022, Chaos 32, 023104); tumbling chaos and running states that no orbit
locks are followed by their kind alone.
Nothing depends on the direction of a parameter.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import json
import math
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from pendmap import _core
from pendmap.analysis.basin_tiles import sources
from pendmap.analysis.fractality import uncertainty_exponent
from pendmap.analysis.result import of_core
from pendmap.analysis.run import part
from pendmap.analysis.varied import with_values
from pendmap.engine import pack, unpack
from pendmap.errors import InputError, core_errors

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from pendmap.analysis.basin_tiles import Axes
    from pendmap.engine import Store, Work
    from pendmap.model import Pendulum

    Place = tuple[int, ...]
    """Index of a model along each parameter."""
    Numbers = Mapping[Place, Sequence[int]]
    """Number of the branch, from 0, of each attractor of each map."""
    Node = tuple[Place, int]
    """An attractor of a model: the place of the model, and its index there."""

_STEP: Final = "map"
_STATE: Final = "sweep"  # Record that all blocks need: there is nothing in it
_SIDES: Final = {1: (16,), 2: (8, 8)}
"""Models of a block along each parameter: one search alone among 16, or 64."""
_POINTS: Final = 128  # Largest number of points of an attractor that are kept
PLANES: Final = ("basins", "only_chaos", "conservative")
_SAME: Final = 1e-6  # Distance within which two orbits of the integration steps are one
_LIKE: Final = 0.25  # Largest mean distance between points of sets that follow one another
_ALONE: Final = ("tumbling_chaos", "quasiperiodic_rotation", "rotation")
"""Kinds that a model has at most once in each sense unless Newton's method finds them."""
CHECKS: Final = ("unreliable", "unreliable_half_step", "unreliable_mirror")
LAW: Final = ("uncertainty_exponent", "uncertainty_exponent_stderr")
MEASURES: Final = (
    *("basin_entropy", "boundary_basin_entropy", "boundary_stderr", "neighbours_agree"),
    *("undecided", "failed", "reached_error", "mean_periods"),
)
COUNTS: Final = (
    *("boundary_boxes", "labels_sampled", "bound", "chaos_bound", "searched_starts"),
    "steps_per_period",
)
"""Measures of each map by their names in the core's result; counts are whole numbers."""


class Found(NamedTuple):
    """An attractor of one of the models; numbers from 1, 0 where one has no meaning."""

    kind: str
    n: int
    w: int
    lean: int
    turn: int
    number: int
    twin: int
    exponent: float
    exponent_stderr: float
    fraction: float
    points: Sequence[Sequence[float]]

    @property
    def described(self) -> tuple[str, int, int, int, int]:
        """What names it: kind, period, turns, side and turn."""
        return self[:5]

    @property
    def symmetric(self) -> bool | None:
        """Whether it is its own mirror image, None if that is not known."""
        return self.twin == self.number if self.twin else None


class Mapped(NamedTuple):
    """The map of one of the models without its labels, which stay in the store."""

    measures: dict[str, Any]
    found: list[Found]


@dataclasses.dataclass(frozen=True)
class SweepTiles:
    """The job of a sweep."""

    pendulum: Pendulum
    varied: tuple[list[tuple[str, list[float]]], ...]
    """Names and values of the parameters along each axis, as passed to the core."""
    axes: Axes
    choices: _core._Choices
    threads: int = 1  # Threads of a block
    at_once: int = 1  # Number of blocks that this process computes at once

    @property
    def shape(self) -> Place:
        """Number of values of each parameter."""
        return tuple(len(axis[0][1]) for axis in self.varied)

    @property
    def side(self) -> Place:
        """Number of models of a block along each parameter."""
        return _SIDES[len(self.varied)]

    @property
    def cells(self) -> tuple[int, int]:
        """Number of rows and columns of starts."""
        return self.axes[1][2], self.axes[0][2]

    @property
    def blocks(self) -> Place:
        """Number of blocks along each parameter."""
        return tuple(-(-n // side) for n, side in zip(self.shape, self.side, strict=True))

    def places(self, tile: int) -> list[Place]:
        """Return the models of a block in the order of their maps: along a snake."""
        corner = np.unravel_index(tile, self.blocks)
        spans = [
            range(int(at) * side, min((int(at) + 1) * side, n))
            for at, side, n in zip(corner, self.side, self.shape, strict=True)
        ]
        if len(spans) == 1:
            return [(k,) for k in spans[0]]
        rows = ([(k, m) for m in (spans[1] if k % 2 == 0 else spans[1][::-1])] for k in spans[0])
        return [*itertools.chain.from_iterable(rows)]

    def values(self, place: Place) -> dict[str, float]:
        """Return the values of the parameters at a place."""
        values: dict[str, float] = {}
        for at, axis in zip(place, self.varied, strict=True):
            for name, levels in axis:  # what two axes have is a product, as in the core
                values[name] = values.get(name, 1.0) * levels[at]
        return values

    def model(self, place: Place) -> Pendulum:
        """Return the model at a place."""
        return with_values(self.pendulum, self.values(place))  # type: ignore[return-value]

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
        choices: _core._Choices = {**self.choices, "threads": self.threads}
        labels, maps = [], []
        for k, place in enumerate(places):
            search, labelling = (part(progress, 2 * k + half, 2 * len(places)) for half in (0, 1))
            if search is not None:
                search(0, 1)
            with core_errors():
                plan = _core.BasinPlan(self.model(place), self.axes, choices, None, search, plan)
                label, one = self._mapped(plan, labelling, check=choices["check"] and k == 0)
            labels.append(label)
            maps.append(one)
        text = np.frombuffer(json.dumps(maps).encode(), np.uint8)
        return pack(label=np.stack(labels), maps=text)

    def _mapped(
        self,
        plan: _core.BasinPlan,
        progress: Any,  # noqa: ANN401
        *,
        check: bool,
    ) -> tuple[NDArray[np.int16], Mapped]:
        """Return the labels of one model's map, and the rest of it."""
        cells, texture = plan.map(progress)
        labelled, checked = plan.plane == PLANES[0], None
        if labelled and check:
            checked = plan.reliability(cells.label[plan.checked_starts()])
        counts = np.bincount(cells.label + 1, minlength=2)
        raw = sources(plan, texture, checked, counts, cells.work)
        measures = {name: of_core(name, raw) for name in (*MEASURES, *CHECKS, *COUNTS)}
        measures["plane"] = PLANES.index(plan.plane)
        if checked is None:
            measures |= dict.fromkeys(CHECKS)
        attractors, moved = plan.finish(np.ascontiguousarray(counts[2:]))
        label = np.concatenate([[-1, 0], moved]).astype(np.int16)[cells.label + 1]
        if labelled:
            with contextlib.suppress(InputError):  # there is no boundary
                law = uncertainty_exponent(label.reshape(self.cells))
                measures |= {LAW[0]: law.value, LAW[1]: law.stderr}
        listed = [
            Found(
                *(a.kind, a.n or 0, a.w, a.lean, a.turn, k, a.twin or 0),
                *(a.exponent, a.exponent_stderr, a.fraction, _spread(a.points, a.n)),
            )
            for k, a in enumerate(attractors, 1)
        ]
        return label, Mapped(measures, listed)

    def run(self, work: Work) -> dict[Place, Mapped]:
        """Compute the blocks that are missing; return the maps of all by their places."""
        work.once(_STATE, lambda: b"none")
        maps: dict[Place, Mapped] = {}
        for tile, record in work.each(_STEP, _STATE, range(math.prod(self.blocks))):
            read = json.loads(unpack(record)["maps"].tobytes())
            for place, (measures, attractors) in zip(self.places(tile), read, strict=True):
                maps[place] = Mapped(measures, [Found(*one) for one in attractors])
        return {place: maps[place] for place in np.ndindex(*self.shape)}

    def labels(self, store: Store, numbers: Numbers) -> NDArray[np.int16]:
        """Return the labels of all maps by the numbers of the whole sweep."""
        labels = np.zeros((*self.shape, *self.cells), dtype=np.int16)
        for tile in range(math.prod(self.blocks)):
            label = unpack(store.get(f"{_STEP}/{tile}") or {})["label"]
            for place, one in zip(self.places(tile), label, strict=True):
                moved = np.array([-1, 0, *(k + 1 for k in numbers[place])], dtype=np.int16)
                labels[place] = moved[one + 1].reshape(self.cells)
        return labels


def _spread(points: Sequence[tuple[float, float]], n: int | None) -> Sequence[tuple[float, float]]:
    """Return all points of an orbit, or some of a chaotic attractor, evenly from their list."""
    few = min(len(points), _POINTS)
    return points if n is not None else [points[k * len(points) // few] for k in range(few)]


# ---- matching


def branches(job: SweepTiles, maps: Mapping[Place, Mapped]) -> dict[Place, list[int]]:
    """Return the branches of the attractors of each model, from 0, the first parameter slowest."""
    places = sorted(maps)
    near = [
        link
        for place in places
        for m, at in enumerate(place)
        if at > 0
        for link in _links(job, maps, (*place[:m], at - 1, *place[m + 1 :]), place)
    ]
    links = [(one, other) for _, _, one, other in sorted(near)]
    rests = itertools.pairwise(sorted(_rests(maps, places)))
    links += [(one, other) for (name, one), (same, other) in rests if name == same]
    index = {place: k for k, place in enumerate(places)}
    numbers = [((index[a], k), (index[b], m)) for (a, k), (b, m) in links]
    sizes = [len(maps[place].found) for place in places]
    return dict(zip(places, _core.numbered(sizes, numbers), strict=True))


def _rests(maps: Mapping[Place, Mapped], places: list[Place]) -> Iterator[tuple[str, Node]]:
    """Yield what is at rest, the only one of its name: one also where it repels in between."""
    for place in places:
        names = [_core.Attractor(*attractor.described).plain for attractor in maps[place].found]
        for k, attractor in enumerate(maps[place].found):
            if attractor.kind in ("rest", "inverted_rest") and names.count(names[k]) == 1:
                yield names[k], (place, k)


def _links(
    job: SweepTiles, maps: Mapping[Place, Mapped], before: Place, place: Place
) -> list[tuple[bool, float, Node, Node]]:
    """Return pairs of attractors of two neighbours: whether no orbit leads there, and distance."""
    old, new = maps[before].found, maps[place].found
    circle = not _core.counts_turns(job.pendulum)
    ahead, there = _followed(job, maps, before, place)
    back, here = _followed(job, maps, place, before)

    def reach(k: int, m: int) -> float:
        missed = k in here and m in there and old[k].n == new[m].n
        if missed or not _alike(old[k], new[m]):
            return 0.0
        alone = old[k].kind == new[m].kind in _ALONE and k not in here and m not in there
        return math.inf if alone else _LIKE

    first, second = ([one.points for one in every] for every in (old, new))
    reaches = [[reach(k, m) for m in range(len(new))] for k in range(len(old))]
    orbits = [(k, m) for k, m in ahead.items() if back.get(m) == k]
    pairs = _core.matched(first, second, reaches, orbits, circle)
    return [(near, far, (before, k), (place, m)) for near, far, k, m in pairs]


def _followed(
    job: SweepTiles, maps: Mapping[Place, Mapped], before: Place, place: Place
) -> tuple[dict[int, int], set[int]]:
    """Return the attractor of the next model that each orbit leads to, and those it may lead to."""
    old, new = maps[before].found, maps[place].found
    steps, circle = maps[before].measures["steps_per_period"], not _core.counts_turns(job.pendulum)
    there = job.values(place)

    def moved(every: list[Found], start: Place) -> dict[int, Sequence[Sequence[float]]]:
        along = [(name, value, there[name]) for name, value in job.values(start).items()]
        orbits = {k: a for k, a in enumerate(every) if a.n}
        states = [(a.points[0][0], a.points[0][1], a.n, a.symmetric) for a in orbits.values()]
        near = _core.orbits_near(job.pendulum, along, steps, states)
        ends = zip(orbits, near, strict=True)
        return {k: one[1] for k, one in ends if one and one[0] == every[k].w}

    ends, those = moved(old, before), moved(new, place)
    followed = {}
    for k, points in ends.items():
        alike = [m for m in those if (new[m].n, new[m].w) == (old[k].n, old[k].w)]
        far = {m: _core.distance(points[:1], those[m], circle) for m in alike}
        nearest = min(far, key=far.__getitem__, default=None)
        if nearest is not None and far[nearest] < _SAME:
            followed[k] = nearest
    return followed, {*those}


def _alike(one: Found, other: Found) -> bool:
    """Return whether they may follow one another: equal turns, not one symmetric alone."""
    turns = _family(one) == _family(other)
    if one.n and other.n:
        turns = turns and one.w * other.n == other.w * one.n
    return turns and not {one.symmetric, other.symmetric} >= {True, False}


def _family(attractor: Found) -> tuple[str, bool]:
    """Return what an attractor keeps where its period doubles or it becomes chaotic."""
    if attractor.kind in ("oscillation", "libration_chaos"):
        return "swings", False
    if attractor.kind in ("rotation", "rotating_chaos", "quasiperiodic_rotation"):
        return "turns", attractor.w < 0
    return attractor.kind, False
