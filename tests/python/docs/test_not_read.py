"""The page "Your file is not read": each of its files is read by its command."""

from __future__ import annotations

import datetime as dt
import json
import math
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest

import pendmap
from containers import THETA as SWING
from containers import TIME as INSIDE
from containers import archive, matlab, open_document, tracker, workbook
from recorded import W0, found, motion, words

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from conftest import Run as Command
    from recorded import Floats

PAGE = Path(__file__).resolve().parents[3] / "docs" / "records" / "not_read.md"
TEXT = PAGE.read_text("utf-8")
FINE = motion(start=0.9, rate=500.0)[:2]
SMALL = motion(start=0.1, rate=500.0)[:2]
TIME, THETA = (column[::20] for column in FINE)
OTHER = 0.3 * np.sin(9.1 * TIME)
X, Y = 0.4 * np.sin(THETA), -0.4 * np.cos(THETA)
VOLTS = 0.3 + 1.25 * THETA
DEGREES = np.degrees(THETA)
CLOCK = dt.datetime(2026, 3, 13, 23, 59, 52)  # noqa: DTZ001 (a laboratory's clock has no zone)


def rows(form: str, *columns: Iterable[Any]) -> str:
    """Return one line a reading."""
    return "".join(f"{form.format(*row)}\n" for row in zip(*columns, strict=True))


def stamped(form: str, angles: str = "{:.2f}") -> str:
    """Return lines of a time of day or a date, and an angle in degrees."""
    times = [CLOCK + dt.timedelta(milliseconds=round(1e3 * t)) for t in TIME]
    return rows("{}" + angles, [f"{t:{form}}".replace("000|", "") for t in times], DEGREES)


def steady(before: float, after: float) -> tuple[Floats, Floats]:
    """Return a motion driven at constant amplitude, released, and braked by hand."""
    theta = motion(start=0.9, rate=50.0)[1]
    lead, tail = np.arange(-before, 0, 0.02), np.arange(0.02, after, 0.02)
    drive = 0.9 * np.cos(W0 * (1 - 0.9**2 / 16) * lead)
    whole = np.concatenate([drive, theta, theta[-1] * np.exp(-9 * tail)])
    return 0.02 * np.arange(whole.size), whole


def frames() -> tuple[Floats, Floats]:
    """Return 30 frames a second of which two are lost, as numbered without them."""
    time, theta, _ = motion(start=0.9, rate=30.0)
    seen = np.delete(theta, [200, 411])
    return time[: seen.size], seen


def bad(theta: Floats) -> Floats:
    """Return readings of which one is wrong."""
    return theta + np.where(np.arange(theta.size) == 250, 0.25, 0.0)


DRIVEN, CAUGHT = steady(6.0, 0.0), steady(5.6, 3.0)
TAKEN = FINE[0][::10], FINE[1][::10].copy()
TAKEN[1][800:] = 0.4 + (TAKEN[1][800] - 0.4) * np.exp(-8 * (TAKEN[0][800:] - TAKEN[0][800]))
TICK = np.floor((np.arange(1000) * 0.02 + 0.0037) / 0.015625) * 0.015625


class Kind(NamedTuple):
    """A kind of file: what pendmap reads from it, with which keywords and with which finding."""

    name: str
    content: str
    options: dict[str, Any] = {}  # noqa: RUF012 (no kind changes it)
    finding: str = ""
    right: tuple[Floats, Floats] | None = FINE
    close: float = 2e-3


