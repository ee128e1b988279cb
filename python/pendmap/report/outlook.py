"""Sections of a diagnosis report: the next experiment, exclusions and detection limits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pendmap.diagnosis.advice import DETECTION_PROBABILITY
from pendmap.diagnosis.result import shape_text
from pendmap.formatting import counted
from pendmap.identification.report import left_out
from pendmap.model.labels import unit_of
from pendmap.report.document import bullets, code, plain, table
from pendmap.report.wording import gained, joined, number

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pendmap.diagnosis import Discrepancy
    from pendmap.diagnosis.advice import Limit

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
"""Effective noise over that of the readings above which the report explains the difference."""


def following(found: Discrepancy) -> Iterator[str]:
    """Yield the recommended next record."""
    if found.advice.next_experiment is not None:
        yield "## The next experiment"
        yield plain(found.advice.next_experiment)


def exclusions(found: Discrepancy) -> Iterator[str]:
    """Yield the parts not used, not computed or not accepted, and the detection limits."""
    yield "## Exclusions and detection limits"
    said = left_out(found.data.experiment, found.data.runs)
    texts = [plain(said.capitalize()) + "."] if said else []
    for run in found.data.runs:
        lost = int((~run.trusted).sum())
        if lost:
            texts.append(f"{code(run.name)}: {counted(lost, 'sample')} not used for fits.")
        texts += [f"{code(run.name)}: {plain(finding.text)}" for finding in run.findings]
    texts += [plain(finding.text) for finding in found.data.experiment.findings]
    if texts:
        yield "Not used, or noted:"
        yield bullets(texts)
    if found.not_computed:
        yield "Not computed, by the field of the JSON object:"
        yield bullets(f"{code(f)}: {plain(why)}" for f, why in found.not_computed.items())
    dropped = [
        (
            joined(a.effects, "with"),
            counted(a.stage, "effect") if a.stage else "the baseline",
            gained(a.bic_gain),
            "" if a.held_out_gain is None else gained(a.held_out_gain),
        )
        for a in found.attempts
        if not a.accepted
    ]
    if dropped:
        yield (
            "Refitted and not accepted, with the fall of the BIC and of the sum of squares on what "
            "was held out:"
        )
        yield table(("effects", "added to", "fall of BIC", "gain held out"), dropped, ("added to",))
    limits = found.advice.limits
    if not limits:
        return
    yield (
        f"Of each effect that was not found, the smallest size that would have been found with "
        f"{100 * DETECTION_PROBABILITY:g} % probability, in the least detectable shape; of a "
        "torque also over Tr and over w0\N{SUPERSCRIPT TWO}:"
    )
    rows = [_limit(found, name, limit) for name, limit in limits.items()]
    yield table(LIMITS, rows, ("parameter", "shape"))
    times = math.sqrt(found.level)
    if times > MORE:
        yield (
            "These limits include the unexplained residual as noise, "
            f"{number(times, 2)} times that of the readings. In records that the model describes "
            "the limits would be smaller by about this factor."
        )


def _limit(found: Discrepancy, effect: str, limit: Limit) -> tuple[str, ...]:
    """Return the row of an effect in the table of detection limits."""
    definition, size = found.definition(effect), limit.size
    parameter = definition.parameters[0].name
    if not math.isfinite(size):
        return code(effect), code(parameter), "undetectable in these records", "", "", ""
    unit = unit_of(f"{effect}.{parameter}", found.definition)
    shape, *unseen = (plain(shape_text(found, c)) for c in (limit.candidate, *limit.unseen))
    shape += f"; undetectable with {' or '.join(unseen)}" if unseen else ""
    row = code(effect), code(parameter), plain(f"{number(size, 2)} {unit}".rstrip()), shape
    if definition.group in {"drive", "reading"} or unit != unit_of("Tr"):
        return (*row, "", "")
    fit = found.best.fitted.fit
    friction = fit.estimates.get("Tr")
    against = number(size / friction.value, 2) if friction and friction.value > 0 else ""
    return (*row, against, number(size / fit["w0"] ** 2, 2))
