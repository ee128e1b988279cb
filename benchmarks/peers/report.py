"""Output of every benchmark: machine, versions and a plain table."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

CPUINFO = Path("/proc/cpuinfo")


def _cpuinfo(key: str) -> str:
    if CPUINFO.exists():
        for line in CPUINFO.read_text(encoding="utf-8").splitlines():
            name, _, value = line.partition(":")
            if name.strip() == key:
                return value.strip()
    return ""


def has_avx512() -> bool:
    """Return whether the processor has AVX-512."""
    return "avx512f" in _cpuinfo("flags").split()


def machine(packages: Iterable[str], simd: str = "") -> str:
    """Return the lines that head a table: processor, cores, instruction set, versions."""
    model = _cpuinfo("model name") or platform.processor() or platform.machine()
    family = f"family {_cpuinfo('cpu family')} model {_cpuinfo('model')}"
    versions = [f"Python {platform.python_version()}"]
    for package in packages:
        try:
            versions.append(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            versions.append(f"{package} not installed")
    lines = [
        f"machine   {model} ({family}), {os.cpu_count()} cores, {platform.system()}",
        f"simd      {'AVX-512 present' if has_avx512() else 'no AVX-512'}"
        + (f"; pendmap uses {simd}" if simd else ""),
        f"versions  {', '.join(versions)}",
    ]
    return "\n".join(lines)


def table(headers: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return an aligned table: numbers to the right, words to the left."""
    body = [list(row) for row in rows]
    widths = [max(len(cell) for cell in column) for column in zip(headers, *body, strict=True)]
    right = [all(_is_number(row[k]) for row in body) for k in range(len(headers))]

    def line(cells: Sequence[str]) -> str:
        parts = (
            cell.rjust(width) if flush else cell.ljust(width)
            for cell, width, flush in zip(cells, widths, right, strict=True)
        )
        return "  ".join(parts).rstrip()

    rule = "-" * (sum(widths) + 2 * (len(widths) - 1))
    return "\n".join([line(headers), rule, *(line(row) for row in body)])


def _is_number(cell: str) -> bool:
    try:
        float(cell.removesuffix("%").removesuffix("x"))
    except ValueError:
        return cell in {"", "-"}
    return True


def say(text: str) -> None:
    """Write to stdout immediately."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def note(text: str) -> None:
    """Write a remark to stderr, so that stdout contains the table alone."""
    sys.stderr.write(text + "\n")
    sys.stderr.flush()
