"""What the benchmarks share: the methods that are compared, and how they are measured.

Each method is a class with ``label``, ``setting`` and ``advance``; see `peers.common.Method`.
"""
