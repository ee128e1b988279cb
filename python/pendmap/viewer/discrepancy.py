"""The recording of a diagnosis: record and both models side by side, what is left, the report."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pendmap import report
from pendmap.charts.diagnosis import OVER_SAID
from pendmap.errors import InputError
from pendmap.files import whole_file
from pendmap.viewer import beside, columns, frame
from pendmap.viewer.beside import AFTER, BEFORE
from pendmap.viewer.panel import Panel

if TYPE_CHECKING:
    import os

    from pendmap.diagnosis import Discrepancy
    from pendmap.viewer.beside import Beside

Z95 = 1.959963984540054

SI = "rad/s\N{SUPERSCRIPT TWO}"


def record_discrepancy(found: Discrepancy, path: str | os.PathLike[str]) -> Path:
    """Write the recording of a diagnosis, with the layout in which the viewer shows it.

    For each run, ``k`` from 1, those held out last: three pendulums side by side,
    ``/run_k/pendulum/data/{record,before,after}/{arm,bob}``, the models' deviations from the record
    drawn larger by a factor that the view names; ``/run_k/angle/{record,before,after}`` (rad) and
    ``/run_k/residual/{before,after,above,below}`` (mrad; two standard deviations of the noise about
    0), on the timeline ``sim_time``, the record's own seconds. The torque that both models lack in
    ``/torque/{angle,velocity,amplitude,drive_phase,lab_time}/data/{before,after}``, the error of
    forecasts in ``/forecast/{free,forced}/data/{before,after,noise}``, the report's text in
    ``/summary``.

    Parameters
    ----------
    found : Discrepancy
        What :func:`pendmap.diagnosis.diagnose` returned.
    path : str or path
        The file to write, ``.rrd``; an existing one is replaced.

    Returns
    -------
    Path
        The file, complete.

    Raises
    ------
    InputError
        For an unknown suffix, or times that a recording cannot hold.
    OSError
        If the file cannot be written.
    """
    shown = beside.beside(found)
    latest = max(float(np.max(np.abs(one.time), initial=0.0)) for one in shown)
    if latest > columns.LATEST:
        raise InputError(
            f"{found.data.experiment.path}: time is {latest:g} s: a recording holds up to "
            f"{columns.LATEST:g} s"
        )
    larger = beside.magnified(shown)
    panels = _panels(found)
    with whole_file(path, (".rrd",)) as part, frame.strict():
        content = _content(found, shown)
        # A layout holds for all recordings of an application, and this one has runs of its own.
        recording = frame.identified(content, f"pendmap diagnosis {content[:6]}")
        with frame.written(recording, _blueprint(shown, larger, panels), part):
            _describe(recording, found, larger)
            frame.text(recording, "summary", report.as_markdown(report.diagnosis(found), {}))
            for number, one in enumerate(shown, 1):
                beside.log(recording, f"run_{number}", one, larger)
            for root, (panel, _) in panels.items():
                panel.log(recording, root)
            _torques(recording, found, panels)
            _forecasts(recording, found, panels)
    return Path(path)


def _panels(found: Discrepancy) -> dict[str, tuple[Panel, str]]:
    """Return panels of torques and forecasts by their roots, with what they are called."""
    panels = {}
    for over, said in OVER_SAID.items():
        rows = [
            row for t in (found.torque_before, found.torque_after) for row in t.rows.get(over, [])
        ]
        if rows:
            x = np.array([(row["from"], row["to"]) for row in rows])
            y = np.array(
                [row["torque"] + sign * Z95 * row["stderr"] for row in rows for sign in (-1, 1)]
            )
            along = " along the motion" if rows[0]["along_motion"] else ""
            panel = Panel.holding(x, np.append(y, 0.0), said, f"torque{along}  ({SI})")
            panels[f"torque/{over}"] = (panel, f"Torque lacking over {over.replace('_', ' ')}")
    for forecast in found.forecasts:
        y = 1e3 * np.concatenate([forecast.before, forecast.after, [0.0, forecast.noise_floor]])
        x = np.append(forecast.horizon, 0.0)
        panel = Panel.holding(x, y, "time ahead  (s)", "rms error  (mrad)")
        panels[f"forecast/{forecast.kind}"] = (panel, f"Error of forecasts, {forecast.kind} runs")
    return panels


def _torques(
    stream: rr.RecordingStream, found: Discrepancy, panels: dict[str, tuple[Panel, str]]
) -> None:
    for over in OVER_SAID:
        root = f"torque/{over}"
        if root not in panels:
            continue
        panel, _ = panels[root]
        zero = [np.array([[panel.x[0], 0.0], [panel.x[1], 0.0]])]
        panel.strips(stream, f"{root}/data/zero", zero, frame.INK, 0.5)
        for look, torque in ((BEFORE, found.torque_before), (AFTER, found.torque_after)):
            rows = torque.rows.get(over, [])
            if rows:
                panel.strips(stream, f"{root}/data/{look.name}", _steps(rows), look.colour, 1.5)
                panel.strips(
                    stream,
                    f"{root}/data/{look.name}/bars",
                    _bars(rows, look is AFTER),
                    look.colour,
                    0.8,
                )


def _steps(rows: list[dict[str, Any]]) -> list[np.ndarray]:
    """Return the line of a torque: level through each bin."""
    return [np.array([(row[end], row["torque"]) for row in rows for end in ("from", "to")])]


def _bars(rows: list[dict[str, Any]], right: bool) -> list[np.ndarray]:  # noqa: FBT001 (a side)
    """Return intervals of 95 %, beside the middle of each bin: both models' are seen."""
    part = 0.55 if right else 0.45
    lines = []
    for row in rows:
        x, half = row["from"] + part * (row["to"] - row["from"]), Z95 * row["stderr"]
        lines.append(np.array([[x, row["torque"] - half], [x, row["torque"] + half]]))
    return lines


