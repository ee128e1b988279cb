"""Free parameters as the core counts them, and in SI.

The core counts time in ``1 / w_ref`` of a fixed ``w_ref``, and ``w0`` is a factor ``xi`` on gravity
there. In SI

``w0 = w_ref sqrt(xi)``, ``x = u w_ref^k xi`` of all others.

The power ``k`` of a size whose unit depends on an exponent ``n`` is ``2 - n``. Where both are free
the Jacobian ``dx / dxi`` has ``dq / dn = -ln(w_ref) q`` beside its diagonal.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from pendmap.identification.free import Quantity
    from pendmap.model.units import Units

    Floats = NDArray[np.float64]

__all__ = ["Conversion", "interval"]


@dataclasses.dataclass(frozen=True)
class Conversion:
    """Conversion of the free parameters of a fit.

    Parameters
    ----------
    quantities : sequence of Quantity
        The parameters.
    units : Units
        SI, with ``w_ref`` for their ``w0``.
    """

    quantities: Sequence[Quantity]
    units: Units

    @property
    def names(self) -> tuple[str, ...]:
        """What the parameters are called."""
        return tuple(q.name for q in self.quantities)

    @property
    def start(self) -> list[tuple[list[tuple[int, int]], float]]:
        """Place and start of each, as the core takes them."""
        starts = [q.start for q in self.quantities]
        scales = self._scales(starts)
        return [
            (q.places, (q.start / self.units.w0) ** 2 if q.is_w0 else q.start / scale)
            for q, scale in zip(self.quantities, scales, strict=True)
        ]

    def given(self, values: ArrayLike) -> Floats:
        """Return in SI what the core calls ``values``, shape (k,)."""
        bare = np.asarray(values, np.float64)
        roots = np.sqrt(np.where(bare > 0, bare, np.nan))
        first = np.array([q.is_w0 for q in self.quantities], bool)
        return np.where(first, self.units.w0 * roots, self._scales(bare) * bare)

    def jacobian(self, values: ArrayLike) -> Floats:
        """Return the derivatives of :meth:`given`, shape (k, k): of rows, by columns."""
        given = self.given(values)
        slopes = self._scales(values)
        for k, q in enumerate(self.quantities):
            if q.is_w0:
                slopes[k] = self.units.w0**2 / (2 * given[k])
        found = np.diag(slopes)
        for size, exponent in self._exponents.items():
            found[size, exponent] = -math.log(self.units.w0) * given[size]
        return found

    def columns(self, bare: Floats, values: ArrayLike) -> Floats:
        """Return derivatives by the parameters in SI, shape (n, k), from those by the core's."""
        return np.asarray(bare @ np.linalg.inv(self.jacobian(values)), np.float64)

    def covariance(self, bare: Floats, values: ArrayLike) -> Floats:
        """Return the covariance in SI, shape (k, k), from the core's.

        Variances are infinite of what the records do not show, and of what is computed from it.
        """
        slopes = self.jacobian(values)
        known = np.where(np.isfinite(bare), bare, 0.0)
        found = slopes @ known @ slopes.T
        unseen = ~np.isfinite(np.diag(bare))
        through = (slopes[:, unseen] != 0).any(axis=1)
        found[through, through] = np.inf
        return np.asarray(found, np.float64)

    @property
    def mixed(self) -> tuple[int, ...]:
        """The places of sizes whose unit is free too: no number of the core's is such a size."""
        return tuple(self._exponents)

    @property
    def _exponents(self) -> dict[int, int]:
        """The place of the exponent of each size whose unit depends on a free one."""
        places = {name: k for k, name in enumerate(self.names)}
        return {k: places[q.less] for k, q in enumerate(self.quantities) if q.less is not None}

    def _scales(self, values: ArrayLike) -> Floats:
        """Return what one of the core's is in SI; an exponent is the same number in both."""
        powers = np.array([q.power for q in self.quantities], np.float64)
        for size, exponent in self._exponents.items():
            powers[size] -= np.asarray(values, np.float64)[exponent]
        units = np.array([q.unit for q in self.quantities], np.float64)
        return np.asarray(units * self.units.w0**powers, np.float64)


def interval(value: float, half: float, *, mixed: bool) -> tuple[float, float]:
    """Return a value less and more ``half`` of its interval; no numbers where that is not finite.

    Of a size whose unit is free too, in equal ratios: what records tell is ``q v^n`` at their
    velocities ``v``, so that ``ln q`` and ``n`` vary together, and nearly normally.
    """
    if not math.isfinite(half):
        return math.nan, math.nan
    if not mixed or value == 0:
        return value - half, value + half
    ratio = min(half / abs(value), 300.0)  # beyond it nothing is known
    low, high = sorted((value * math.exp(-ratio), value * math.exp(ratio)))
    return low, high
