"""What a command would take, from timed samples of it: time, memory and disk."""

from pendmap.cli.planning.dry_run import Cost, cost, show_cost
from pendmap.cli.planning.request import Request
from pendmap.cli.planning.sweep import Places

__all__ = ["Cost", "Places", "Request", "cost", "show_cost"]
