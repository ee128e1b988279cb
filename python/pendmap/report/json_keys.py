"""Keys of the JSON objects that commands on records print, by path, with unit and meaning.

``runs[].rms`` is the key ``rms`` of an item of the list ``runs``. A part of a path in capitals
stands for names: of parameters, effects, methods, channels. A key without a value is null. The keys
are in ``json_keys.toml``.
"""

from __future__ import annotations

from typing import Any, Final

from pendmap.files.saved import COLUMNS
from pendmap.files.toml import packaged
from pendmap.model.labels import LABELS, QUANTITIES

Keys = dict[str, tuple[str, str]]  # Unit and meaning by path; paths of one meaning have commas

_TABLES: Final = packaged("report/json_keys.toml")
_UNITS: Final = {"chance": "1", "error_percent": "percent", "quantity": "", "unit": ""}
_TABLES["groups"]["QUANTITY"] = {
    name: (_UNITS.get(name, "that of unit"), text)
    for name, text in COLUMNS["row"].items()
    if name != "run"
}


def _expanded(table: dict[str, Any]) -> Keys:
    """Return the keys of a table, after those of its groups below their places."""
    keys: Keys = {}
    for place, groups in table.items():
        for group in groups.split() if isinstance(groups, str) else ():
            for names, about in _expanded(_TABLES["groups"][group]).items():
                paths = (f"{place}.{name}".lstrip(".") for name in names.split(", "))
                keys[", ".join(paths)] = about
    return keys | {
        n: (about[0], about[1]) for n, about in table.items() if not isinstance(about, str)
    }


KEYS: Final[dict[str, Keys]] = {name: _expanded(table) for name, table in _TABLES["keys"].items()}
"""Unit and meaning of all keys, by command and path."""
KEYS["identify"] |= {
    f"methods.METHOD.{name}": (LABELS[name].unit or "1", LABELS[name].meaning)
    for name in ("w0", "c_over_m", "zeta", "Tr", "theta_r", "offset")
}
KEYS["identify"] |= {
    f"quantities.{name}.{part}": (unit, f"{text}: {part}")
    for name, (unit, _, text) in QUANTITIES.items()
    for part in ("value", "stderr", "ci95[]")
}
