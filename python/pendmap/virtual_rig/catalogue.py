"""All effects by name, and how a user asks for them."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError
from pendmap.virtual_rig.effects.damping import AGEING, DAMPING
from pendmap.virtual_rig.effects.readings import READINGS
from pendmap.virtual_rig.effects.stand import STANDS
from pendmap.virtual_rig.effects.torques import TORQUES

if TYPE_CHECKING:
    from numpy.random import Generator

    from pendmap.virtual_rig.effects.base import Effect

EFFECTS: Final[dict[str, type[Effect]]] = {
    effect.full_name(): effect for effect in (*DAMPING, *AGEING, *TORQUES, *STANDS, *READINGS)
}
"""Every effect, by name and variant."""

ANY: Final = "any"
"""Asks for one that the seed chooses."""
NONE: Final = "none"
"""Asks for a rig without hidden effects."""


def describe() -> list[dict[str, str]]:
    """Name, group, formula, runs needed and parameters with their ranges, for each effect."""
    return [
        {
            "name": name,
            "group": effect.group,
            "formula": effect.formula,
            "needs": effect.needs,
            "parameters": ", ".join(_range(field) for field in dataclasses.fields(effect)),
        }
        for name, effect in EFFECTS.items()
    ]


def _range(field: dataclasses.Field[float]) -> str:
    about = field.metadata
    sign = "" if not about.get("size") else "size "
    return f"{sign}{field.name} {about['low']:.3g} to {about['high']:.3g} {about['unit']}".strip()


def draw(asked: list[str], rng: Generator, scale: float, kinds: set[str]) -> list[Effect]:
    """Draw the effects that a user asked for.

    Parameters
    ----------
    asked : list of str
        Each ``name``, ``name:variant``, ``any``, or alone ``none``; parameters may follow, as in
        ``quadratic_drag,q=0.01``.
    rng : Generator
        Where sizes and shapes come from.
    scale : float
        Multiplies every size that is drawn.
    kinds : set of str
        Kinds of the experiment's runs, ``free`` and ``forced``; ``any`` chooses only what they
        show.

    Returns
    -------
    list of Effect
        In the order asked.

    Raises
    ------
    InputError
        For an unknown name or parameter, a value outside its range, an effect asked for twice, or
        one that leaves no trace in such runs.
    """
    if NONE in asked and len(asked) > 1:
        raise InputError("effect none must be alone, got others beside it")
    made: list[Effect] = []
    for text in asked:
        if text == NONE:
            continue
        name, given = _parse(text)
        used = {effect.name for effect in made}
        if name == ANY:
            pool = [e for e in EFFECTS.values() if e.drawn and e.needs in {"", *kinds}]
            pool = [effect for effect in pool if effect.name not in used]
            kind = pool[int(rng.integers(len(pool)))]
        elif name in EFFECTS:
            kind = EFFECTS[name]
        else:
            raise InputError(f"effect {name!r} is not known: {_near(name)}")
        if kind.name in used:
            raise InputError(f"effect {name!r}: {kind.name} is asked for twice")
        if kind.needs not in {"", *kinds}:
            raise InputError(f"effect {name!r} shows in {kind.needs} runs only: here are none")
        made.append(kind.draw(rng, scale, given))
    return made


def draws_size(text: str) -> bool:
    """Whether what a user asked for has a size that is drawn; where it is not known, too."""
    if text == NONE:
        return False
    name, given = _parse(text)
    fields = dataclasses.fields(EFFECTS[name]) if name in EFFECTS else ()
    return not any(field.metadata.get("size") and field.name in given for field in fields)


def _parse(text: str) -> tuple[str, dict[str, float]]:
    name, *rest = text.split(",")
    given = {}
    for part in rest:
        key, equals, value = part.partition("=")
        try:
            given[key.strip()] = float(value)
        except ValueError:
            equals = ""
        if not equals:
            raise InputError(f"effect {text!r}: a parameter must be NAME=VALUE, got {part!r}")
    if name == ANY and given:
        raise InputError(f"effect {text!r}: any takes no parameters")
    return name.strip(), given


def _near(name: str) -> str:
    """Which names come close; where none does, where they are listed."""
    import difflib  # noqa: PLC0415 (for a message only)

    close = difflib.get_close_matches(name, EFFECTS, n=3)
    known = f"did you mean {', '.join(close)}? " if close else ""
    return f"{known}it must be any, none or one that pendmap rig --list shows"
