"""Samples of a sweep: a few neighbouring models at places spread over its ranges.

In a sweep with g starts each a model takes F + k (g - g0) if it is searched alone, as the first of
each block is, and C + k (g - g0) if it starts from its neighbour. Some neighbours tell F and C,
those with more starts k where g is large. Places are added until the standard error of the sum is
small. Then each model takes what the nearest place tells, which gives the time of each block, and
the threads take block after block. What files take has the same form with one fixed part.
"""

from __future__ import annotations

import dataclasses
import heapq
import itertools
import math
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.spatial import cKDTree

from pendmap import _core
from pendmap.analysis.sweeps.tiles import SIDES
from pendmap.cli.planning.request import Request, fewer_starts
from pendmap.cli.planning.samples import Estimate, peak, timed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import xarray as xr

    from pendmap.cli.planning.request import Run, Save
    from pendmap.signal import Floats

_NEIGHBOURS: Final = 3  # Models of a place
_FEWEST: Final = 8  # Places at least
_WRITTEN: Final = 4  # Places whose files are written
_TOLD: Final = 12  # Places that tell a standard error
_ERROR: Final = 0.1  # Relative standard error of the time that is small enough
_SHARE: Final = 0.25  # Part of the whole time that samples may take
_STARTS: Final = (40_000, 160_000)  # Most starts of a map of a sample, and of one with more


