"""What the noise itself tells: a clock that is not what its stamps say."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendmap.records.noise import noise_of

if TYPE_CHECKING:
    from pendmap.records.work import Work

__all__ = ["check"]


def check(work: Work) -> None:
    """Say so where noise grows with speed."""
    if work.integrated:
        return  # a late reading of a rate errs with the acceleration
    floor = noise_of(
        work.time, work.theta, trusted=work.trusted, count=0.0 if work.edges else work.count
    )
    if floor.law is not None:
        interval = float(np.median(np.diff(work.time)))
        part = f"{100 * floor.law.tau / interval:.0f} % of the interval"
        work.say("noise-grows-with-speed", f"{floor.law} ({part})")
