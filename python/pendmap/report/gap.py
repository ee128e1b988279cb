"""Parts 1 to 4 of a diagnosis' report: the verdict, the gap, where it is, figure 7."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from pendmap.discrepancy.summary import PLACES
from pendmap.discrepancy.torque import STANDS_OUT
from pendmap.discrepancy.verdict import CHANCE, FORECAST
from pendmap.report.document import Items, Name, Paragraph, Picture, Section, Strong, Table
from pendmap.report.wording import chance, compared, joined, mrad, values

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pendmap.discrepancy import Discrepancy
    from pendmap.discrepancy.horizon import Forecast
    from pendmap.report.document import Block, Text

__all__ = ["gap", "verdict", "where"]

SAID: Final = {
    "none": "the model describes the records to within their noise.",
    "named": "what was found explains all that the model lacked.",
    "ambiguous": "a class of effects explains it, which these records do not tell apart.",
    "partial": "what was found closes most of the gap, and something is left: its form is only "
    "nearly right.",
    "unknown": "something is missing that no effect of the library explains. No name is claimed.",
}

RARE: Final = 1e-9
"""Probabilities below this say no more than that."""


def verdict(found: Discrepancy) -> Section:
    """Return the verdict with its probability, and what it rests on."""
    blocks: list[Block] = [
        Paragraph((Strong(found.verdict.capitalize()), ": ", SAID[found.verdict]))
    ]
    effects = tuple(
        (*values(effect), f"; the right name with a probability {_of(effect.probability)}")
        for effect in found.effects
    )
    if effects:
        blocks.append(Items(effects))
    blocks += [
        Paragraph(("Not told apart here: ", *joined(names), ".")) for names in found.equivalent
    ]
    blocks += [Paragraph("It rests on this:"), Items(tuple(_rests(found)))]
    return Section("Verdict", tuple(blocks))


def _rests(found: Discrepancy) -> Iterator[Text]:
    judged = found.judgement
    form = judged.form
    yield (
        f"Chi-squared over degrees of freedom is {judged.ratio:.4g}; the doubt about the noise "
        f"allows up to {judged.ratio_allowed:.4g}. On what was held out it is "
        f"{judged.ratio_held:.4g}."
    )
    further = () if form.further is None else (" (", Name(form.further), " would take up most)")
    left: dict[str, tuple[str | Name, ...]] = {
        "slow": ("so much in the slow part of the residuals",),
        "torque": ("such a torque over angle, velocity, amplitude, phase or time",),
        "runs": ("the parameters of the runs so far apart",),
        "effects": ("so much for an effect that is not in the model", *further),
    }
    for key, words in left.items():
        chance_of = _rare(form.chances[key])
        yield ("Noise alone would leave ", *words, f" with a probability {chance_of}.")
    yield (
        f"Something is left where the least of these, times how many they are, is below {CHANCE:g};"
        f" with effects found, also where chi-squared on what was held out is above {FORECAST:g}."
    )


def _rare(probability: float) -> str:
    return f"of {probability:.2g}" if probability > RARE else f"below {RARE:g}"


def _of(probability: float) -> str:
    said = chance(probability)
    return said if said.startswith(("above", "below")) else f"of {said}"


def gap(found: Discrepancy) -> Iterator[Section]:
    """Yield the gap before and after, and how forecasts lose their way."""
    own = found.gap
    rows = [
        ("fitted runs", mrad(own.before), mrad(own.after), mrad(own.noise_floor)),
        ("held out", mrad(own.held_out_before), mrad(own.held_out_after), mrad(own.noise_floor)),
    ]
    each = [
        (
            ("held out: " if run.held_out else "", Name(run.name)),
            mrad(run.before),
            mrad(run.after),
            mrad(run.noise_floor),
        )
        for run in own.by_run
    ]
    names = joined(dict.fromkeys(run.name for run in found.evidence.held))
    parts = "Stretches were held back of " if found.evidence.inside else "Held back: "
    after = "; before is the baseline, after the model found" if found.adds else ""
    yield Section(
        "The gap",
        (
            Paragraph(
                (
                    f"Root mean squares of record less model{after}. {parts}",
                    *names,
                    ". No parameter was fitted to that.",
                )
            ),
            compared(found, Table(("residual", "before", "after", "noise"), (*rows, *each))),
            Picture("gap", "Residual by run, and the error of forecasts against their horizon."),
            Picture("residuals", "Record less model where the baseline misses most."),
        ),
    )
    if found.forecasts:
        yield Section(
            "How far ahead the models see",
            (
                Paragraph(
                    "From starts on held-out data each model runs forward without any further "
                    "reading; its state at the start comes from the swing before. Root mean square "
                    "errors:"
                ),
                compared(
                    found,
                    Table(
                        ("runs", "ahead", "before", "after", "noise"),
                        tuple(row for f in found.forecasts for row in _ahead(f)),
                    ),
                ),
                *_chaotic(found),
            ),
        )


def _ahead(forecast: Forecast) -> Iterator[tuple[str, ...]]:
    last = forecast.horizon.size - 1
    for k in dict.fromkeys((0, last // 4, last // 2, last)):
        yield (
            forecast.kind,
            f"{forecast.horizon[k]:.3g} s",
            mrad(forecast.before[k]),
            mrad(forecast.after[k]),
            mrad(forecast.noise_floor),
        )


def _chaotic(found: Discrepancy) -> Iterator[Block]:
    if any(forecast.kind == "forced" for forecast in found.forecasts):
        yield Paragraph(
            "A forced motion may be chaotic; then what the noise hides of the state grows in every "
            "model."
        )


def where(found: Discrepancy) -> Iterator[Section]:
    """Yield where torque is lacking, and the errors of periods and peaks."""
    blocks: list[Block] = []
    clearest: dict[str, dict[str, Any]] = {}
    for row in found.where:
        clearest.setdefault(row["over"], row)
    if clearest:
        blocks += [
            Paragraph(
                "The torque per moment of inertia that the baseline lacks stands out most clearly:"
            ),
            Items(tuple(_place(row) for row in clearest.values())),
        ]
    else:
        blocks.append(
            Paragraph(
                f"The torque that the baseline lacks stands out nowhere by more than "
                f"{STANDS_OUT:g} standard errors."
            )
        )
    blocks.append(Picture("torque", "Torque that is lacking, with bands of 95 %."))
    yield Section("Where the gap is", tuple(blocks))
    rows: list[tuple[Text, ...]] = [
        (
            ("held out: " if one.held_out else "", Name(one.name)),
            *(
                f"{getattr(one.errors[m], what):.3g} %" if m in one.errors else ""
                for what in ("period_rms", "peak_rms")
                for m in ("before", "after")
            ),
        )
        for one in found.cycles
    ]
    if rows:
        head = ("free run", "periods, before", "after", "peaks, before", "after")
        yield Section(
            "Periods and peaks",
            (
                Paragraph(
                    "Each model runs forward from the first measured peak, as in the paper's "
                    "figure 7. Root mean square errors:"
                ),
                compared(found, Table(head, tuple(rows))),
                Picture("figure_7", "Errors of simulated periods and peaks."),
            ),
        )


def _place(row: dict[str, Any]) -> str:
    along = " along the motion" if row["along_motion"] else ""
    return (
        f"{PLACES[row['over']]} {row['from']:.3g} to {row['to']:.3g} {row['unit']}: "
        f"{row['torque']:.2g} \N{PLUS-MINUS SIGN} {row['stderr']:.1g} "
        f"rad/s\N{SUPERSCRIPT TWO}{along}"
    )
