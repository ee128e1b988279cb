"""Reading of a file or folder as an experiment, with all checks in order."""

from __future__ import annotations

import dataclasses
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

from pendmap.errors import InputError, short_repr
from pendmap.formatting import counted, listed
from pendmap.records.across import checked_together
from pendmap.records.channels import channels_of
from pendmap.records.description import NAME, RATES, Description, RunPlan, checked, read_description
from pendmap.records.experiment import Experiment, Finding, Run, finding_of
from pendmap.records.guesses import side_by_side
from pendmap.records.rod_sensors import gyroscope_of
from pendmap.records.rules import OF_RELEASE, RULES, apply
from pendmap.records.tables import is_frame, read_table, table_of
from pendmap.records.work import Work

if TYPE_CHECKING:
    import pandas as pd

    from pendmap.records.tables import Table

    Records: TypeAlias = Experiment | Run | pd.DataFrame | str | os.PathLike[str]

# Suffixes of the files that are records in a folder without a description
TABLES: Final = (".csv", ".tsv", ".txt", ".dat", ".parquet", ".pq", ".xlsx")
_FORMS: Final = (
    "paths, DataFrames with columns like t_s and theta_rad, an Experiment like"
    " pendmap.read_experiment('folder'), Runs or a list of them"
)
FRAME: Final = "DataFrame"  # Name of a record that has no file
_SHOWN: Final = 3  # Names of records in the name of several together


def files_of(path: str | os.PathLike[str]) -> list[Path]:
    """Return the files from which an experiment is read, without reading any record.

    They are the file; ``experiment.toml`` and the files that it names, which need not exist; or all
    files of a plain folder that may be records. Raises InputError for an invalid description.
    """
    place = Path(path)
    if not place.is_dir():
        return [place]
    description = [place / NAME] if (place / NAME).is_file() else []
    return description + [
        place / file for file in dict.fromkeys(plan.file for plan in _planned(place).runs)
    ]


