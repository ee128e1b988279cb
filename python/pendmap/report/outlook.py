"""The next experiment, what was left out, and detection limits in the report of a diagnosis."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pendmap.diagnosis.next_experiment.limits import MARGIN, SURELY
from pendmap.formatting import counted
from pendmap.identification.report import left_out
from pendmap.model.labels import unit_of
from pendmap.report.document import Name, Section, Strong, Table
from pendmap.report.wording import chance, gained, joined, number

if TYPE_CHECKING:
    from pendmap.diagnosis import Discrepancy
    from pendmap.diagnosis.candidates import Candidate
    from pendmap.diagnosis.next_experiment.limits import Limit
    from pendmap.diagnosis.next_experiment.power import Outlook
    from pendmap.report.document import Block, Text

ROWS: Final = 8
"""Number of rows in the table of proposals."""

LIMITS: Final = (
    "effect",
    "parameter",
    "found from",
    "shape",
    "over Tr",
    "over w0\N{SUPERSCRIPT TWO}",
)
"""Header of the table of detection limits."""

MORE: Final = 1.5
"""Effective noise over that of the readings above which the difference is explained."""

FIGURES: Final = {
    "separation": "separation",
    "interval": "half an interval of 95 %, over the value",
    "limits": "smallest size seen, over that now",
}
"""Predicted figure of each proposal, by aim."""


def following(found: Discrepancy) -> Section:
    """Return what to record next, and the prediction for each kind of run."""
    advice = found.advice
    blocks: list[Block] = []
    if advice.next_experiment is not None:
        blocks.append(advice.next_experiment)
    elif "proposals" in found.reasons:
        blocks.append(f"Not computed: {found.reasons['proposals']}.")
    outlook = advice.outlook
    if outlook is not None and outlook.prospects:
        blocks += [_meaning(outlook), _proposals(outlook)]
    return Section("The next experiment", tuple(blocks))


def _meaning(outlook: Outlook) -> Text:
    """Return the meaning of the table of proposals."""
    start = (
        "Each line is the best of a kind of run that this rig could do: run through by the model, "
        "read as often and as well as these records, and added to them. "
    )
    if outlook.aim == "separation":
        return (
            f"{start}The separation is the part of the gain of one name that the other cannot "
            f"follow; from {outlook.wanted:g} on a wrong name is improbable. Now it is "
            f"{gained(outlook.now)}."
        )
    if outlook.aim == "interval":
        return (
            f"{start}Half the interval of ",
            Name(outlook.about[0]),
            f" over its value is now {number(outlook.now, 2)}; half of that is wanted.",
        )
    median = "The last column is the median over all effects that were not found; half is wanted."
    return (f"{start}{median} Most would be gained for ", *joined(outlook.about), ".")


def _proposals(outlook: Outlook) -> Table:
    """Return the table of proposals."""
    separates = outlook.aim == "separation"
    head = ["record", "recorded (s)", "wait (s)", FIGURES[outlook.aim]]
    head += ["wrong name", "one name left"] if separates else []
    best = outlook.best
    rows = []
    for prospect in outlook.by_start[:ROWS]:
        proposal = prospect.proposal
        row: list[Text] = [
            Strong(proposal.what) if prospect is best else proposal.what,
            f"{proposal.seconds:g}",
            f"{proposal.wait_s:g}",
            gained(prospect.value) if separates else number(prospect.value, 2),
        ]
        if separates:
            wrong = prospect.wrong or 0.0
            said = number(wrong, 1) if wrong >= MARGIN else f"below {number(MARGIN, 1)}"
            row += [said, chance(prospect.resolved or 0.0)]
        rows.append(tuple(row))
    return Table(tuple(head), tuple(rows))


def set_aside(found: Discrepancy) -> Section:
    """Return what was not used, not computed or not accepted, and the detection limits."""
    said = left_out(found.data.experiment, found.data.runs)
    texts: list[Text] = [said.capitalize() + "."] if said else []
    for run in found.data.runs:
        lost = int((~run.trusted).sum())
        if lost:
            texts.append((Name(run.name), f": {counted(lost, 'sample')} not for fitting."))
        texts += [(Name(run.name), f": {finding.text}") for finding in run.findings]
    texts += [finding.text for finding in found.data.experiment.findings]
    blocks: list[Block] = ["Not used, or noted:", texts] if texts else []
    unknown: list[Text] = [(Name(f), f": {reason}") for f, reason in found.not_computed.items()]
    blocks += ["Not computed, by the field of the JSON object:", unknown] if unknown else []
    dropped = tuple(
        (
            joined(a.names, "with"),
            counted(a.stage, "effect") if a.stage else "the baseline",
            gained(a.gain),
            "" if a.held_gain is None else gained(a.held_gain),
        )
        for a in found.attempts
        if not a.accepted
    )
    if dropped:
        blocks += [
            (
                "Refitted and not taken, with the fall of the BIC and of the sum of squares on "
                "what was held out:"
            ),
            Table(("effects", "beside", "fall of BIC", "gain held out"), dropped, ("beside",)),
        ]
    limits = found.advice.limits
    if limits:
        blocks += [
            (
                f"Of each effect that was not found, the smallest size that would have been found "
                f"with {100 * SURELY:g} % probability, in the shape that shows it least; of a "
                "torque also over Tr and over w0\N{SUPERSCRIPT TWO}:"
            ),
            Table(
                LIMITS,
                tuple(_limit(found, name, limit) for name, limit in limits.items()),
                words=("parameter", "shape"),
            ),
        ]
    times = math.sqrt(found.level)
    if limits and times > MORE:
        blocks.append(
            "These sizes hold beside what is missing: what the baseline leaves counts as noise "
            f"here, {number(times, 2)} times that of the readings. In records that the model "
            "describes the sizes would be smaller by about as much."
        )
    return Section("What was left out, and what would have shown", tuple(blocks))


def _limit(found: Discrepancy, effect: str, limit: Limit) -> tuple[Text, ...]:
    """Return the row of an effect in the table of limits."""

    def said(candidate: Candidate) -> str:
        return ", ".join(f"{name} = {number(value)}" for name, value in candidate.shape.items())

    definition, size = found.definition(effect), limit.size
    parameter = str(definition["parameters"][0]["name"])
    if not math.isfinite(size):
        return Name(effect), Name(parameter), "not visible in these records", "", "", ""
    unit = unit_of(f"{effect}.{parameter}", found.definition)
    unseen = " or ".join(map(said, limit.unseen))
    shape = said(limit.candidate) + (f"; not visible with {unseen}" if unseen else "")
    row = Name(effect), Name(parameter), f"{number(size, 2)} {unit}".rstrip(), shape
    if definition["group"] in {"drive", "reading"} or unit != unit_of("Tr"):
        return (*row, "", "")
    fit = found.best.fitted.fit
    friction = fit.estimates.get("Tr")
    against = number(size / friction.value, 2) if friction and friction.value > 0 else ""
    return (*row, against, number(size / fit["w0"] ** 2, 2))
