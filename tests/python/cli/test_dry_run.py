"""``--dry-run`` tells what a command would take and writes nothing; long commands tell it first."""

from __future__ import annotations

import json
import shlex
from typing import TYPE_CHECKING

import pytest

from pendmap.cli.show import Forecast

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

KEYS = [
    "cells",
    "starts",
    "tiles",
    "seconds",
    "threads",
    "memory_bytes",
    "worker_memory_bytes",
    "disk_bytes",
    "sample_cells",
    "sample_seconds",
]
COMMANDS = {
    "basins --p 0.6 --grid 60": (3600, 3600),
    "map --p 0.2:0.4:6 --omega 2:2.2:5 --starts 4": (30, 120),
    "bifurcation --p 0.2:0.4:20": (20, 180),
    "sweep --p 0.4:0.6:5 --grid 20": (2000, 2000),
    "lifetime --p 1.7 --starts 2000": (2000, 2000),
}


@pytest.mark.parametrize("words", COMMANDS)
def test_a_dry_run_tells_the_cost_and_writes_nothing(
    pendmap_command: Run, tmp_path: Path, words: str
) -> None:
    run = pendmap_command(*shlex.split(words), "--dry-run")
    assert run.returncode == 0, run.stderr
    cells, starts = COMMANDS[words]
    first, time, memory, disk = run.stdout.splitlines()
    assert first.startswith(f"{cells} cells")
    assert starts == cells or f"{starts} starts" in first
    assert "thread" in time
    assert memory.startswith("Memory: about ")
    assert disk.startswith("Disk: about ")
    assert list(tmp_path.iterdir()) == []


def test_its_json_has_plain_names(pendmap_command: Run, tmp_path: Path) -> None:
    words = "basins --p 0.6 --grid 60 --threads 1 --out map.nc --dry-run --json"
    run = pendmap_command(*words.split())
    assert run.returncode == 0, run.stderr
    told = json.loads(run.stdout)
    assert list(told) == KEYS
    assert told["worker_memory_bytes"] is None
    assert (told["threads"], told["tiles"]) == (1, 1)
    assert told["sample_cells"] <= told["cells"]
    assert list(tmp_path.iterdir()) == []
    assert pendmap_command(*words.split()[:-2], "--quiet").returncode == 0
    assert 0.6 < told["disk_bytes"] / (tmp_path / "map.nc").stat().st_size < 1.6


def test_json_alone_needs_no_disk(pendmap_command: Run) -> None:
    run = pendmap_command(*["bifurcation", "--p", "0.2:0.4:3", "--dry-run", "--json"])
    assert json.loads(run.stdout)["disk_bytes"] == 0


@pytest.mark.parametrize("other", ["--resume", "--view"])
def test_it_is_refused_beside(pendmap_command: Run, tmp_path: Path, other: str) -> None:
    words = f"basins --grid 10 --out map.zarr --dry-run {other}"
    run = pendmap_command(*words.split())
    assert run.returncode == 2
    assert f"--dry-run must be given without {other}" in run.stderr
    assert len(run.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_dry_run_refuses_what_the_command_refuses(pendmap_command: Run) -> None:
    run = pendmap_command(*["basins", "--grid", "10", "--tol", "1", "--dry-run"])
    assert run.returncode == 2
    assert "--tol" in run.stderr


class Clock:
    """Time that passes when it is told to."""

    def __init__(self) -> None:
        self.now = 100.0
        self.said: list[str] = []
        self.forecast = Forecast(self.said.append, lambda: self.now)

    def after(self, seconds: float, done: int, total: int) -> None:
        """Report progress some seconds later."""
        self.now += seconds
        self.forecast.report(done, total)


def test_long_work_tells_its_time_once() -> None:
    clock = Clock()
    clock.after(0, 0, 1000)
    for done in range(10, 1000, 10):
        clock.after(2, done, 1000)
    assert clock.said == ["This takes about 3 minutes."]


def test_it_is_told_within_seconds_of_very_long_work() -> None:
    clock = Clock()
    clock.after(0, 0, 10**6)
    clock.after(5, 500, 10**6)
    assert clock.said == []
    clock.after(6, 1100, 10**6)
    assert clock.said == ["This takes about 3 hours."]


def test_work_of_less_than_a_minute_tells_nothing() -> None:
    clock = Clock()
    clock.after(0, 0, 100)
    for done in range(1, 101):
        clock.after(0.5, done, 100)
    assert clock.said == []


def test_the_pace_is_that_of_the_present_part() -> None:
    clock = Clock()
    clock.after(0, 0, 100)
    clock.after(1, 100, 100)
    clock.after(9, 0, 400)  # other work
    clock.after(4, 20, 400)
    assert clock.said == ["This takes about 90 seconds."]
