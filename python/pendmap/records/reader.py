"""From a path to an experiment."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pendmap.errors import InputError
from pendmap.records import angle, clock, motion, noise_check, resampled, samples, scale, signs
from pendmap.records.channels import Channels, channels_of
from pendmap.records.description import ALONE, NAME, RunPlan, read_description
from pendmap.records.experiment import Experiment, Finding, Run
from pendmap.records.table import read_table
from pendmap.records.work import Work

if TYPE_CHECKING:
    import os

    from pendmap.records.description import Description
    from pendmap.records.text import Table

__all__ = ["read_experiment"]


def read_experiment(path: str | os.PathLike[str]) -> Experiment:
    """Read a record or a folder of records, and say what is odd about them.

    A file (CSV, other text, Parquet) with a time and an angle is an experiment of one free decay. A
    folder is one with an ``experiment.toml``. Nothing is written. What is certain is mended (turns
    that a sensor wraps are unwrapped, milliseconds become seconds, ...), and that is said; all
    else is only said. ``Run.trusted`` marks the samples that are for fitting.

    Parameters
    ----------
    path : str or path
        The file or folder.

    Returns
    -------
    Experiment
        Its runs in SI: times in s, angles in rad from the downward rest.

    Raises
    ------
    InputError
        If there is no record in it, on one line that says what, where and what is allowed.
    OSError
        If a file cannot be read.

    Examples
    --------
    >>> experiment = pendmap.read_experiment("lab")  # doctest: +SKIP
    >>> experiment.runs[0].theta  # doctest: +SKIP
    """
    place = Path(path)
    if not place.is_dir():
        run = _run(place, RunPlan(place.name), ALONE, {}, place.stem)
        return Experiment(place, (run,), {}, (), {place.name: run.sha256})
    if not (place / NAME).is_file():
        raise InputError(f"{place}: has no {NAME}: allowed is one that lists the runs, or a file")
    description = read_description(place / NAME)
    tables: dict[str, tuple[Table, str]] = {}
    names = _names([plan.file for plan in description.runs])
    runs = []
    for count, (plan, name) in enumerate(zip(description.runs, names, strict=True), 1):
        if not (place / plan.file).exists():
            raise InputError(f"{place / NAME}: [[run]] {count}: no file {plan.file!r}")
        runs.append(_run(place / plan.file, plan, description, tables, name))
    digests = {run.file: run.sha256 for run in runs}
    return Experiment(place, tuple(runs), description.known, _across(runs), digests)


def _names(files: list[str]) -> list[str]:
    """Name runs after their files, apart where several share one."""
    names = []
    for k, file in enumerate(files):
        stem = file.rsplit(".", 1)[0]
        same = files[: k + 1].count(file)
        names.append(f"{stem} ({same})" if files.count(file) > 1 else stem)
    return names


def _run(
    path: Path,
    plan: RunPlan,
    description: Description,
    tables: dict[str, tuple[Table, str]],
    name: str,
) -> Run:
    if plan.file not in tables:
        tables[plan.file] = read_table(path, description.reader)
    table, digest = tables[plan.file]
    channels = channels_of(table, description, plan, str(path))
    work = Work.begin(str(path), plan, description.known, channels, table)
    if plan.kind == "forced" and plan.drive is None and plan.pivot is None:
        text = 'kind is "forced" and there is neither drive nor pivot: what drives it is not known'
        work.say("drive-missing", text)
    clock.mend(work)
    work.cut(plan.from_s, plan.to_s)
    angle.make(work)
    if not work.peaks_only:
        resampled.check(work)
        samples.check(work)
        moves = motion.moves(work)
        if moves:
            scale.check(work)
        samples.say_steps(work)
        if moves:
            motion.check(work)
            signs.check(work)
            noise_check.check(work)
    work.refuse_short()
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
        drive=plan.drive,
        pivot=work.pivot(),
        pivot_unit=channels.pivot_unit,
        findings=tuple(dataclasses.replace(f, where=f.where or name) for f in work.findings),
        peaks_only=work.peaks_only,
        segments=tuple(work.segments),
        channels=_columns(channels),
        count_rad=work.count,
        sha256=digest,
    )


def _columns(channels: Channels) -> dict[str, str]:
    return {channel: str(column) for channel, column in channels.columns.items()}


def _across(runs: list[Run]) -> tuple[Finding, ...]:
    """Return what runs show together: the same record twice, all of them held out."""
    found = []
    for k, run in enumerate(runs):
        for other in runs[:k]:
            same = run.theta.size == other.theta.size and np.array_equal(run.theta, other.theta)
            if same and np.array_equal(run.time, other.time):
                text = f"{run.name} and {other.name} are the same record"
                found.append(Finding("same-record", text, where=run.name))
    if all(run.hold_out for run in runs):
        found.append(Finding("all-held-out", "all runs are held out: none is left to fit"))
    return tuple(found)
