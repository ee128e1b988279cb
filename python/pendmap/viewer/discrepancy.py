"""Recording of a diagnosis: record and both models side by side, residuals, the report."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import rerun.blueprint as rrb

from pendmap import report
from pendmap.charts import diagnosis, names
from pendmap.viewer import chart, frame, runs
from pendmap.viewer.comparison import thinned
from pendmap.viewer.runs import Series

if TYPE_CHECKING:
    import os

    import rerun as rr

    from pendmap.charts.marks import Floats
    from pendmap.diagnosis import Discrepancy
    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun

RATIO: Final = 0.56  # Height of a panel over its width
RECORD: Final = Series("record", (128, 128, 128), 1.0)
BEFORE: Final = Series("before", (213, 94, 0), 1.6)
AFTER: Final = Series("after", (0, 114, 178), 1.6)
APART: Final = 2.5  # Distance between two pivots, arm lengths
THIN, BROAD = (0.8, 4.0, 3.0), (3.0, 10.0, 1.0)
"""Radii of arm and bob, in screen points, and drawing order (greater is on top)."""
SEEN: Final = 0.3
"""Angle at which the old model's pendulum is drawn at a residual of three times the root mean
square, rad."""
MOST: Final = 1000.0  # Greatest magnification of the drawn deviations


@dataclass(frozen=True)
class Beside:
    """A record (s, rad) and the residuals of two models (rad), with the noise of a reading.

    A row of NaN marks a gap; samples that are not used are NaN.
    """

    name: str
    time: Floats
    record: Floats
    before: Floats
    after: Floats
    sigma: float

    @property
    def rms(self) -> float:
        """Root mean square residual of the old model, rad; 0 if no sample is used."""
        known = self.before[np.isfinite(self.before)]
        return float(np.sqrt(np.mean(known**2))) if known.size else 0.0


def record_discrepancy(found: Discrepancy, path: str | os.PathLike[str]) -> Path:
    """Write the recording of a diagnosis, with the layout in which the viewer shows it.

    For each run, ``k`` from 1, with held-out runs last: three pendulums side by side,
    ``/run_k/pendulum/data/{record,before,after}/{arm,bob}``, the models' deviations from the
    record magnified by a factor in the view's name; ``/run_k/angle/{record,before,after}`` (rad)
    and ``/run_k/residual/{before,after,above,below}`` (mrad; two standard deviations of the noise
    about 0), on the timeline ``sim_time``, the record's own seconds. The missing torque of both
    models is in ``/torque/{angle,velocity,amplitude,drive_phase,lab_time}/data/{before,after}``,
    the forecast error in ``/forecast/{free,forced}/data/{before,after,noise}``, the report's text
    in ``/summary``.

    Parameters
    ----------
    found : Discrepancy
        Result of :func:`pendmap.diagnose`.
    path : str or path
        The file to write, ``.rrd``; an existing one is replaced.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    InputError
        For an unknown suffix, or times that a recording cannot hold.
    OSError
        If the file cannot be written.
    """
    shown = _beside(found)
    source = Path(found.data.experiment.path)
    runs.refuse_late(source, (one.time for one in shown))
    larger = _magnified(shown)
    panels = [chart.Place.of(panel, RATIO) for panel in diagnosis.recorded(found)]
    tabs: list[rrb.Container] = [_views(f"run_{k}", one, larger) for k, one in enumerate(shown, 1)]
    if panels:
        views = [place.frame.view(place.panel.where, place.panel.title) for place in panels]
        tabs.append(rrb.Grid(*views, grid_columns=2, name="Gap"))
    # The run with the worst baseline fit is in front.
    worst = int(np.argmax([one.rms / one.sigma for one in shown]))
    aside = rrb.TextDocumentView(origin="/summary", name="Report")
    estimates = [(n, e.value) for n, e in found.best.fitted.fit.estimates.items()]
    arrays = (a for one in shown for a in (one.time, one.record, one.before, one.after))

    def log(stream: rr.RecordingStream) -> None:
        frame.text(stream, "summary", report.as_markdown(found, {}))
        for number, one in enumerate(shown, 1):
            _log(stream, f"run_{number}", one, larger)
        for place in panels:
            chart.log_panel(stream, place)

    gap = found.gap
    return frame.save(
        path,
        frame.screen(rrb.Tabs(*tabs, active_tab=worst), aside, shares=[5, 3]),
        log,
        name=f"diagnosis of {source.name}",
        content=runs.content_of((found.verdict, estimates), arrays),
        known={
            "kind": "diagnosis",
            "verdict": found.verdict,
            "effects": ", ".join(effect.name for effect in found.effects),
            "noise_floor": gap.noise_floor,
            "before": gap.before,
            "after": gap.after,
            "held_out_before": gap.held_out_before,
            "held_out_after": gap.held_out_after,
            "deviations_drawn_larger": larger,
        },
        own_layout=True,
    )


def _beside(found: Discrepancy) -> list[Beside]:
    """Return all runs, with whole runs held out after the others."""
    data, base, best = found.data, found.base, found.best
    fits, w0 = (base.fitted.fit, best.fitted.fit), found.base.fitted.fit.model.w0
    held = (base.hold_out.fit, best.hold_out.fit)
    made = []
    for k, run in enumerate(data.fitted):
        left = [_left(run, fit, k) for fit in fits]
        if data.inside and data.fitted_of[k] in data.held_of:
            # The stretches held back lie within the run, and the motion continues through them.
            place = data.held_of.index(data.fitted_of[k])
            back = [_left(data.held[place], fit, place) for fit in held]
            left = [np.where(np.isfinite(b), b, a) for a, b in zip(left, back, strict=True)]
        made.append(_drawn(run, left, run.name, w0))
    if not data.inside:
        for k, run in enumerate(data.held):
            left = [_left(run, fit, k) for fit in held]
            made.append(_drawn(run, left, f"{run.name}, held out", w0))
    return made


def _left(run: FitRun, fit: TrajectoryFit, place: int) -> Floats:
    known = np.isfinite(fit.curves[place][0])
    if run.trusted is not None:
        known &= run.trusted
    return np.where(known, fit.residuals[place], math.nan)


def _drawn(run: FitRun, left: list[Floats], name: str, w0: float) -> Beside:
    sigma = float(np.sqrt(np.mean(np.square(run.sigma))))
    instants, record, before, after = thinned(run.time, w0, run.theta, *left)
    return Beside(name, instants, record, before, after, sigma)


def _magnified(shown: list[Beside]) -> float:
    """Return the magnification of the pendulums' deviations: 1, 2, 5, 10, ..."""
    wanted = SEEN / (3 * max(*(one.rms for one in shown), 1e-12))
    power = 10.0 ** math.floor(math.log10(wanted))
    return float(np.clip(max(m * power for m in (1, 2, 5) if m * power <= wanted), 1.0, MOST))


