"""Channels of a record, their units, and the words of headings, which stand in ``words.toml``."""

from __future__ import annotations

import dataclasses
import functools
import re
import unicodedata
from typing import TYPE_CHECKING, Final

from pendmap.errors import InputError
from pendmap.files.toml import packaged

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

_TABLES: Final = packaged("tables/words.toml")
TIMES: Final[dict[str, float]] = _TABLES["time"]
ANGLES: Final[dict[str, float]] = _TABLES["angle"]
LENGTHS: Final[dict[str, float]] = _TABLES["length"]
PIVOT_UNITS: Final = {unit: (si, factor) for unit, (si, factor) in _TABLES["pivot"].items()}
RAW: Final = frozenset(_TABLES["raw"])
DEGREE: Final = ANGLES["deg"]
SPEEDS: Final = {f"{a}/{t}": ANGLES[a] / TIMES[t] for t in ("s", "min") for a in ANGLES}
_ACCELERATIONS: Final = {
    **{f"{name}/s2": factor for name, factor in LENGTHS.items() if name != "px"},
    "g": 9.80665,
    **{f"{name}/s2": factor for name, factor in ANGLES.items()},
}

_UNITS: Final[dict[str, str]] = {
    word: name
    for name, words in _TABLES["spelled"].items()
    for word in (name.lower(), *words.split())
}
# Meanings in the order in which they decide about a heading
MEANINGS: Final = tuple(_TABLES["words"])
# Meanings of columns that are not the pendulum's
OTHERS: Final = ("drive", "motor", "pivot", "error")
_WORDS: Final[dict[str, str]] = {
    word: name for name, words in _TABLES["words"].items() for word in words.split()
}
_SETTINGS: Final = tuple(words.split() for words in _TABLES["settings"].values())
_SETTING: Final = re.compile(r"(\d*\.?\d+(?:e[+-]?\d+)?) ?([^\W\d_]*)(?:/s)?$")
_RATES: Final = (1.0, 1e6)  # Sampling rates that a setting may have, Hz
_ENDINGS: Final = ("", "s", "es", "n", "en")  # of plurals
_FIRM: Final = ("velocity", "acceleration", "trigger")  # Meanings that no unit contradicts
_FURTHER: Final = ("plain", "pendulum", "smooth")  # Meanings of words that follow a unit
_SHORTEST_STEM: Final = 3
_SHORTEST_PART: Final = 4  # Shortest part of a compound, letters, but for Chinese
_SIGNS: Final = str.maketrans("˚º∘ł（）［］【】：´’′`μµ−⋅·*", "°°°l()[][]:''''uu-...")
_MARKS: Final = ((r"([α-ω])\u0308", r"\1 ddot"), (r"([α-ω])\u0307", r"\1 dot"))
_DERIVATIVES: Final[list[list[str]]] = _TABLES["derivatives"]
_BRACKETS: Final = re.compile(r"\s*/?\s*[\(\[\{]([^()\[\]{}]*)[\)\]\}]")
_CAMEL: Final = r"(?<=[a-z])(?=[A-Z])"
_BREAKS: Final = re.compile(rf"\s*[/,;:]\s*|(?:[\s_]+(?:in|en|em|w)[\s_]+)|[\s_]+|{_CAMEL}")
_PER: Final = re.compile(r"[\s_](?:per|pro|par|por|al|na)[\s_]")
_LAST: Final = re.compile(r"(.*?)[\s_#.-]*(\d+|[^\W\d_]+)")
_TOKENS: Final = re.compile(r"[\u3400-\u9fff]+|[^\W\d_\u3400-\u9fff]+'*")


@dataclasses.dataclass(frozen=True)
class Channel:
    """Quantity of a column, with its units and usual heading."""

    unit: str  # in SI
    units: Mapping[str, float]  # factor to SI by name
    default: str  # usual heading
    meanings: tuple[str, ...] = ()  # of the words of other headings

    def factor(self, unit: str, where: str) -> float:
        """Return the factor from a unit to SI; raise InputError for other units."""
        spelled = spelling(unit)
        if spelled not in self.units:
            raise InputError(
                f"{where}: unit must be one of {', '.join(self.units)}, or a scale must be given,"
                f" {self.unit} per unit{' (angle_scale)' * (self.unit == 'rad')}, got {unit!r}"
            )
        return self.units[spelled]

    def has(self, unit: str) -> bool:
        """Return whether a text is one of the channel's units, raw ones included."""
        return spelling(unit) in self.units or spelling(unit) in RAW


