"""Part 6 of a diagnosis' report: the ranking of candidates, and why the runners-up lost."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pendmap.diagnosis.result import ranking_table
from pendmap.diagnosis.thresholds import Thresholds
from pendmap.report.document import Name, Paragraph, Picture, Section, Table
from pendmap.report.wording import gained, number, stated

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pendmap.diagnosis import Discrepancy
    from pendmap.diagnosis.alternatives import Rival, Standing
    from pendmap.report.document import Block

RIVALS: Final = 4
"""Rivals of an effect that are shown."""


def ranked(found: Discrepancy) -> Section:
    """Return the ranking of candidates, and why the runners-up lost."""
    head, rows = ranking_table(found)
    blocks: list[Block] = [
        Paragraph(
            "Every effect of the library, scored at the baseline's fit: the score G is what it "
            "would take off the sum of squares by itself, in units of the noise. The best were "
            "fitted with all other parameters: they have the fall of the sum of squares with "
            "Schwarz's penalty, and the least one on a held-out set."
        ),
        Table(
            tuple(head),
            tuple((Name(row[0]), *row[1:]) for row in rows),
            words=("shape",),
        ),
        Picture("ranking", "Scores of the candidates at the baseline."),
        *_functions(found),
    ]
    for standing in found.judgement.standings:
        blocks += _rivals(found, standing)
    return Section("Ranking", tuple(blocks))


def _functions(found: Discrepancy) -> Iterator[Block]:
    """Yield what candidates that are Python functions would explain."""
    if not found.functions:
        return
    yield Paragraph(
        "Python functions that were tried: to first order only, and never refitted or named. G is "
        "what the function would take off the sum of squares at the baseline, then beside the "
        "effects found, if there are any:"
    )
    rows = tuple(
        (
            Name(score.name),
            stated(score.size, score.stderr) if math.isfinite(score.size) else "does not show",
            gained(score.gain),
            gained(score.left),
        )
        for score in found.functions
    )
    yield Table(("function", "times its torque", "score G", "G beside what was found"), rows)


def _rivals(found: Discrepancy, standing: Standing) -> Iterator[Block]:
    name = standing.candidate.name
    if not standing.rivals:
        yield Paragraph(("Nothing else of the library could stand in for ", Name(name), "."))
        return
    claimed = "" if found.effects else ", which comes nearest and is not claimed"
    yield Paragraph(
        (
            "In the place of ",
            Name(name),
            (
                f"{claimed} (gain {gained(standing.gain)}): the separation s is the part of that "
                "gain which another effect does not reach."
            ),
        )
    )
    yield Table(
        ("instead", "gain", "behind", "share", "separation", "why not"),
        tuple(
            (
                Name(rival.candidate.title),
                gained(rival.gain),
                gained(rival.behind),
                number(rival.separation, 2),
                gained(rival.separation * standing.gain),
                _why(rival),
            )
            for rival in standing.rivals[:RIVALS]
        ),
        words=("why not",),
    )


def _why(rival: Rival) -> str:
    if rival.contains:
        return "does the same with more parameters and gains no more"
    if rival.alike:
        return f"not told apart: behind by less than {Thresholds().alike:g}, or by one run alone"
    return "refitted, explains less" if rival.refitted else "scored, explains less"
