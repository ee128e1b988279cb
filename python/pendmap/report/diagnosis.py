"""Report of a diagnosis."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pendmap.comparison.replay import LOST, effect_strength
from pendmap.diagnosis.result import ranking_table, shape_text, zeroed
from pendmap.model.labels import unit_of
from pendmap.model.rig import own_name
from pendmap.report.document import Document, Picture, bullets, code, plain, table
from pendmap.report.gap import gap, verdict, where
from pendmap.report.outlook import exclusions, following
from pendmap.report.wording import (
    before_and_after,
    gained,
    joined,
    lead,
    mrad,
    number,
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


SI: Final = "rad/s\N{SUPERSCRIPT TWO}"

EQUATION: Final = "theta'' + (c/m) v + w0^2 (1 + a(t)) sin(theta) = -Tr sign(v)"
"""Baseline equation of the paper, with the velocity denoted as in effects."""

ALTERNATIVES: Final = 4  # Number of alternatives in the table of an effect


def diagnosis(found: Discrepancy) -> Document:
    """Return the report of a diagnosis.

    Its parts are the verdict, the gap, the residual torque, periods and peaks, the added effects,
    the ranking of candidates, parameters run by run, the next experiment, exclusions, and the
    detection limits of effects that were not found.

    Parameters
    ----------
    found : Discrepancy
        From :func:`pendmap.diagnose`.

    Returns
    -------
    Document
        For :func:`pendmap.report.as_markdown` and :func:`pendmap.report.as_html`.
    """
    name = Path(found.data.experiment.path).resolve().name
    parts = (
        verdict(found),
        gap(found),
        where(found),
        added(found),
        ranked(found),
        parameters_by_run(found),
        following(found),
        exclusions(found),
    )
    blocks = (lead(found), *(block for part in parts for block in part))
    return Document(f"What the model of {name} lacks", blocks)


def added(found: Discrepancy) -> Iterator[str]:
    """Yield the added effects, their strength, and the changes of the other parameters."""
    yield "## What was added"
    if found.effects:
        yield from _terms(found)
        yield bullets(
            f"{values(effect)}{_elsewhere(effect)}{_strength(found, effect)}"
            for effect in found.effects
        )
        yield "Changes of the other parameters:"
    else:
        yield "Nothing: no effect is claimed. The resulting model is the baseline."
    yield _parameters(found)
    yield from map(plain, zeroed(found))


def _terms(found: Discrepancy) -> Iterator[str]:
    """Yield the equation with the terms of the added effects."""
    terms, others = [], []
    meant = ["v = theta'", "a the pivot's acceleration over gravity"]
    for effect in found.effects:
        formula, group = effect.definition.formula, effect.definition.group
        if group in {"drive", "reading"}:
            others.append(f"In the {'drive' if group == 'drive' else 'sensor'}: {code(formula)}.")
            continue
        term, _, said = formula.partition(", ")
        sign, rest = (term[0], term[1:]) if term.startswith(("-", "+")) else ("+", term)
        terms.append((f"{sign} {rest.strip()}", effect.name))
        meant += [said] if said else []
    # A fence: indented lines after a list would belong to its last item.
    if len(terms) == 1:
        yield f"```\n{EQUATION} {terms[0][0]}\n```"
    elif terms:
        wide = max(len(term) for term, _ in terms)
        lines = [EQUATION, *(f"    {term:{wide}}   ({name})" for term, name in terms)]
        yield "\n".join(["```", *lines, "```"])
    if terms:
        yield f"with {plain('; '.join(dict.fromkeys(meant)))}."
    yield from others


def _elsewhere(effect: NamedEffect) -> str:
    """Return the other shapes with which an effect fits equally well."""
    return "".join(
        f". With {name} = {number(value, 4)} it fits equally well"
        for name, value in effect.elsewhere.items()
    )


def _strength(found: Discrepancy, effect: NamedEffect) -> str:
    """Return the strength of an effect over the records, relative to friction and gravity."""
    fit = found.best.fitted.fit
    try:
        strength = effect_strength(fit, found.data.fitted, effect.name)
    except LOST as error:
        return f". Its strength over these records is not computed: {plain(str(error))}"
    if strength.torque > 0:
        w0, friction = fit["w0"], fit.estimates.get("Tr")
        against = ""
        if friction is not None and friction.value > 0 and own_name(effect.name) != "Tr":
            against = f"{number(strength.torque / friction.value, 2)} Tr and "
        return (
            f". Over these records its torque is {number(strength.torque, 2)} {SI} rms, {against}"
            f"{number(strength.torque / w0**2, 1)} w0\N{SUPERSCRIPT TWO}; at most "
            f"{number(strength.greatest_torque, 2)} {SI}"
        )
    if strength.reading > 0:
        return (
            f". It changes the readings by {mrad(strength.reading)} rms, at most "
            f"{mrad(strength.greatest_reading)}"
        )
    return ""


def _parameters(found: Discrepancy) -> str:
    """Return the table of the changes of the baseline's parameters."""
    before, after = (found.base.fitted.fit.estimates, found.best.fitted.fit.estimates)
    wide, wider = (math.sqrt(f.fitted.widening) for f in (found.base, found.best))
    new = {own_name(effect.name) for effect in found.effects}
    rows = []
    for name, old in before.items():
        if name not in after or "[" in name or name in new:
            continue
        now = after[name]
        moved = now.value - old.value
        error = wider * (now.stderr or 0.0)
        rows.append(
            (
                code(name),
                plain(unit_of(name, found.definition)),
                _said(old, wide),
                _said(now, wider),
                f"{'+' * (moved > 0)}{number(moved / error, 2)}" if error and moved else "0",
            )
        )
    head = ("parameter", "unit", "before", "after", "moved, standard errors")
    return before_and_after(found, head, rows, words=("unit",))


