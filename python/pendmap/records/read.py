"""Reading of a file or folder as an experiment, with all checks in order."""

from __future__ import annotations

import dataclasses
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError, check_number
from pendmap.formatting import counted
from pendmap.records import (
    angle,
    clock,
    cross_checks,
    motion,
    noise,
    resolution,
    samples,
    scale,
    trigger,
)
from pendmap.records.across import checked_together
from pendmap.records.channels import channels_of
from pendmap.records.description import NAME, Description, RunPlan, read_description
from pendmap.records.experiment import Experiment, Finding, Run
from pendmap.records.rod_sensors import gyroscope_of
from pendmap.records.tables import read_table

if TYPE_CHECKING:
    import os

    from pendmap.records.tables import Table
    from pendmap.records.work import Work


# Suffixes of the files that are records in a folder without a description
TABLES: Final = (".csv", ".tsv", ".txt", ".dat", ".parquet", ".pq", ".xlsx", ".xls")
LEAST_RATE: Final = 1e-3  # Least sampling rate, Hz
MOST_RATE: Final = 1e9  # Greatest sampling rate, Hz


def files_of(path: str | os.PathLike[str]) -> list[Path]:
    """Return the files from which an experiment is read, without reading any record.

    Parameters
    ----------
    path : str or path
        File or folder, as in :func:`read_experiment`.

    Returns
    -------
    list of Path
        The file; or ``experiment.toml`` and the files that it names, which need not exist; or, in a
        folder without one, all files that may be records.

    Raises
    ------
    InputError
        If the ``experiment.toml`` is not valid.
    """
    place = Path(path)
    if not place.is_dir():
        return [place]
    if not (place / NAME).is_file():
        return _tables(place)
    plans = read_description(place / NAME).runs
    return [place / NAME, *(place / file for file in dict.fromkeys(plan.file for plan in plans))]


def read_experiment(path: str | os.PathLike[str], *, rate_hz: float | None = None) -> Experiment:
    """Read a record or a folder of records, and report its faults.

    A file (CSV, other text, Parquet, Excel) with a time and an angle is an experiment of one free
    decay. A folder is an experiment with an ``experiment.toml``; without it each file is a free
    decay. Each free release of a file is one run, named ``decay 1/3``. Nothing is written.
    Each fault is a finding under a stable key. Data are corrected only where the correction is
    unambiguous: wrapped turns are unwrapped, milliseconds become seconds. ``Run.trusted`` marks the
    samples for fitting.

    Parameters
    ----------
    path : str or path
        File or folder.
    rate_hz : float, optional
        Sampling rate, Hz, of files without a column of times: ``t = k / rate_hz``. It overrides
        ``rate_hz`` of [columns].

    Returns
    -------
    Experiment
        Runs in SI: times in s, angles in rad from the downward rest.

    Raises
    ------
    InputError
        If there is no valid record, with one line that names fault, place and valid input.
    OSError
        If a file cannot be read.

    Examples
    --------
    >>> import numpy as np
    >>> import pendmap
    >>> time = np.arange(0, 20, 0.01)
    >>> theta = 0.5 * np.exp(-0.02 * time) * np.cos(6.2 * time)
    >>> rows = np.column_stack((time, theta))
    >>> np.savetxt("run.csv", rows, delimiter=",", header="t_s,theta_rad", comments="")
    >>> pendmap.read_experiment("run.csv").runs[0].theta.size
    2000
    """
    place = Path(path)
    rate = None if rate_hz is None else check_number("rate_hz", rate_hz)
    if rate is not None and not LEAST_RATE <= rate <= MOST_RATE:
        raise InputError(f"rate_hz must be {LEAST_RATE:g} to {MOST_RATE:g} Hz, got {rate:g}")
    description = Description(rate_hz=rate)
    if not place.is_dir():
        runs, findings = _runs(place, RunPlan(place.name), description, {}, place.stem)
    elif not (place / NAME).is_file():
        runs, findings = _plain(place, description)
    else:
        description = read_description(place / NAME)
        description = dataclasses.replace(description, rate_hz=rate or description.rate_hz)
        runs, findings = _described(place, description)
    digests = {run.file: run.sha256 for run in runs}
    checked, together = checked_together(runs)
    return Experiment(place, checked, description.known, (*findings, *together), digests)


def _tables(folder: Path) -> list[Path]:
    """Return the files of a folder that may be records, sorted by name."""
    files = sorted(file for file in folder.iterdir() if file.suffix.lower() in TABLES)
    return [file for file in files if file.is_file() and not file.name.startswith((".", "~"))]


