"""The command ``pendmap``: parse, call, show. No mathematics."""

from pendmap.cli.main import run

__all__ = ["run"]