@dataclasses.dataclass(frozen=True)
class Places:
    """The places of a sweep, and how a quantity sampled there extends to all of it."""

    request: Request

    @property
    def along(self) -> str:
        """Parameter along which neighbours are taken: the one with most values."""
        counts = self.request.counts
        return max(counts, key=counts.__getitem__)

    @property
    def neighbours(self) -> int:
        """Number of models of a place."""
        return min(_NEIGHBOURS, self.request.counts[self.along])

    @property
    def starts(self) -> tuple[int, int, int]:
        """Number of starts of a map: few, more, all."""
        grid = self.request.arguments["grid"]
        few, more = (fewer_starts(grid, most).cells for most in _STARTS)
        return few, more, grid.cells

    def __iter__(self) -> Iterator[dict[str, int]]:
        """Yield the first model of each place by its indices, in the order of Halton's points."""
        counts = self.request.counts
        sides = {n: c - (self.neighbours - 1) * (n == self.along) for n, c in counts.items()}
        seen: set[tuple[int, ...]] = set()
        for k in itertools.count(1):
            both = zip(sides.values(), (2, 3), strict=False)
            place = tuple(int(side * _reversed(k, base)) for side, base in both)
            if place not in seen:
                seen.add(place)
                yield dict(zip(sides, place, strict=True))
            if len(seen) == math.prod(sides.values()):
                return

    def at(self, place: Mapping[str, int], starts: int) -> Request:
        """Return the request of neighbours at a place."""
        own, ranges = {**self.request.arguments}, {}
        for name, span in own["ranges"].items():
            count = self.neighbours if name == self.along else 1
            values = np.linspace(*span)[place[name] :][:count]
            ranges[name] = (float(values[0]), float(values[-1]), count)
        grid = fewer_starts(own["grid"], starts)
        return Request(self.request.kind, {**own, "grid": grid, "ranges": ranges})

    def extended(self, values: Floats, blocks: int = 1) -> float:
        """Return a quantity of the whole sweep from ``values`` of a place; see ``of_models``."""
        first, later = self.of_models(values)
        models = math.prod(self.request.counts.values())
        return float(blocks * first + (models - blocks) * later)

    def of_models(self, values: Floats) -> Floats:
        """Return a quantity of the first model of a block, and of a later one.

        ``values`` are those of the first model of a place, of a later one, and of a later one with
        more starts.
        """
        (first, later, larger), (few, more, every) = values, self.starts
        slope = max(larger - later, 0.0) / max(more - few, 1)
        both: Floats = np.array([first, max(later, 0.0)]) + slope * (every - few)
        return both

    def of_blocks(self, places: Sequence[Mapping[str, int]], times: Sequence[Floats]) -> Floats:
        """Return the time of each block, each model as at the nearest place."""
        shape = [*self.request.counts.values()]
        sides = SIDES[len(shape)]
        models = np.indices(shape).reshape(len(shape), -1)
        known = np.array([[*place.values()] for place in places])
        nearest = cKDTree(known / shape).query(models.T / shape)[1]
        alone = np.all([own % side == 0 for own, side in zip(models, sides, strict=True)], axis=0)
        first, later = np.array([self.of_models(own) for own in times]).T
        each = np.where(alone, first[nearest], later[nearest])
        corners = [own // side for own, side in zip(models, sides, strict=True)]
        numbers = [-(-n // side) for n, side in zip(shape, sides, strict=True)]
        return np.bincount(np.ravel_multi_index(corners, numbers), each).astype(float)


def _reversed(k: int, base: int) -> float:
    """Return the number whose digits after the point are those of a whole number, backward."""
    found, place = 0.0, 1.0
    while k:
        place /= base
        k, digit = divmod(k, base)
        found += digit * place
    return found


class _Watch:
    """Progress of a few models: the time until the second one begins."""

    def __init__(self, models: int) -> None:
        self.first, self._models, self._began = 0.0, models, time.perf_counter()
        self._second = False

    def __call__(self, done: int, total: int) -> None:
        self._second |= self._models * done > total
        if not self._second:
            self.first = time.perf_counter() - self._began


def estimate(request: Request, run: Run, save: Save, threads: int, each: int) -> Estimate:
    """Return what a sweep takes, from samples at some places.

    ``threads`` take blocks at once; ``each`` threads work on a block if there are few blocks.
    Samples are computed at once, too, on the processors of this machine.
    """
    places, used = Places(request), min(threads, _core.default_threads())
    sampled = partial(_sampled, places, run)
    taken = iter(places)
    _, imports = timed(sampled, next(iter(places)))
    first_peak, began = peak(), time.perf_counter()
    chosen: list[Mapping[str, int]] = []
    times: list[Floats] = []
    written: list[Floats] = []
    with ThreadPoolExecutor(used) as pool:
        while some := [*itertools.islice(taken, used)]:
            for runs in pool.map(sampled, some):
                dataset = runs[0][0]
                times.append(_three(places, [own[1:] for own in runs]))
                if len(written) < _WRITTEN:
                    both = [_files(places, own[0], save) for own in runs]
                    written.append(_three(places, both))
            chosen += some
            spent = time.perf_counter() - began
            if len(chosen) == len(some):
                imports -= spent
            every = [places.extended(own, request.tiles) for own in times]
            error = np.std(every) / math.sqrt(len(every))
            whole = np.mean(every) / used
            sure = len(every) >= _TOLD and error < _ERROR * used * whole
            if len(every) >= _FEWEST and (sure or spent > _SHARE * whole):
                break
    size, writing = np.mean(written, axis=0).T
    ends = [0.0] * threads
    for block in places.of_blocks(chosen, times):
        heapq.heapreplace(ends, ends[0] + float(block) / each)
    few, more, _ = places.starts
    return Estimate(
        dataset,
        max(ends),
        places.extended(writing),
        places.extended(size),
        max(imports, 0.0),
        first_peak,
        len(times) * places.neighbours * (few + (more if more > few else 0)),
        spent,
    )


def _sampled(
    places: Places, run: Run, place: Mapping[str, int]
) -> list[tuple[xr.Dataset, float, float]]:
    """Return the results of a place, with few starts and with more if there are more.

    Each comes with the time of its first model and that of all.
    """
    found = []
    for starts in dict.fromkeys(places.starts[:2]):
        own = places.at(place, starts).arguments
        watch = _Watch(places.neighbours)
        dataset, every = timed(run, {**own, "threads": 1, "progress": watch})
        found.append((dataset, watch.first if places.neighbours > 1 else every, every))
    return found


def _files(places: Places, dataset: xr.Dataset, save: Save) -> tuple[Floats, Floats]:
    """Return size and time of writing of the first model of a place, and of all."""
    both = (_first_model(dataset, places.along), dataset)
    alone, whole = (np.array(timed(save, one), dtype=float) for one in both)
    return alone, whole


def _three(places: Places, runs: Sequence[tuple[float | Floats, float | Floats]]) -> Floats:
    """Return the values that ``of_models`` takes from those of the first model and of all."""
    later = max(places.neighbours - 1, 1)
    steps = [(every - (places.neighbours > 1) * first) / later for first, every in runs]
    return np.array([runs[0][0], steps[0], steps[-1]], dtype=float)


def _first_model(dataset: xr.Dataset, along: str) -> xr.Dataset:
    """Return the part of a sweep that has its first model, with the attractors of it."""
    one = dataset.isel({along: slice(0, 1)})
    there = one["exists"].any([dim for dim in one["exists"].dims if dim != "attractor"])
    points = one[f"point_{along}"] == one[along].values[0]
    return one.isel(attractor=there.values.astype(bool), point=points.values)
