"""The report of a diagnosis."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pendmap.comparison.further import Reasons, attempted
from pendmap.comparison.replay import strength_of
from pendmap.diagnosis.result import zeroed
from pendmap.model.labels import unit_of
from pendmap.report.document import (
    Document,
    Formula,
    Items,
    Name,
    Paragraph,
    Picture,
    Section,
    Table,
)
from pendmap.report.gap import gap, verdict, where
from pendmap.report.outlook import following, set_aside
from pendmap.report.ranking import ranked
from pendmap.report.wording import (
    compared,
    joined,
    lead,
    mrad,
    number,
    own_parameters,
    share,
    stated,
    values,
    within,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pendmap.diagnosis import Discrepancy, NamedEffect
    from pendmap.identification import Estimate
    from pendmap.report.document import Block


def diagnosis(found: Discrepancy) -> Document:
    """Return the report of a diagnosis in its nine parts.

    Verdict; gap; where it is; figure 7; what was added; the ranking; run by run; what to record
    next; what was left out, and from which size on each effect that was not found would have shown.

    Parameters
    ----------
    found : Discrepancy
        As of :func:`pendmap.diagnosis.diagnose`.
    """
    name = Path(found.evidence.experiment.path).resolve().name
    return Document(
        f"What the model of {name} lacks",
        lead(found),
        (
            verdict(found),
            *gap(found),
            *where(found),
            added(found),
            ranked(found),
            run_by_run(found),
            following(found),
            set_aside(found),
        ),
    )


# Parts 5 and 7 of a diagnosis' report: what was added, and run by run.


SI: Final = "rad/s\N{SUPERSCRIPT TWO}"
EQUATION: Final = "theta'' + (c/m) v + w0^2 (1 + a(t)) sin(theta) = -Tr sign(v)"
"""The model to begin with, as the paper has it, with the velocity named as effects name it."""


def added(found: Discrepancy) -> Section:
    """Return what was added, how strong it is, and how the other parameters moved."""
    if not found.effects:
        return Section(
            "What was added",
            (
                Paragraph("Nothing: no effect is claimed. The model given out is the baseline."),
                _parameters(found),
                *_zeroed(found),
            ),
        )
    blocks: list[Block] = []
    terms, meant = [], ["v = theta'", "a the pivot's acceleration over gravity"]
    for effect in found.effects:
        entry = effect.definition
        if entry["group"] not in {"drive", "reading"}:
            term, _, said = str(entry["formula"]).partition(", ")
            terms.append((_signed(term), effect.name))
            meant += [said] if said else []
    if len(terms) == 1:
        blocks.append(Formula(f"{EQUATION} {terms[0][0]}"))
    elif terms:
        wide = max(len(term) for term, _ in terms)
        lines = (f"    {term:{wide}}   ({name})" for term, name in terms)
        blocks.append(Formula("\n".join([EQUATION, *lines])))
    if terms:
        blocks.append(Paragraph(f"with {'; '.join(dict.fromkeys(meant))}."))
    for effect in found.effects:
        entry = effect.definition
        if entry["group"] in {"drive", "reading"}:
            where = "drive" if entry["group"] == "drive" else "sensor"
            blocks.append(Paragraph((f"In the {where}: ", Name(entry["formula"]), ".")))
    blocks.append(
        Items(
            tuple(
                (*values(effect), *_elsewhere(effect), *_strength(found, effect))
                for effect in found.effects
            )
        )
    )
    blocks += [Paragraph("How the other parameters moved:"), _parameters(found)]
    return Section("What was added", (*blocks, *_zeroed(found)))


def _signed(term: str) -> str:
    sign, rest = (term[0], term[1:]) if term.startswith(("-", "+")) else ("+", term)
    return f"{sign} {rest.strip()}"


def _elsewhere(effect: NamedEffect) -> Iterator[str]:
    """Yield at which other place an effect would do as well."""
    for name, value in effect.elsewhere.items():
        at = f"{name} = {number(value, 4)}"
        yield f". With {at} it does as well: the records do not tell which"


def _strength(found: Discrepancy, effect: NamedEffect) -> Iterator[str]:
    """Yield how strong an effect is over the records, against friction and gravity."""
    reasons: Reasons = {}
    strength = attempted(
        reasons,
        "strength",
        lambda: strength_of(found.best.trial.fit, found.evidence.fitted, effect.name),
        None,
    )
    if strength is None:
        yield f". How strong it is over these records is not computed: {reasons['strength']}"
        return
    fit = found.best.trial.fit
    if strength.torque > 0:
        w0, friction = fit["w0"], fit.estimates.get("Tr")
        against = ""
        if (
            friction is not None
            and friction.value > 0
            and "Tr" not in own_parameters([effect.name])
        ):
            against = f"{number(strength.torque / friction.value, 2)} Tr and "
        yield (
            f". Over these records its torque is {number(strength.torque, 2)} {SI} rms, {against}"
            f"{number(strength.torque / w0**2, 1)} w0\N{SUPERSCRIPT TWO}; at most "
            f"{number(strength.greatest_torque, 2)} {SI}"
        )
    elif strength.reading > 0:
        yield (
            f". It moves the readings by {mrad(strength.reading)} rms, at most "
            f"{mrad(strength.greatest_reading)}"
        )


def _parameters(found: Discrepancy) -> Table:
    before, after = (found.base.trial.fit.estimates, found.best.trial.fit.estimates)
    wide, wider = (math.sqrt(f.trial.widening) for f in (found.base, found.best))
    new = own_parameters(effect.name for effect in found.effects)
    names = [n for n in before if n in after and "[" not in n and n not in new]
    rows = []
    for name in names:
        old, now = before[name], after[name]
        moved = now.value - old.value
        error = wider * (now.stderr or 0.0)
        rows.append(
            (
                Name(name),
                unit_of(name, found.definition),
                _said(old, wide),
                _said(now, wider),
                f"{'+' * (moved > 0)}{number(moved / error, 2)}" if error and moved else "0",
            )
        )
    head = ("parameter", "unit", "before", "after", "moved, standard errors")
    return compared(found, Table(head, tuple(rows), words=("unit",)))


def _said(estimate: Estimate, wider: float) -> str:
    return stated(estimate.value, wider * (estimate.stderr or 0.0))


def _zeroed(found: Discrepancy) -> Iterator[Block]:
    for said in zeroed(found):
        yield Paragraph(said)


def run_by_run(found: Discrepancy) -> Section:
    """Return what was found as each run would have it by itself."""
    standings = found.judgement.standings
    sizes = [standing.candidate.free[0] for standing in standings]
    blocks: list[Block] = []
    if not sizes:
        blocks.append(Paragraph("There is no effect to compare between runs."))
    names = [run.name for run in found.evidence.fitted]
    if sizes and len(names) == 1:
        blocks.append(Paragraph("There is one run, and nothing to compare it with."))
    for size in sizes:
        pairs = found.runs.coefficients[size]
        spread = found.runs.between(size) / max(abs(found.best.trial.fit[size]), 1e-300)
        said = _said(
            found.nearest.trial.fit.estimates[size], math.sqrt(found.nearest.trial.widening)
        )
        label = unit_of(size, found.definition)
        shown = [(n, v, e) for n, (v, e) in zip(names, pairs, strict=True) if math.isfinite(e)]
        blind = [n for n, (_, e) in zip(names, pairs, strict=True) if not math.isfinite(e)]
        differ = (
            f" Beyond noise they differ by {share(spread)} of it."
            if spread
            else " They differ by no more than noise."
        )
        if len(names) == 1:
            blocks.append(Paragraph((Name(size), f": {said} {label}".rstrip() + ".")))
            continue
        blocks += [
            Paragraph(
                (
                    Name(size),
                    f": all runs together {said} {label}".rstrip() + ".",
                    differ if len(shown) > 1 else "",
                )
            ),
            Table(
                (
                    "run",
                    f"value ({label})" if label else "value",
                    "standard error, the others held",
                ),
                tuple((Name(n), within(v, e), number(e, 2)) for n, v, e in shown),
            ),
        ]
        if blind:
            blocks.append(Paragraph(("It does not show in ", *joined(blind), ".")))
    if sizes and len(names) > 1:
        blocks.append(
            Picture("runs", "Each run's own value, the other parameters held, with bars of 95 %.")
        )
    return Section("Run by run", tuple(blocks))
