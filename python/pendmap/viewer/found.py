"""What was found in a record, as a page of text."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError
from pendmap.formatting import counted, written
from pendmap.model.labels import unit_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pendmap.identification import Estimate, Identification, IdentificationReport

COMPARED: Final = ("w0", "c_over_m", "Tr")
"""What all methods are compared by."""

FOLLOWING: Final[Mapping[str, str]] = {"zeta": "", "theta_r": " rad"}
"""What follows from them, with its unit."""


def page(report: IdentificationReport) -> str:
    """Return the tables of what was found, with intervals, and everything that was warned of."""
    return "\n".join([*_best(report), *_methods(report), *_warnings(report)])


def _applied(report: IdentificationReport) -> Identification | None:
    try:
        return report.best
    except InputError:
        return None


def _best(report: IdentificationReport) -> Iterator[str]:
    best = _applied(report)
    if best is None:
        yield from ("**No method could be applied.**", "")
        return
    yield f"## By {_said(best.method)}"
    yield from ("", f"Used: {best.used}." if best.used else "", "")
    yield from ("| parameter | value | 95 % interval | unit |", "|---|---|---|---|")
    for name, each in best.estimates.items():
        yield f"| {name} | {_value(each)} | {_interval(each)} | {unit_of(name)} |"
    yield ""
    follows = [f"{name} = {each.value:.4g}{FOLLOWING[name]}" for name, each in best.derived.items()]
    if follows:
        yield from (f"So {' and '.join(follows)}.", "")
    yield from (f"- {text}" for text in best.warnings)
    yield ""
    if report.joint is not None and report.joint.fit.rms:
        fit = report.joint.fit
        noise = ", ".join(f"{reading.sigma:.3g}" for reading in report.joint.readings)
        yield (
            f"Residuals: {fit.rms:.3g} rad rms in {counted(fit.samples, 'reading')}; noise seen "
            f"without a model: {noise} rad."
        )
        yield ""


def _methods(report: IdentificationReport) -> Iterator[str]:
    """Return a table a parameter: one of all would be too wide for a column of the window."""
    for parameter in COMPARED:
        known = {n: m for n, m in report.methods.items() if parameter in m.estimates}
        if not known:
            continue
        yield from (f"## {parameter} ({unit_of(parameter)}) by each method", "")
        yield from ("| method | value | 95 % interval |", "|---|---|---|")
        for name, found in known.items():
            each = found.estimates[parameter]
            yield f"| {_said(name)} | {_value(each)} | {_interval(each)} |"
        yield ""


def _warnings(report: IdentificationReport) -> Iterator[str]:
    runs = report.joint.runs if report.joint is not None else (report.run,)
    said_of = {n: each for n, each in report.methods.items() if each is not _applied(report)}
    found = [(name, text) for name, each in said_of.items() for text in each.warnings]
    if found:
        yield from ("## Warnings of the other methods", "")
        yield from (f"- {_said(name)}: {text}" for name, text in found)
        yield ""
    said = [(run.name, finding.text) for run in runs for finding in run.findings]
    said += [("experiment", finding.text) for finding in report.experiment.findings]
    if said:
        yield from ("## The record", "")
        yield from (f"- {where}: {text}" for where, text in said)


def _said(method: str) -> str:
    return method.replace("_", " ")


def _width(each: Estimate) -> float:
    """Return half the width of the interval, or the standard error, or 0 where nothing is known."""
    if each.ci95 is not None:
        return (each.ci95[1] - each.ci95[0]) / 2
    return each.stderr or 0.0


def _value(each: Estimate) -> str:
    return written(each.value, _width(each))


def _interval(each: Estimate) -> str:
    if each.ci95 is None or not _width(each):  # peaks without errors leave intervals without width
        return ""
    low, high = (written(end, _width(each)) for end in each.ci95)
    return f"[{low}, {high}]"
