"""Reading of a file or folder as an experiment, with all checks in order."""

from __future__ import annotations

import dataclasses
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from pendmap.errors import InputError, named, short_repr
from pendmap.files import read_toml
from pendmap.formatting import counted, listed
from pendmap.records.across import checked_together
from pendmap.records.angle import gyroscope_of
from pendmap.records.by_hand import FRAME, GIVEN, ByHand, by_keyword, name_columns, override
from pendmap.records.channels import channels_of
from pendmap.records.description import NAME, Description, RunPlan, description_of
from pendmap.records.experiment import Experiment, Run
from pendmap.records.guesses import side_by_side
from pendmap.records.rules import OF_RELEASE, RULES, apply
from pendmap.records.work import Work
from pendmap.tables.findings import Finding, finding_of
from pendmap.tables.formats import TABLES, read_table
from pendmap.tables.table import frame_of, table_of

if TYPE_CHECKING:
    from typing import Unpack

    import pandas as pd
    import xarray as xr
    from numpy.typing import ArrayLike

    from pendmap.tables.text import Table

    Frame: TypeAlias = pd.DataFrame | pd.Series | xr.Dataset | xr.DataArray
    Records: TypeAlias = Experiment | Run | Frame | str | os.PathLike[str]

_FORMS: Final = (
    "paths, arrays t and theta, DataFrames or xarray with columns like t_s and theta_rad, an"
    " Experiment like pendmap.read_experiment('folder'), Runs or a list of them"
)
_NO_RECORD: Final = (
    f"{{place}}: has no {NAME}: there must be one, or files that are records, got {{got}}"
)
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
    plans = _described(place, _tables_of(place)).runs
    return description + [place / file for file in dict.fromkeys(plan.file for plan in plans)]


def read_experiment(
    path: str | os.PathLike[str] | Frame | ArrayLike,
    theta: ArrayLike | None = None,
    **by_hand: Unpack[ByHand],
) -> Experiment:
    """Read a record or a folder of records, and report its faults.

    A file (CSV, other text, .xlsx, .ods, Parquet, .mat, .zip, .trk), a table in memory or two
    arrays with a time and an angle are an experiment of one free decay. A folder is an experiment
    with an ``experiment.toml``; without it each file is a free decay. Each free release of a file
    is one run, named ``decay 1/3``. Nothing is written. Each fault is a finding under a stable key.
    Data are corrected only where the correction is unambiguous: wrapped turns are unwrapped,
    milliseconds become seconds. ``Run.trusted`` marks the samples for fitting.

    Parameters
    ----------
    path : str, path, array, DataFrame, Series, or Dataset or DataArray of xarray
        File or folder; or columns named as in a file, such as ``t_s`` and ``theta_rad``, also an
        index of dates or one with a name; of xarray what stands along the longest dimension, in the
        unit of the attribute ``units``. With ``theta`` the times, shape (N,), s or dates.
    theta : array, shape (N,), optional
        Angles from the downward rest, rad; a name of the array may have another unit.
    **by_hand
        Columns, units, clock and span: :class:`pendmap.records.ByHand`, of every file of a folder.

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
    >>> pendmap.read_experiment("run.csv")
    <Experiment run.csv: 1 run, 1 free>
    >>> pendmap.read_experiment(time, np.degrees(theta), angle_unit="deg").runs[0].theta.size
    2000
    """
    return read_described(path, theta, by_hand)[0]


def read_described(
    path: object, theta: object, by_hand: ByHand
) -> tuple[Experiment, dict[str, Any]]:
    """Return :func:`read_experiment`, and the tables with which its folder is read in this way."""
    if unknown := by_hand.keys() - ByHand.__annotations__.keys():
        raise TypeError(f"got an unexpected keyword argument {unknown.pop()!r}")
    given = {name: value for name, value in by_hand.items() if value is not None}
    frame = frame_of(path, theta)
    if frame is not None:
        place, content = Path(FRAME), _free_decays([FRAME])
        given = given if theta is None else {"time": 1, "angle": 2} | given
    elif isinstance(path, str | os.PathLike):
        place = Path(path)
        content = _tables_of(place)
    else:
        wanted = "a path, a table of pandas or xarray, or times with theta beside them"
        raise InputError(f"path must be {wanted}, got {short_repr(path)}")
    described = (place / NAME).is_file() and frame is None
    GIVEN.set((str(place) if described else "", given))
    planned = _described(place, content)
    if given:
        override(content, given)
        try:
            planned = description_of(content)
        except InputError as error:
            raise InputError(by_keyword(str(error), given)) from None
    if frame is None:
        runs, findings = _every(place, planned)
    else:
        read = table_of(frame, FRAME), ""
        runs, findings = _runs(read, planned.runs[0], planned, FRAME, FRAME)
    unique, together = checked_together(runs)
    experiment = Experiment(place, unique, planned.known, (*findings, *together))
    name_columns(content, runs)
    return experiment, content


