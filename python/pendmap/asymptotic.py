"""Critical curves of the damped Mathieu equation by perturbation, beside the exact ones.

For ``th'' + gamma th' + (1 + p cos(omega tau)) th = 0`` a periodic solution is written with the
few harmonics that matter, and those which are not resonant are eliminated: what the methods of
Struble, of averaging and of multiple scales give at the same order.

**First tongue**, about ``omega = 2``: ``th = A cos(omega tau/2) + B sin(omega tau/2)`` alone gives

``a^2 + c^2 = p^2/4``, ``a = 1 - omega^2/4``, ``c = gamma omega/2``: first order.

The third harmonic answers with ``C = (p/2) A / (9 omega^2/4 - 1)`` and acts back with ``(p/2) C``,
which adds ``k p^2``, ``k = 1/(9 omega^2 - 4)``, to ``a``: second order,

``(a + k p^2)^2 + c^2 = p^2/4``.

**Second tongue**, about ``omega = 1``: ``th = C0 + A cos(omega tau) + B sin(omega tau)`` and the
second harmonic. ``C0 = -(p/2) A`` takes ``p^2/2`` off the stiffness of the cosine alone, the second
harmonic adds ``s p^2``, ``s = 1/(4 (4 omega^2 - 1))``, to both:

``(a - (1/2 - s) p^2)(a + s p^2) + c^2 = 0``, ``a = 1 - omega^2``, ``c = gamma omega``: second
order.

Damping of the harmonics that are eliminated is left out: it is of the next order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

__all__ = ["CURVES", "first_tongue", "first_tongue_second_order", "second_tongue"]


def first_tongue(omega: Floats, gamma: float) -> Floats:
    """Critical ``p`` of the first tongue to first order; nan nearer to the second tongue."""
    a, c = 1 - omega**2 / 4, gamma * omega / 2
    return np.where(omega > 1.0, 2 * np.hypot(a, c), np.nan)


def first_tongue_second_order(omega: Floats, gamma: float) -> Floats:
    """Critical ``p`` of the first tongue to second order; nan where the expansion has none."""
    a, c = 1 - omega**2 / 4, gamma * omega / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        k = 1 / (9 * omega**2 - 4)
        # k^2 P^2 + (2 a k - 1/4) P + a^2 + c^2 = 0 in P = p^2: the root that is not far away.
        half = 1 / 8 - a * k
        square = (a**2 + c**2) / (half + np.sqrt(half**2 - k**2 * (a**2 + c**2)))
        found = np.sqrt(square)
    # Left of 2/3 the third harmonic is resonant before the first.
    return np.where((omega > 1.0) & np.isfinite(found), found, np.nan)


def second_tongue(omega: Floats, gamma: float) -> Floats:
    """Critical ``p`` of the second tongue to second order; nan where the expansion has none."""
    a, c = 1 - omega**2, gamma * omega
    with np.errstate(divide="ignore", invalid="ignore"):
        s = 1 / (4 * (4 * omega**2 - 1))
        # s (1/2 - s) P^2 + a (1/2 - 2 s) P - (a^2 + c^2) = 0.
        leading, half = s * (0.5 - s), a * (0.5 - 2 * s) / 2
        square = (-half + np.sqrt(half**2 + leading * (a**2 + c**2))) / leading
        found = np.sqrt(square)
    # Left of 1/sqrt(2) the second harmonic is nearly resonant itself.
    return np.where((omega > np.sqrt(0.5)) & np.isfinite(found), found, np.nan)


CURVES: dict[str, tuple[int, Callable[[Floats, float], Floats]]] = {
    "tongue 1, first order": (-1, first_tongue),
    "tongue 1, second order": (-1, first_tongue_second_order),
    "tongue 2, second order": (1, second_tongue),
}
"""What each is called, the multiplier on it, and its formula."""
