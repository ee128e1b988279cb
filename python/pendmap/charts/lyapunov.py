"""Chart of a Lyapunov exponent: growth of deviations, running mean, distribution."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from pendmap.charts import names
from pendmap.charts.chart import Axis, Chart, Panel, holding
from pendmap.charts.legend import typeset
from pendmap.charts.marks import DASHED, QUIET, ZERO, Band, Level, Line, Span, Steps
from pendmap.files import facts
from pendmap.formatting import counted, typographic, with_error
from pendmap.units import Units

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.charts.marks import Mark

_LINE, _MEAN, _BAND, _TRANSIENT = "#1d3557", "#d55e00", "#9db4d3", "#f8edd6"
_BINS: Final = 60  # Number of bins of the distribution
_SIGMAS: Final = 2  # Half width of the band, standard errors
_WIDTHS: Final = {1: 6.0, 2: 8.8, 3: 12.4}  # Width of a figure by its number of panels, inches


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 0) -> Chart:
    """Return the growth of deviations; for chaos also the exponent and its distribution."""
    del cells
    panels = [_growth(dataset)]
    if dataset.sizes["window"]:
        panels += [_average(dataset), _distribution(dataset)]
    ends = {
        "undamped": "motion without damping",
        "undecided": "undecided",
        "failed": "the motion leaves the range of numbers",
    }
    end = ends.get(str(dataset["end"].item()), "")
    of = typeset(str(dataset["attractor"].values[0])) if dataset.sizes["attractor"] else end
    return Chart(
        f"Largest Lyapunov exponent: {of}",
        names.with_start(facts(dataset)),
        [panels],
        size=(_WIDTHS[len(panels)], 4.3),
    ).only(layer, (_WIDTHS[1], 4.3))


def _rate(dataset: xr.Dataset) -> str:
    return f"λ ({names.per_time(Units.of(facts(dataset)))})"


def _mean_look(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the look of lines that show the exponent; their name is its value with its error."""
    a, text = facts(dataset), ""
    exponent, error = float(a["largest_exponent"]), float(a["largest_exponent_stderr"])
    if math.isfinite(exponent):
        value = typographic(with_error(exponent, error))
        text = f"λ = {value} {names.per_time(Units.of(a))}"
    return {"colour": _MEAN, "width": 1.6, "dash": DASHED, "name": text}


def _level(dataset: xr.Dataset, axis: Literal["x", "y"] = "y") -> Level:
    value = float(dataset["largest_exponent"])
    return Level(value, axis=axis, order=2.0, path="value", **_mean_look(dataset))


def _growth(dataset: xr.Dataset) -> Panel:
    a, periods, growth = facts(dataset), dataset["elapsed"].values, dataset["growth"].values
    rate, transient = float(a["per_period"]), max(int(a["transient_periods"]), 0)
    marks: list[Mark] = [ZERO, Line(periods, growth, colour=_LINE, width=1.1, path="own")]
    if transient:
        text = f"transient, {counted(transient, 'period')}"
        marks.insert(0, Span((0, transient), colour=_TRANSIENT, name=text))
    if math.isfinite(rate) and math.isfinite(a["largest_exponent_stderr"]):
        begin = min(int(np.searchsorted(periods, transient)), periods.size - 1)
        # Over many decades the constant matters little, so that the line meets the end.
        last = growth[-1] if transient else rate * periods[-1]
        line = last + rate * (periods[begin:] - periods[-1])
        marks.append(Line(periods[begin:], line, **_mean_look(dataset)))
    up = Axis("ln |δx|", holding(growth, 0.0))
    title = "growth along the start's own trajectory"
    first, last = dataset["elapsed"].values[[0, -1]].tolist()
    clock = Axis("periods since the start", (first, max(last, first + 1)))
    return Panel("growth", title, clock, up, marks)


def _average(dataset: xr.Dataset) -> Panel:
    """Return the mean over all trajectories against the periods averaged, with its band."""
    a, periods = facts(dataset), dataset["averaged"].values.astype(float)
    mean, error = dataset["running_exponent"].values, dataset["running_stderr"].values
    marks: list[Mark] = []
    shown = [mean]
    if math.isfinite(a["largest_exponent_stderr"]):
        low, high = mean - _SIGMAS * error, mean + _SIGMAS * error
        text = f"±{_SIGMAS} standard errors of the mean"
        marks.append(Band(periods, low, high, colour=_BAND, name=text, path="band"))
        shown += [low, high]
    if a["end"] == "undamped":
        regular = np.log1p(periods / a["dropped_periods"]) / (periods * a["forcing_period"])
        text = "regular motion: deviations grow as τ"
        marks.append(Line(periods, regular, width=1.0, dash=":", name=text, order=4.0))
        shown.append(regular)
    marks += [_level(dataset), Line(periods, mean, colour=_LINE, path="own", order=3.0)]
    across = Axis("periods averaged, each", (periods[0], periods[-1]), "log")
    title = f"mean over {a['trajectories']} trajectories"
    up = Axis(_rate(dataset), holding(*shown, margin=0.08))
    return Panel("average", title, across, up, marks)


def _distribution(dataset: xr.Dataset) -> Panel:
    values = dataset["finite_time_exponent"].values.ravel()
    density, edges = np.histogram(values, bins=_BINS, density=True)
    marks = [
        Steps(edges, density, colour=_BAND, filled=True),
        Steps(edges, density, colour=_LINE, width=0.9, path="density"),
        _level(dataset, "x"),
        Level(0.0, axis="x", colour=QUIET, width=0.6),
    ]
    across = Axis(_rate(dataset), (float(edges[0]), float(edges[-1])))
    up = Axis("density", (0.0, 1.08 * float(density.max())))
    title = f"exponents over {dataset.attrs['window']} periods"
    return Panel("distribution", title, across, up, marks)
