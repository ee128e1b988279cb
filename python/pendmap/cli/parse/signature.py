"""Type, default and help of options, from signatures and docstrings of what a command calls."""

from __future__ import annotations

import ast
import functools
import inspect
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import pendmap
from pendmap.cli.parse import options, types
from pendmap.cli.parse.options import added, flag, option

if TYPE_CHECKING:
    from collections.abc import Iterator

    import click
    import cloup

    from pendmap.cli.parse.options import Decorator

_PACKAGE: Final = Path(pendmap.__file__).parent
_ENTRY: Final = re.compile(r"^(\w+(?:, \w+)*)(?: : .*)?\n((?: {4}.*\n|\n)+)", re.MULTILINE)
_REFERENCE: Final = re.compile(r"As for :func:`(?:pendmap\.)?(\w+)`")
_SENTENCE: Final = re.compile(r"(.*?)(?<!eq)\.(?: |$)")
_OF_FLAG: Final = re.compile("^(Whether to|False:) ")
_MARKUP: Final = re.compile(r":\w+:`~?(?:pendmap\.)?(.*?)`|``(.*?)``")

_TYPES: Final = {"int": types.INTEGER, "float": types.NUMBER}
"""Type of an option by the first word of its annotation; other options are text."""
_SEVERAL: Final = ("tuple[str", "Sequence", "Collection", "Iterable")
GROUPS: Final = {
    **dict.fromkeys(("starts", "precision", "tol", "max_periods"), options.ACCURACY),
    **dict.fromkeys(("theta", "velocity"), options.START),
    "seed": options.RANDOM,
    "threads": options.MACHINE,
}
"""Group of what means the same in all commands; others have a group of their command."""


class Parameter(NamedTuple):
    """A parameter as its function declares it: annotation, default, description."""

    annotation: str
    default: Any
    text: str

    @property
    def is_option(self) -> bool:
        """Whether it is a number, a switch or a text."""
        return self.annotation.split(" |")[0] in {"int", "float", "bool", "str"}

    @property
    def help(self) -> str:
        """First sentence of the description, with the default at its end."""
        sentence = _SENTENCE.match(self.text)
        words = _MARKUP.sub(r"\1\2", sentence[1] if sentence else self.text)
        words, _, default = _OF_FLAG.sub("", words).partition("by default ")
        words = words[:1].upper() + words[1:].rstrip(" ,;")
        if self.annotation.startswith(_SEVERAL):
            words += "; may be repeated"
        return f"{words}." + (f"  [default: {default}]" if default else "")


@functools.cache
def parameters(path: str) -> dict[str, Parameter]:
    """Return the parameters of a function or a class, like ``analysis.basins.basins``.

    Its source is read: importing what it needs would take longer than to print the help.
    """
    module, _, name = path.rpartition(".")
    place = _PACKAGE.joinpath(*module.split("."))
    source = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    tree = ast.parse(source.read_text(encoding="utf-8"))
    node = next(part for part in tree.body if getattr(part, "name", "") == name)
    assert isinstance(node, ast.FunctionDef | ast.ClassDef)  # noqa: S101 (of our own sources)
    document = inspect.cleandoc(ast.get_docstring(node) or "") + "\n"
    entries = {
        one: " ".join(text.split())
        for names, text in _ENTRY.findall(document.partition("Parameters\n---")[2])
        for one in names.split(", ")
    }
    result = {}
    for one, annotation, default in _declared(node):
        text = entries.get(one, "")
        if (other := _REFERENCE.match(text)) is not None:
            text = parameters(f"{pendmap.HOMES[other[1]]}.{other[1]}")[one].text
        result[one] = Parameter(annotation, default, text)
    return result


def _declared(node: ast.FunctionDef | ast.ClassDef) -> Iterator[tuple[str, str, Any]]:
    """Yield name, annotation and default of each parameter, or field of a dataclass."""
    fields: list[tuple[str, ast.expr | None, ast.expr | None]]
    if isinstance(node, ast.ClassDef):
        assigned = [part for part in node.body if isinstance(part, ast.AnnAssign)]
        fields = [(ast.unparse(one.target), one.annotation, one.value) for one in assigned]
    else:
        without = [None] * (len(node.args.args) - len(node.args.defaults))
        defaults = [*without, *node.args.defaults, *node.args.kw_defaults]
        names = [*node.args.args, *node.args.kwonlyargs]
        pairs = zip(names, defaults, strict=True)
        fields = [(one.arg, one.annotation, default) for one, default in pairs]
    for name, annotation, value in fields:
        default = None if value is None else ...
        if isinstance(value, ast.Constant | ast.UnaryOp | ast.Tuple):
            default = ast.literal_eval(value)
        yield name, "" if annotation is None else ast.unparse(annotation), default


def options_of(
    path: str, names: str, group: cloup.OptionGroup | None = None, **kinds: click.ParamType[Any]
) -> Decorator:
    """Return options for parameters of a function or a class.

    ``names`` are those typed, separated by spaces; one that differs from the parameter's is written
    ``typed=parameter``. ``kinds`` are types of options that an annotation does not name.
    """
    declared = parameters(path)
    made = []
    for word in names.split():
        typed, _, other = word.partition("=")
        name = other or typed
        parameter = declared[name]
        annotation = parameter.annotation.split(" |")[0]
        written = f"--{typed.replace('_', '-')} {name}"
        kind = kinds.get(name, _TYPES.get(annotation, types.TEXT))
        home = group if group is options.RECORD else GROUPS.get(name, group)
        # The default of an option must be a literal in the source.
        assert home is not None and parameter.default is not ..., name  # noqa: S101, PT018
        if annotation == "bool":
            written = f"--no-{typed} {name}" if parameter.default else written
            made.append(flag(written, parameter.help, group=home, default=parameter.default))
        elif annotation.startswith(_SEVERAL):
            made.append(option(written, kind, parameter.help, group=home, multiple=True))
        else:
            made.append(option(written, kind, parameter.help, parameter.default, group=home))
    return added(*made)


_READING: Final = "time angle velocity x y time_unit angle_unit angle_scale rate=rate_hz"
_COLUMNS: Final = dict.fromkeys(("time", "angle", "velocity", "x", "y"), types.COLUMN)
reading_options: Final = options_of(
    "records.by_hand.ByHand",
    f"{_READING} from=from_s to=to_s counts_per_turn",
    options.RECORD,
    **_COLUMNS,
)
"""Options that say how records are read."""


def take_reading(given: dict[str, Any]) -> Any:  # noqa: ANN401 (a ByHand)
    """Remove the options that say how records are read from ``given`` and return them."""
    return {name: given.pop(name) for name in parameters("records.by_hand.ByHand")}