def _plain(folder: Path, description: Description) -> tuple[list[Run], list[Finding]]:
    """Read a folder without a description, in which each file is one free run."""
    files = _tables(folder)
    runs: list[Run] = []
    text = f"no {NAME}: each file is taken for one free run, in the order of the names"
    findings, refused = [Finding("no-description", text)], []
    for file, name in zip(files, _names([file.name for file in files]), strict=True):
        try:
            found, shared = _runs(file, RunPlan(file.name), description, {}, name)
        except InputError as error:
            refused.append(str(error))
            findings.append(Finding("file-left-out", f"left out: {error}"))
        else:
            runs += found
            findings += shared
    if not runs:
        first = f", the first refused: {refused[0]}" if refused else f" of {', '.join(TABLES)}"
        count = counted(len(refused), "file")
        raise InputError(
            f"{folder}: has no {NAME}: there must be one, or files that are records, got"
            f" {count}{first}"
        )
    return runs, findings


def _described(folder: Path, description: Description) -> tuple[list[Run], list[Finding]]:
    """Read the runs of an ``experiment.toml``."""
    tables: dict[str, tuple[Table, str]] = {}
    runs: list[Run] = []
    findings: list[Finding] = []
    names = _names([plan.file for plan in description.runs])
    for count, (plan, name) in enumerate(zip(description.runs, names, strict=True), 1):
        if not (folder / plan.file).exists():
            raise InputError(f"{folder / NAME}: [[run]] {count}: no file {plan.file!r}")
        found, shared = _runs(folder / plan.file, plan, description, tables, name)
        runs += found
        findings += shared
    return runs, findings


def _names(files: list[str]) -> list[str]:
    """Return distinct run names: file stems, with suffix or number if files share a stem."""
    stems = {file: file.rsplit(".", 1)[0] for file in files}
    alike, every, before = Counter(stems.values()), Counter(files), Counter[str]()
    names = []
    for file in files:
        before[file] += 1
        name = stems[file] if alike[stems[file]] == 1 else file
        names.append(f"{name} ({before[file]})" if every[file] > 1 else name)
    return names


def _runs(  # noqa: C901 (a step each)
    path: Path,
    plan: RunPlan,
    description: Description,
    tables: dict[str, tuple[Table, str]],
    name: str,
) -> tuple[list[Run], list[Finding]]:
    """Return the runs of a file, one per release, and the findings that belong to none."""
    if plan.file not in tables:
        tables[plan.file] = read_table(path, description.reader)
    table, digest = tables[plan.file]
    work = channels_of(table, description, plan, str(path))
    if plan.kind == "forced" and plan.drive is None and plan.pivot is None:
        text = 'kind is "forced" but neither drive nor pivot is given'
        work.report("drive-missing", text)
    clock.mend(work)
    work.cut(plan.from_s, plan.to_s)
    if not work.peaks_only:
        clock.cut_at_pauses(work)
    angle.check_peaks(work)
    angle.make(work)
    if not work.peaks_only:
        resolution.put_on_edges(work)
    if work.peaks_only or work.edges:
        # The intervals are those of turning points or encoder edges, not of a clock.
        work.findings = [found for found in work.findings if found.what not in clock.SPACING]
    if work.peaks_only:
        work.refuse_short()
        return [_run(work, name, digest)], []
    if not work.edges:
        samples.keep_readings(work)
    samples.check(work)
    moves = motion.moves(work)
    if moves and work.angle_source is None:
        scale.check(work)
    samples.say_steps(work)
    if moves:
        motion.check(work)
        trigger.check_drive(work)
        cross_checks.check(work)
        resolution.check(work)
    cross_checks.smooth_pivot(work)
    work.refuse_short()
    works, shared = work.split_by_release()
    runs = []
    for k, part in enumerate(works, 1):
        if moves:
            motion.check_zero(part)
            noise.check(part)
        own = f"{name} {k}/{len(works)}" if len(works) > 1 else name
        runs.append(_run(part, own, digest))
    return runs, [dataclasses.replace(found, where=found.where or name) for found in shared]


def _run(work: Work, name: str, digest: str) -> Run:
    """Return the run of a checked record."""
    plan = work.plan
    gyroscope = None
    if work.integrated:
        gyroscope = gyroscope_of(work.time, work.theta, work.extra["velocity"])
    return Run(
        name=name,
        file=plan.file,
        kind=plan.kind,
        time=work.time,
        theta=work.theta,
        trusted=work.trusted,
        lab_time_s=plan.lab_time_s,
        hold_out=plan.hold_out,
        velocity=work.extra.get("velocity"),
        acceleration=work.extra.get("acceleration"),
        accelerometer=work.angle_source,
        gyroscope=gyroscope,
        drive=plan.drive,
        pivot=work.pivot or None,
        pivot_unit=work.pivot_unit,
        findings=tuple(dataclasses.replace(f, where=f.where or name) for f in work.findings),
        peaks_only=work.peaks_only,
        segments=tuple(work.segments),
        channels=work.columns,
        unused=work.unused,
        count_rad=0.0 if work.edges else work.count,
        sha256=digest,
    )
