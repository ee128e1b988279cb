"""Variables of results by the CF conventions 1.11.

Units are those of UDUNITS-2; what it does not have is the unit 1 with its meaning in the long name.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Hashable, Mapping

CONVENTIONS: Final = "CF-1.11"
FORMAT_VERSION: Final = 2  # Version of the layout, in the attribute ``format_version``
NO_YES: Final = {0: "no", 1: "yes"}  # Meanings of a flag
_UDUNITS: Final = re.compile(r"(1|rad|m|mm|s|Hz)(/(rad|s)\d?)?")  # Units that UDUNITS-2 has too
_NOT_IN_FLAGS: Final = re.compile(r"[^\w@.+-]", re.ASCII)
"""Characters that CF does not allow in ``flag_meanings``."""


def variable(  # noqa: PLR0913 (attributes of CF)
    dims: Hashable | tuple[Hashable, ...],
    values: Any,  # noqa: ANN401 (an array)
    units: str = "",
    long_name: str = "",
    comment: str = "",
    *,
    flags: Mapping[int, str] | None = None,
    missing: int | None = None,
) -> tuple[Hashable | tuple[Hashable, ...], Any, dict[str, Any]]:
    """Return a variable of a dataset with the attributes of CF that are not empty.

    ``flags`` are the meanings of whole numbers, ``missing`` the number that means none.
    """
    units = units.replace("^", "")
    if units and not _UDUNITS.fullmatch(units):
        units, long_name = "1", f"{long_name}, in {units}"
    attributes: dict[str, Any] = {"units": units, "long_name": long_name, "comment": comment}
    attributes = {key: text for key, text in attributes.items() if text}
    dtype = getattr(values, "dtype", None) or np.asarray(values).dtype  # reads no lazy array
    if flags is not None:
        attributes["flag_values"] = np.array([*flags], dtype=dtype)
        meanings = (_NOT_IN_FLAGS.sub("_", meaning) for meaning in flags.values())
        attributes["flag_meanings"] = " ".join(meanings)
    if missing is not None:
        attributes["_FillValue"] = dtype.type(missing)
    return dims, values, attributes


def flag(
    dims: Hashable | tuple[Hashable, ...],
    values: Any,  # noqa: ANN401 (an array)
    long_name: str,
    flags: Mapping[int, str] = NO_YES,
) -> tuple[Hashable | tuple[Hashable, ...], Any, dict[str, Any]]:
    """Return a variable that is 0 or 1, or another small number with a meaning."""
    return variable(dims, np.asarray(values, dtype=np.int8), "", long_name, flags=flags)
