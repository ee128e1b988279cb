"""Data classes of an experiment: its runs, their segments, and the findings about them."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Final

from pendmap.errors import InputError, short_repr
from pendmap.formatting import counted
from pendmap.model.quantities import GRAVITY

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    import pandas as pd

    from pendmap.records.description import Kind
    from pendmap.signal import Floats, Mask
    from pendmap.tables.findings import Finding

NOTHING_TO_FIT: Final = "no-motion"  # Finding about runs without samples for fitting


@dataclasses.dataclass(frozen=True)
class Segment:
    """Interval of a record with one state of the pendulum.

    Parameters
    ----------
    what : str
        ``"held"`` before a release, ``"motion"``, ``"rest"`` after it, ``"handled"`` between two
        releases, ``"driven"`` before a free motion, or braked after it.
    from_s, to_s : float
        First and last time, s.
    used : bool
        Whether the samples are for fitting.
    """

    what: str
    from_s: float
    to_s: float
    used: bool


@dataclasses.dataclass(frozen=True)
class Gyroscope:
    """Gyroscope from whose readings alone the angle was computed."""

    w0: float  # rad/s, from speeds in the middle of swings: its reading over a small angle


@dataclasses.dataclass(frozen=True, repr=False)
class Run:
    """One record in SI, corrected if the correction is unambiguous.

    Parameters
    ----------
    name : str
        Name in messages.
    file : str
        Source file.
    kind : str
        ``"free"`` or ``"forced"``.
    time : ndarray, shape (N,)
        Times of the file, s, strictly increasing.
    theta : ndarray, shape (N,)
        Angle from the downward rest, rad, unwrapped, finite.
    trusted : ndarray of bool, shape (N,)
        False for samples that are not for fitting: outlier, missed count, clipped, held by hand, at
        rest, handled between two releases; all samples of a record without motion.
    lab_time_s : float
        Start of the run on the laboratory's clock, s.
    hold_out : bool
        Whether the run is held out of fits.
    velocity : ndarray, shape (N,), or None
        Measured velocity, rad/s, if any.
    acceleration : ndarray, shape (N,), or None
        Measured acceleration, m/s^2 (or rad/s^2), if any.
    gyroscope : Gyroscope or None
        The gyroscope, if the angle was computed from it alone.
    drive : mapping or None
        ``p``, ``Omega`` and ``phi`` (``None``: to be fitted) of a(t) = p cos(Omega t + phi).
    pivot : mapping of str to ndarray, or None
        Recorded motion of the pivot in SI: ``vertical`` and ``horizontal``, each (N,), positive
        upward and toward positive theta.
    pivot_unit : str or None
        Unit of the pivot's motion: ``"m/s2"``, ``"m/s"`` or ``"m"``.
    findings : tuple of Finding
        Findings about this run.
    peaks_only : bool
        Whether the samples are turning points only.
    segments : tuple of Segment
        Segments in order of time.
    channels : mapping of str to str
        Column of each channel.
    unused : tuple of str
        Columns without a channel.
    count_rad : float
        Resolution of the readings, rad; 0 if none is found.
    sha256 : str
        SHA-256 of the file.
    clock_stderr : float
        Relative standard error of the sampling interval, by coarse time stamps; 0 if they are fine.
    zero_rad : float
        Angle subtracted from the readings, rad: their zero.
    """

    name: str
    file: str
    kind: Kind
    time: Floats
    theta: Floats
    trusted: Mask
    lab_time_s: float = 0.0
    hold_out: bool = False
    velocity: Floats | None = None
    acceleration: Floats | None = None
    gyroscope: Gyroscope | None = None
    drive: Mapping[str, float | None] | None = None
    pivot: Mapping[str, Floats] | None = None
    pivot_unit: str | None = None
    findings: tuple[Finding, ...] = ()
    peaks_only: bool = False
    segments: tuple[Segment, ...] = ()
    channels: Mapping[str, str] = dataclasses.field(default_factory=dict)
    unused: tuple[str, ...] = ()
    count_rad: float = 0.0
    sha256: str = ""
    clock_stderr: float = 0.0
    zero_rad: float = 0.0

    def __repr__(self) -> str:
        span = f"{self.time[0]:g} to {self.time[-1]:g} s" if self.time.size else "no time"
        return f"<Run {self.name}: {self.kind}, {counted(self.time.size, 'sample')}, {span}>"

    def _repr_html_(self) -> str:
        return str(self.to_dataframe().to_html(max_rows=10))

    def to_dataframe(self) -> pd.DataFrame:
        """Return the samples.

        Returns
        -------
        pandas.DataFrame
            Index ``t_s``; ``theta_rad``, the measured ones of ``velocity_rad_s`` and
            ``acceleration_m_s2``, and ``trusted``.
        """
        import pandas as pd

        further = {"velocity_rad_s": self.velocity, "acceleration_m_s2": self.acceleration}
        columns = {"theta_rad": self.theta} | {k: v for k, v in further.items() if v is not None}
        frame = pd.DataFrame(columns, index=pd.Index(self.time, name="t_s"))
        return frame.assign(trusted=self.trusted)

    @property
    def moves(self) -> bool:
        """Whether any sample is for fitting."""
        return bool(self.trusted.any())

    @property
    def copied(self) -> bool:
        """Whether the readings are duplicates of another run's, which includes them."""
        return not self.moves and any(finding.what == "same-record" for finding in self.findings)

    @property
    def read(self) -> Floats:
        """Readings that are fitted, shape (N,): rad, or rad/s of a gyroscope."""
        return self.theta if self.gyroscope is None or self.velocity is None else self.velocity

    @property
    def rate_hz(self) -> float:
        """Sampling rate of the record, gaps excluded, Hz."""
        from pendmap.signal.robust import intervals_of

        return 1 / intervals_of(self.time).tick if self.time.size > 1 else 0.0