# Channels by name, in the order in which columns are assigned
CHANNELS: Final = {
    "time": Channel("s", TIMES, "t_s", ("time",)),
    "angle": Channel("rad", ANGLES, "theta_rad", ("angle",)),
    "velocity": Channel("rad/s", SPEEDS, "velocity_rad_s", ("velocity", "gyroscope")),
    "acceleration": Channel("m/s2", _ACCELERATIONS, "acceleration_m_s2", ("acceleration",)),
    "pixel_x": Channel("px", LENGTHS, "pixel_x", ("x",)),
    "pixel_y": Channel("px", LENGTHS, "pixel_y", ("y",)),
    "peaks": Channel("rad", ANGLES, "peak_rad", ("peaks",)),
    "trigger": Channel("1", {"1": 1.0, "V": 1.0, "mV": 1e-3, "ttl": 1.0}, "trigger", ("trigger",)),
}


def _folded(text: str) -> str:
    """Return a text in lower case without accents; dots above Greek letters become words."""
    text = unicodedata.normalize("NFKD", text.translate(_SIGNS)).translate(_SIGNS).casefold()
    for mark, word in _MARKS:
        text = re.sub(mark, word, text)
    return "".join(letter for letter in text if not unicodedata.combining(letter))


def stated_rate(lines: Iterable[str]) -> float | None:
    """Return the sampling rate, Hz, that lines above a table state, as "Sample rate: 50 Hz" does.

    The number stands behind the words, in the next cell, or in the one below.
    """
    cells = [[cell.strip() for cell in re.split(r"[,;\t:=]", _folded(line))] for line in lines]
    for row, below in zip(cells, [*cells[1:], []], strict=False):
        for k, cell in enumerate(row):
            words = {*_TOKENS.findall(cell)}
            sampling, rate, interval = (any(p in cell for p in parts) for parts in _SETTINGS)
            rate = (sampling and rate) or "fps" in words
            if not rate and not (sampling and interval) and not words & {"dt", "increment"}:
                continue
            for text in (cell, *row[k + 1 : k + 2], *below[k : k + 1]):
                match = _SETTING.search(text)
                if match is None or not float(match[1]):
                    continue
                value, unit = float(match[1]), spelling(match[2])
                value *= 1e3 if unit == "khz" else TIMES.get(unit, 1.0)
                value = value if rate and unit not in TIMES else 1 / value
                if _RATES[0] <= value <= _RATES[1]:
                    return value
    return None


def _stems(word: str) -> Iterator[str]:
    """Yield a word, and what it may be the plural of."""
    for ending in _ENDINGS:
        if word.endswith(ending) and (not ending or len(word) - len(ending) >= _SHORTEST_STEM):
            yield word.removesuffix(ending)


def spelling(unit: str) -> str:
    """Return a unit in the spelling of the tables of units, like "deg/s" for "°·s⁻¹"."""
    text = _PER.sub("/", _folded(unit).strip()).replace("^", "")
    text = re.sub(r"\s*/\s*", "/", text).replace("s-1", "/s").replace("s-2", "/s2")
    text = re.sub(r"[\s_.]*/", "/", text)
    text = _UNITS.get(text, text)
    text = re.sub(r"(?<=.)[\s_.](s2?)$", r"/\1", text).replace("/s/s", "/s2")
    over, *under = text.split("/")
    names = ["rad" if over == "1" and under else _name(over)]
    names += [_name(part.removesuffix("2")) + "2" * part.endswith("2") for part in under]
    return "/".join(names)


def _name(unit: str) -> str:
    """Return the name of a unit in the tables, or the unit itself."""
    return next((_UNITS[stem] for stem in _stems(unit.strip()) if stem in _UNITS), unit.strip())


def plain(name: str) -> str:
    """Return a name as words: lower case, no accents, no digits, single spaces."""
    text = _folded(re.sub(_CAMEL, " ", name))
    for pattern, words in _DERIVATIVES:
        text = re.sub(pattern, words, text)
    return " ".join(_TOKENS.findall(text))