def experiment_of(
    records: Records | Sequence[Records] | ArrayLike,
    theta: ArrayLike | None = None,
    **by_hand: Unpack[ByHand],
) -> Experiment:
    """Return records in any of their forms as one experiment.

    Records are what :func:`read_experiment` takes, experiments, runs, or a sequence of these, which
    are runs of one rig: copies among them are used once, runs of one name are numbered, and what is
    known of the rig must agree. ``by_hand`` applies to what is read.
    """
    if theta is not None:
        return read_experiment(records, theta, **by_hand)
    if isinstance(records, str) or not isinstance(records, Sequence):
        records = [records]
    parts = [_experiment(part, by_hand) for part in records]
    if not parts:
        raise InputError(f"records must be {_FORMS}, got {short_repr(records)}")
    if len(parts) == 1:
        return parts[0]
    known = dict[str, Any]()
    for name, value in (pair for part in parts for pair in part.known.items()):
        if known.setdefault(name, value) != value:
            raise InputError(f"{name} must be one for all records, got {known[name]} and {value}")
    runs, before = list[Run](), Counter[str]()
    for run in (run for part in parts for run in part):
        before[run.name] += 1
        number = f" ({before[run.name]})" if before[run.name] > 1 else ""
        runs.append(dataclasses.replace(run, name=run.name + number))
    unique, together = checked_together(runs)
    findings = dict.fromkeys([*(finding for part in parts for finding in part.findings), *together])
    place = Path(listed([part.path.name for part in parts], _SHOWN))
    return Experiment(place, unique, known, tuple(findings))


def _experiment(records: object, by_hand: ByHand) -> Experiment:
    """Return one form of records as an experiment."""
    if isinstance(records, str | os.PathLike) or frame_of(records) is not None:
        return read_experiment(records, **by_hand)
    if not isinstance(records, Run | Experiment):
        raise InputError(f"records must be {_FORMS}, got {short_repr(records)}")
    for name, value in by_hand.items():
        if value is not None:
            raise InputError(f"{name} must be left out where no file or table is read")
    if isinstance(records, Experiment):
        return records
    return Experiment(Path(records.file or records.name), (records,))


def _tables_of(place: Path) -> dict[str, Any]:
    """Return the tables of an ``experiment.toml``; without one, of free decays."""
    if (place / NAME).is_file():
        return read_toml(place / NAME)
    files = [place]
    if place.is_dir():
        files = sorted(file for file in place.iterdir() if file.suffix.lower() in TABLES)
        files = [f for f in files if f.is_file() and not f.name.startswith((".", "~"))]
    return _free_decays([file.name for file in files])


def _free_decays(files: Sequence[str]) -> dict[str, Any]:
    """Return the tables of an experiment of free decays."""
    return {"rig": {}, "columns": {}, "run": [{"file": file} for file in files]}


def _described(place: Path, content: dict[str, Any]) -> Description:
    """Return the description of a place; InputError if it is invalid, or there is no file."""
    if not (place / NAME).is_file() and not content["run"]:
        raise InputError(_NO_RECORD.format(place=place, got=f"0 files of {', '.join(TABLES)}"))
    with named(str(place / NAME)):
        return description_of(content)


def _every(place: Path, description: Description) -> tuple[list[Run], list[Finding]]:
    """Read all runs; in a folder without a description, leave out files that are no records."""
    described = (place / NAME).is_file()
    plain = place.is_dir() and not described
    runs, findings = list[Run](), [finding_of("no-description")] * plain
    tables: dict[str, tuple[Table, str]] = {}
    refused = list[str]()
    names = zip(description.runs, _names(description.runs), strict=True)
    for count, (plan, name) in enumerate(names, 1):
        path = place / plan.file if place.is_dir() else place
        if described and not path.exists():
            raise InputError(f"{place / NAME}: [[run]] {count}: no file {plan.file!r}")
        try:
            if plan.file not in tables:
                tables = {plan.file: read_table(path, description.reader)}
            of_file, shared = _runs(tables[plan.file], plan, description, str(path), name)
            runs, findings = runs + of_file, findings + shared
        except InputError as error:
            if not plain:
                raise
            refused.append(str(error))
            findings.append(finding_of("file-left-out", error=error))
    if not runs:
        got = f"{counted(len(refused), 'file')}, the first refused: {refused[0]}"
        raise InputError(_NO_RECORD.format(place=place, got=got))
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
    read: tuple[Table, str], plan: RunPlan, description: Description, where: str, name: str
) -> tuple[list[Run], list[Finding]]:
    """Return the runs of a file, one per release, and the findings that belong to none."""
    table, digest = read
    named = any(column.name for column in description.columns.values())
    parts, shared = list[Work](), list[Finding]()
    for beside in [table] if named else side_by_side(table):
        work = channels_of(beside, description, plan, where)
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
        zero_rad=work.zero,
    )