KINDS = [
    Kind(
        "separators.csv",
        "Time,Drive,Pendulum\n" + rows("{:.3f}\t{:.3f}\t{:.4f}", TIME, OTHER, THETA),
        finding="motor-column",
    ),
    Kind(
        "tracker.txt",
        "mass A\t\t\t\nt\tx\ty\t\n" + rows("{:.3f}\t{:.4f}\t{:.4f}\t", TIME, X, Y),
        finding="angle-from-pixels",
    ),
    Kind(
        "tracker_angle.txt",
        "mass A\t\t\nt\tθ\tr\n" + rows("{:.3f}\t{:.2f}\t0.4001", TIME, DEGREES),
        finding="angle-unit",
    ),
    Kind(
        "kinovea.txt",
        "#Kinovea Trajectory data export\n#T X Y\n"
        + rows(
            "0:00:{:02.0f}:{:02.0f} {:.2f} {:.2f}",
            *np.divmod(np.round(100 * TIME), 100),
            100 * X,
            100 * Y,
        ),
        finding="angle-from-pixels",
    ),
    Kind(
        "space.csv",
        "Frame,Time,Bob X,Bob Y,Bob Z\n"
        + rows("{},{:.3f},0.0500,{:.4f},{:.4f}", range(TIME.size), TIME, X, Y),
        finding="angle-from-pixels",
    ),
    Kind(
        "logger_pro.csv",
        '"Latest: Time (s)","Latest: Angle (°)"\n' + rows("{:.2f},{:.2f}", TIME, DEGREES),
    ),
    Kind(
        "logger_pro.txt",
        "Vernier Format 2\nUntitled.cmbl 3/14/2026 10:21:03\nRun 1\nTime\tAngle\nt\tθ\ns\trad\n\n"
        + rows("{:.2f}\t{:.4f}", TIME, THETA),
    ),
    Kind(
        "capstone.csv",
        '"Time (s) Run #1","Angle (rad) Run #1"\n' + rows("{:.4f},{:.4f}", TIME, THETA),
    ),
    Kind(
        "data_studio.txt",
        "Angular Position, Ch 1&2\nRun #2\nTime ( s )\tAngle ( rad )\n"
        + rows("{:.4f}\t{:.4f}", TIME, THETA),
    ),
    Kind(
        "oscilloscope.csv",
        "x-axis,1\nsecond,Volt\n" + rows("{:+.5E},{:+.5E}", TIME, VOLTS),
        {"angle_scale": 0.8},
        "zero-offset",
        close=0.01,  # the middle of a decay; a fit finds the rest
    ),
    Kind(
        "comments.txt",
        "# rig 12, long rod\n# time[s] angle[deg]\n" + rows("{:.3f} {:.2f}", TIME, DEGREES),
    ),
    Kind(
        "states.csv",
        "time_ms,state,angle_deg,remark\n"
        + rows("{:.0f},FREE,{:.2f},ok", 1e3 * TIME, DEGREES).replace("FREE", "ARMED", 8),
        finding="columns-unused",
    ),
    Kind(
        "decimal_commas.txt",
        "Zeit [s]\tWinkel [Grad]\n" + rows("{:.3f}\t{:.2f}", TIME, DEGREES).replace(".", ","),
    ),
    Kind(
        "minus.csv",
        "Time (s),Angle (°)\n" + rows("{:.2f},{:.2f}", TIME, DEGREES).replace("-", "\u2212"),
    ),
    Kind(
        "thousands.csv",
        '"Time (ms)","Angle (mrad)"\n' + rows('"{:,.0f}","{:,.1f}"', 1e3 * TIME + 1e3, 1e3 * THETA),
    ),
    Kind(
        "polish.csv",
        "Czas [s];Kąt [°]\n" + rows("{:.3f};{:.2f}", TIME, DEGREES).replace(".", ","),
    ),
    Kind("chinese.csv", "时间（秒）,角度（度）\n" + rows("{:.3f},{:.2f}", TIME, DEGREES)),
    Kind(
        "encoder.csv",
        "t_ms,counts\n" + rows("{:.0f},{:.0f}", 1e3 * TIME, THETA * 2400 / math.tau),
        {"counts_per_turn": 2400},
    ),
    Kind(
        "encoder_bare.csv",
        "t_ms,enc\n" + rows("{:.0f},{:.0f}", 1e3 * TIME, THETA * 2400 / math.tau),
        {"angle_unit": "counts", "counts_per_turn": 2400},
    ),
    Kind("midnight.csv", "Time,Angle (deg)\n" + stamped("%H:%M:%S.%f|,")),
    Kind("twelve_hours.csv", "Time;Angle (deg)\n" + stamped("%I:%M:%S.%f| %p;")),
    Kind(
        "german_date.csv",
        "Datum;Uhrzeit;Winkel [°]\n"
        + re.sub(r"\.(\d\d)$", r",\1", stamped("%d.%m.%Y;%H:%M:%S,%f|;"), flags=re.MULTILINE),
    ),
    Kind("american_date.csv", "Timestamp,Angle (deg)\n" + stamped("%m/%d/%Y %I:%M:%S.%f| %p,")),
    Kind("epoch.csv", "timestamp,angle\n" + rows("{:.0f},{:.4f}", 1e3 * TIME + 1.7735e12, THETA)),
    Kind("empty_time.csv", "time,t_ms,angle\n" + rows("NaN,{:.0f},{:.4f}", 1e3 * TIME, THETA)),
    Kind("no_clock.csv", "angle_deg\n" + rows("{:.2f}", DEGREES), {"rate_hz": 25, "angle": 1}),
    Kind(
        "ticks.csv",
        "t_s,theta_rad\n" + rows("{:.6f},{:.4f}", TICK, FINE[1][:-1:10]),
        finding="time-coarse",
        close=5e-2,
    ),
    Kind(
        "circle.txt",
        rows("{:.3f} {:.4f} {:.4f}", TIME, 1.2 + X, 0.7 + Y),
        finding="angle-from-pixels",
    ),
    Kind(
        "x_alone.csv",
        "t (s),x (m)\n" + rows("{:.2f},{:.5f}", SMALL[0][::20], 0.4 * np.sin(SMALL[1][::20])),
        {"angle": 2, "angle_scale": 2.5},
        right=SMALL,
    ),
    Kind("cosine.csv", "t,cos\n" + rows("{:.2f},{:.4f}", TIME, np.cos(THETA)), right=None),
    Kind(
        "names.txt",
        "a,b,c\n" + rows("{:.3f},{:.3f},{:.2f}", TIME, OTHER, DEGREES),
        {"time": 1, "angle": 3, "angle_unit": "deg"},
    ),
    Kind(
        "driven.csv",
        "t_s,theta_rad\n" + rows("{:.2f},{:.4f}", *DRIVEN),
        finding="driven-start",
        right=DRIVEN,
    ),
    Kind(
        "taken.csv",
        "t_s,theta_rad\n" + rows("{:.2f},{:.4f}", *TAKEN),
        finding="handled-end",
        right=TAKEN,
    ),
    Kind(
        "caught.csv",
        "t_s,theta_rad\n" + rows("{:.2f},{:.4f}", *CAUGHT),
        {"from_s": 5.6, "to_s": 25},
        "cut",
        right=CAUGHT,
    ),
    Kind(
        "bad_reading.csv",
        "t_s,theta_rad\n" + rows("{:.2f},{:.4f}", TIME, bad(THETA)),
        finding="outliers",
    ),
    Kind(
        "lost.csv",
        "t_s,theta_rad\n"
        + re.sub(r"(?m)(?<=4,).*$", "-999", rows("{:.2f},{:.4f}", TIME, THETA), count=9),
        finding="angle-missing",
    ),
    Kind(
        "frames.csv",
        "t_s,theta_rad\n" + rows("{:.4f},{:.4f}", *frames()),
        finding="time-slips",
    ),
]


