"""Records with their models in motion: angles, residuals with the noise, pendulums side by side."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap.charts import names, palette, registry
from pendmap.charts.palette import look
from pendmap.comparison import Comparison
from pendmap.comparison.experiment import in_short
from pendmap.diagnosis import Discrepancy
from pendmap.diagnosis.result import as_text as diagnosis_text
from pendmap.formatting import MINUS
from pendmap.identification import IdentificationReport
from pendmap.identification.report import as_text as identification_text
from pendmap.viewer import chart, recording
from pendmap.viewer.marks import plain
from pendmap.viewer.recording import INK, Look

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pendmap.charts.marks import Floats
    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun
    from pendmap.records import Run

RECORD: Final = Look((128, 128, 128), 1.0, 3.0, "record")
INSTANTS: Final = 20000
"""Greatest number of drawn instants of a run; of a longer one every k-th is drawn, unless too few
per swing would remain."""
PER_SWING: Final = 24  # Least number of drawn instants per swing
GAP: Final = 8.0  # Interval, over the median, above which a gap is not bridged
MILLI: Final = 1e3  # Residuals are in mrad, which needs fewer digits on the axis
BAND: Final = 2.0  # Half width of the band of noise, standard deviations
APART: Final = 2.5  # Distance between two pivots, arm lengths


@dataclass(frozen=True)
class Motion:
    """A record and its models, in s and rad; a row of NaN marks a gap.

    ``models`` have a look and angles; ``sigma`` is the noise of a reading.
    """

    name: str
    time: Floats
    record: Floats
    models: Sequence[tuple[Look, Floats]]
    sigma: float


def contents(result: Any) -> dict[str, Any]:  # noqa: ANN401 (of several types)
    """Return layout, contents and name of the recording of what was found in records."""
    shown = registry.of_result(result, layer=registry.ALL)
    drawn, text, every = chart.drawings(shown), summary(result), motions(result)
    recording.refuse_late(shown.title, (one.time for one in every))
    tabs = [container(f"run_{k}", one) for k, one in enumerate(every, 1)]
    tabs += [one.container for one in drawn]

    def write(stream: rr.RecordingStream) -> None:
        chart.log(stream, drawn, text)
        for number, one in enumerate(every, 1):
            log(stream, f"run_{number}", one)

    arrays = (v for one in every for v in (one.time, one.record, *(m[1] for m in one.models)))
    return {
        "name": plain(shown.title),
        "content": recording.content_of([shown.title, text, *arrays]),
        "known": {"kind": type(result).__name__},
        "layout": recording.screen(rrb.Tabs(*tabs, active_tab=0), chart.ASIDE, shares=[11, 5]),
        "log": write,
    }


def motions(result: Any) -> list[Motion]:  # noqa: ANN401 (of several types)
    """Return the runs in motion."""
    if isinstance(result, IdentificationReport):
        return of_identification(result)
    return of_diagnosis(result) if isinstance(result, Discrepancy) else []


def summary(result: Any) -> str:  # noqa: ANN401 (of several types)
    """Return the text of a result, as its command prints it."""
    lines: Iterable[str] = [repr(result)]
    if isinstance(result, IdentificationReport):
        lines = identification_text(result)
    elif isinstance(result, Discrepancy):
        lines = diagnosis_text(result)
    elif isinstance(result, Comparison):
        lines = in_short(result)
    return "\n\n".join(line.strip() for line in lines)


def of_identification(report: IdentificationReport) -> list[Motion]:
    """Return every run to which a trajectory was fitted."""
    made, joint = [], report.joint
    if joint is None:
        return []
    for k, (one, reading) in enumerate(zip(joint.runs, joint.readings, strict=True)):
        angle, residual = joint.fit.curves[k][0], joint.fit.residuals[k]
        # Errors of a sensor on the rod do not apply to the angle.
        theta = one.theta - residual if one.gyroscope is None else angle
        theta = np.where(one.trusted & np.isfinite(angle), theta, math.nan)
        made.append(_thinned(one, report.model.w0, [(_look("model"), theta)], reading.sigma))
    return made


def of_diagnosis(result: Discrepancy) -> list[Motion]:
    """Return all runs with both models, whole runs held out after the others."""
    data, w0 = result.data, result.base.fitted.fit.model.w0
    fits = (result.base.fitted.fit, result.best.fitted.fit)
    held = (result.base.hold_out.fit, result.best.hold_out.fit)
    looks = [_look(name) for name in ("before", "after")]
    made = []
    for k, run in enumerate(data.fitted):
        angles = [_model(run, fit, k) for fit in fits]
        made.append(_thinned(run, w0, list(zip(looks, angles, strict=True)), _noise_of(run)))
    for k, run in enumerate(() if data.inside else data.held):
        pairs = list(zip(looks, [_model(run, fit, k) for fit in held], strict=True))
        held_out = _thinned(run, w0, pairs, _noise_of(run))
        made.append(replace(held_out, name=f"{run.name}, held out"))
    return made


def _noise_of(run: FitRun) -> float:
    return float(np.sqrt(np.mean(np.square(run.sigma))))


def _look(name: str) -> Look:
    return Look(palette.parts(look(name).colour), 1.6, 1.0, look(name).label)


def _model(run: FitRun, fit: TrajectoryFit, place: int) -> Floats:
    """Return the reading of a model, NaN at samples that are not used."""
    used = np.isfinite(fit.curves[place][0])
    if run.trusted is not None:
        used &= run.trusted
    return np.where(used, run.theta - fit.residuals[place], math.nan)


def _thinned(
    run: FitRun | Run, w0: float, angles: Sequence[tuple[Look, Floats]], sigma: float
) -> Motion:
    """Return the drawn instants of a run, with NaN in gaps."""
    step = float(np.median(np.diff(run.time)))
    most = int(min(math.tau / w0 / step, run.time.size) / PER_SWING)
    every = max(1, min(-(-run.time.size // INSTANTS), most))
    chosen = run.time[::every]
    cuts = np.flatnonzero(np.diff(chosen) > GAP * every * step) + 1
    time = np.insert(chosen, cuts, (chosen[cuts - 1] + chosen[cuts]) / 2)
    record, *models = (
        np.insert(column[::every], cuts, math.nan)
        for column in (run.theta, *(theta for _, theta in angles))
    )
    drawn = [(shade, theta) for (shade, _), theta in zip(angles, models, strict=True)]
    return Motion(run.name, time, record, drawn, sigma)


def container(root: str, one: Motion) -> rrb.Container:
    """Return the views of a run: pendulums above, angles and residuals below."""
    who = ", ".join(["record", *(shade.name for shade, *_ in one.models)])
    wide = [-APART / 2, APART * (len(one.models) + 0.5)]
    pendulums = rrb.Spatial2DView(
        origin=f"/{root}/pendulum",
        name=f"{who[:1].upper()}{who[1:]}",
        visual_bounds=rrb.VisualBounds2D(x_range=wide, y_range=[-1.15, 1.5]),
    )
    named = {"angle": f"{names.ANGLE}, {one.name}", "residual": "Record less model (mrad)"}
    # A decay leaves this corner free.
    corner = rrb.Corner2D.RightTop
    below = [
        rrb.TimeSeriesView(origin=f"/{root}/{leaf}", name=name, plot_legend=corner)
        for leaf, name in named.items()
    ]
    return rrb.Vertical(pendulums, *below, row_shares=[5, 3, 4], name=one.name)


def log(stream: rr.RecordingStream, root: str, one: Motion) -> None:
    """Log one run: angles, residuals with the noise, and pendulums side by side."""
    recording.series(stream, f"{root}/angle/record", one.time, one.record, RECORD)
    path = f"{root}/pendulum"
    stream.log(f"{path}/data", recording.UPWARD, static=True)
    pivots = [APART * place for place in range(1 + len(one.models))]
    spots = rr.Points2D([[x, 0.0] for x in pivots], colors=[INK], radii=rr.Radius.ui_points(3.0))
    stream.log(f"{path}/axes/pivots", spots, static=True)
    words = ["record", *(shade.name for shade, *_ in one.models)]
    named = recording.labels([[x, 1.2] for x in pivots], words)
    stream.log(f"{path}/axes/names", named, static=True)
    record = one.time, one.record
    _pendulum(stream, f"{path}/data/record", record, RECORD, 0.0)
    for pivot, (shade, theta) in zip(pivots[1:], one.models, strict=True):
        leaf = f"{path}/data/{shade.name}"
        recording.series(stream, f"{root}/angle/{shade.name}", one.time, theta, shade)
        _pendulum(stream, f"{leaf}/record", record, RECORD, pivot)
        _pendulum(stream, leaf, (one.time, theta), shade, pivot)
        residual = one.record - theta
        rms = MILLI * math.sqrt(float(np.nanmean(residual**2)))
        leaf = shade.name if len(one.models) > 1 else "residual"
        named_look = replace(shade, size=1.2, name=f"{shade.name}, {rms:.3g} mrad rms")
        recording.series(stream, f"{root}/residual/{leaf}", one.time, MILLI * residual, named_look)
    size = MILLI * BAND * one.sigma
    for leaf, sign, mark in (("above", 1.0, "+"), ("below", -1.0, MINUS)):
        name = f"{mark}{BAND:g} σ of the noise, {mark}{size:.3g} mrad"
        lines = np.full(2, sign * size), Look(INK, 1.5, name=name)
        recording.series(stream, f"{root}/residual/{leaf}", one.time[[0, -1]], *lines)


def _pendulum(
    stream: rr.RecordingStream, path: str, motion: tuple[Floats, Floats], shade: Look, pivot: float
) -> None:
    """Log a pendulum; the record's is thin and on top beside a model."""
    time, theta = motion
    known = np.isfinite(theta)
    at = np.stack([pivot + np.sin(theta), -np.cos(theta)], axis=1)[known]
    arms = np.stack([np.broadcast_to((pivot, 0.0), at.shape), at], axis=1)
    arm, bob = (0.8, 4.0) if shade is RECORD and pivot else (3.0, 10.0)
    recording.strips(stream, f"{path}/arm", time[known], arms, replace(shade, size=arm))
    recording.points(stream, f"{path}/bob", time[known], at, replace(shade, size=bob, order=2.0))
