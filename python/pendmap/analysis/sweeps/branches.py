"""Attractors matched along parameters: branches, each with one number over the whole sweep.

An orbit is followed from one model to the next by Newton's method, in halved steps of the
parameters along its tangent where a whole one fails; two orbits are one where that leads from each
to the other without a change of symmetry. Global continuation as by Attractors.jl (Datseris &
Wagemakers 2022, Chaos 32, 023104; Datseris, Luiz Rossi & Wagemakers 2023, Chaos 33, 073151)
compares the distances of sets instead. So are here those of which one has another period or none
that Newton's method finds: what an orbit becomes where its period doubles, chaos. Tumbling chaos
and running states that no orbit locks are followed by their kind alone. Nothing depends on the
order in which the models were mapped or on the direction of a parameter.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap import _core
from pendmap.analysis.orbit_table import distance, matched

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pendmap.analysis.sweeps.tiles import Found, Mapped, Place, SweepTiles
    from pendmap.signal import Floats

    Node = tuple[Place, int]
    """An attractor of a model: the place of the model, and its index there."""

_SAME: Final = 1e-6  # Distance within which two orbits of the integration steps are one
_LIKE: Final = 0.25
"""Largest mean distance between the points of two sets that follow one another."""
_ALONE: Final = ("tumbling_chaos", "quasiperiodic_rotation", "rotation")
"""Kinds that a model has at most once in each sense unless Newton's method finds them."""
_HALVED: Final = 4  # Number of times that a step of the parameters is halved
_NEAR: Final = 2.0**-12  # Part of a step of the parameters over which a tangent is taken


def branches(job: SweepTiles, maps: Mapping[Place, Mapped]) -> dict[Place, list[int]]:
    """Return the numbers from 0 of the branches that the attractors of each model belong to.

    They are counted in the order in which they appear along the parameters, the first one slowest.
    """
    places = sorted(maps)
    joined = _Joined({place: len(maps[place].found) for place in places})
    pairs = [(before, place) for place in places for before in _before(place)]
    links = [link for pair in pairs for link in _links(job, maps, *pair)]
    for _, _, one, other in sorted(links):
        joined.join(one, other)
    for before, after in itertools.pairwise(sorted(_rests(maps, places))):
        if before[0] == after[0]:
            joined.join(before[1], after[1])
    number: dict[Node, int] = {}
    for place in places:
        for k in range(len(maps[place].found)):
            number.setdefault(joined.root((place, k)), len(number))
    return {
        place: [number[joined.root((place, k))] for k in range(len(maps[place].found))]
        for place in places
    }


def _rests(maps: Mapping[Place, Mapped], places: list[Place]) -> Iterator[tuple[str, Node]]:
    """Yield what is at rest, the only one of its name: one also where it repels in between."""
    for place in places:
        names = [_core.Attractor(*attractor.described).plain for attractor in maps[place].found]
        for k, attractor in enumerate(maps[place].found):
            if attractor.kind in ("rest", "inverted_rest") and names.count(names[k]) == 1:
                yield names[k], (place, k)


def _before(place: Place) -> list[Place]:
    """Return the neighbours with the lower value of one of the parameters."""
    lower = (tuple(x - (k == m) for m, x in enumerate(place)) for k in range(len(place)))
    return [one for one in lower if min(one) >= 0]


class _Joined:
    """Sets of attractors, of each model at most one in a set."""

    def __init__(self, counts: Mapping[Place, int]) -> None:
        every = [(place, k) for place, count in counts.items() for k in range(count)]
        self._parent: dict[Node, Node] = {node: node for node in every}
        self._places: dict[Node, set[Place]] = {node: {node[0]} for node in every}

    def root(self, node: Node) -> Node:
        """Return the attractor that stands for the set of another."""
        while self._parent[node] != node:
            self._parent[node] = self._parent[self._parent[node]]
            node = self._parent[node]
        return node

    def join(self, one: Node, other: Node) -> None:
        """Join two sets, unless some model has attractors of both."""
        small, large = sorted((self.root(one), self.root(other)), key=self._size)
        if small != large and self._places[small].isdisjoint(self._places[large]):
            self._parent[small] = large
            self._places[large] |= self._places.pop(small)

    def _size(self, root: Node) -> tuple[int, Node]:
        return len(self._places[root]), root


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

    first, second = ([attractor.points for attractor in attractors] for attractors in (old, new))
    orbits = [(k, m) for k, m in ahead.items() if back.get(m) == k]
    pairs = matched(first, second, reach, orbits, circle=circle)
    return [(near, far, (before, k), (place, m)) for near, far, k, m in pairs]


def _followed(
    job: SweepTiles, maps: Mapping[Place, Mapped], before: Place, place: Place
) -> tuple[dict[int, int], set[int]]:
    """Return the attractor of the next model that each orbit leads to, and those it may lead to."""
    old, new = maps[before].found, maps[place].found
    steps, circle = int(maps[before].measures["steps"]), not _core.counts_turns(job.pendulum)
    first, last = np.array(before, float), np.array(place, float)

    def moved(every: list[Found], points: Mapping[int, Floats], at: float) -> dict[int, Floats]:
        model = job.model((first + at * (last - first)).tolist())
        states = [(*x.tolist(), every[k].n, every[k].symmetric) for k, x in points.items()]
        orbits = zip(points, _core.orbits_near(model, steps, states), strict=True)
        return {k: np.array(one[1]) for k, one in orbits if one and one[0] == every[k].w}

    starts, theirs = ({k: a.points[0] for k, a in enumerate(s) if a.n > 0} for s in (old, new))
    ends, those = moved(old, starts, 1.0), moved(new, theirs, 1.0)
    for k in starts.keys() - ends.keys():
        at, step, point = 0.0, 0.5, starts[k]
        while at < 1.0 and step >= 0.5**_HALVED:
            near = moved(old, {k: point}, at + _NEAR).get(k)
            change = np.zeros(2) if near is None else near[0] - point
            if circle:
                change[0] = math.remainder(change[0], math.tau)
            length = min(step, 1.0 - at)
            orbit = moved(old, {k: point + length / _NEAR * change}, at + length).get(k)
            if orbit is None:
                step *= 0.5
            else:
                at, point = at + length, orbit[0]
        if orbit is not None and at == 1.0:
            ends[k] = orbit
    followed = {}
    for k, points in ends.items():
        alike = [m for m in those if (new[m].n, new[m].w) == (old[k].n, old[k].w)]
        far = {m: distance(points[:1], those[m], circle=circle) for m in alike}
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
