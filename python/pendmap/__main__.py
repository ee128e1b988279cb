"""``python -m pendmap`` is the command ``pendmap``."""

from pendmap.cli import run

if __name__ == "__main__":
    run()
