"""Which runs of an experiment were read, and which were left out and why."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pendmap.words import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendmap.records import Experiment, Run

__all__ = ["left_out"]

STILL: Final = "in which nothing moves"
"""What a run is that shows no motion."""

COPY: Final = "that copies another"
"""What a run is whose readings count in another one."""


def left_out(experiment: Experiment, read: Sequence[Run]) -> str:
    """Return how many runs were read and which were not, in words; empty if all were.

    Parameters
    ----------
    experiment : Experiment
        All of its runs.
    read : sequence of Run
        Those of them that were read.
    """
    reasons: dict[str, int] = {}
    for run in experiment.runs:
        if any(run is each for each in read):
            continue
        # Where runs held out are read all the same, that is no reason for a forced one.
        held = run.hold_out and (run.kind == "free" or not any(each.hold_out for each in read))
        why = "held out" if held else "forced"
        if run.kind == "free" and not run.hold_out:
            why = "of peaks alone" if run.peaks_only else "shorter" if run.moves else STILL
        elif run.kind == "free" and not run.moves:
            why = STILL
        elif run.kind == "free" and run.peaks_only and any(each.hold_out for each in read):
            why = "of peaks alone"
        if run.copied:
            why = COPY
        reasons[why] = reasons.get(why, 0) + 1
    if not reasons:
        return ""
    first, *others = (
        f"{counted(n, 'run')} {why}"
        if why in {"held out", "of peaks alone", STILL, COPY}
        else counted(n, f"{why} run")
        for why, n in reasons.items()
    )
    last = f" and {others.pop()}" if others else ""
    words = ", ".join([first, *others]) + last
    verb = "is" if sum(reasons.values()) == 1 else "are"
    return f"{counted(len(read), 'run')} read; {words} {verb} not used"
