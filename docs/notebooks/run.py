"""Execute the notebooks in place: `python docs/notebooks/run.py [NAME ...]`, by default all.

Each runs in a temporary folder with this Python, so that the files it writes are not kept.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient

HERE = Path(__file__).resolve().parent
PATIENCE = 600  # s: limit for one cell
os.environ["PYDEVD_DISABLE_FILE_VALIDATION"] = "1"  # else the kernel warns of frozen modules


class ThisPython(NotebookClient):
    """Client whose kernel is this Python, whatever kernels are installed."""

    def create_kernel_manager(self) -> object:
        """Return the manager of a kernel that this Python runs."""
        manager = super().create_kernel_manager()
        spec = manager.kernel_spec
        spec.argv = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
        return manager


def executed(path: Path) -> nbformat.NotebookNode:
    """Return a notebook with the outputs of its cells; an error in a cell is raised."""
    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        ThisPython(
            notebook,
            timeout=PATIENCE,
            kernel_name="python3",
            resources={"metadata": {"path": folder}},
            record_timing=False,
        ).execute()
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    return notebook


if __name__ == "__main__":
    for path in sorted(HERE.glob("*.ipynb")):
        if sys.argv[1:] and path.stem not in sys.argv[1:]:
            continue
        began = time.perf_counter()
        nbformat.write(executed(path), path)
        seconds, size = time.perf_counter() - began, path.stat().st_size / 1000
        print(f"{path.name}: {seconds:.0f} s, {size:.0f} kB")
