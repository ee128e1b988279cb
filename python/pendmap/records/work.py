"""A record on its way from the table to a run: what each check sees and may change."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap.errors import InputError
from pendmap.formatting import counted
from pendmap.records.experiment import Finding, Segment

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from pendmap.records.channels import Channels
    from pendmap.records.description import RunPlan
    from pendmap.records.rod_sensors import Accelerometer
    from pendmap.records.text import Table

    Floats = NDArray[np.float64]

FEWEST = 5
"""Samples that a record must have; fewer show no swing."""

_FEWEST_PEAKS = 3


@dataclasses.dataclass
class Work:
    """One record while it is read; all arrays have one length.

    ``count`` is the step of the readings as it is known, ``seen`` as they show it, 0 for none.
    ``extra`` holds further channels by name, those of the pivot as ``pivot:vertical`` and
    ``pivot:horizontal``. ``accelerometer`` says where an acceleration was measured, or
    ``place_missing`` which keys would; ``integrated`` whether the angle was made of the velocity.
    ``releases`` are the stretches for fitting of a free record, first place and the one after the
    last; ``edge`` and ``phase`` what [columns] says of the trigger;
    ``edges`` whether each reading is an edge of an encoder; ``pivot_unit`` what
    the pivot's channels are.
    """

    where: str
    plan: RunPlan
    known: Mapping[str, Any]
    declared: frozenset[str]
    time: Floats
    theta: Floats
    rows: NDArray[np.intp]
    extra: dict[str, Floats]
    trusted: NDArray[np.bool_]
    findings: list[Finding]
    segments: list[Segment] = dataclasses.field(default_factory=list)
    count: float = 0.0
    seen: float = 0.0
    peaks_only: bool = False
    accelerometer: Accelerometer | None = None
    integrated: bool = False
    place_missing: str = ""
    releases: list[tuple[int, int]] = dataclasses.field(default_factory=list)
    edge: str | None = None
    phase: float | None = None
    edges: bool = False
    pivot_unit: str | None = None

    @property
    def made_of(self) -> Accelerometer | None:
        """The accelerometer that the angle was made of; none where the angle was measured."""
        made = self.accelerometer is not None and math.isfinite(self.accelerometer.w0)
        return self.accelerometer if made else None

    @classmethod
    def begin(
        cls,
        where: str,
        plan: RunPlan,
        known: Mapping[str, Any],
        channels: Channels,
        table: Table,
    ) -> Work:
        """Take the channels of a table; nothing is an angle yet unless a channel is one."""
        extra = {name: values.copy() for name, values in channels.values.items() if name != "time"}
        for way, values in (channels.pivot or {}).items():
            extra[f"pivot:{way}"] = values.copy()
        time = channels.values["time"].copy()
        return cls(
            where=where,
            plan=plan,
            known=known,
            declared=channels.declared,
            time=time,
            theta=extra.pop("angle", np.zeros(time.size)),
            rows=table.rows.copy(),
            extra=extra | ({} if "angle" in channels.values else {"no angle": np.zeros(time.size)}),
            trusted=np.ones(time.size, bool),
            findings=[*table.findings, *channels.findings],
            accelerometer=channels.accelerometer,
            place_missing=channels.place_missing,
            edge=channels.edge,
            phase=channels.phase,
            pivot_unit=channels.pivot_unit,
        )

    def say(
        self,
        what: str,
        text: str,
        *,
        mended: bool = False,
        at: NDArray[np.intp] | None = None,
        span: tuple[float, float] | None = None,
    ) -> None:
        """Note a finding, at samples or over a span of time."""
        where = ""
        if at is not None and at.size:
            shown = ", ".join(str(int(self.rows[k])) for k in at[:3])
            where = f"{'rows' if at.size > 1 else 'row'} {shown}{', ...' if at.size > 3 else ''}"
            span = span or (float(self.time[at[0]]), float(self.time[at[-1]]))
        if span is not None and not all(map(math.isfinite, span)):
            span = None
        low, high = span or (None, None)
        self.findings.append(Finding(what, text, mended, where, low, high))

    def keep(self, which: NDArray[Any]) -> None:
        """Keep some samples, in the order given."""
        self.time, self.theta = self.time[which], self.theta[which]
        self.rows, self.trusted = self.rows[which], self.trusted[which]
        self.extra = {name: values[which] for name, values in self.extra.items()}

    def apart(self) -> tuple[list[Work], list[Finding]]:
        """Return a work for each release, and what was found in the file and in none of them alone.

        The first keeps what is before it, the last what is after it; what is between two releases
        is in neither.
        """
        if len(self.releases) < 2:
            return [self], []
        lows = [0, *(low for low, _ in self.releases[1:])]
        highs = [*(high for _, high in self.releases[:-1]), self.time.size]
        shared, parts = list(self.findings), []
        for k, (low, high) in enumerate(zip(lows, highs, strict=True)):
            begin, end = float(self.time[low]), float(self.time[high - 1])
            own = [f for f in shared if _within(f.from_s, f.to_s, begin, end)]
            shared = [f for f in shared if f not in own]
            part = dataclasses.replace(
                self,
                findings=own,
                segments=[s for s in self.segments if _within(s.from_s, s.to_s, begin, end)],
                releases=[(self.releases[k][0] - low, self.releases[k][1] - low)],
            )
            part.keep(np.arange(low, high))
            parts.append(part)
        return parts, shared

    def cut(self, low: float | None, high: float | None) -> None:
        """Keep the part of the file that the run is said to be."""
        if low is None and high is None:
            return
        first, last = float(self.time[0]), float(self.time[-1])
        low, high = -math.inf if low is None else low, math.inf if high is None else high
        self.keep((self.time >= low) & (self.time <= high))
        if self.time.size < FEWEST:
            raise InputError(
                f"{self.where}: from_s and to_s must be times within {first:g} to {last:g} s, they"
                f" leave {counted(self.time.size, 'sample')}"
            )

    def refuse_short(self) -> None:
        """Refuse what is too short for a record.

        Raises
        ------
        InputError
            If there are fewer samples than show a swing.
        """
        least = _FEWEST_PEAKS if self.peaks_only else FEWEST
        if self.time.size < least:
            raise InputError(
                f"{self.where}: must have {least} samples or more with time and angle, got"
                f" {counted(self.time.size, 'sample')}"
            )

    def pivot(self) -> dict[str, Floats] | None:
        """The pivot's recorded motion, if there is any."""
        found = {
            name.removeprefix("pivot:"): values
            for name, values in self.extra.items()
            if name.startswith("pivot:")
        }
        return found or None


def _within(low: float | None, high: float | None, begin: float, end: float) -> bool:
    return low is not None and high is not None and begin <= low <= high <= end