def read_experiment(
    path: str | os.PathLike[str] | pd.DataFrame, *, rate_hz: float | None = None
) -> Experiment:
    """Read a record or a folder of records, and report its faults.

    A file (CSV, other text, Parquet, Excel) or a DataFrame with a time and an angle is an
    experiment of one free decay. A folder is an experiment with an ``experiment.toml``; without it
    each file is a free decay. Each free release of a file is one run, named ``decay 1/3``. Nothing
    is written. Each fault is a finding under a stable key. Data are corrected only where the
    correction is unambiguous: wrapped turns are unwrapped, milliseconds become seconds.
    ``Run.trusted`` marks the samples for fitting.

    Parameters
    ----------
    path : str, path or pandas.DataFrame
        File or folder; or the columns themselves, named as in a file, such as ``t_s`` and
        ``theta_rad``. An index of dates, or one with a name, is a column too.
    rate_hz : float, optional
        Sampling rate, Hz, of records without a column of times: ``t = k / rate_hz``. It overrides
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
    rate = None if rate_hz is None else checked("rate_hz", rate_hz, RATES)
    if isinstance(path, str | os.PathLike):
        place = Path(path)
        planned = _planned(place)
        planned = dataclasses.replace(planned, rate_hz=rate or planned.rate_hz)
        runs, findings = _every(place, planned)
    else:
        if not is_frame(path):
            raise InputError(f"path must be a path or a DataFrame, got {short_repr(path)}")
        place, planned = Path(FRAME), Description(rate_hz=rate)
        tables = {FRAME: (table_of(path, FRAME), "")}
        runs, findings = _runs(place, RunPlan(FRAME), planned, tables, FRAME)
    digests = {run.file: run.sha256 for run in runs if run.sha256}
    unique, together = checked_together(runs)
    return Experiment(place, unique, planned.known, (*findings, *together), digests)


def experiment_of(
    records: Records | Sequence[Records], *, rate_hz: float | None = None
) -> Experiment:
    """Return records in any of their forms as one experiment.

    Records are what :func:`read_experiment` takes, experiments, runs, or a sequence of these, which
    are runs of one rig: copies among them are used once, runs of one name are numbered, and what is
    known of the rig must agree. ``rate_hz`` is that of files and DataFrames.
    """
    if isinstance(records, str) or not isinstance(records, Sequence):
        records = [records]
    parts = [_experiment(part, rate_hz) for part in records]
    if not parts:
        raise InputError(f"records must be {_FORMS}, got {short_repr(records)}")
    if len(parts) == 1:
        return parts[0]
    known = dict(parts[0].known)
    for part in parts[1:]:
        for name, value in part.known.items():
            if known.setdefault(name, value) != value:
                raise InputError(
                    f"{name} must be one for all records, got {known[name]} and {value}"
                )
    runs, before = list[Run](), Counter[str]()
    for run in (run for part in parts for run in part.runs):
        before[run.name] += 1
        name = f"{run.name} ({before[run.name]})" if before[run.name] > 1 else run.name
        runs.append(run if name == run.name else dataclasses.replace(run, name=name))
    unique, together = checked_together(runs)
    findings = dict.fromkeys([*(finding for part in parts for finding in part.findings), *together])
    digests = {file: digest for part in parts for file, digest in part.sha256.items()}
    place = Path(listed([part.path.name for part in parts], _SHOWN))
    return Experiment(place, unique, known, tuple(findings), digests)


def _experiment(records: object, rate_hz: float | None) -> Experiment:
    """Return one form of records as an experiment."""
    if isinstance(records, str | os.PathLike) or is_frame(records):
        return read_experiment(records, rate_hz=rate_hz)
    if not isinstance(records, Run | Experiment):
        raise InputError(f"records must be {_FORMS}, got {short_repr(records)}")
    if rate_hz is not None:
        raise InputError("rate_hz must be left out where no file or DataFrame is read")
    if isinstance(records, Experiment):
        return records
    digests = {records.file: records.sha256} if records.sha256 else {}
    return Experiment(Path(records.file or records.name), (records,), sha256=digests)


def _planned(place: Path) -> Description:
    """Return the description of an experiment; without an ``experiment.toml``, of free decays."""
    if (place / NAME).is_file():
        return read_description(place / NAME)
    files = [place]
    if place.is_dir():
        files = sorted(file for file in place.iterdir() if file.suffix.lower() in TABLES)
        files = [f for f in files if f.is_file() and not f.name.startswith((".", "~"))]
    return Description(runs=tuple(RunPlan(file.name) for file in files))


def _every(place: Path, description: Description) -> tuple[list[Run], list[Finding]]:
    """Read all runs; in a folder without a description, leave out files that are no records."""
    plans, described = description.runs, (place / NAME).is_file()
    plain = place.is_dir() and not described
    runs, findings, refused = list[Run](), list[Finding](), list[str]()
    if plain:
        findings.append(finding_of("no-description"))
    tables: dict[str, tuple[Table, str]] = {}
    for count, (plan, name) in enumerate(zip(plans, _names(plans), strict=True), 1):
        path = place / plan.file if place.is_dir() else place
        if described and not path.exists():
            raise InputError(f"{place / NAME}: [[run]] {count}: no file {plan.file!r}")
        try:
            of_file, shared = _runs(path, plan, description, tables if described else {}, name)
        except InputError as error:
            if not plain:
                raise
            refused.append(str(error))
            findings.append(finding_of("file-left-out", error=error))
        else:
            runs += of_file
            findings += shared
    if not runs:
        first = f", the first refused: {refused[0]}" if refused else f" of {', '.join(TABLES)}"
        raise InputError(
            f"{place}: has no {NAME}: there must be one, or files that are records, got"
            f" {counted(len(refused), 'file')}{first}"
        )
    return runs, findings


def _names(plans: Sequence[RunPlan]) -> list[str]:
    """Return distinct run names: file stems, with suffix or number if files share a stem."""
    stems = {plan.file: plan.file.removesuffix(Path(plan.file).suffix) for plan in plans}
    alike, every = Counter(stems.values()), Counter(plan.file for plan in plans)
    before = Counter[str]()
    names = []
    for file in (plan.file for plan in plans):
        before[file] += 1
        name = stems[file] if alike[stems[file]] == 1 else file
        names.append(f"{name} ({before[file]})" if every[file] > 1 else name)
    return names


def _runs(
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
    named = any(column.name for column in description.columns.values())
    parts, shared = list[Work](), list[Finding]()
    for beside in [table] if named else side_by_side(table):
        work = channels_of(beside, description, plan, str(path))
        apply(RULES, work)
        releases, others = work.split_by_release()
        parts += releases
        shared += others
    runs = []
    for k, part in enumerate(parts, 1):
        apply(OF_RELEASE, part)
        runs.append(_run(part, f"{name} {k}/{len(parts)}" if len(parts) > 1 else name, digest))
    return runs, [dataclasses.replace(finding, where=finding.where or name) for finding in shared]


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
        drive=dataclasses.asdict(plan.drive) if plan.drive else None,
        pivot=work.pivot or None,
        pivot_unit=work.pivot_unit,
        findings=tuple(dataclasses.replace(f, where=f.where or name) for f in work.findings),
        peaks_only=work.peaks_only,
        segments=tuple(work.segments),
        channels=work.columns,
        unused=work.unused,
        count_rad=0.0 if work.edges else work.count,
        sha256=digest,
        clock_stderr=work.clock_stderr,
    )
