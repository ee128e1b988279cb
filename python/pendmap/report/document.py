"""A report as a structure, from which Markdown and HTML are made alike.

Texts are plain: whatever stands in them is shown as it is, names of files and columns included.
What looks otherwise is a :class:`Name` or :class:`Strong`.
"""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True)
class Name:
    """What a program calls something."""

    text: str


@dataclasses.dataclass(frozen=True)
class Strong:
    """What is read first."""

    text: str


Text = str | Name | Strong | tuple[str | Name | Strong, ...]


@dataclasses.dataclass(frozen=True)
class Paragraph:
    """A few sentences."""

    text: Text


@dataclasses.dataclass(frozen=True)
class Formula:
    """Lines that keep their blanks."""

    text: str


@dataclasses.dataclass(frozen=True)
class Items:
    """A list, a line each."""

    texts: tuple[Text, ...]


@dataclasses.dataclass(frozen=True)
class Table:
    """Heads and rows; the first column holds words, and of the others those that are named."""

    head: tuple[str, ...]
    rows: tuple[tuple[Text, ...], ...]
    words: tuple[str, ...] = ()

    @property
    def of_words(self) -> tuple[bool, ...]:
        """Which columns hold words; the others hold numbers."""
        return tuple(k == 0 or name in self.words for k, name in enumerate(self.head))


@dataclasses.dataclass(frozen=True)
class Picture:
    """A figure by its name, and what it shows."""

    name: str
    caption: str


Block = Paragraph | Formula | Items | Table | Picture


@dataclasses.dataclass(frozen=True)
class Section:
    """A part with its heading."""

    title: str
    blocks: tuple[Block, ...]


@dataclasses.dataclass(frozen=True)
class Document:
    """A report.

    Parameters
    ----------
    title : str
        What it is about.
    lead : str or tuple
        The one sentence for those who read no more.
    sections : tuple of Section
        Its parts.
    """

    title: str
    lead: Text
    sections: tuple[Section, ...]

    @property
    def pictures(self) -> list[str]:
        """Names of all figures, in their order."""
        blocks = (block for section in self.sections for block in section.blocks)
        return [block.name for block in blocks if isinstance(block, Picture)]
