"""Optional parts of a diagnosis, on which the verdict does not depend.

A fitted model may diverge in another record, from another state or with another size of an effect.
The part that needs this motion is then omitted, and the reason is kept.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

Reasons = dict[str, str]  # Reason why a part was not computed, by its field in the JSON object

Part = TypeVar("Part")

LOST: Final = (ArithmeticError, np.linalg.LinAlgError)
"""Errors raised by a diverging motion, directly or in arithmetic and linear algebra with it."""


def compute_part(reasons: Reasons, field: str, compute: Callable[[], Part], default: Part) -> Part:
    """Return a part of a diagnosis, or the default if it fails, with the reason in ``reasons``."""
    try:
        return compute()
    except LOST as error:
        reasons[field] = str(error)
        return default
