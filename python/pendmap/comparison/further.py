"""What a diagnosis computes once its verdict stands, each part by itself.

The verdict does not rest on these parts, and a model that was fitted may be lost where they run it:
in another record, from another start, with another size of an effect. A part that cannot be
computed is left out, and its reason is kept.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

Reasons = dict[str, str]
"""Why a part was not computed, by its field in the JSON object."""

Part = TypeVar("Part")

LOST: Final = (ArithmeticError, np.linalg.LinAlgError)
"""How it shows that numbers are lost: in a motion, in a quotient, in a matrix made of both."""


def attempted(reasons: Reasons, field: str, compute: Callable[[], Part], otherwise: Part) -> Part:
    """Return a part of a diagnosis, or ``otherwise`` with the reason kept."""
    try:
        return compute()
    except LOST as error:
        reasons[field] = str(error)
        return otherwise
