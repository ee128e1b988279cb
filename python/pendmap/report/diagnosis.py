"""The report of a diagnosis."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pendmap.comparison.further import Reasons, compute_part
from pendmap.comparison.replay import effect_strength
from pendmap.diagnosis.result import ranking_table, zeroed
from pendmap.diagnosis.thresholds import Thresholds
from pendmap.model.labels import unit_of
from pendmap.report.document import (
    Document,
    Formula,
    Name,
    Picture,
    Section,
    Table,
)
from pendmap.report.gap import gap, verdict, where
from pendmap.report.outlook import following, set_aside
from pendmap.report.wording import (
    compared,
    gained,
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
    from pendmap.diagnosis.verdict import Alternative, Identifiability
    from pendmap.identification import Estimate
    from pendmap.report.document import Block


SI: Final = "rad/s\N{SUPERSCRIPT TWO}"

EQUATION: Final = "theta'' + (c/m) v + w0^2 (1 + a(t)) sin(theta) = -Tr sign(v)"
"""The baseline, as in the paper, with the velocity named as in effects."""

ALTERNATIVES: Final = 4
"""Number of alternatives of an effect in its table."""


def diagnosis(found: Discrepancy) -> Document:
    """Return the report of a diagnosis.

    Its parts are the verdict, the gap, the residual torque, periods and peaks, the added effects,
    the ranking of candidates, parameters run by run, the next experiment, and what was left out,
    with the smallest size at which each effect that was not found would have shown.

    Parameters
    ----------
    found : Discrepancy
        From :func:`pendmap.diagnosis.diagnose`.

    Returns
    -------
    Document
        For :func:`pendmap.report.as_markdown` and :func:`pendmap.report.as_html`.
    """
    name = Path(found.data.experiment.path).resolve().name
    return Document(
        f"What the model of {name} lacks",
        lead(found),
        (
            verdict(found),
            *gap(found),
            *where(found),
            added(found),
            ranked(found),
            parameters_by_run(found),
            following(found),
            set_aside(found),
        ),
    )


def added(found: Discrepancy) -> Section:
    """Return the added effects, their strength, and the changes of the other parameters."""
    if not found.effects:
        nothing = "Nothing: no effect is claimed. The model given out is the baseline."
        return Section("What was added", (nothing, _parameters(found), *zeroed(found)))
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
        blocks.append(f"with {'; '.join(dict.fromkeys(meant))}.")
    for effect in found.effects:
        entry = effect.definition
        if entry["group"] in {"drive", "reading"}:
            where = "drive" if entry["group"] == "drive" else "sensor"
            blocks.append((f"In the {where}: ", Name(entry["formula"]), "."))
    blocks += [
        [
            (*values(effect), *_elsewhere(effect), *_strength(found, effect))
            for effect in found.effects
        ],
        "How the other parameters moved:",
        _parameters(found),
    ]
    return Section("What was added", (*blocks, *zeroed(found)))


def _signed(term: str) -> str:
    """Return a term of a sum with its sign."""
    sign, rest = (term[0], term[1:]) if term.startswith(("-", "+")) else ("+", term)
    return f"{sign} {rest.strip()}"


def _elsewhere(effect: NamedEffect) -> Iterator[str]:
    """Yield the other places where an effect fits equally well."""
    for name, value in effect.elsewhere.items():
        at = f"{name} = {number(value, 4)}"
        yield f". With {at} it does as well: the records do not tell which"


def _strength(found: Discrepancy, effect: NamedEffect) -> Iterator[str]:
    """Yield the strength of an effect over the records, against friction and gravity."""
    reasons: Reasons = {}
    strength = compute_part(
        reasons,
        "strength",
        lambda: effect_strength(found.best.fitted.fit, found.data.fitted, effect.name),
        None,
    )
    if strength is None:
        yield f". How strong it is over these records is not computed: {reasons['strength']}"
        return
    fit = found.best.fitted.fit
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
    """Return the changes of the parameters of the baseline."""
    before, after = (found.base.fitted.fit.estimates, found.best.fitted.fit.estimates)
    wide, wider = (math.sqrt(f.fitted.widening) for f in (found.base, found.best))
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


def parameters_by_run(found: Discrepancy) -> Section:
    """Return the sizes of the effects in each run by itself."""
    sizes = [each.candidate.free[0] for each in found.assessment.identified]
    blocks: list[Block] = []
    if not sizes:
        blocks.append("There is no effect to compare between runs.")
    names, head = [run.name for run in found.data.fitted], "standard error, the others held"
    if sizes and len(names) == 1:
        blocks.append("There is one run, and nothing to compare it with.")
    for size in sizes:
        pairs = found.runs.coefficients[size]
        spread = found.runs.between(size) / max(abs(found.best.fitted.fit[size]), 1e-300)
        nearest = found.nearest.fitted
        said = _said(nearest.fit.estimates[size], math.sqrt(nearest.widening))
        label = unit_of(size, found.definition)
        shown = [(n, v, e) for n, (v, e) in zip(names, pairs, strict=True) if math.isfinite(e)]
        blind = [n for n, (_, e) in zip(names, pairs, strict=True) if not math.isfinite(e)]
        differ = " They differ by no more than noise."
        if spread:
            differ = f" Beyond noise they differ by {share(spread)} of it."
        if len(names) == 1:
            blocks.append((Name(size), f": {said} {label}".rstrip() + "."))
            continue
        blocks += [
            (
                Name(size),
                f": all runs together {said} {label}".rstrip() + ".",
                differ if len(shown) > 1 else "",
            ),
            Table(
                ("run", f"value ({label})" if label else "value", head),
                tuple((Name(n), within(v, e), number(e, 2)) for n, v, e in shown),
            ),
        ]
        if blind:
            blocks.append(("It does not show in ", *joined(blind), "."))
    if sizes and len(names) > 1:
        blocks.append(
            Picture("runs", "Each run's own value, the other parameters held, with bars of 95 %.")
        )
    return Section("Run by run", tuple(blocks))


def ranked(found: Discrepancy) -> Section:
    """Return the ranking of candidates, and the alternatives of each effect."""
    head, rows = ranking_table(found)
    blocks: list[Block] = [
        (
            "Every effect of the library, scored at the baseline's fit: the score G is what it "
            "would take off the sum of squares by itself, in units of the noise. The best were "
            "fitted with all other parameters: they have the fall of the sum of squares with "
            "Schwarz's penalty, and the least one on a held-out set."
        ),
        Table(tuple(head), tuple((Name(row[0]), *row[1:]) for row in rows), words=("shape",)),
        Picture("ranking", "Scores of the candidates at the baseline."),
        *_functions(found),
    ]
    for each in found.assessment.identified:
        blocks += _alternatives(found, each)
    return Section("Ranking", tuple(blocks))


def _functions(found: Discrepancy) -> Iterator[Block]:
    """Yield the scores of candidates that are Python functions."""
    if not found.functions:
        return
    yield (
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


def _alternatives(found: Discrepancy, each: Identifiability) -> Iterator[Block]:
    """Yield the table of alternatives of an effect."""
    name = each.candidate.name
    if not each.alternatives:
        yield ("Nothing else of the library could stand in for ", Name(name), ".")
        return
    claimed = "" if found.effects else ", which comes nearest and is not claimed"
    yield (
        "In the place of ",
        Name(name),
        (
            f"{claimed} (gain {gained(each.gain)}): the separation s is the part of that "
            "gain which another effect does not reach."
        ),
    )
    head = ("instead", "gain", "behind", "share", "separation", "why not")
    rows = tuple(
        (
            Name(other.candidate.title),
            gained(other.gain),
            gained(other.behind),
            number(other.separation, 2),
            gained(other.separation * each.gain),
            _why(other),
        )
        for other in each.alternatives[:ALTERNATIVES]
    )
    yield Table(head, rows, words=("why not",))


def _why(alternative: Alternative) -> str:
    """Return why an alternative was not accepted."""
    if alternative.contains:
        return "does the same with more parameters and gains no more"
    if alternative.alike:
        return f"not told apart: behind by less than {Thresholds().alike:g}, or by one run alone"
    return "refitted, explains less" if alternative.refitted else "scored, explains less"
