"""The rules of reading: all checks of a record, in the order in which they run.

A rule is a function of the record that is being read (:class:`pendmap.records.work.Work`). It may
correct the record, leave samples out or mark them as not for fitting. It returns a finding or None,
and raises InputError where no record is left. A new rule is one function, in the file of its
subject, and one line here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pendmap.records import (
    angle,
    clock,
    motion,
    noise,
    outliers,
    releases,
    resolution,
    samples,
    scale,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pendmap.records.work import Work
    from pendmap.tables.findings import Finding

    Rules = Sequence[tuple[str, Callable[[Work], Finding | None]]]

# Conditions under which rules run
WHEN: Final[Mapping[str, Callable[[Work], bool]]] = {
    "always": lambda work: bool(work.where),
    "sampled": lambda work: not work.peaks_only,
    "by clock": lambda work: not work.peaks_only and not work.edges,
    "angle": lambda work: not work.peaks_only and not work.integrated,
    "rate": lambda work: work.integrated,
    "moves": lambda work: work.moves,
    "driven": lambda work: work.moves and not work.free,
}
RULES: Final[Rules] = (
    # Times
    ("always", clock.missing),
    ("always", clock.stopped),
    ("always", clock.restarted),
    ("always", clock.coarse),
    ("always", clock.repeated),
    ("always", clock.unordered),
    ("always", clock.gaps),
    ("always", clock.cut),
    ("sampled", clock.pause),
    # Angle
    ("always", angle.turning_points),
    ("always", angle.source_missing),
    ("always", angle.derived),
    ("always", angle.missing),
    ("sampled", angle.wrapped),
    ("sampled", resolution.edges),
    ("always", clock.no_clock),
    # Readings
    ("by clock", samples.interpolated),
    ("angle", samples.step),
    ("angle", samples.clipped),
    ("rate", samples.clipped),
    ("angle", samples.frozen),
    ("angle", outliers.outliers),
    ("angle", outliers.slips),
    ("angle", outliers.jumps),
    ("rate", outliers.spikes),
    ("rate", outliers.integrate_again),
    # Units and zero
    ("sampled", motion.moves),
    ("moves", scale.seconds),
    ("moves", scale.radians),
    ("moves", scale.one_sided),
    ("moves", scale.curvature),
    ("moves", scale.period_of_rig),
    ("moves", scale.sampling),
    ("moves", scale.zero),
    ("sampled", samples.named_step),
    # Motion
    ("moves", motion.free_motions),
    ("moves", releases.marked),
    ("moves", motion.used_motions),
    ("moves", motion.held_or_at_rest),
    ("driven", resolution.pivot_unit),
    # What a fit can tell
    ("moves", resolution.used_share),
    ("moves", resolution.drive),
    ("moves", resolution.gain),
    ("sampled", resolution.pivot_steps),
)
# Rules of each release of a record
OF_RELEASE: Final[Rules] = (("moves", noise.grows),)


def apply(rules: Rules, work: Work) -> None:
    """Run rules on a record, in order, and note their findings."""
    for condition, rule in rules:
        finding = rule(work) if WHEN[condition](work) else None
        if finding is not None:
            work.findings.append(finding)
    work.refuse_short()
