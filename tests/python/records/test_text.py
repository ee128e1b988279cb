"""Text of twenty kinds of loggers: separators, names, words, clocks, spellings; none is misread."""

from __future__ import annotations

import datetime as dt
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from recorded import clean, found, read

if TYPE_CHECKING:
    from pathlib import Path

TIME, THETA = clean(duration=12.0, rate=25.0)
BEGIN = dt.datetime(2025, 1, 31, 23, 59, 55)  # noqa: DTZ001 (loggers write no time zone)
STAMPS = [BEGIN + dt.timedelta(seconds=t) for t in TIME.tolist()]
NOON = [stamp - dt.timedelta(hours=11) for stamp in STAMPS]


def lines(form: str, *, comma: bool = False) -> list[str]:
    """Return a line for each sample: t in s, d a date before midnight, n one before 1 o'clock."""
    rows = zip(TIME.tolist(), THETA.tolist(), STAMPS, NOON, strict=True)
    made = [
        form.format(t=t, a=a, ms=1000 * t + 0.5, d=d, n=n, k=k, m=int(t // 60), us=round(1e9 * t))
        for k, (t, a, d, n) in enumerate(rows)
    ]
    return [line.replace(".", ",") for line in made] if comma else made


def row(sep: str, *more: str) -> list[str]:
    return lines(sep.join(["{t:.2f}", *more, "{a:.5f}"]))


# Lines of a file, and the names of time and angle that are found in it
FILES: dict[str, tuple[list[str], str]] = {
    "trailing tabs above alone": (["\tmass_A\t\t\t", "t\tr\tθ (rad)\t", *row("\t", "400")], "t θ (rad)"),
    "trailing tabs everywhere": (["t\tθ\t", *lines("{t:.2f}\t{a:.5f}\t")], "t θ"),
    "names by commas, rows by tabs": (["- 3 -", "Time,Drive,Angle", *lines("{t:.2f}\t1.5\t{a:.5f}", comma=True)], "Time Angle"),
    "names by blanks, with units": (["Time (s) Angle (rad)", *row("\t")], "Time (s) Angle (rad)"),
    "long names, short names, units": (["Run 1", "Time\tAngle", "T\tA", "s\trad", *row("\t")], "Time [s] Angle [rad]"),
    "a prefix": (['"Latest: Time (s)","Latest: Angle (rad)"', *row(",")], "Latest: Time (s) Latest: Angle (rad)"),
    "a suffix": (["Time (s) Run #1,Angle (rad) Run #1", *row(",")], "Time (s) Run #1 Angle (rad) Run #1"),
    "a line of runs": (["Run #1;", "Time (s);Angle (rad)", *row(";")], "Time (s) Angle (rad)"),
    "a comment": (["% by hand", "% t\ttheta", *row("\t")], "t theta"),
    "a line of settings": (["rate,25", "t,theta", *row(",")], "t theta"),
    "a name for an empty column": (["t\ttheta\tComment", *row("\t")], "t theta"),
    "no name for the first column": (['"t" "theta"', *lines('"{k}" {t:.2f} {a:.5f}')], "t theta"),
    "a state between": (["t,state,theta", *row(",", "HOLD")], "t theta"),
    "remarks with commas": (["t,theta", *[line + ", hit, ok" * (k % 9 == 5) for k, line in enumerate(row(","))]], "t theta"),
    "units in the cells": (["t,theta", *lines("{t:.2f} s,{a:.5f} rad")], "t [s] theta [rad]"),
    "labels in the cells": (lines("t={t:.2f},theta={a:.5f}"), "t theta"),
    "a true minus": (["t;theta", *[line.replace("-", "\u2212") for line in row(";")]], "t theta"),
    "thousands in quotes": (["t (ms),theta", *lines('"{ms:,.1f}",{a:.5f}')], "t (ms) theta"),
    "thousands by apostrophes": (["t (ms)\ttheta", *[line.replace(",", "'") for line in lines("{ms:,.1f}\t{a:.5f}")]], "t (ms) theta"),
    "a spectrum behind": (["t,theta", *row(","), "f,p", *[f"{k},{k * k}" for k in range(99)]], "t theta"),
    "settings beside": (["t,theta,,", f"0.00,{THETA[0]:.5f},,mass", *[line + ",," for line in row(",")][1:]], "t theta"),
    "times of day over midnight": (["Time\tAngle", *lines("{d:%H:%M:%S.%f}\t{a:.5f}")], "Time Angle"),
    "a clock of twelve hours": (["Time,Angle", *lines("{n:%I:%M:%S.%f} PM,{a:.5f}")], "Time Angle"),
    "one without am and pm": (["Time,Angle", *lines("{n:%I:%M:%S.%f},{a:.5f}")], "Time Angle"),
    "minutes and seconds": (["Time,Angle", *lines("{m}:{t:05.2f},{a:.5f}")], "Time Angle"),
    "hundredths behind the seconds": (["T Angle", *[f"0:00:{k // 25:02d}:{k % 25 * 4:02d} {a:.5f}" for k, a in enumerate(THETA)]], "T Angle"),
    "frames behind the seconds": (["T Angle", *[f"0:00:{k // 25:02d}:{k % 25:02d} {a:.5f}" for k, a in enumerate(THETA)]], "T Angle"),
    "commas of logging": (["Time,Angle", *[re.sub(r"\.(\d{3})\d+,", r",\1,", line) for line in lines("{d:%H:%M:%S.%f},{a:.5f}")]], "Time Angle"),
    "dates, day first": (["Datum;Winkel", *lines("{d:%d.%m.%Y %H:%M:%S.%f};{a:.5f}")], "Datum Winkel"),
    "dates, month first": (["Date,Angle", *lines("{d:%m/%d/%Y %I:%M:%S.%f %p},{a:.5f}")], "t_s Angle"),
    "dates with names of months": (["angle,when", *lines("{a:.5f},{d:%d %b %Y %H:%M:%S.%f}")], "t_s angle"),
    "dates without marks": (["Time;Angle", *lines("{d:%Y%m%d %H:%M:%S.%f};{a:.5f}")], "Time Angle"),
    "a time beside an empty one": (["t_s,time_ms,theta_rad", *lines(",{us},{a:.5f}")], "time_ms theta_rad"),
    "an arrow": (["", *lines("{d:%H:%M:%S.%f} -> {a:.5f}")], "column 1 column 2"),
    "brackets": (lines("[{d:%Y-%m-%d %H:%M:%S.%f}] theta: {a:.5f}"), "t_s theta"),
    "date and time apart": (["Date,Time,Angle", *lines("{d:%d/%m/%Y},{d:%H:%M:%S.%f},{a:.5f}")], "Time Angle"),
    "s since 1970": (["clock,theta", *[f"{1738928443 + float(x):.2f},{y}" for x, y in (z.split() for z in lines("{t:.2f} {a:.5f}"))]], "clock theta"),
    "ns since 1970": (["time (ns),theta", *[f"{1738928443 * 10**9 + int(x)},{y}" for x, y in (z.split() for z in lines("{us} {a:.5f}"))]], "time [s] theta"),
    "s and ns apart": (["stamp.sec,stamp.nanosec,position[0]", *[f"{1738928443 + x // 10**9},{x % 10**9},{y}" for x, y in ((int(z[0]), z[1]) for z in map(str.split, lines("{us} {a:.5f}")))]], "stamp.sec position[0]"),
}  # fmt: skip


@pytest.mark.parametrize("kind", FILES)
def test_a_text_table_is_read(tmp_path: Path, kind: str) -> None:
    content, names = FILES[kind]
    run = read(tmp_path, "\n".join(content) + "\n", "record.txt")
    assert " ".join((run.channels["time"], run.channels["angle"])) == names
    np.testing.assert_allclose(run.time - run.time[0], TIME, atol=1e-5)
    np.testing.assert_allclose(run.theta, THETA, atol=1e-5)
    assert ("tables-behind" in found(run)) == (kind == "a spectrum behind")


@pytest.mark.parametrize("lost", ["-999", "9999.0", "---", "NaN"])
def test_lost_readings_are_left_out(tmp_path: Path, lost: str) -> None:
    cells = [lost if k % 40 == 7 else f"{a:.5f}" for k, a in enumerate(THETA)]
    content = ["t,theta", *[f"{t:.2f},{cell}" for t, cell in zip(TIME, cells, strict=True)]]
    run = read(tmp_path, "\n".join(content) + "\n")
    there = np.arange(TIME.size) % 40 != 7
    np.testing.assert_allclose(run.theta, THETA[there], atol=1e-5)
    assert run.trusted.all()


@pytest.mark.parametrize(
    ("above", "rate"),
    [
        (["Sampling frequency: 40 Hz", "angle (deg)"], 40),
        (["zero, sample_rate, length", "0, 40, 5"], 40),
        (["Abtastintervall;25 ms", "Winkel"], 40),
        (["Capture Frame Rate\t0.04 kHz", "Total Frames\t300"], 40),
        (["Sample time: 12:30:05", "drive frequency: 3 Hz", "angle"], 100),
    ],
)
def test_a_rate_above_the_table_is_in_the_command(
    tmp_path: Path, above: list[str], rate: int
) -> None:
    with pytest.raises(pendmap.InputError, match=f"--rate {rate} --angle 1"):
        read(tmp_path, "\n".join([*above, *lines("{a:.5f}")]) + "\n")


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (["t_s,theta_rad", *lines("{t:.2f},abc")], "column 2 ('theta_rad') must be numbers, got 'abc' in line 2"),
        (["t_s,theta_rad", "no", "7 rows"], "no rows of numbers: line 3 is '7 rows'"),
        (lines("{k},{k:02d},0,{k:04d}"), "decimal commas need another delimiter"),
        (["time,theta_rad", *lines("00:00:{k:02d}:12,{a:.5f}")], "must be numbers, got '00:00:00:12'"),
        (["time,theta_rad", *lines("11:{k},{a:.5f}")[10:60]], "must be numbers, got '11:10'"),
    ],
)  # fmt: skip
def test_what_is_no_number_is_named(tmp_path: Path, content: list[str], says: str) -> None:
    with pytest.raises(pendmap.InputError, match=re.escape(says)):
        read(tmp_path, "\n".join(content) + "\n")