@dataclasses.dataclass(frozen=True, repr=False)
class Experiment:
    """Runs of one rig; a collection of them, ``experiment["run_00"]`` by name or by number.

    Parameters
    ----------
    path : Path
        File or folder.
    runs : tuple of Run
        Runs in the order of the experiment.
    known : mapping
        Content of ``[rig]``: ``gravity``, ``length_m``, ``w0``, ``encoder_counts``, and the body's
        ``inertia`` about the pivot, kg m^2, ``mass``, kg, and ``length`` to its centre of mass, m.
    findings : tuple of Finding
        Findings about the experiment or a whole file with several releases.
    """

    path: Path
    runs: tuple[Run, ...]
    known: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    findings: tuple[Finding, ...] = ()

    def __iter__(self) -> Iterator[Run]:
        return iter(self.runs)

    def __len__(self) -> int:
        return len(self.runs)

    def __getitem__(self, name: str | int) -> Run:
        if not isinstance(name, str):
            return self.runs[name]
        runs = {run.name: run for run in self.runs}
        if name not in runs:
            raise InputError(f"run must be one of {', '.join(runs)}, got {short_repr(name)}")
        return runs[name]

    def __repr__(self) -> str:
        free = sum(run.kind == "free" for run in self.runs)
        return f"<Experiment {self.path.name}: {counted(len(self), 'run')}, {free} free>"

    def _repr_html_(self) -> str:
        return str(self.to_dataframe().to_html())

    def to_dataframe(self) -> pd.DataFrame:
        """Return one row a run.

        Returns
        -------
        pandas.DataFrame
            Index ``name``; ``kind``, numbers of ``samples`` and of those for fitting, ``trusted``,
            ``rate_hz``, ``from_s``, ``to_s``, and the keys of its ``findings``.
        """
        import pandas as pd

        columns = {
            "name": [run.name for run in self],
            "kind": [run.kind for run in self],
            "samples": [run.time.size for run in self],
            "trusted": [int(run.trusted.sum()) for run in self],
            "rate_hz": [run.rate_hz for run in self],
            "from_s": [run.time[0] for run in self],
            "to_s": [run.time[-1] for run in self],
            "findings": [", ".join(finding.what for finding in run.findings) for run in self],
        }
        return pd.DataFrame(columns).set_index("name")

    @property
    def sha256(self) -> dict[str, str]:
        """SHA-256 of each file that was read."""
        return {run.file: run.sha256 for run in self if run.sha256}

    @property
    def w0(self) -> float | None:
        """``w0`` of ``[rig]``, rad/s; None if not given or inconsistent with a record's period."""
        doubtful = any(
            finding.what == "period-unlike-rig" for _, finding in self.findings_of(self.runs)
        )
        return None if doubtful or "w0" not in self.known else float(self.known["w0"])

    @property
    def gravity(self) -> float:
        """``gravity`` of ``[rig]``, m/s^2; 9.81 by default."""
        return float(self.known.get("gravity", GRAVITY))

    def refuse_still(self, runs: Sequence[Run]) -> None:
        """Raise InputError if none of the runs has samples for fitting."""
        if any(run.moves for run in runs):
            return
        pairs = self.findings_of(runs)
        whys = (finding.text for _, finding in pairs if finding.what == NOTHING_TO_FIT)
        why = next(whys, "no sample is trusted")
        raise InputError(f"{self.path}: must be a record of a motion, got nothing to fit: {why}")

    def findings_of(self, runs: Iterable[Run]) -> Iterator[tuple[str, Finding]]:
        """Yield the findings about the experiment and some runs, with their places."""
        yield from ((str(self.path), finding) for finding in self.findings)
        yield from ((run.name, finding) for run in runs for finding in run.findings)
