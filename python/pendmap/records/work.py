"""Mutable record between table and run, which the rules read and correct."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from pendmap.errors import InputError
from pendmap.formatting import counted, listed
from pendmap.records.by_hand import by_hand
from pendmap.tables.findings import finding_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from pendmap.records.description import RunPlan
    from pendmap.records.experiment import Segment
    from pendmap.signal import Floats, Indices, Mask, Stretch
    from pendmap.tables.findings import Finding

FEWEST_SAMPLES = 5  # Fewest samples of a record
_FEWEST_PEAKS = 3  # Fewest samples of a record of turning points


@dataclasses.dataclass(frozen=True)
class Jump:
    """Change of the zero by ``size`` +- ``error`` rad before sample ``at``, or a slip of time."""

    at: int
    size: float
    error: float
    slip: float = 0.0  # s; the reading does not change then
    certain: bool = False  # the swing after it differs from that before by no more than this


@dataclasses.dataclass
class Work:
    """Record that is being read, in SI; all arrays have shape (N,)."""

    where: str
    plan: RunPlan
    known: Mapping[str, Any]  # [rig]
    declared: frozenset[str]  # channels with a unit or scale in [columns]
    time: Floats
    theta: Floats
    rows: Indices  # lines of the file
    extra: dict[str, Floats]  # further channels
    pivot: dict[str, Floats]  # recorded motion of the pivot by direction
    trusted: Mask
    findings: list[Finding]
    columns: Mapping[str, str]  # heading of each channel
    unused: tuple[str, ...]  # headings of columns without a channel
    segments: list[Segment] = dataclasses.field(default_factory=list)
    count: float = 0.0  # step of the readings, declared or estimated, rad; 0 for none
    estimated_step: float = 0.0  # step estimated from the readings, rad; 0 for none
    peaks_only: bool = False
    integrated: bool = False  # the angle is the integral of the velocity
    moves: bool = False  # whether the pendulum moves
    jumps: list[Jump] = dataclasses.field(default_factory=list)  # of the reading, not corrected
    bridged: Floats = dataclasses.field(default_factory=lambda: np.empty(0))  # without outliers
    parts: list[Stretch] = dataclasses.field(default_factory=list)  # free motions
    cut: list[Stretch] = dataclasses.field(default_factory=list)  # driven or braked
    releases: list[Stretch] = dataclasses.field(default_factory=list)  # parts that are used
    edge: str | None = None  # edge of the trigger that is used
    edges: bool = False  # each reading is an edge of an encoder
    pivot_unit: str | None = None
    middle: float = 0.0  # middle of the swing, rad
    period: float = math.nan  # period of small swings, s
    noise: float = 0.0  # standard deviation of a reading, rad
    clock_stderr: float = 0.0  # relative standard error of the sampling interval
    zero: float = 0.0  # angle subtracted from the readings, rad
    limit: float = 0.0  # range of readings below which there is no motion, rad

    @property
    def free(self) -> bool:
        """Whether the record is of a free motion."""
        return self.plan.kind == "free"

    def finding(
        self,
        key: str,
        *,
        at: Indices | None = None,
        span: tuple[float, float] | None = None,
        **values: object,
    ) -> Finding:
        """Return a finding of ``findings.toml``, at samples or over a span in s."""
        where = ""
        if at is not None and at.size:
            shown = listed([str(row) for row in self.rows[at[:4]]], 3)
            where = f"{'rows' if at.size > 1 else 'row'} {shown}"
            span = span or (float(self.time[at[0]]), float(self.time[at[-1]]))
        if span is not None and not all(map(math.isfinite, span)):
            span = None
        return finding_of(key, where=where, span=span, **values)

    def note(self, key: str, **values: Any) -> None:  # noqa: ANN401 (of any type)
        """Note a further finding of a rule."""
        self.findings.append(self.finding(key, **values))

    def keep(self, which: NDArray[Any]) -> None:
        """Keep the selected samples, in the given order."""
        self.time, self.theta = self.time[which], self.theta[which]
        self.rows, self.trusted = self.rows[which], self.trusted[which]
        self.extra = {name: values[which] for name, values in self.extra.items()}
        self.pivot = {way: values[which] for way, values in self.pivot.items()}

    def leave_out(self, which: Mask, key: str, noun: str, **values: object) -> Finding | None:
        """Remove samples, if any, and return the finding with their ``number``."""
        finding = self.distrust(np.flatnonzero(which), key, noun, **values)
        self.keep(~which)
        return finding

    def distrust(self, at: Indices, key: str, noun: str, **values: object) -> Finding | None:
        """Exclude samples, if any, from fits, and return the finding with their ``number``."""
        if not at.size:
            return None
        self.trusted[at] = False
        return self.finding(key, at=at, span=None, number=counted(at.size, noun), **values)

    def split_by_release(self) -> tuple[list[Work], list[Finding]]:
        """Return a record for each release, and the findings that belong to none of them."""
        if len(self.releases) < 2:
            return [self], []
        lows = [0, *(low for low, _ in self.releases[1:])]
        highs = [*(high for _, high in self.releases[:-1]), self.time.size]
        shared, parts = list(self.findings), []
        for (first, last), low, high in zip(self.releases, lows, highs, strict=True):
            ends = float(self.time[low]), float(self.time[high - 1])
            part = dataclasses.replace(
                self,
                findings=[finding for finding in shared if _within(finding, *ends)],
                segments=[segment for segment in self.segments if _within(segment, *ends)],
                releases=[(first - low, last - low)],
            )
            shared = [finding for finding in shared if not _within(finding, *ends)]
            part.keep(np.arange(low, high))
            parts.append(part)
        return parts, shared

    def other(self) -> dict[str, object]:
        """Return the option that reads another column as the angle, if there is one."""
        return {"angle": self.unused[0]} if self.unused else {}

    def refuse(self, text: str, **options: object) -> NoReturn:
        """Raise InputError, with the command that helps by its options, if there are any."""
        more = f": {by_hand(self.where, **options)}" if options else ""
        raise InputError(f"{self.where}: {text}{more}")

    def refuse_short(self) -> None:
        """Raise InputError if there are too few samples for a record."""
        least = _FEWEST_PEAKS if self.peaks_only else FEWEST_SAMPLES
        if self.time.size < least:
            got = counted(self.time.size, "sample")
            text = f"must have {least} samples or more with time and angle, got {got}"
            self.refuse(text, **self.other())


def _within(part: Finding | Segment, begin: float, end: float) -> bool:
    low, high = part.from_s, part.to_s
    return low is not None and high is not None and begin <= low <= high <= end
