"""The methods that benchmarks compare, and their measurement.

Each method is a class with ``label``, ``setting`` and ``advance``; see `peers.common.Method`.
"""

from __future__ import annotations

import sys

# numba imports the package coverage if it exists, and would find the benchmark of that name.
sys.modules.setdefault("coverage", None)  # type: ignore[arg-type]
