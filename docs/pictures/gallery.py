"""Make the pictures of docs/gallery.md: `python docs/pictures/gallery.py [WORD]`, from anywhere."""

from __future__ import annotations

import re
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np

import pendmap
from pendmap import Grid, Pendulum, plot, virtual_rig

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HERE = Path(__file__).resolve().parent
PAGE = HERE.parent / "gallery.md"
DPI = 90


def snippets() -> dict[str, str]:
    """Return the code of each picture of the page by its file's name."""
    parts = re.split(r"^## ", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    pairs = (re.search(r"\]\(pictures/(\S+)\).*?```python\n(.*?)```", p, re.DOTALL) for p in parts)
    return {pair[1]: pair[2] for pair in pairs if pair}


def experiments(folder: Path) -> dict[str, Path]:
    """Write the records that snippets read; return their folders by name."""
    drag = ("quadratic_drag,q=0.0008",)
    requests = {
        "DECAY": virtual_rig.Request("free_decay", free=1),
        "LAB": virtual_rig.Request("hidden", 3, drag, free=3, forced=3, duration=20.0),
    }
    for name, request in requests.items():
        virtual_rig.write(
            virtual_rig.make(request), virtual_rig.places(folder / name, replace=True)
        )
    return {name: folder / name for name in requests}


def draw(code: str, records: dict[str, Path]) -> Figure:
    """Return the figure of a snippet."""
    names: dict[str, Any] = {"Grid": Grid, "Pendulum": Pendulum, "np": np, "pendmap": pendmap}
    names |= {"plt": plt, "plot": plot, **records}
    exec(code, names)  # noqa: S102 (our own page)
    figure: Figure = names["fig"]
    return figure


if __name__ == "__main__":
    plt.style.use("pendmap.figures")
    with tempfile.TemporaryDirectory() as folder:
        records = experiments(Path(folder))
        for name, code in snippets().items():
            if not all(word in name for word in sys.argv[1:]):
                continue
            began = time.perf_counter()
            figure = draw(code, records)
            figure.savefig(HERE / name, dpi=DPI)
            plt.close(figure)
            seconds, size = time.perf_counter() - began, (HERE / name).stat().st_size / 1000
            print(f"{name}: {seconds:.1f} s, {size:.0f} kB")
