"""Maps and diagrams over parameters computed block by block: equal to those of one call."""

from __future__ import annotations

import numpy as np
import pytest

from pendmap import Grid, Pendulum, _core
from pendmap.analysis.cell_search import spread

P = [("p", np.linspace(0.2, 1.2, 19).tolist())]
OMEGA = [("omega", np.linspace(1.7, 2.2, 17).tolist())]
EACH = 2
STARTS = spread(Grid.square(100), 61 * EACH)


def arrays(found: object) -> dict[str, object]:
    """Return the attributes of a result of the core, down to numbers, lists and bytes."""
    public = {name: getattr(found, name) for name in dir(found) if not name.startswith("_")}
    return {
        name: value.tobytes()
        if isinstance(value, np.ndarray)
        else arrays(value)
        if isinstance(value, _core.Followed)
        else value
        for name, value in public.items()
    }


def computed(
    model: Pendulum, *axes: list[tuple[str, list[float]]]
) -> tuple[_core.Survey, list[bytes]]:
    """Return a survey and its blocks, every call with a survey of its own, last block first."""
    first = _core.Survey(model, axes, *STARTS, EACH, 1e-6, None, 1)
    same = lambda: _core.Survey(model, axes, *STARTS, EACH, 1e-6, None, 1, first.state)  # noqa: E731
    order = range(first.blocks - 1, -1, -1)
    blocks = {k: same().search(k) for k in order}
    for number in range(1, first.passes + 1):
        new = {
            k: same().exchange(number, k, {at: blocks[at] for at in first.around(k)}) for k in order
        }
        blocks |= {k: found for k, found in new.items() if found is not None}
        if not any(first.gained(number, k, found) for k, found in blocks.items()):
            break
    return first, [blocks[k] for k in sorted(blocks)]


def test_blocks_give_the_map_of_one_call() -> None:
    whole = _core.parameter_map(Pendulum(), (P, OMEGA), *STARTS, EACH, 1e-6, None, 2)
    survey, blocks = computed(Pendulum(), P, OMEGA)
    assert [len(survey.cells(k)) for k in range(4)] == [256, 48, 16, 3]
    assert arrays(survey.result(blocks)) == arrays(whole)
    assert whole.searched_again > 0


def test_blocks_give_the_diagram_of_one_call() -> None:
    whole = _core.bifurcation(Pendulum(), P, *STARTS, EACH, (0.3, 0.0), 1e-6, None, 2)
    survey, blocks = computed(Pendulum(), P)
    assert arrays(survey.diagram(blocks, (0.3, 0.0))) == arrays(whole)


def test_wrong_blocks_and_states_are_refused() -> None:
    survey = _core.Survey(Pendulum(), [P], *STARTS, EACH, 1e-6, None, 1)
    with pytest.raises(ValueError, match="block must be one of the survey, got 2"):
        survey.search(2)
    with pytest.raises(ValueError, match="known must be what this version has stored"):
        survey.exchange(1, 0, {})
    with pytest.raises(ValueError, match="pass_number must be 1 to passes, got 0"):
        survey.exchange(0, 0, {})
    with pytest.raises(ValueError, match="blocks must be what this version has stored"):
        survey.result([])
    with pytest.raises(ValueError, match="axes must be 1 or 2, got 0"):
        _core.Survey(Pendulum(), [], *STARTS, EACH, 1e-6, None, 1)
    with pytest.raises(ValueError, match="state must be what this version has stored"):
        _core.Survey(Pendulum(), [P, OMEGA], *STARTS, EACH, 1e-6, None, 1, survey.state)
