"""What a command would take, from timed samples of it: time, memory and disk."""

from pendmap.cli.planning.cost import show_cost

__all__ = ["show_cost"]
