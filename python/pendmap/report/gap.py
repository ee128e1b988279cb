"""Sections of a diagnosis report: verdict, gap, residual torque, periods and peaks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.diagnosis.result import PLACES, SAID
from pendmap.report.document import Picture, bullets, code
from pendmap.report.wording import (
    before_and_after,
    chance,
    joined,
    mrad,
    number,
    stated,
    values,
)
from pendmap.residuals.torque import STANDS_OUT

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pendmap.comparison.forecast import Forecast
    from pendmap.diagnosis import Discrepancy

PROBABILITY: Final = (
    "The probability of a name is that it is right, given that the effect is in the library. It "
    "was calibrated on blind experiments, and falls with the remaining residual, with the number "
    "of effects, and with the weakness of the effect relative to the strongest."
)

RARE: Final = 1e-9  # Smallest reported probability

UNEVEN: Final = 1.5
"""Ratio of the noise at high speed to that at low speed above which the report mentions it."""


def verdict(found: Discrepancy) -> Iterator[str]:
    """Yield the verdict with its probabilities and the statistics it is based on."""
    yield "## Verdict"
    yield f"**{found.verdict.capitalize()}**: {SAID[found.verdict]}."
    if found.effects:
        yield bullets(
            f"{values(effect)}; probability {chance(effect.probability)}"
            for effect in found.effects
        )
        shared = " Indistinguishable names share it." if found.verdict == "ambiguous" else ""
        yield PROBABILITY + shared
    for names in found.equivalent:
        yield f"Indistinguishable in these records: {joined(names)}."
    yield "Statistics of the verdict:"
    yield bullets(_statistics(found))


def _statistics(found: Discrepancy) -> Iterator[str]:
    """Yield the statistics on which the verdict is based."""
    judged = found.assessment
    form, limits = judged.form, judged.thresholds
    yield (
        f"The mean of squared residuals over squared noise is {number(judged.ratio, 4)} in the run "
        "that exceeds its noise most, where noise alone has 1; the uncertainty and the colour of "
        f"the noise allow up to {number(judged.ratio_allowed, 4)}."
    )
    left = {
        "slow": "as much in the slow part of the residuals",
        "torque": "as much torque over angle, velocity, amplitude, phase or time",
        "runs": "the parameters of the runs as far apart",
        "effects": "as much for an effect that is not in the model to explain",
    }
    if form.further is not None:
        left["effects"] += f" ({code(form.further)} would explain most)"
    if judged.identified:
        left["held_out"] = "as large residuals in what was held out"
    rare = f"below {number(RARE, 1)}"
    for key, what in left.items():
        chance_of = form.chances[key]
        said = f"of {number(chance_of, 2)}" if chance_of > RARE else rare
        yield f"Noise alone would leave {what} with a probability {said}."
    count = len(form.chances)
    yield (
        f"The least of these {count} probabilities, times {count} (Bonferroni), is "
        f"{number(form.chance, 2) if form.chance > RARE else rare}. Below {limits.rest:g} the "
        "residuals are significant."
    )


def gap(found: Discrepancy) -> Iterator[str | Picture]:
    """Yield the gap before and after, and the forecast errors."""
    own = found.gap
    floor = mrad(own.held_out_noise_floor)
    rows = [
        ("fitted runs", mrad(own.before), mrad(own.after), mrad(own.noise_floor)),
        ("held out", mrad(own.held_out_before), mrad(own.held_out_after), floor),
    ]
    for run in own.by_run:
        name = f"{'held out: ' if run.held_out else ''}{code(run.name)}"
        rows.append((name, mrad(run.before), mrad(run.after), mrad(run.noise_floor)))
    parts = "stretches of " if found.data.inside else ""
    after = "; before is the baseline, after the model found" if found.adds else ""
    yield "## The gap"
    yield (
        f"Root mean squares of record less model{after}. Held out: {parts}"
        f"{joined(dict.fromkeys(run.name for run in found.data.held))}. No parameter was fitted to "
        "that."
    )
    yield before_and_after(found, ("residual", "before", "after", "noise"), rows)
    yield from noise_of(found)
    yield Picture("gap", "Residual by run, and the error of forecasts against their horizon.")
    yield Picture("residuals", "Record less model where the baseline misses most.")
    if not found.forecasts:
        return
    yield "## Forecast errors"
    yield (
        "From starts on held-out data each model runs forward without any further reading; its "
        "state at the start comes from the swing before. Root mean square errors:"
    )
    ahead = [row for forecast in found.forecasts for row in _ahead(forecast)]
    yield before_and_after(found, ("runs", "ahead", "before", "after", "noise"), ahead)
    if any(forecast.kind == "forced" for forecast in found.forecasts):
        yield (
            "A forced motion may be chaotic; then errors of the initial state grow in every model."
        )


def _ahead(forecast: Forecast) -> Iterator[tuple[str, ...]]:
    """Yield table rows of the forecast error at some horizons."""
    last = forecast.horizon.size - 1
    for k in dict.fromkeys((0, last // 4, last // 2, last)):
        yield (
            forecast.kind,
            f"{number(forecast.horizon[k])} s",
            mrad(forecast.before[k]),
            mrad(forecast.after[k]),
            mrad(forecast.noise_floor),
        )


def where(found: Discrepancy) -> Iterator[str | Picture]:
    """Yield the bins with a missing torque, and the errors of periods and peaks."""
    yield "## Where the gap is"
    if found.where:
        yield "The torque per moment of inertia that the baseline lacks is most significant:"
        yield bullets(map(_place, found.clearest))
        yield (
            "Each is fitted by itself, as if the torque depended on that quantity alone, beyond "
            "what damping, friction, frequency and initial states can explain. Where it depends on "
            "another one, the value may be too large and of either sign."
        )
    else:
        yield (
            f"The torque that the baseline lacks exceeds {STANDS_OUT:g} standard errors nowhere."
        )
    yield Picture("torque", "Missing torque, with bands of 95 %.")
    rows = [
        (
            f"{'held out: ' if one.held_out else ''}{code(one.name)}",
            *(
                f"{number(getattr(one.errors[m], what))} %" if m in one.errors else ""
                for what in ("period_rms", "peak_rms")
                for m in ("before", "after")
            ),
        )
        for one in found.cycles
    ]
    if not rows:
        return
    yield "## Periods and peaks"
    yield (
        "Each model runs forward from the first measured peak, as in the paper's figure 7. Root "
        "mean square errors:"
    )
    head = ("free run", "periods, before", "after", "peaks, before", "after")
    yield before_and_after(found, head, rows)
    yield Picture("figure_7", "Errors of simulated periods and peaks.")


def _place(row: dict[str, Any]) -> str:
    along = " along the motion" if row["along_motion"] else ""
    return (
        f"{PLACES[row['over']]} {number(row['from'])} to {number(row['to'])} {row['unit']}: "
        f"{stated(row['torque'], row['stderr'])} "
        f"rad/s\N{SUPERSCRIPT TWO}{along}"
    )


def noise_of(found: Discrepancy) -> Iterator[str]:
    """Yield notes on the noise of the readings."""
    noise = [run.sigmas[run.counted] for run in found.data.fitted]
    low, high = (float(end) for end in np.percentile(np.concatenate(noise), (5, 95)))
    if high > UNEVEN * low:
        yield (
            "The noise is that of the readings used, each at its own speed: about "
            f"{mrad(low)} where they are slow and {mrad(high)} where they are fast. "
            f"({code('pendmap look')} gives one number for a whole record.)"
        )
    yield from _block_means(found)


def _block_means(found: Discrepancy) -> Iterator[str]:
    """Yield a note for each run whose dense readings were averaged."""
    data = found.data
    for run, k in zip(data.fitted, data.fitted_of, strict=True):
        size = data.runs[k].time.size
        if run.time.size < size:
            yield (
                f"The {size} readings of {code(run.name)} are denser than the motion needs: "
                f"{run.time.size} means of them were fitted, and the noise above is that of the "
                f"means. A reading by itself has {mrad(data.readings[k].sigma)}."
            )
