"""Lifetimes of transient chaos: survival with its tail, and the mean against the tail's start."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.charts import names, palette
from pendmap.charts.chart import Axis, Chart, Panel
from pendmap.charts.legend import colours_of, typeset
from pendmap.charts.marks import INK, QUIET, Band, Dash, Level, Line, Mark, Points, Span, bars
from pendmap.files import facts
from pendmap.formatting import counted, typographic, with_error, written

if TYPE_CHECKING:
    import xarray as xr

    from pendmap.charts.marks import Floats

SIGMAS: Final = 2.0  # Half width of a band, standard errors
FEW: Final = 0.01
"""Share of starts cut off at the bound above which curves of single attractors are not drawn."""
_FIT, _BAND = "#d55e00", "#f4c3a0"
_DASHES: Final[tuple[Dash, ...]] = ("-", (5, 1.5), (1.2, 1.2), (5, 1.5, 1.2, 1.5))
"""Dashes of the curves, because those of mirror twins coincide."""
_LEAST_SIGNIFICANT: Final = 0.05  # Significance level below which a tail is not exponential
_MARK: Final = (2.0, 2.0)  # Dash of the line at the start of the tail


def chart(dataset: xr.Dataset, *, layer: str | None = None, cells: int = 0) -> Chart:
    """Return survival curves with the fitted tail, and the mean time left by start of the tail."""
    del cells
    panels, a = [_survival(dataset)], facts(dataset)
    if dataset.sizes["tail_begin"] > 1:
        panels.append(_tail(dataset))
    if a["persistent"]:
        title = f"Persistent chaos: {typeset(str(dataset['attractor'].values[0]))}"
    elif a["transient_chaos"]:
        mean = written(float(a["mean_periods"]), float(a["mean_periods_stderr"]))
        title = f"Transient chaos: lives {mean} periods on average"
    else:
        decided = math.isfinite(a["escape_rate"]) or a["captured_starts"]
        title = "No transient chaos" if decided else "Undecided"
    subtitle = f"{names.parameters(a)};   {counted(int(dataset.attrs['starts']), 'start')}"
    size = (9.6 if len(panels) > 1 else 6.0, 4.6)
    return Chart(title, subtitle, [panels], size=size).only(layer, (6.0, 4.6))


def _survival(dataset: xr.Dataset) -> Panel:
    """Return the share of all starts still alive, and of each attractor if few are cut off."""
    a, captured = facts(dataset), dataset["captured"].values
    starts, periods = int(a["starts"]), dataset["elapsed"].values.astype(float)
    lasting = round(float(a["chaotic_share"]) * starts)
    alive: list[tuple[str, str, Any]] = [
        ("all starts", INK, starts - int(a["failed"]) - lasting - captured.sum(axis=0))
    ]
    if a["persistent"]:
        periods = np.array([0.0, float(a["chaos_bound"])])
        alive = [("all starts", INK, np.full(2, starts))]
    elif int(a["censored"]) <= FEW * starts:
        total = np.rint(dataset["fraction"].values * starts)
        called, colours = dataset["attractor"].values, colours_of(dataset)
        for k in np.flatnonzero(captured.any(axis=1)).tolist():
            text = f"those that {typeset(str(called[k]))} captures"
            alive.append((text, palette.on_white(colours[k]), total[k] - captured[k]))
    marks: list[Mark] = []
    for k, (text, colour, count) in enumerate(alive):
        share = np.where(count > 0, count / starts, np.nan)
        look: dict[str, Any] = {"name": text, "path": str(k), "colour": colour}
        look |= {"width": 1.3 if k else 1.8, "dash": _DASHES[k % 4]}
        marks.append(Line(periods, share, step=True, **look))
    lowest = min(np.min(count[count > 0], initial=starts) for _, _, count in alive) / starts
    marks += _fit(dataset, periods, alive[0][2] / starts)
    across = Axis("periods", (periods[0], max(periods[-1], periods[0] + 1.0)))
    up = Axis("share alive", (max(0.5 / starts, 0.5 * float(lowest)), 1.5), "log")
    return Panel("survival", "share of starts still alive", across, up, marks)


def _fit(dataset: xr.Dataset, periods: Floats, share: Floats) -> list[Mark]:
    """Return the fitted tail; empty without transient chaos, or if the tail begins later."""
    a, last = facts(dataset), periods[-1]
    begin = max(float(a["from_period"]), periods[0])
    if not a["transient_chaos"] or begin > last:
        return []
    mean, error = float(a["mean_periods"]), float(a["mean_periods_stderr"])
    at = np.linspace(begin, max(last, begin + 1), 200)
    low, middle, high = (
        np.interp(begin, periods, share)
        * np.exp((at - begin) * np.log1p(-1 / max(mean + way * SIGMAS * error, 1.01)))
        for way in (-1, 0, 1)
    )
    life = typographic(with_error(mean, error))
    text = f"tail from period {a['from_period']}: mean lifetime {life} periods"
    return [
        Band(at, low, high, colour=_BAND, name=text, path="band", order=1.0),
        Line(at, middle, colour=_FIT, width=1.4, name=text, path="tail", order=5.0),
        Level(begin, axis="x", colour=QUIET, dash=_MARK),
    ]


def _tail(dataset: xr.Dataset) -> Panel:
    """Return the mean time left against the start of the tail; open points: not exponential."""
    begin, mean = dataset["tail_begin"].values.astype(float), dataset["tail_mean"].values
    error, chance = dataset["tail_stderr"].values, dataset["tail_exponential"].values
    a = facts(dataset)
    marks: list[Mark] = []
    if a["transient_chaos"]:
        middle, wide = float(a["mean_periods"]), SIGMAS * float(a["mean_periods_stderr"])
        marks = [
            Span((middle - wide, middle + wide), axis="y", colour=_BAND),
            Level(middle, colour=_FIT, width=1.4, path="fitted", order=1.0),
            Level(float(a["from_period"]), axis="x", colour=QUIET, dash=_MARK),
        ]
    rough = chance <= _LEAST_SIGNIFICANT
    spots: dict[str, Any] = {"size": 4.0, "edge": INK, "edge_width": 0.8, "order": 3.0}
    good, not_so = (
        "from here on exponential, with standard error",
        "not exponential at the 5 % level",
    )
    marks += [
        Line(*bars(begin, mean - error, mean + error), colour=QUIET, width=0.8, path="error"),
        Points(begin, mean, name=good, path="mean", **spots),
        Points(begin[rough], mean[rough], fill="#ffffff", name=not_so, **spots),
    ]
    precise = error < np.maximum(0.25 * mean, 1e-9)
    low = float(np.min((mean - error)[precise], initial=float(mean.min())))
    high = float(np.max((mean + error)[precise], initial=low * 1.05))
    room = 0.08 * (high - low)
    across = Axis("where the tail begins (periods)", (0.0, 1.03 * float(begin[-1])))
    up = Axis("mean time left (periods)", (low - room, high + room))
    return Panel("tail", "mean time left, against where the tail begins", across, up, marks)
