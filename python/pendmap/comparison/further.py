"""Parts of a diagnosis that its verdict does not rest on: each may fail by itself.

A fitted model may diverge where such a part runs it: in another record, from another state, with
another size of an effect. The part is then left out, and the reason is kept.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

Reasons = dict[str, str]  # Why a part was not computed, by its field in the JSON object

Part = TypeVar("Part")

LOST: Final = (ArithmeticError, np.linalg.LinAlgError)
"""Errors that a diverging motion raises, directly or through a quotient or matrix of it."""


def compute_part(reasons: Reasons, field: str, compute: Callable[[], Part], default: Part) -> Part:
    """Return a part of a diagnosis; where it fails, the default, with the reason kept."""
    try:
        return compute()
    except LOST as error:
        reasons[field] = str(error)
        return default