def _forecasts(
    stream: rr.RecordingStream, found: Discrepancy, panels: dict[str, tuple[Panel, str]]
) -> None:
    for forecast in found.forecasts:
        root = f"forecast/{forecast.kind}"
        panel, _ = panels[root]
        floor = 1e3 * forecast.noise_floor
        noise = [np.array([[panel.x[0], floor], [panel.x[1], floor]])]
        panel.strips(stream, f"{root}/data/noise", noise, frame.INK, 1.0)
        for look, error in ((BEFORE, forecast.before), (AFTER, forecast.after)):
            line = np.stack([forecast.horizon, 1e3 * error], axis=1)
            panel.strips(stream, f"{root}/data/{look.name}", [line], look.colour, 1.5)


def _content(found: Discrepancy, shown: list[Beside]) -> str:
    """Return a name that tells what was recorded: other readings or models, another name."""
    estimates = [(n, e.value) for n, e in found.best.fitted.fit.estimates.items()]
    digest = hashlib.blake2b(repr((found.verdict, estimates)).encode(), digest_size=12)
    for one in shown:
        for column in (one.time, one.record, one.before, one.after):
            digest.update(np.ascontiguousarray(column).data)
    return digest.hexdigest()


def _describe(stream: rr.RecordingStream, found: Discrepancy, larger: float) -> None:
    """Log the recording's name and, as properties, verdict, effects and gap."""
    stream.send_recording_name(f"diagnosis of {Path(found.data.experiment.path).name}")
    gap = found.gap
    known: dict[str, float | str] = {
        "kind": "diagnosis",
        "verdict": found.verdict,
        "effects": ", ".join(effect.name for effect in found.effects),
        "noise_floor": gap.noise_floor,
        "before": gap.before,
        "after": gap.after,
        "held_out_before": gap.held_out_before,
        "held_out_after": gap.held_out_after,
        "deviations_drawn_larger": larger,
    }
    stream.send_property("pendmap", rr.AnyValues(drop_untyped_nones=True, **known))


def _blueprint(
    shown: list[Beside], larger: float, panels: dict[str, tuple[Panel, str]]
) -> rrb.Blueprint:
    """Return the layout: a tab a run and one of the panels, beside them the report."""
    runs = [beside.views(f"run_{k}", one, larger) for k, one in enumerate(shown, 1)]
    grid = rrb.Grid(
        *(panel.view(root, name) for root, (panel, name) in panels.items()),
        grid_columns=2,
        name="Gap",
    )
    front = rrb.Tabs(*runs, *([grid] if panels else []), active_tab=_worst(shown))
    aside = rrb.TextDocumentView(origin="/summary", name="Report")
    return frame.screen(front, aside, shares=[5, 3])


def _worst(shown: list[Beside]) -> int:
    """Return the run that the baseline misses most: it lies in front."""
    sizes = [
        float(np.sqrt(np.nanmean(one.before**2))) / one.sigma
        if np.isfinite(one.before).any()
        else 0
        for one in shown
    ]
    return int(np.argmax(sizes))