TIMES_ARE_RIGHT = "t_s,theta_rad\n0.0"  # heading of files whose first lines show no fault


def head(content: str, lines: int) -> str:
    """Return the first lines of a file, with spaces for tabs."""
    return "\n".join(line.expandtabs(8).rstrip() for line in content.split("\n")[:lines])


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_file_of_the_page_is_read_by_its_command(
    pendmap_command: Command, tmp_path: Path, kind: Kind
) -> None:
    path = tmp_path / kind.name
    path.write_text(kind.content, encoding="utf-8")
    command = shlex.join(["pendmap", "look", kind.name, *words(kind.options)])
    assert f"`{command}`" in TEXT
    shown = [f"```text\n{head(kind.content, lines)}\n```" for lines in range(3, 7)]
    assert kind.content.startswith(TIMES_ARE_RIGHT) or any(block in TEXT for block in shown)
    plain = pendmap_command("look", kind.name)
    if plain.returncode:
        assert kind.options or kind.right is None
        assert plain.stderr.strip() in TEXT
    if kind.right is None:
        assert plain.returncode == 2
        return
    look = pendmap_command(*shlex.split(command)[1:], "--json")
    assert look.returncode == 0, look.stderr
    (run,) = pendmap.read_experiment(path, **kind.options)
    assert json.loads(look.stdout)["channels"] == dict(run.channels)
    if kind.finding:
        assert f"`{kind.finding}`" in TEXT
        assert kind.finding in found(run)
    begin = 0.0 if kind.right is CAUGHT else run.time[0]
    expected = np.interp(run.time - begin, *kind.right)[run.trusted]
    np.testing.assert_allclose(run.theta[run.trusted], expected, atol=kind.close)
    assert run.trusted.mean() > 0.7


def mat(folder: Path) -> Path:
    """Return a file of MATLAB."""
    return matlab(folder, t=INSIDE, theta=SWING)


@pytest.mark.parametrize("write", [archive, workbook, open_document, mat, tracker])
def test_a_container_of_the_page_is_read_by_its_command(
    pendmap_command: Command, tmp_path: Path, write: Callable[[Path], Path]
) -> None:
    name = write(tmp_path).name
    assert f"`pendmap look {name}`" in TEXT
    look = pendmap_command("look", name, "--json")
    assert look.returncode == 0, look.stderr
    assert json.loads(look.stdout)["runs"][0]["samples"] == INSIDE.size


def test_the_page_has_no_other_file() -> None:
    names = set(re.findall(r"pendmap look (\w+\.\w+)", TEXT))
    assert {kind.name for kind in KINDS} <= names
    assert names <= {kind.name for kind in KINDS} | {
        f"run.{end}" for end in ("zip", "xlsx", "ods", "mat", "trk")
    }
