"""Experiments that the rig of some records could do next, as far as the records tell.

From the records come the natural frequency, how long a run lasts, how often and how well the angle
is read, when the last run ended, and which drive there is. From the model found comes how the
pendulum would move. Nothing here looks for an effect: which of these experiments is worth doing is
a question of their information (:mod:`pendmap.diagnosis.next_experiment.power`).
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

    from numpy.typing import NDArray

    from pendmap.comparison.data import Evidence
    from pendmap.identification.runs import FitRun

RELEASES: Final = (0.5, 1.2, 2.0, 2.8)
"""Angles of release, rad, as far as the rig has them: small swings, and up to nearly inverted."""

FLINGS: Final = (2.5, 3.5)
"""Velocities at the bottom over ``w0``: with more than 2 the pendulum goes round. Much quicker, a
record no longer shows where the hand has let go."""

WAITS: Final = (600.0, 3600.0)
"""Pauses in the laboratory, s, after which slow changes show."""

LATER: Final = (1.2, 2.8)
"""Releases after such a pause."""

LENGTHS: Final = (0.5, 1.0, 2.0)
"""Lengths of a run over those of the records."""

LONGEST_S: Final = 240.0
"""No run is proposed that lasts longer, unless the records did."""

SHORTEST: Final = 5.0
"""Swings that a run has at least."""

REPEATS: Final = (2, 4)
"""How often the same run is done."""

PAUSE_S: Final = 60.0
"""From the end of one run to the next."""

DRIVEN: Final = (1.0, 1.5, 2.0)
"""Drive frequencies over ``w0``: second resonance, between, first resonance."""

BEYOND: Final = 1.25
"""What a rig surely can, over the greatest that its records show."""

FASTEST: Final = 0.98
"""Quantile of the speeds between readings that noise does not reach."""

SWINGING: Final = 1.0
"""Angle at which a driven swing begins, rad."""


@dataclasses.dataclass(frozen=True)
class Start:
    """How a run begins, and what drives it."""

    what: str  # In words
    theta: float  # Angle (rad) and velocity (rad/s) at the first sample
    velocity: float
    wait_s: float  # Pause in the laboratory before it, s, beyond the usual one
    lab_time_s: float  # When it begins
    # As of FitRun; none of a free decay.
    drive: Mapping[str, float | None] | None = dataclasses.field(default=None, hash=False)

    @property
    def noun(self) -> str:
        """What the run is."""
        return "free decay" if self.drive is None else "forced run"


@dataclasses.dataclass(frozen=True)
class Planned:
    """A run to be recorded: a start, and for how long."""

    start: Start
    seconds: float


@dataclasses.dataclass(frozen=True)
class Proposal:
    """An experiment: runs to be recorded beside the records that there are."""

    runs: tuple[Planned, ...]  # One or more of the same length

    @property
    def seconds(self) -> float:
        """Recording time, s."""
        return sum(run.seconds for run in self.runs)

    @property
    def wait_s(self) -> float:
        """The pause before it, s."""
        return max(run.start.wait_s for run in self.runs)

    @property
    def starts(self) -> tuple[Start, ...]:
        """The different starts."""
        return tuple(dict.fromkeys(run.start for run in self.runs))

    @property
    def what(self) -> str:
        """In words."""
        each = f"{self.runs[0].seconds:g} s"
        first, *others = self.starts
        if others:
            ends = " and one ".join(start.what for start in (first, *others))
            return f"one {first.noun} {ends}, {each} each"
        if len(self.runs) > 1:
            return f"{counted(len(self.runs), first.noun)} {first.what.rstrip(',')}, {each} each"
        return f"one {first.noun} {first.what} for {each}"


def menu_of(evidence: Evidence, w0: float) -> tuple[Proposal, ...]:
    """Return the experiments that the rig could do next.

    Free decays from small and wide angles and flung round, either way, of several lengths, repeated
    and after pauses; with a harmonic drive among the records forced runs at other frequencies, half
    as strong, swinging and turning; of all these what the rig can do: ``max_angle``,
    ``max_velocity`` and ``max_frequency`` of ``[rig]``, else a little more than the records show.
    """
    usual = _usual_length(evidence)
    most = max(usual, LONGEST_S)
    least = SHORTEST * math.tau / w0
    limits = _limits(evidence)
    lengths = [x for f in LENGTHS if least <= (x := _round(f * usual)) <= most] or [_round(least)]
    ended = max(run.lab_time_s + float(run.time[-1]) for run in evidence.fitted) + PAUSE_S
    singles, pairs = _free(w0, ended, math.floor(100 * limits.angle) / 100)
    singles = [s for s in (*singles, *_forced(evidence, w0, ended)) if limits.allows(s)]
    pairs = [pair for pair in pairs if all(map(limits.allows, pair))]
    found = [Proposal((Planned(start, x),)) for start in singles for x in lengths]
    for x in lengths:
        found += [Proposal((Planned(a, x), Planned(b, x))) for a, b in pairs]
        found += [
            Proposal(tuple(_in_turn(Planned(start, x), count)))
            for start, count in itertools.product(singles, REPEATS)
            if start.wait_s == 0
        ]
    return tuple(found)


@dataclasses.dataclass(frozen=True)
class _Limits:
    """The greatest angle (rad), velocity and drive frequency (rad/s) of a rig."""

    angle: float
    velocity: float
    frequency: float

    def allows(self, start: Start) -> bool:
        """Whether the rig can begin a run so."""
        omega = abs(float((start.drive or {}).get("Omega") or 0.0))
        return (
            abs(start.theta) <= self.angle
            and abs(start.velocity) <= self.velocity
            and omega <= self.frequency
        )


def _limits(evidence: Evidence) -> _Limits:
    """Return what ``[rig]`` says of the rig's limits, else a little more than the records show."""
    known = evidence.experiment.known
    runs = evidence.fitted
    shown = _Limits(
        max(float(np.nanmax(np.abs(run.theta))) for run in runs),
        max(float(np.nanquantile(_speeds(run), FASTEST)) for run in runs),
        max((float(r.drive.get("Omega") or 0.0) for r in runs if r.drive is not None), default=0.0),
    )
    return _Limits(
        float(known.get("max_angle", min(BEYOND * shown.angle, math.pi))),
        float(known.get("max_velocity", BEYOND * shown.velocity)),
        float(known.get("max_frequency", BEYOND * shown.frequency)),
    )


