"""Proposals of further experiments on the rig of some records.

The records give the natural frequency, the length of a run, the rate and noise of readings, the end
of the last run, and the drive. :mod:`pendmap.diagnosis.next_experiment.power` predicts the outcome
of each experiment.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.formatting import counted

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from pendmap.comparison.data import DataSplit

RELEASES: Final = (0.5, 1.2, 2.0, 2.8)  # Release angles, rad, reduced to the limits of the rig

FLINGS: Final = (2.5, 3.5)  # Initial velocities at the bottom over ``w0``; above 2 it rotates

WAITS: Final = (600.0, 3600.0)  # Pauses before a run, s, after which slow changes are detectable

LATER: Final = (1.2, 2.8)  # Release angles after such a pause, rad

LENGTHS: Final = (0.5, 1.0, 2.0)  # Lengths of a proposed run over those of the records

LONGEST_S: Final = 240.0  # Longest proposed run, s, unless the records are longer

SHORTEST: Final = 5.0  # Shortest proposed run, in periods of small swings

REPEATS: Final = (2, 4)  # Numbers of repetitions of a run

PAUSE_S: Final = 60.0  # Pause between two runs, s

DRIVEN: Final = (1.0, 1.5, 2.0)
"""Drive frequencies over ``w0``: second resonance, intermediate, first resonance."""

BEYOND: Final = 1.25  # Limits of the rig over the greatest values in its records

FASTEST: Final = 0.98  # Quantile of measured speeds taken as the greatest; higher ones are noise

SWINGING: Final = 1.0  # Initial angle of a forced swing, rad


@dataclasses.dataclass(frozen=True)
class Start:
    """Initial state and drive of a run."""

    what: str  # Description in words
    theta: float  # Angle at the first sample, rad
    velocity: float  # Velocity at the first sample, rad/s
    wait_s: float  # Pause before the run, s, in addition to the usual one
    lab_time_s: float  # Lab time at the start, s
    # As in FitRun; None for a free decay.
    drive: Mapping[str, float | None] | None = dataclasses.field(default=None, hash=False)

    @property
    def noun(self) -> str:
        """Name of the kind of run."""
        return "free decay" if self.drive is None else "forced run"


@dataclasses.dataclass(frozen=True)
class Proposal:
    """An experiment to be recorded in addition to the present records."""

    runs: tuple[Start, ...]  # One or more, repetitions included
    length_s: float  # Of each run, s

    @property
    def seconds(self) -> float:
        """Recording time, s."""
        return sum([self.length_s] * len(self.runs))

    @property
    def wait_s(self) -> float:
        """Longest pause before a run, s."""
        return max(start.wait_s for start in self.runs)

    @property
    def starts(self) -> tuple[Start, ...]:
        """The different starts."""
        return tuple(dict.fromkeys(self.runs))

    @property
    def what(self) -> str:
        """Description in words."""
        each = f"{self.length_s:g} s"
        first, *others = self.starts
        if others:
            ends = " and one ".join(start.what for start in (first, *others))
            return f"one {first.noun} {ends}, {each} each"
        if len(self.runs) > 1:
            return f"{counted(len(self.runs), first.noun)} {first.what.rstrip(',')}, {each} each"
        return f"one {first.noun} {first.what} for {each}"


def list_proposals(data: DataSplit, w0: float) -> tuple[Proposal, ...]:
    """Return proposals of further experiments within the limits of the rig.

    Free decays with several release angles and rotations, in both directions, of several lengths,
    repeated and after pauses. With a harmonic drive in the records also forced runs at several
    frequencies, at full and half amplitude, swinging and rotating. All are within ``max_angle``,
    ``max_velocity`` and ``max_frequency`` of ``[rig]``, or 1.25 times the range of the records.
    """
    free = [run for run in data.fitted if not run.forced] or list(data.fitted)
    usual = float(np.median([np.ptp(run.time) for run in free]))
    most = max(usual, LONGEST_S)
    least = SHORTEST * math.tau / w0
    angle, velocity, frequency = _limits(data)

    def possible(start: Start) -> bool:
        omega = abs(float((start.drive or {}).get("Omega") or 0.0))
        slow = abs(start.velocity) <= velocity and omega <= frequency
        return slow and abs(start.theta) <= angle

    lengths = [x for f in LENGTHS if least <= (x := _round(f * usual)) <= most] or [_round(least)]
    ended = max(run.lab_time_s + float(run.time[-1]) for run in data.fitted) + PAUSE_S
    singles, pairs = _free(w0, ended, math.floor(100 * angle) / 100)
    singles = [s for s in (*singles, *_forced(data, w0, ended)) if possible(s)]
    pairs = [pair for pair in pairs if all(map(possible, pair))]
    found = [Proposal((start,), x) for start in singles for x in lengths]
    for x in lengths:
        found += [Proposal(pair, x) for pair in pairs]
        # The later lab time of repetitions is neglected.
        found += [
            Proposal((start,) * count, x)
            for start, count in itertools.product(singles, REPEATS)
            if start.wait_s == 0
        ]
    return tuple(found)


def _limits(data: DataSplit) -> tuple[float, float, float]:
    """Return the greatest angle (rad), velocity and drive frequency (rad/s) of the rig.

    They are taken from ``[rig]``, else a little more than the range of the records.
    """
    known, runs = data.experiment.known, data.fitted
    angle = max(float(np.nanmax(np.abs(run.theta))) for run in runs)
    speeds = (np.abs(np.gradient(run.angle, run.time)) for run in runs)
    velocity = max(float(np.nanquantile(speed, FASTEST)) for speed in speeds)
    drives = [run.drive for run in runs if run.drive is not None]
    frequency = max((float(drive.get("Omega") or 0.0) for drive in drives), default=0.0)
    return (
        float(known.get("max_angle", min(BEYOND * angle, math.pi))),
        float(known.get("max_velocity", BEYOND * velocity)),
        float(known.get("max_frequency", BEYOND * frequency)),
    )


def _round(value: float) -> float:
    """Return a number rounded to two digits."""
    return float(f"{value:.2g}")


def _free(w0: float, ended: float, widest: float) -> tuple[list[Start], list[tuple[Start, Start]]]:
    """Return free decays from angles up to the widest, and pairs in opposite directions."""

    def within(angles: Sequence[float]) -> list[float]:
        return list(dict.fromkeys(min(angle, widest) for angle in angles))

    singles = [Start(f"from {angle:g} rad", angle, 0.0, 0.0, ended) for angle in within(RELEASES)]
    farthest = singles[-1].theta
    other = Start(f"from -{farthest:g} rad", -farthest, 0.0, 0.0, ended)
    pairs = [(singles[-1], other)]
    flung = []
    for factor in FLINGS:
        speed = _round(factor * w0)
        flung.append(Start(f"flung through 0 at {speed:g} rad/s", 0.0, speed, 0.0, ended))
    speed = -flung[0].velocity
    back = Start(f"flung through 0 at {speed:g} rad/s", 0.0, speed, 0.0, ended)
    pairs.append((flung[0], back))
    later = [
        Start(f"from {angle:g} rad, {_pause(wait)} after the last,", angle, 0.0, wait, ended + wait)
        for angle, wait in itertools.product(within(LATER), WAITS)
    ]
    return singles + flung + later, pairs


def _pause(seconds: float) -> str:
    hours = seconds / 3600
    return "an hour" if hours == 1 else f"{seconds / 60:g} minutes"


def _forced(data: DataSplit, w0: float, ended: float) -> Iterator[Start]:
    """Yield forced runs at the largest drive amplitude of the records and at half of it."""
    drives = [run.drive for run in data.fitted if run.drive is not None]
    strengths = [strength for drive in drives if (strength := drive.get("p"))]
    if not strengths:
        return
    strongest = max(strengths)
    # The phase is known if all records have it.
    phi = None if any(drive.get("phi") is None for drive in drives) else 0.0
    for p, factor in [*((strongest, f) for f in DRIVEN), (strongest / 2, DRIVEN[-1])]:
        omega, size = _round(factor * w0), _round(p)
        drive = {"p": size, "Omega": omega, "phi": phi}
        how = f"with p = {size:g} at {omega:g} rad/s"
        yield Start(f"{how} from {SWINGING:g} rad", SWINGING, 0.0, 0.0, ended, drive)
        if p == strongest:
            yield Start(f"{how}, turning with it,", 0.0, omega, 0.0, ended, drive)
