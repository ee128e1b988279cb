"""Formatting of numbers and phrases shared by the parts of a report."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pendmap.formatting import written
from pendmap.model.labels import unit_of
from pendmap.report.document import code, plain, table

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pendmap.diagnosis import Discrepancy, NamedEffect

SMALL, LARGE = -4, 6
"""Powers of ten of numbers without an exponent: first one included, first one excluded."""

FAINT: Final = 1e-7  # Least standard error of a number without an exponent

RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float, digits: int = 3) -> str:
    """Return a number with some digits; with an exponent if it is very small or large."""
    if not value or not math.isfinite(value):
        return f"{value:g}"
    power = _power(float(f"{value:.{digits - 1}e}"))
    if SMALL <= power < LARGE:
        text = f"{round(value, digits - 1 - power):.{max(digits - 1 - power, 0)}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    mantissa = f"{value / 10.0**power:.{digits}g}"
    return _times(power).split()[-1] if mantissa == "1" else f"{mantissa}{_times(power)}"


def within(value: float, width: float) -> str:
    """Return a number to two digits of its uncertainty, with an exponent if it is small."""
    most = max(abs(value), abs(width))
    if not math.isfinite(most) or not 0 < most < 10.0**SMALL:
        return written(value, width)
    power = _power(most)
    return f"{written(value / 10.0**power, width / 10.0**power)}{_times(power)}"


def stated(value: float, error: float) -> str:
    """Return a number with its standard error to two digits, with a common exponent."""
    if not (error and math.isfinite(error)):
        return number(value, 5)
    power = 0
    if max(abs(value), error) < 10.0**SMALL or error < FAINT:
        power = _power(max(abs(value), error))
    value, error = value / 10.0**power, error / 10.0**power
    text = f"{written(value, error)} \N{PLUS-MINUS SIGN} {written(error, error)}"
    return f"({text}){_times(power)}" if power else text


def _power(value: float) -> int:
    return math.floor(math.log10(abs(value)))


def _times(power: int) -> str:
    return f" \N{MULTIPLICATION SIGN} 10{str(power).translate(RAISED)}"


def mrad(value: float) -> str:
    """Return a small angle, rad, in mrad."""
    return f"{number(1e3 * value)} mrad"


def gained(value: float) -> str:
    """Return a score or a difference of sums of squares as text."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"  # noqa: PLR2004 (three digits)


def chance(probability: float) -> str:
    """Return a probability in percent, never as 0 or 100 %."""
    if probability > 0.999:  # noqa: PLR2004 (as far as it is known)
        return "above 99.9 %"
    if probability < 0.001:  # noqa: PLR2004
        return "below 0.1 %"
    return f"{100 * probability:.{3 if probability > 0.99 else 2}g} %"  # noqa: PLR2004


def share(part: float) -> str:
    """Return a share in percent."""
    return f"{100 * part:.3g} %" if part > 0.99 else f"{100 * part:.0f} %"  # noqa: PLR2004


def joined(names: Iterable[str], last: str = "and") -> str:
    """Return names joined by commas and a last conjunction."""
    each = [code(name) for name in names]
    return f" {last} ".join([", ".join(each[:-1]), each[-1]] if len(each) > 1 else each)


def values(effect: NamedEffect) -> str:
    """Return an effect's parameters with 95 % intervals and units."""
    said = []
    for name, value in effect.parameters.items():
        unit = unit_of(f"{effect.name}.{name}", lambda _: effect.definition)
        after, bounds = plain(f" {unit}".rstrip()), effect.ci95.get(name)
        if bounds is None:
            said.append(f"{name} = {number(value, 4)}{after}")
            continue
        width = (bounds[1] - bounds[0]) / 2
        low, high = (within(bound, width) for bound in bounds)
        said.append(f"{name} = {within(value, width)}{after} (95 %: {low} to {high})")
    return f"{code(effect.name)}, {', '.join(said)}"


def lead(found: Discrepancy) -> str:
    """Return a summary of a diagnosis in one sentence."""
    names = joined(effect.name for effect in found.effects)
    several = len(found.effects) > 1
    nearest = found.nearest.fitted.names
    gap, closed = found.gap, found.assessment.closed
    to = f"from {mrad(gap.held_out_before)} to {mrad(gap.held_out_after)}"
    noise = f"the noise is {mrad(gap.held_out_noise_floor)}."
    if found.verdict == "none":
        return (
            "**Nothing detectable is missing**: the residual of the model is the noise of these "
            f"records, {mrad(gap.noise_floor)}."
        )
    if found.verdict == "named":
        return (
            f"**The model lacks** {names}. With {'them' if several else 'it'} the residual on "
            f"held-out data falls {to}; {noise}"
        )
    if found.verdict == "ambiguous":
        return (
            f"**The model lacks one of a class**: "
            f"{'; '.join(joined(each, 'or') for each in found.equivalent)}. These records do not "
            f"distinguish them. With the first, the residual on held-out data falls {to}; {noise}"
        )
    if found.verdict == "partial":
        return (
            f"**The model lacks approximately** {names}, and residuals remain. "
            f"{'They close' if several else 'It closes'} {share(closed)} of the squared gap: the "
            f"residual on held-out data falls {to}; {noise}"
        )
    near = ""
    if nearest:
        part = f"{share(closed)} of its squared gap" if closed > 0 else "nothing of its gap"
        s, verb = ("s", "close") if len(nearest) > 1 else ("", "closes")
        near = f" The nearest effect{s}, {joined(nearest)}, {verb} {part}; no name is claimed."
    return (
        "**Something is missing that no candidate explains**. The residual on held-out data is "
        f"{mrad(gap.held_out_before)}; {noise}{near}"
    )


def before_and_after(
    found: Discrepancy,
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    words: Sequence[str] = (),
) -> str:
    """Return a table, without the columns ``after`` if the best model is the baseline."""
    if found.adds:
        return table(head, rows, words)
    kept = [k for k, name in enumerate(head) if not name.startswith(("after", "moved"))]
    own = [head[k].replace("before", "baseline") for k in kept]
    return table(own, [[row[k] for k in kept] for row in rows], words)
