"""Progress as a bar, and progress of work whose rounds are not known."""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys

import pytest

from pendmap.analysis.run import in_rounds

SHOWN = """
import time
import pendmap
with pendmap.ProgressBar("basins") as bar:
    for done in (0, 300, 1000, 2, 4):
        bar(done, 1000 if done > 4 or not done else 4)
        time.sleep(0.15)
    bar(0, 0)
"""


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="this system has no such terminals")
def test_a_narrow_terminal_shows_the_share_done_and_the_time_and_a_file_nothing() -> None:
    ours, theirs = os.openpty()
    narrow = os.environ | {"COLUMNS": "50"}
    subprocess.run([sys.executable, "-c", SHOWN], stderr=theirs, check=True, env=narrow)
    os.close(theirs)
    data = b""
    with contextlib.suppress(OSError):  # the end
        while part := os.read(ours, 1 << 16):
            data += part
    shares = [int(share) for share in re.findall(r"basins +(\d+) %\|", data.decode())]
    assert shares[0] == 0
    assert {30, 100} <= set(shares)
    assert "passed" in data.decode()
    assert max(map(len, data.decode().split("\r"))) <= 52
    run = subprocess.run([sys.executable, "-c", SHOWN], capture_output=True, text=True, check=True)
    assert run.stderr == ""


def test_progress_in_rounds_rises_with_each_and_never_falls() -> None:
    seen: list[float] = []
    report = in_rounds(lambda done, total: seen.append(done / total), 4)
    assert report is not None
    for total in (20, 13, 7, 7, 3):
        for done in range(total + 1):
            report(done, total)
    assert seen == sorted(seen)
    assert 0 <= seen[0] < seen[-1] < 1
    assert seen[-1] == pytest.approx(6 / 10)