@functools.cache
def meaning_of(word: str) -> str:
    """Return the meaning of a word, or of the last part of a compound; empty if it is unknown."""
    for stem in _stems(word):
        if stem in _WORDS:
            return _WORDS[stem]
    parts = [w for w in _WORDS if len(w) >= _SHORTEST_PART or w > "\u3400"]
    ends = [w for w in parts if word.endswith(w)]
    begins = [w for w in parts if word.startswith(w) and _WORDS[w] in OTHERS]
    longest = max(begins or ends, key=len, default="")
    return _WORDS[longest] if ends else ""


def meanings_of(words: Iterable[str]) -> list[str]:
    """Return the meanings of words, the deciding one first; empty ones, of unknown words, last."""
    return sorted({*map(meaning_of, words)}, key=(*MEANINGS, "").index)


def _is_unit(text: str) -> bool:
    """Return whether a text is a unit of any channel, written with a letter or a sign."""
    return text != "1" and any(channel.has(text) for channel in CHANNELS.values())


def _splits(text: str) -> Iterator[tuple[str, str]]:
    """Yield a heading divided into a name and what may be its unit, the likeliest first."""
    for match in _BRACKETS.finditer(text):
        yield text[: match.start()] + text[match.end() :], match[1]
    yield text, text if len(text) > 1 else ""
    yield from ((text[: gap.start()], text[gap.end() :]) for gap in _BREAKS.finditer(text, 1))
    first, *rest = plain(text).split() or [""]
    if len(first) > 1 and rest and {*meanings_of(rest)} <= {"time", "plain"}:
        yield text, first if spelling(first) in TIMES else ""  # "seconds_elapsed"
    last = _LAST.fullmatch(text)
    if last and last[1] and (last[2].isdigit() or meaning_of(last[2].lower()) in _FURTHER):
        yield from ((f"{name} {last[2]}", unit) for name, unit in _splits(last[1]))


@functools.cache
def name_and_unit(header: str) -> tuple[str, str | None]:
    """Return name and unit of a heading; None without a unit.

    >>> name_and_unit("Time (s)"), name_and_unit("t/ms"), name_and_unit("Kąt_stopnie")
    (('Time', 's'), ('t', 'ms'), ('Kąt', 'stopnie'))
    """
    text = header.translate(_SIGNS).strip()
    if ":" in text and not _is_unit(text.rpartition(":")[2]):
        text = text.rpartition(":")[2].strip() or text  # "Run 1: Time (s)"
    for name, unit in _splits(text):
        if _is_unit(unit):
            return name.strip(), unit.strip()
    bracket = re.search(r"[\(\[\{](?!\d+.$)([^()\[\]{}]+)[\)\]\}]$", text)
    if bracket and "" in meanings_of(plain(bracket[1]).split() or [""]):
        return text[: bracket.start()].strip(), bracket[1].strip()  # reported if it is needed
    return text, None


@dataclasses.dataclass(frozen=True)
class Heading:
    """Name and unit of a column, and what its words mean."""

    name: str
    unit: str | None
    meanings: tuple[str, ...]  # the deciding one first; an empty one for unknown words

    @classmethod
    def of(cls, header: str) -> Heading:
        """Return the meaning of a heading."""
        name, unit = name_and_unit(header)
        return cls(name, unit, tuple(meanings_of(plain(name).split())))

    @property
    def meaning(self) -> str:
        """The deciding meaning; empty if no word is known."""
        return self.meanings[0] if self.meanings else ""

    def rank(self, channel: str) -> int | None:
        """Return how well a heading fits a channel, 0 for best; None if it does not."""
        kind, unit = CHANNELS[channel], spelling(self.unit or "")
        if self.unit is not None and not kind.has(unit):
            return None
        unknown = "" in self.meanings
        if self.meaning in kind.meanings and not (unknown and channel.startswith("pixel")):
            return unknown + 2 * ("smooth" in self.meanings)
        if channel not in {"time", "angle", "velocity"} or "error" in self.meanings:
            return None
        if self.meaning in OTHERS:
            return 6 if unit in kind.units or {*kind.meanings} & {*self.meanings} else None
        owners = [c for c in CHANNELS.values() if self.meaning in c.meanings]
        free = not any(self.unit is None or c.has(unit) for c in owners)
        if unit in kind.units and free and self.meaning not in _FIRM:
            return 4
        weak = self.meaning == "pendulum" and self.unit is None
        return 5 - weak if channel == "angle" and free and (weak or unit in RAW) else None
