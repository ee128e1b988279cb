"""Statistics of paths between wells, for paths with known itineraries."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pendmap.comparison.itinerary import Itineraries, Ruler, repeats, wells

TICK, PERIOD = 0.01, 0.73
RULER = Ruler(TICK, 1.0, PERIOD, 0.001)
TIME = np.arange(0, 40, TICK)


def of(path: np.ndarray, ruler: Ruler = RULER) -> Itineraries:
    return Itineraries.of(path[None], ruler)


def test_passages_of_a_staircase_of_wells_are_counted() -> None:
    """The path goes up two wells, back one, and twice round: 7 passages through 6 wells."""
    visited = [0, 1, 2, 1, 0, -1, -2, -3]
    path = np.repeat(math.tau * np.array(visited, float), TIME.size // len(visited))
    found = of(path)
    assert found.escapes[0] == 7
    assert found.wells[0] == 6
    assert found.covered[0] == pytest.approx(5 * math.tau)
    assert wells(path[None]).tolist()[0][:: TIME.size // len(visited)] == visited


def test_noise_at_the_top_is_no_escape_and_a_jump_over_wells_is_several_escapes() -> None:
    near_top = math.pi + np.random.default_rng(1).normal(0, 0.02, TIME.size)
    near_top[0] = 0.0
    assert of(near_top).escapes[0] == 0
    over = np.where(TIME < 20, 0.3, 0.3 + 3 * math.tau)
    assert (of(over).escapes[0], of(over).wells[0]) == (3, 2)


def test_velocities_are_those_of_the_motion() -> None:
    path = 1.3 * np.sin(5.0 * TIME)
    assert of(path).fastest[0] == pytest.approx(6.5, rel=1e-3)
    speed = RULER.velocity(path)
    np.testing.assert_allclose(speed[20:-20], 6.5 * np.cos(5.0 * TIME)[20:-20], atol=0.01)


@pytest.mark.parametrize(("n", "w"), [(1, 0), (2, 0), (3, 0), (1, 1), (2, -1), (5, 5), (8, 3)])
def test_a_cycle_is_found_with_its_period_and_turns(n: int, w: int) -> None:
    rate = math.tau / (n * PERIOD)
    cycle = 0.8 * np.sin(rate * TIME) + 0.3 * np.cos((2 * n - 1) * rate * TIME)
    path = cycle + w * rate * TIME + np.random.default_rng(2).normal(0, 0.001, TIME.size)
    found = of(path)
    assert (found.n[0], found.w[0]) == (n, w)
    assert found.settled[0] == 0


def test_the_time_to_settle_is_that_of_the_slowest_part() -> None:
    """A difference ``a exp(-k t)`` from the cycle changes by 0.05 a period at a known time."""
    rate, decay, apart = math.tau / PERIOD, 0.25, 1.5
    path = 0.5 * np.sin(rate * TIME) + apart * np.exp(-decay * TIME)
    expected = math.log(apart * (1 - math.exp(-decay * PERIOD)) / RULER.near) / decay
    found = of(path)
    assert (found.n[0], found.w[0]) == (1, 0)
    assert found.settled[0] == pytest.approx(expected, abs=2 * TICK)


def test_a_path_without_a_cycle_never_settles() -> None:
    drawn = np.random.default_rng(3).normal(0, 1, TIME.size)
    walk = np.cumsum(drawn) * 0.1
    found = of(walk)
    assert (found.n[0], found.w[0]) == (0, 0)
    assert math.isinf(found.settled[0])
    late = np.where(TIME < 39, walk, 0.0)  # four periods are required, and only one is present
    assert math.isinf(of(late).settled[0])


def test_without_a_period_only_rest_counts_as_settled() -> None:
    ruler = Ruler(TICK, 1.0, None, 0.001)
    stays = np.exp(-0.5 * TIME) * np.cos(6 * TIME) + math.tau
    n, w, settled = repeats(stays[None], ruler)
    assert (n[0], w[0]) == (1, 0)
    last = TIME[np.flatnonzero(np.abs(stays - stays[-1]) > ruler.near)[-1]]
    assert settled[0] == pytest.approx(last + TICK)
    assert math.isinf(repeats(np.sin(6 * TIME)[None], ruler)[2][0])


def test_many_paths_at_once_equal_single_ones() -> None:
    rng = np.random.default_rng(4)
    paths = np.stack(
        [np.sin(math.tau / PERIOD * TIME + k) + 0.02 * k * TIME * rng.normal() for k in range(7)]
    )
    together = Itineraries.of(paths, RULER)
    apart = Itineraries.joined([of(path) for path in paths])
    for name in ("wells", "escapes", "covered", "fastest", "settled", "n", "w"):
        np.testing.assert_allclose(getattr(together, name), getattr(apart, name), rtol=1e-12)
