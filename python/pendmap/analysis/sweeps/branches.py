"""Attractors matched along parameters: branches, each with one number over the whole sweep.

An orbit is followed from one model to the next by Newton's method, in halved steps of the
parameters where a whole one fails; global continuation as by Attractors.jl (Datseris & Wagemakers
2022, Chaos 32, 023104; Datseris, Luiz Rossi & Wagemakers 2023, Chaos 33, 073151) compares the
distances of sets instead. So are here the attractors that no orbit leads to: chaos, and what an
orbit becomes where its period doubles. Tumbling chaos is followed by its kind alone. Nothing
depends on the order in which the models were mapped.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap import _core
from pendmap.analysis.orbit_table import distance, plain

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pendmap.analysis.sweeps.tiles import Found, Mapped, Place, SweepTiles
    from pendmap.signal import Floats

    Node = tuple[Place, int]
    """An attractor of a model: the place of the model, and its index there."""

_SAME: Final = 1e-4
"""Distance within which an orbit of the integration steps is the precise one."""
_LIKE: Final = 0.25
"""Largest mean distance between the points of two sets that follow one another."""
_EVERYWHERE: Final = "tumbling_chaos"
"""Kind that one attractor of a model has at most; its samples lie apart by their own spacing."""
_HALVED: Final = 4  # Number of times that a step of the parameters is halved


def branches(job: SweepTiles, maps: Mapping[Place, Mapped]) -> dict[Place, list[int]]:
    """Return the numbers from 0 of the branches that the attractors of each model belong to.

    They are counted in the order in which they appear along the parameters, the first one slowest.
    """
    places = sorted(maps)
    joined = _Joined({place: len(maps[place].found) for place in places})
    near: list[tuple[Node, Node]] = []
    for place in places:
        for before in _before(place):
            orbits, others = _links(job, maps, before, place)
            for one, other in orbits:
                joined.join((before, one), (place, other))
            near += [((before, one), (place, other)) for one, other in others]
    for pair in near:
        joined.join(*pair)
    rests = [(place, k) for place in places for k, a in enumerate(maps[place].found) if _rests(a)]
    for both in itertools.pairwise(sorted(rests, key=lambda node: _name(maps, node))):
        if _name(maps, both[0]) == _name(maps, both[1]):
            joined.join(*both)
    number: dict[Node, int] = {}
    for place in places:
        for k in range(len(maps[place].found)):
            number.setdefault(joined.root((place, k)), len(number))
    return {
        place: [number[joined.root((place, k))] for k in range(len(maps[place].found))]
        for place in places
    }


def _rests(own: Found) -> bool:
    """Return whether it is at rest: one attractor also where it repels in between."""
    return own.kind in ("rest", "inverted_rest")


def _name(maps: Mapping[Place, Mapped], node: Node) -> str:
    return maps[node[0]].found[node[1]].name


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
) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Return pairs of attractors of two neighbours: followed as orbits, and near ones."""
    old, new = maps[before].found, maps[place].found
    steps, circle = int(maps[place].measures["steps"]), not _core.counts_turns(job.pendulum)
    orbits, free = [], set(range(len(new)))
    for k, end in enumerate(_followed(job, steps, old, before, place)):
        if end is None:
            continue
        w, point = end
        for m in sorted(free):
            own = new[m]
            if (own.n, own.w) == (old[k].n, w) and distance(
                point, own.points, circle=circle
            ) < _SAME:
                orbits.append((k, m))
                free.discard(m)
                break
    left = [k for k in range(len(old)) if k not in {one for one, _ in orbits}]
    far = {
        (k, m): _apart(old[k].points, new[m].points, circle=circle)
        for k, m in itertools.product(left, sorted(free))
        if _alike(old[k], new[m], k, m)
    }
    others: list[tuple[int, int]] = []
    for k, m in sorted(far, key=lambda pair: (far[pair], pair)):
        taken = any(k == one or m == other for one, other in others)
        near = far[k, m] < _LIKE or old[k].kind == _EVERYWHERE
        if near and not taken:
            others.append((k, m))
    return orbits, others


def _followed(
    job: SweepTiles, steps: int, old: list[Found], before: Place, place: Place
) -> list[tuple[int, Floats] | None]:
    """Return turns and first point of each orbit at the next model, None where it ends."""
    first, last = np.array(before, float), np.array(place, float)
    closed = [k for k, own in enumerate(old) if own.n > 0]
    ends: list[tuple[int, Floats] | None] = [None] * len(old)

    def moved(
        which: list[int], points: Mapping[int, Floats], at: float
    ) -> dict[int, tuple[int, Floats]]:
        model = job.model((first + at * (last - first)).tolist())
        states = [(*points[k].tolist(), old[k].n) for k in which]
        found = _core.orbits_near(model, steps, states)
        return {
            k: (one[0], np.array(one[1]))
            for k, one in zip(which, found, strict=True)
            if one is not None and one[0] == old[k].w
        }

    for k, (w, points) in moved(closed, {k: old[k].points[0] for k in closed}, 1.0).items():
        ends[k] = w, points[:1]
    for k in closed:
        at, step, point = 0.0, 0.5, old[k].points[0]
        while ends[k] is None and step >= 0.5**_HALVED:
            ahead = min(at + step, 1.0)
            found = moved([k], {k: point}, ahead).get(k)
            if found is None:
                step *= 0.5
                continue
            at, point = ahead, found[1][0]
            if at == 1.0:
                ends[k] = found[0], found[1][:1]
    return ends


def _alike(one: Found, other: Found, k: int, m: int) -> bool:
    """Return whether they may follow one another: equal turns, both symmetric or neither."""
    families = _family(one), _family(other)
    turns = families[0] == families[1]
    if one.n and other.n:
        turns = turns and one.w * other.n == other.w * one.n
    symmetric = one.twin == k + 1, other.twin == m + 1
    return turns and symmetric[0] == symmetric[1]


def _family(own: Found) -> tuple[str, str]:
    """Return what an attractor keeps where its period doubles or it becomes chaotic."""
    if own.kind in ("oscillation", "libration_chaos"):
        return "swings", ""
    if own.kind in ("rotation", "rotating_chaos", "quasiperiodic_rotation"):
        backward = own.w < 0 or plain(own.name).endswith("-")
        return "turns", "-" if backward else "+"
    return own.kind, ""


def _apart(one: Floats, other: Floats, *, circle: bool) -> float:
    """Return the larger of the mean distances from the points of one set to the other."""
    return max(distance(one, other, circle=circle), distance(other, one, circle=circle))
