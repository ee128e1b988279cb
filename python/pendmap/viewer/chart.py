"""Recordings of charts and of datasets: panels, their marks, a legend in words, layouts."""

from __future__ import annotations

import functools
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import rerun.blueprint as rrb

from pendmap.charts import marks as charts
from pendmap.charts import palette, registry
from pendmap.charts.chart import Sheet
from pendmap.files import facts
from pendmap.viewer import marks, recording, trajectory
from pendmap.viewer.marks import Place, plain

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    import rerun as rr
    import xarray as xr

    from pendmap.charts.chart import Chart
    from pendmap.charts.marks import Mark

_OF_A_RUN: Final = ("seconds", "summary", "history")  # Facts that differ between equal results
CELLS: Final = 4096
"""Most rows and columns of an image; not all graphics processors take larger ones."""
FEW: Final = 3  # Number of views up to which they stand below one another
ASIDE: Final = rrb.Vertical(
    rrb.TextDocumentView(origin="/legend", name="Legend"),
    rrb.TextDocumentView(origin="/summary", name="Summary"),
)


@dataclass(frozen=True, eq=False)
class Drawing:
    """A chart with the places of its panels."""

    chart: Chart
    places: Sequence[Place]

    @property
    def container(self) -> rrb.Container:
        """Layout of the panels: tabs, or below one another, in two columns if they are many."""
        views, name = [place.view() for place in self.places], plain(self.chart.title)
        if self.chart.timeline:
            return rrb.Vertical(rrb.Tabs(*views[:-1], active_tab=0), views[-1], name=name)
        if self.chart.tabs:
            return rrb.Tabs(*views, active_tab=0, name=name)
        if len(views) > FEW:
            return rrb.Grid(*views, grid_columns=2, name=name)
        return rrb.Vertical(*views, name=name)

    def legend(self) -> Iterator[str]:
        """Yield lines with names and colours of the marks, warnings and notes."""
        chart = self.chart
        yield from (f"## {plain(chart.title)}", "", plain(chart.subtitle), "")
        names: dict[str, str] = {}
        for place in self.places:
            if place.panel.warning:
                yield from (f"**{plain(place.panel.warning)}**", "")
            names |= marks.legend(place.panel.marks)
        for name, shade in names.items():
            yield f"- {plain(name)}" + f": {palette.in_words(shade)}" * (shade != charts.INK)
        yield from (f"\n{plain(note)}" for note in chart.notes)


def drawings(shown: Chart | Sheet) -> list[Drawing]:
    """Return the charts of a figure; those of a sheet have numbered paths."""
    sheet = isinstance(shown, Sheet)
    every = shown.charts if isinstance(shown, Sheet) else [shown]
    made = []
    for number, chart in enumerate(every, 1):
        places: dict[str, Place] = {}
        for panel in chart.recorded or chart.panels:
            name = f"part_{number}/{panel.where}" if sheet else panel.where
            root = re.sub(r"[^\w/]+", "_", name)
            root += f"_{len(places)}" if root in places else ""
            places[root] = Place.of(chart.whole(panel), chart.ratio, root)
        made.append(Drawing(chart, list(places.values())))
    return made


def log(stream: rr.RecordingStream, drawn: Iterable[Drawing], summary: str) -> None:
    """Log the panels of charts, their legend and a summary."""
    recording.text(stream, "summary", summary)
    recording.text(stream, "legend", "\n".join(line for one in drawn for line in one.legend()))
    for place, steps in ((place, one.chart.timeline) for one in drawn for place in one.places):
        if place.panel.bare:
            recording.text(stream, place.root, "\n".join(_document(place.panel.marks)))
            continue
        place.log_frame(stream)
        for number, mark in enumerate(place.panel.marks):
            marks.log(stream, place, mark, number, steps)


def _document(every: Sequence[Mark]) -> Iterator[str]:
    """Yield tables and texts of a panel without a frame as lines of Markdown."""
    for mark in every:
        if isinstance(mark, charts.Table):
            head, *rows = ([plain(cell) for cell in row] for row in (mark.head, *mark.rows))
            lines = [head, ["---"] * len(head), *rows]
            yield from (f"| {' | '.join(cells)} |" for cells in lines)
        elif isinstance(mark, charts.Text):
            yield from ("", plain(mark.text))


def contents(dataset: xr.Dataset) -> dict[str, Any]:
    """Return layout, contents and name of the recording of a dataset."""
    attrs, kind = dataset.attrs, dataset.attrs["kind"]
    known = {str(k): v for k, v in facts(dataset).items() if k not in _OF_A_RUN}
    arrays = (v.values for k, v in sorted(dataset.variables.items()) if v.ndim)
    made: dict[str, Any] = {
        "name": ": ".join(str(attrs[key]) for key in ("kind", "title") if key in attrs),
        "content": recording.content_of([sorted(known.items()), *arrays]),
        # A property has one type in all recordings of a process.
        "known": {
            k: v if isinstance(v, str) else float(v) for k, v in known.items() if np.ndim(v) == 0
        },
    }
    if kind == "trajectory":
        around = trajectory.places(known, dataset["velocity"].values)
        layout = trajectory.layout(known, around)
        return made | {"layout": layout, "log": functools.partial(trajectory.log, dataset=dataset)}
    drawn = drawings(registry.build(dataset, cells=CELLS))
    text = "\n\n".join(str(attrs.get("summary", "")).splitlines())
    return made | {
        "layout": recording.screen(
            drawn[0].container, ASIDE, shares=[6, 5], steps=drawn[0].chart.timeline
        ),
        "log": functools.partial(log, drawn=drawn, summary=text),
    }