def _views(root: str, one: Beside, larger: float) -> rrb.Container:
    """Return the views of a run: three pendulums above, angles and residuals below."""
    times = f", deviations {larger:g} times larger" if larger > 1 else ""
    pendulums = rrb.Spatial2DView(
        origin=f"/{root}/pendulum",
        name=f"Record, old model, new model{times}",
        visual_bounds=rrb.VisualBounds2D(x_range=[-APART / 2, 2.5 * APART], y_range=[-1.15, 1.5]),
    )
    below = [
        runs.view(f"{root}/angle", f"{names.ANGLE}, {one.name}"),
        runs.view(f"{root}/residual", "Record less model (mrad)"),
    ]
    return rrb.Vertical(pendulums, *below, row_shares=[5, 3, 4], name=one.name)


def _log(stream: rr.RecordingStream, root: str, one: Beside, larger: float) -> None:
    """Log one run: angles, residuals, and three pendulums side by side.

    A model's pendulum is drawn at the record's angle plus its deviation magnified by ``larger``;
    the record's pendulum is thin behind it.
    """
    runs.series(stream, f"{root}/angle/record", one.time, one.record, RECORD)
    at = f"{root}/pendulum"
    pivots = [APART * place for place in range(3)]
    runs.pivots(stream, at, pivots)
    labels = ["record", "old model", "new model"]
    frame.write(stream, f"{at}/axes/names", [[x, 1.2] for x in pivots], labels)
    runs.pendulum(stream, f"{at}/data/record", one.time, one.record, RECORD, BROAD)
    for look, left, pivot in ((BEFORE, one.before, pivots[1]), (AFTER, one.after, pivots[2])):
        path, theta = f"{at}/data/{look.name}", one.record - larger * left
        runs.series(stream, f"{root}/angle/{look.name}", one.time, one.record - left, look)
        look_left = Series(look.name, look.colour, 1.2)
        runs.residual(stream, f"{root}/residual/{look.name}", one.time, left, look_left)
        runs.pendulum(stream, f"{path}/record", one.time, one.record, RECORD, THIN, pivot)
        runs.pendulum(stream, path, one.time, theta, look, BROAD, pivot)
    runs.noise(stream, f"{root}/residual", one.time, one.sigma)
