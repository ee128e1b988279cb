"""Parts 8 and 9 of a diagnosis' report: what to record next, what was left out and not seen."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pendmap.discrepancy.select import GATE
from pendmap.identification.left_out import left_out
from pendmap.pictures.names import unit_of
from pendmap.report.document import Items, Name, Paragraph, Section, Table
from pendmap.report.wording import gained, joined
from pendmap.words import counted

if TYPE_CHECKING:
    from pendmap.discrepancy import Discrepancy
    from pendmap.report.document import Block, Text

__all__ = ["following", "set_aside"]


def following(found: Discrepancy) -> Section:
    """Return what to record next."""
    return Section("The next experiment", (Paragraph(found.advice.next_experiment),))


def set_aside(found: Discrepancy) -> Section:
    """Return what was not used, what was tried and dropped, and what would have shown."""
    blocks: list[Block] = []
    used = found.evidence.runs
    texts: list[Text] = []
    said = left_out(found.evidence.experiment, used)
    if said:
        texts.append(said.capitalize() + ".")
    for run in used:
        lost = int((~run.trusted).sum())
        if lost:
            texts.append((Name(run.name), f": {counted(lost, 'sample')} not for fitting."))
        texts += [(Name(run.name), f": {finding.text}") for finding in run.findings]
    texts += [finding.text for finding in found.evidence.experiment.findings]
    blocks += [Paragraph("Not used, or noted:"), Items(tuple(texts))] if texts else []
    dropped = [a for a in found.attempts if not a.accepted]
    if dropped:
        blocks += [
            Paragraph(
                "Refitted and not taken, with the fall of the BIC and of the sum of squares on "
                "what was held back:"
            ),
            Table(
                ("effects", "beside", "fall of BIC", "gain held out"),
                tuple(
                    (
                        joined(a.names, "with"),
                        counted(a.stage, "effect") if a.stage else "the baseline",
                        gained(a.gain),
                        gained(a.held_gain),
                    )
                    for a in dropped
                ),
                words=("beside",),
            ),
        ]
    limits = found.advice.limits
    if limits:
        blocks += [
            Paragraph(
                f"Of each effect that was not found, the smallest size that these records would "
                f"have scored {GATE:g}, in the shape that shows it least:"
            ),
            Table(
                ("effect", "parameter", "would have shown from"),
                tuple(
                    (Name(name), Name(_size(found, name)), _limit(found, name, limit))
                    for name, limit in limits.items()
                ),
                words=("parameter",),
            ),
        ]
    return Section("What was left out, and what would have shown", tuple(blocks))


def _size(found: Discrepancy, effect: str) -> str:
    return str(found.definition(effect)["parameters"][0]["name"])


def _limit(found: Discrepancy, effect: str, limit: float) -> str:
    if not math.isfinite(limit):
        return "not at any size"
    unit = unit_of(f"{effect}.{_size(found, effect)}", found.definition)
    return f"{limit:.2g} {unit}".rstrip()