def _said(estimate: Estimate, wider: float) -> str:
    return stated(estimate.value, wider * (estimate.stderr or 0.0))


def parameters_by_run(found: Discrepancy) -> Iterator[str | Picture]:
    """Yield the size of each effect in each run."""
    yield "## Run by run"
    sizes = [each.candidate.free[0] for each in found.assessment.identified]
    names = [run.name for run in found.data.fitted]
    if not sizes:
        yield "There is no effect to compare between runs."
        return
    if len(names) == 1:
        yield "There is one run only: no comparison between runs."
    for size in sizes:
        nearest = found.nearest.fitted
        said = _said(nearest.fit.estimates[size], math.sqrt(nearest.widening))
        label = plain(unit_of(size, found.definition))
        value = f"{said} {label}".rstrip()
        if len(names) == 1:
            yield f"{code(size)}: {value}."
            continue
        pairs = found.runs.coefficients[size]
        shown = [(n, v, e) for n, (v, e) in zip(names, pairs, strict=True) if math.isfinite(e)]
        blind = [n for n, (_, e) in zip(names, pairs, strict=True) if not math.isfinite(e)]
        spread = found.runs.between(size) / max(abs(found.best.fitted.fit[size]), 1e-300)
        differ = " They differ by no more than noise."
        if spread:
            differ = f" Beyond noise they differ by {share(spread)} of it."
        yield f"{code(size)}: all runs together {value}.{differ if len(shown) > 1 else ''}"
        head = ("run", f"value ({label})" if label else "value", "standard error, the others held")
        yield table(head, [(code(n), within(v, e), number(e, 2)) for n, v, e in shown])
        if blind:
            yield f"It is undetectable in {joined(blind)}."
    if len(names) > 1:
        yield Picture("runs", "Each run's own value, the other parameters held, with bars of 95 %.")


def ranked(found: Discrepancy) -> Iterator[str | Picture]:
    """Yield the ranking of candidates, and the alternatives of each effect."""
    yield "## Ranking"
    yield (
        "Every effect of the library, scored at the baseline's fit: the score G is what it would "
        "take off the sum of squares by itself, in units of the noise. The best were fitted with "
        "all other parameters: they have the fall of the sum of squares with Schwarz's penalty, "
        "and the least one on a held-out set."
    )
    head, rows = ranking_table(found)
    yield table(head, [(code(row[0]), *map(plain, row[1:])) for row in rows], words=("shape",))
    yield Picture("ranking", "Scores of the candidates at the baseline.")
    for each in found.assessment.identified:
        yield from _alternatives(found, each)


def _alternatives(found: Discrepancy, each: Identifiability) -> Iterator[str]:
    """Yield the table of alternatives of an effect."""
    name = code(each.candidate.name)
    if not each.alternatives:
        yield f"No other effect of the library could replace {name}."
        return
    claimed = "" if found.effects else ", the nearest effect, not claimed"
    yield (
        f"In the place of {name}{claimed} (gain {gained(each.gain)}): the separation s is the part "
        "of that gain which another effect does not reach."
    )
    head = ("instead", "gain", "behind", "share", "separation", "why not")
    rows = [
        (
            f"{code(other.candidate.name)} {plain(shape_text(found, other.candidate))}".rstrip(),
            gained(other.gain),
            gained(other.behind),
            number(other.separation, 2),
            gained(other.separation * each.gain),
            _why(other, found.assessment.thresholds.alike),
        )
        for other in each.alternatives[:ALTERNATIVES]
    ]
    yield table(head, rows, words=("why not",))


def _why(alternative: Alternative, alike: float) -> str:
    """Return the reason why an alternative was not accepted."""
    if alternative.contains:
        return "does the same with more parameters and gains no more"
    if alternative.alike:
        return f"indistinguishable: behind by less than {alike:g}, or by one run alone"
    return "refitted, explains less" if alternative.refitted else "scored, explains less"
