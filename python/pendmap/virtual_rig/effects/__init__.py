"""All effects by name, and the parsing and drawing of requested effects."""

from __future__ import annotations

import dataclasses
import difflib
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError
from pendmap.virtual_rig.effects import readings, stand, torques
from pendmap.virtual_rig.effects.base import Effect

if TYPE_CHECKING:
    from numpy.random import Generator

EFFECTS: Final[dict[str, type[Effect]]] = {
    kind.full_name(): kind
    for module in (torques, stand, readings)
    for kind in vars(module).values()
    if isinstance(kind, type) and issubclass(kind, Effect) and "formula" in vars(kind)
}
"""Every effect with a formula, by name and variant, in the order of the modules."""

ANY: Final = "any"  # Requests an effect that the seed chooses
NONE: Final = "none"  # Requests a rig without hidden effects


def describe() -> list[dict[str, str]]:
    """Return name, group, formula, required kind of run and parameter ranges of each effect.

    Examples
    --------
    >>> next(e["formula"] for e in describe() if e["name"] == "quadratic_drag")
    '-q v abs(v)'
    """
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
    sign = "size " if about["size"] else ""
    return f"{sign}{field.name} {about['low']:.3g} to {about['high']:.3g} {about['unit']}".strip()


def draw(asked: list[str], rng: Generator, scale: float, kinds: set[str]) -> list[Effect]:
    """Draw the requested effects in order; ``any`` chooses one that these kinds of runs show.

    An entry is ``name``, ``name:variant`` or ``any``, with parameters as in
    ``quadratic_drag,q=0.01``, or ``none`` alone; ``scale`` multiplies every size that is drawn.
    """
    if NONE in asked and len(asked) > 1:
        raise InputError("effect none must be alone, got other effects too")
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
            close = difflib.get_close_matches(name, EFFECTS, n=3)
            near = f"did you mean {', '.join(close)}? " if close else ""
            raise InputError(
                f"effect {name!r} is not known: {near}it must be any, none or one that pendmap rig "
                "--list shows"
            )
        if kind.name in used:
            raise InputError(f"effect {name!r}: {kind.name} is asked for twice")
        if kind.needs not in {"", *kinds}:
            raise InputError(f"effect {name!r} is detectable in {kind.needs} runs only, got none")
        made.append(kind.draw(rng, scale, given))
    return made


def draws_size(text: str) -> bool:
    """Return whether an entry of :func:`draw` has a size that is drawn, or an unknown name."""
    if text == NONE:
        return False
    name, given = _parse(text)
    fields = dataclasses.fields(EFFECTS[name]) if name in EFFECTS else ()
    return not any(field.metadata["size"] and field.name in given for field in fields)


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
