"""Samples of a sweep: pairs of neighbouring models at places spread over its ranges.

A sweep of M models with g starts each, in B blocks, takes B F + (M - B) C + M k (g - g0): F for a
model that is searched alone, C for one that starts from its neighbour, both with g0 starts, and k
for a further start. Each place tells the three: its first model, then its neighbour, then the
first model with more starts where g is large. Places are added until the standard error of the sum
is small. What files take, and the time to write them, has the same form with one fixed part.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import time
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.cli.planning.request import Request, fewer_starts
from pendmap.cli.planning.samples import Estimate, peak, timed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import xarray as xr

    from pendmap.cli.planning.request import Run, Save
    from pendmap.signal import Floats

_FEWEST: Final = 4  # Places at least
_SPREAD: Final = 8  # Places that tell a standard error
_ERROR: Final = 0.1  # Relative standard error of the time that is small enough
_SHARE: Final = 0.25  # Part of the whole time that samples may take
_STARTS: Final = (10_000, 40_000)  # Most starts of a map of a sample, and of one with more
_GOLDEN: Final = {1: 1.618033988749895, 2: 1.324717957244746}
"""The root of x^(d + 1) = x + 1 for d parameters, whose powers spread places evenly."""


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
        """Number of models of a place: 2, or 1 if there is one model."""
        return min(2, self.request.counts[self.along])

    @property
    def starts(self) -> tuple[int, int, int]:
        """Number of starts of a map: few, more, all."""
        grid = self.request.arguments["grid"]
        few, more = (fewer_starts(grid, most).cells for most in _STARTS)
        return few, more, grid.cells

    def __iter__(self) -> Iterator[dict[str, int]]:
        """Yield the first model of each place by its indices, spread by an additive recurrence."""
        counts = self.request.counts
        sides = {n: c - (self.neighbours - 1) * (n == self.along) for n, c in counts.items()}
        powers = _GOLDEN[len(sides)] ** -np.arange(1.0, len(sides) + 1)
        seen: set[tuple[int, ...]] = set()
        for k in itertools.count():
            place = tuple(((0.5 + k * powers) % 1.0 * [*sides.values()]).astype(int).tolist())
            if place not in seen:
                seen.add(place)
                yield dict(zip(sides, place, strict=True))
            if len(seen) == math.prod(sides.values()):
                return

    def at(self, place: Mapping[str, int], models: int, starts: int) -> Request:
        """Return the request of neighbours at a place."""
        own, ranges = {**self.request.arguments}, {}
        for name, span in own["ranges"].items():
            count = models if name == self.along else 1
            values = np.linspace(*span)[place[name] :][:count]
            ranges[name] = (float(values[0]), float(values[-1]), count)
        grid = fewer_starts(own["grid"], starts)
        return Request(self.request.kind, {**own, "grid": grid, "ranges": ranges})

    def extended(self, values: Floats, blocks: int = 1) -> float:
        """Return a quantity of the whole sweep, of which each block has the fixed part.

        ``values`` are those of one model, of the pair, and of one with more starts.
        """
        (one, pair, larger), (few, more, every) = values, self.starts
        models = math.prod(self.request.counts.values())
        step = max(pair - one, 0.0)
        slope = max(larger - one, 0.0) / max(more - few, 1)
        return float(blocks * one + (models - blocks) * step + models * slope * (every - few))


class _Watch:
    """Progress of a pair of models: the time until the second one begins."""

    def __init__(self) -> None:
        self.first, self._second, self._began = 0.0, False, time.perf_counter()

    def __call__(self, done: int, total: int) -> None:
        self._second |= 2 * done > total
        if not self._second:
            self.first = time.perf_counter() - self._began


def estimate(request: Request, run: Run, save: Save) -> Estimate:
    """Return what a sweep takes on one thread, from samples at some places."""
    places = Places(request)
    _, imports = timed(partial(_sampled, places, run=run, save=save), next(iter(places)))
    first_peak, began = peak(), time.perf_counter()
    found: list[Floats] = []
    for place in places:
        dataset, values = _sampled(places, place, run, save)
        found.append(values)
        spent = time.perf_counter() - began
        if len(found) == 1:
            imports -= spent
        every = [places.extended(own[0], request.tiles) for own in found]
        error = float(np.std(every)) / math.sqrt(len(every)) if len(every) >= _SPREAD else math.inf
        if len(every) < _FEWEST:
            continue
        if error < _ERROR * np.mean(every) or spent > _SHARE * np.mean(every):
            break
    seconds, size, writing = np.mean(found, axis=0)
    few, more, _ = places.starts
    return Estimate(
        dataset,
        places.extended(seconds, request.tiles),
        places.extended(writing),
        places.extended(size),
        max(imports, 0.0),
        first_peak,
        len(found) * (places.neighbours * few + (more if more > few else 0)),
        spent,
    )


def _sampled(
    places: Places, place: Mapping[str, int], run: Run, save: Save
) -> tuple[xr.Dataset, Floats]:
    """Return times, sizes and times of writing at a place, shape (3, 3): see ``extended``."""
    few, more, _ = places.starts
    watch = _Watch()
    given = {"threads": 1, "progress": watch}
    dataset, pair = timed(run, {**places.at(place, places.neighbours, few).arguments, **given})
    first = watch.first if places.neighbours > 1 else pair
    rows = [(first, *timed(save, _first_model(dataset, places.along)))]
    rows += [(pair, *timed(save, dataset)), rows[0]]
    if more > few:
        larger, seconds = timed(run, {**places.at(place, 1, more).arguments, **given})
        rows[2] = (seconds, *timed(save, larger))
    return dataset, np.array(rows).T


def _first_model(dataset: xr.Dataset, along: str) -> xr.Dataset:
    """Return the part of a sweep that has its first model, with the attractors of it."""
    one = dataset.isel({along: slice(0, 1)})
    there = one["exists"].any([dim for dim in one["exists"].dims if dim != "attractor"])
    points = one[f"point_{along}"] == one[along].values[0]
    return one.isel(attractor=there.values.astype(bool), point=points.values)
