"""JSON and text of an experiment's records, noise, segments and findings."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.formatting import counted, moment
from pendmap.records.noise import noise_floor
from pendmap.records.samples import FINEST

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pendmap.records.experiment import Experiment, Run
    from pendmap.records.noise import NoiseFloor
    from pendmap.tables.findings import Finding

# Findings of a wrong unit or scale, which makes results wrong unless corrected
UNIT_FINDINGS: Final = frozenset(("angle-scale", "angle-unit", "pivot-unit", "time-unit"))
# Findings that are reported before any result
DOUBTFUL: Final = UNIT_FINDINGS | {
    "few-used",
    "lab-time-missing",
    "motor-column",
    "rigs-differ",
    "upright-left-out",
}


def as_json(experiment: Experiment) -> dict[str, Any]:
    """Return the JSON object of ``pendmap look``; its top level joins the fields of the runs."""
    runs = [_run(run) for run in experiment.runs]
    whole: dict[str, Any] = {"path": str(experiment.path), "known": dict(experiment.known)}
    whole["unused"] = list(dict.fromkeys(name for run in runs for name in run["unused"]))
    if len(runs) == 1:
        (only,) = runs
        whole |= {key: only[key] for key in ("channels", "rate_hz", "noise", "segments")}
    else:
        loudest = max(runs, key=lambda run: np.nan_to_num(run["noise"]["sigma"]))
        whole["channels"] = {key: text for run in runs for key, text in run["channels"].items()}
        whole["rate_hz"] = float(np.median([run["rate_hz"] for run in runs]))
        whole["noise"] = loudest["noise"] | {"run": loudest["name"]}
        whole["segments"] = [{"run": r["name"], **s} for r in runs for s in r["segments"]]
    findings = [{"run": r["name"], **finding} for r in runs for finding in r["findings"]]
    whole["findings"] = [dataclasses.asdict(finding) for finding in experiment.findings] + findings
    whole["runs"] = runs
    return whole


def _run(run: Run) -> dict[str, Any]:
    """Return the JSON object of a run."""
    used = run.theta[run.trusted]
    same = ("name", "file", "sha256", "kind", "lab_time_s", "hold_out")
    return {
        **{key: getattr(run, key) for key in same},
        "drive": None if run.drive is None else dict(run.drive),
        "channels": dict(run.channels),
        "unused": list(run.unused),
        "samples": int(run.time.size),
        "trusted": int(run.trusted.sum()),
        "from_s": float(run.time[0]),
        "to_s": float(run.time[-1]),
        "rate_hz": run.rate_hz,
        "theta_min": float(used.min()) if used.size else None,
        "theta_max": float(used.max()) if used.size else None,
        "count_rad": run.count_rad or None,
        "peaks_only": run.peaks_only,
        "noise": dataclasses.asdict(noise_floor(run)) | {"unit": noise_unit(run)},
        "segments": [dataclasses.asdict(segment) for segment in run.segments],
        "findings": [dataclasses.asdict(finding) for finding in run.findings],
    }


def as_text(experiment: Experiment) -> str:
    """Return the content of an experiment as text."""
    lines = [*doubt_lines(experiment, *experiment.runs)]
    if experiment.known:
        known = ", ".join(f"{name} {value:g}" for name, value in experiment.known.items())
        lines.append(f"rig       {known}")
    lines += [_line(finding) for finding in experiment.findings if not _doubted(finding)]
    for run in experiment.runs:
        if lines:
            lines.append("")
        lines += _lines(run)
    return "\n".join(lines)


def _lines(run: Run) -> Iterator[str]:
    """Yield the lines about a run."""
    held = ", held out" if run.hold_out else ""
    yield f"{run.name} ({run.kind}{held})"
    channels = ", ".join(f"{channel} from {column!r}" for channel, column in run.channels.items())
    yield f"  channels  {channels}"
    span = f"{moment(run.time[0])} to {moment(run.time[-1])} s"
    what = "turning point" if run.peaks_only else "sample"
    rate = "" if run.peaks_only else f" at {run.rate_hz:.5g} Hz"
    count = run.count_rad
    turn = f"{2 * math.pi / count:.5g} a turn" if count > FINEST else ""
    steps = f", in steps of {count:.4g} rad ({turn})" if turn else ""
    yield f"  samples   {run.time.size} {what}s{rate}, {span}; {run.trusted.sum()} for fitting"
    yield f"  angle     {run.theta.min():.4g} to {run.theta.max():.4g} rad{steps}"
    if run.drive is not None:
        phi = run.drive["phi"]
        phase = "phi to be fitted" if phi is None else f"phi = {phi:g}"
        yield f"  drive     p = {run.drive['p']:g}, Omega = {run.drive['Omega']:g} rad/s, {phase}"
    if run.pivot is not None:
        ways = ", ".join(
            f"{way} {np.nanmin(values):.4g} to {np.nanmax(values):.4g} {run.pivot_unit}"
            for way, values in run.pivot.items()
            if np.isfinite(values).any()
        )
        yield f"  pivot     {ways or 'no numbers'}"
    if not run.peaks_only:
        yield f"  noise     {noise_said(noise_floor(run), noise_unit(run))}"
    for segment in run.segments:
        used = "for fitting" if segment.used else "not for fitting"
        yield f"  {segment.what:<9} {moment(segment.from_s)} to {moment(segment.to_s)} s, {used}"
    mended = sum(finding.mended for finding in run.findings)
    many = counted(len(run.findings), "finding")
    yield f"  {many}, {mended} of them mended" if run.findings else "  no findings"
    for finding in run.findings:
        if not _doubted(finding):
            yield f"  {_line(finding)}"


def _line(finding: Finding) -> str:
    """Return the line of a finding."""
    mark = "mended: " if finding.mended else ""
    where = f" ({finding.where})" if finding.where.startswith(("row", "line")) else ""
    return f"- {mark}{finding.text}{where}  [{finding.what}]"


def doubts(experiment: Experiment, *runs: Run) -> list[str]:
    """Return the texts of all uncorrected findings that make results doubtful."""
    findings = experiment.findings_of(runs)
    return [f"{where}: {finding.text}" for where, finding in findings if _doubted(finding)]


def doubt_lines(experiment: Experiment, *runs: Run) -> Iterator[str]:
    """Yield a warning for each of :func:`doubts`."""
    return (f"Warning: {text}" for text in doubts(experiment, *runs))


def doubt_keys(experiment: Experiment, *runs: Run) -> set[str]:
    """Return the keys of uncorrected doubtful findings of the readings that are used."""
    keys = {finding.what for _, finding in experiment.findings_of(runs) if _doubted(finding)}
    # An effect can cause the first two, the others are of readings that are not used.
    return keys - {"angle-scale", "lab-time-missing", "few-used", "upright-left-out"}


def finding_lines(experiment: Experiment, *runs: Run, changes: bool = False) -> Iterator[str]:
    """Yield a line for each finding that is not in :func:`doubts`, or for changes of data alone."""
    for where, finding in experiment.findings_of(runs):
        changed = finding.mended or finding.what == "file-left-out"
        if not _doubted(finding) and (changed or not changes):
            yield f"{where}: {'mended: ' if finding.mended else ''}{finding.text}"


def _doubted(finding: Finding) -> bool:
    """Return whether a finding makes results doubtful and is not corrected."""
    return finding.what in DOUBTFUL and not finding.mended


def noise_unit(run: Run) -> str:
    """Return the unit of :func:`noise_floor`."""
    return "rad" if run.gyroscope is None else "rad/s"


def noise_said(noise: NoiseFloor, unit: str = "rad") -> str:
    """Return the noise as text."""
    if not math.isfinite(noise.sigma):
        return "unknown, too few samples"
    degrees = f"{math.degrees(noise.sigma):.2g} degrees{unit.removeprefix('rad')}"
    if noise.bound:
        few = "motion included: few samples a period"
        return f"at most {noise.sigma:.2g} {unit} ({degrees}), {few}"
    text = f"{noise.sigma:.3g} +- {noise.stderr:.1g} {unit} ({degrees})"
    if noise.limited_by_count:
        return f"{text}, that of rounding to counts: the record shows no less"
    return text