def _speeds(run: FitRun) -> NDArray[np.float64]:
    return np.asarray(np.abs(np.gradient(run.angle, run.time)), np.float64)


def _usual_length(evidence: Evidence) -> float:
    free = [run for run in evidence.fitted if not run.forced] or list(evidence.fitted)
    return float(np.median([np.ptp(run.time) for run in free]))


def _round(value: float) -> float:
    """Return a number of two digits, as one sets a clock or a protractor."""
    return float(f"{value:.2g}")


def _in_turn(run: Planned, count: int) -> Iterator[Planned]:
    """Yield the same run several times. That each begins a little later changes little."""
    for _ in range(count):
        yield run


def _free(w0: float, ended: float, widest: float) -> tuple[list[Start], list[tuple[Start, Start]]]:
    """Return free decays from angles up to the widest, and those that are done either way."""

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


def _forced(evidence: Evidence, w0: float, ended: float) -> Iterator[Start]:
    """Yield runs under the drive that the records have, at its greatest amplitude and half that."""
    drives = [run.drive for run in evidence.fitted if run.drive is not None]
    strengths = [strength for drive in drives if (strength := drive.get("p"))]
    if not strengths:
        return
    strongest = max(strengths)
    # Whoever knows the phase of one run knows that of the next.
    phi = None if any(drive.get("phi") is None for drive in drives) else 0.0
    for p, factor in [*((strongest, f) for f in DRIVEN), (strongest / 2, DRIVEN[-1])]:
        omega, size = _round(factor * w0), _round(p)
        drive = {"p": size, "Omega": omega, "phi": phi}
        how = f"with p = {size:g} at {omega:g} rad/s"
        yield Start(f"{how} from {SWINGING:g} rad", SWINGING, 0.0, 0.0, ended, drive)
        if p == strongest:
            yield Start(f"{how}, turning with it,", 0.0, omega, 0.0, ended, drive)
