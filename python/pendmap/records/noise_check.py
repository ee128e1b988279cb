"""What the noise itself tells: a clock that is not what its stamps say."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.records.noise import noise_of

if TYPE_CHECKING:
    from pendmap.records.work import Work

__all__ = ["check"]

GROWS: Final = 2.0
"""Times that the noise of the fastest quarter is that of the slowest before it is said."""


def check(work: Work) -> None:
    """Say so where noise grows with speed."""
    floor = noise_of(work.time, work.theta, trusted=work.trusted, count=work.count)
    if not math.isfinite(floor.sigma) or floor.limited_by_count or not floor.by_speed:
        return
    slow, fast = floor.by_speed[0], floor.by_speed[-1]
    certain = fast.sigma - GROWS * slow.sigma > 4 * (fast.stderr + GROWS * slow.stderr)
    if certain and fast.speed_from > 0 and fast.sigma > 2 * work.count:
        extra = math.sqrt(fast.sigma**2 - slow.sigma**2)
        late = extra / ((fast.speed_from + min(fast.speed_to, 2 * fast.speed_from)) / 2)
        interval = float(np.median(np.diff(work.time)))
        text = (
            f"the noise grows with speed, {slow.sigma:.2g} to {fast.sigma:.2g} rad: as if the"
            f" instants of sampling missed their stamps by {late:.1g} s"
            f" ({100 * late / interval:.0f} % of the interval)"
        )
        work.say("noise-grows-with-speed", text)
