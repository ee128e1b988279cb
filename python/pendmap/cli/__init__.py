"""The command ``pendmap``: it parses arguments, calls the library and shows results."""

import sys

__all__ = ["run"]


def run() -> None:
    """Run the command line and exit: 0 done, 1 not all of it, 2 bad input, 130 interrupted."""
    try:
        from pendmap.cli.main import run as begin

        begin()
    except KeyboardInterrupt:
        sys.stderr.write("pendmap: interrupted, nothing was written\n")
        sys.exit(130)
