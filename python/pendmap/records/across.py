"""What the runs of an experiment show together."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pendmap.records.copies import once_each
from pendmap.records.experiment import Finding
from pendmap.records.scale import small_period

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.records.experiment import Run

ONE_RIG: Final = 0.05
"""Share by which periods of small swings of one pendulum may differ: 10 % of its length."""


def checked_together(runs: Sequence[Run]) -> tuple[tuple[Run, ...], tuple[Finding, ...]]:
    """Return runs, each reading counted once, and what they show together.

    Parameters
    ----------
    runs : sequence of Run
        All of an experiment.
    """
    made = once_each(runs)
    found = list(_unlike(made))
    if runs and all(run.hold_out for run in runs):
        found.append(Finding("all-held-out", "all runs are held out: none is left to fit"))
    return tuple(made), tuple(found)


def _unlike(runs: Sequence[Run]) -> list[Finding]:
    """Return that runs are of several pendulums, where the periods of small swings show it."""
    swings = {
        run.name: small_period(run.time[run.trusted], run.theta[run.trusted], run.count_rad)
        for run in runs
        if run.kind == "free" and not run.peaks_only and run.moves
    }
    known = {name: period for name, period in swings.items() if math.isfinite(period)}
    if len(known) < 2 or max(known.values()) <= (1 + ONE_RIG) * min(known.values()):
        return []
    short, long = min(known, key=lambda n: known[n]), max(known, key=lambda n: known[n])
    text = (
        f"small swings take {known[short]:.4g} s in {short} and {known[long]:.4g} s in {long}: "
        "these are not runs of one pendulum"
    )
    return [Finding("rigs-differ", text)]
