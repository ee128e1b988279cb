"""Kinds of damage to a record, each made from a clean one."""

from __future__ import annotations

import dataclasses
import functools
import gzip
import io
import math
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from recorded import COUNT, clean, text

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@functools.cache
def sound() -> str:
    return text(clean(duration=10.0))


def one_line(message: str) -> None:
    """Assert that a message is one readable line."""
    assert message
    assert "\n" not in message
    assert len(message) < 400
    assert "Traceback" not in message
    for nonsense in ("None", "nan", "array(", "dtype"):
        assert nonsense not in message, message


@dataclasses.dataclass(frozen=True)
class Damage:
    """A kind of damage: how it is made, and its expected findings or refusal."""

    make: Callable[[str], str | bytes]
    says: tuple[str, ...] | None = ()
    refused: str = ""
    suffix: str = ".csv"


def arrays(change: Callable[[Floats, Floats], tuple[Floats, Floats]]) -> Callable[[str], str]:
    def make(sound: str) -> str:
        time, theta = np.loadtxt(io.StringIO(sound), delimiter=",", skiprows=1).T
        return text(change(time.copy(), theta.copy()), form="%.10g")

    return make


def lines(change: Callable[[list[str]], list[str]]) -> Callable[[str], str]:
    return lambda sound: "\n".join(change(sound.splitlines())) + "\n"


def at(values: Floats, places: object, new: object) -> Floats:
    values[places] = new  # type: ignore[index]
    return values


def every(row: str, k: int) -> Callable[[str], str]:
    return lines(
        lambda rows: [
            part
            for n, line in enumerate(rows)
            for part in ([line, row] if n and n % k == 0 else [line])
        ]
    )


def parquet(change: Callable[[pd.DataFrame], pd.DataFrame]) -> Callable[[str], bytes]:
    def make(sound: str) -> bytes:
        buffer = io.BytesIO()
        change(pd.read_csv(io.StringIO(sound))).to_parquet(buffer)
        return buffer.getvalue()

    return make


def bad(make: Callable[[str], str | bytes], refused: str, suffix: str = ".csv") -> Damage:
    """Return a damage whose record is refused with this message."""
    return Damage(make, None, refused, suffix)


def said(make: Callable[[str], str | bytes], *keys: str, suffix: str = ".csv") -> Damage:
    """Return a damage whose record is read, with these findings."""
    return Damage(make, keys, suffix=suffix)


def _again(a: Floats) -> tuple[Floats, Floats]:
    """Append a second release: a hand carries the pendulum back in 1 s, and holds it 0.3 s."""
    carried = a[-1] + (a[0] - a[-1]) * (1 - np.cos(np.pi * np.arange(100) / 100)) / 2
    theta = np.r_[a, carried, np.full(30, a[0]), a[:600]]
    return np.arange(theta.size) / 100, theta


def _lossy(t: Floats, a: Floats, share: float) -> tuple[Floats, Floats]:
    kept = np.random.default_rng(3).random(t.size) > share
    return t[kept], a[kept]


def _swapped(t: Floats) -> Floats:
    t[[300, 301]] = t[[301, 300]]
    return t


RNG = np.random.default_rng(7)
MISSING = ("-", "NaN", "nan", "", "null", "N/A", "inf", "-inf", "#N/A")

TEXTS = {
    "empty": bad(lambda _: "", "is empty"),
    "nul bytes alone": bad(lambda _: b"\0" * 500, "is empty"),
    "only a header": bad(lambda s: s.splitlines()[0] + "\n", "no rows of numbers"),
    "one row": bad(lambda s: "\n".join(s.splitlines()[:2]), "must have 5 samples or more with time and angle, got 1 sample"),
    "one column": bad(lambda s: "\n".join(r.split(",")[0] for r in s.splitlines()), "no column of angles"),
    "random bytes": bad(lambda _: RNG.bytes(5000), ""),
    "a workbook": bad(lambda _: b"PK\x03\x04" + RNG.bytes(3000), "Excel"),
    "an old workbook": bad(lambda _: b"\xd0\xcf\x11\xe0" + RNG.bytes(3000), "Excel"),
    "compressed": bad(lambda s: gzip.compress(s.encode()), "compressed"),
    "hdf5": bad(lambda _: b"\x89HDF\r\n\x1a\n" + RNG.bytes(300), "HDF5"),
    "matlab": bad(lambda _: b"MATLAB 5.0 MAT-file" + bytes(300), "MATLAB"),
    "json": bad(lambda _: '{"t_s": [0, 1, 2],\n "theta_rad": [1, 2, 3]}\n', "no rows"),
    "no times": bad(lambda s: s.replace("t_s,theta_rad", "omega,theta"), "no column of times"),
    "no angle": bad(lambda s: s.replace("theta_rad", "height (m)"), "no column of angles"),
    "volts": bad(lambda s: s.replace("theta_rad", "volts"), "scale"),
    "furlongs": bad(lambda s: s.replace("theta_rad", "theta (furlongs)"), "furlongs"),
    "acceleration alone": bad(lambda s: s.replace("theta_rad", "acc_x (m/s2)"), "acceleration"),
    "decimal commas between commas": bad(
        lambda s: s.splitlines()[0] + "\n" + s.split("\n", 1)[1].replace(".", ","), "delimiter"
    ),
    "half a line": said(lambda s: s[:-9], "angle-missing"),
    "half a line without the angle": said(lambda s: s + "10.01", "unreadable-lines"),
    "nul bytes at the end": said(lambda s: s.encode() + b"\0" * 60, "nul-bytes"),
    "nul bytes inside": said(lambda s: s.encode().replace(b"\n", b"\0\n", 50), "nul-bytes"),
    "noise lines at the start": said(lambda s: "boot v1.2\n~~\xff?\nok\n" + s),
    "a message between rows": said(every("WARNING: buffer 80 % full", 100), "unreadable-lines"),
    "a column too many in places": said(every("1.0,2.0,3.0", 300), "unreadable-lines"),
    "a trailing comma": said(lambda s: s.replace("\n", ",\n")),
    "windows lines": said(lambda s: s.replace("\n", "\r\n")),
    "old mac lines": said(lambda s: s.replace("\n", "\r")),
    "a mark before the text": said(lambda s: b"\xef\xbb\xbf" + s.encode()),
    "utf-16": said(lambda s: s.encode("utf-16")),
    "utf-16 without a mark": said(lambda s: s.encode("utf-16-le")),
    "latin-1": said(lambda s: s.replace("theta_rad", "Winkel [°]").encode("latin-1")),
    "empty lines": said(lambda s: s.replace("\n", "\n\n")),
    "blanks around": said(lambda s: s.replace(",", "  ,  ").replace("\n", "  \n")),
    "tabs": said(lambda s: s.replace(",", "\t")),
    "blanks between": said(lambda s: s.replace(",", "   ")),
    "decimal commas": said(lambda s: s.replace(",", ";").replace(".", ",")),
    "quoted decimal commas": said(
        lambda s: '"' + s.strip().replace(",", '","').replace("\n", '"\n"').replace(".", ",") + '"\n'
    ),
    "no header": said(lambda s: s.split("\n", 1)[1], "columns-guessed"),
    "comments": said(lambda s: "# pendulum 3\n# 2024-05-01\n" + s),
    "a line of units": said(lambda s: s.replace("t_s,theta_rad", "t,theta\ns,rad"), "columns-guessed"),
    **{
        f"missing as {word or 'nothing'}": said(
            lines(lambda r, w=word: [x if k % 97 else x.split(",")[0] + "," + w for k, x in enumerate(r, 1)]),
            "angle-missing",
        )
        for word in MISSING
    },
    "parquet with dates": said(
        parquet(lambda f: f.assign(t_s=pd.Timestamp(2024, 5, 1) + pd.to_timedelta(f.t_s, "s"))),
        suffix=".parquet",
    ),
    "parquet with words": bad(
        parquet(lambda f: f.assign(theta_rad="x")), "no column of angles", ".parquet"
    ),
    "parquet with lists": bad(parquet(lambda f: f.assign(theta_rad=[[x] for x in f.theta_rad])), "", ".parquet"),
    "parquet with switches": said(parquet(lambda f: f.assign(theta_rad=f.theta_rad > 0)), "no-motion", suffix=".parquet"),
    "parquet without rows": bad(parquet(lambda f: f.iloc[:0]), "is empty", ".parquet"),
    "parquet cut": bad(lambda s: parquet(lambda f: f)(s)[:900], "Parquet", ".parquet"),
    "csv called parquet": bad(lambda s: s, "Parquet", ".parquet"),
}  # fmt: skip

TIMES = {
    "times not there": bad(arrays(lambda t, a: (t * np.nan, a)), "no row with a time"),
    "times all equal": bad(arrays(lambda t, a: (t * 0, a)), "do not increase"),
    "some times missing": said(arrays(lambda t, a: (at(t, slice(50, 60), np.nan), a)), "time-missing"),
    "times backwards": said(arrays(lambda t, a: (t[::-1], a[::-1])), "time-backwards"),
    "two rows exchanged": said(arrays(lambda t, a: (_swapped(t), a)), "time-backwards"),
    "rows shuffled": bad(arrays(lambda t, a: (RNG.permutation(t), a)), "out of order"),
    "rows in another order": said(arrays(lambda t, a: tuple(RNG.permutation(np.c_[t, a]).T)), "time-backwards"),
    "one false stamp": said(arrays(lambda t, a: (at(t, 400, 1e9), a)), "time-backwards"),
    "one stamp of zero": said(arrays(lambda t, a: (at(t, 400, 0.0), a)), "time-backwards"),
    "stamps twice": said(arrays(lambda t, a: (np.repeat(t, 2), np.repeat(a, 2))), "time-duplicate"),
    "a coarse clock": said(arrays(lambda t, a: (np.floor(t / 0.03) * 0.03, a)), "time-coarse"),
    "jitter": said(arrays(lambda t, a: (t + RNG.normal(0, 1e-3, t.size), a)), "time-coarse"),
    "a gap": said(arrays(lambda t, a: (np.delete(t, slice(300, 350)), np.delete(a, slice(300, 350)))), "time-gap"),
    "uneven": said(arrays(lambda t, a: _lossy(t, a, 0.4)), "time-uneven"),
    "milliseconds": said(arrays(lambda t, a: (t * 1e3, a)), "time-unit"),
    "a clock that starts again": said(arrays(lambda t, a: (np.where(t < 4, t, t - 4), a)), "time-restarts"),
    "a counter of 16 bits": said(arrays(lambda t, a: ((t + 60) % 65.536, a)), "time-restarts"),
    "sampled slowly": said(arrays(lambda t, a: (t[::15], a[::15])), "sampling-slow"),
    "time twice": bad(lambda s: "t_s,theta_rad\n" + "\n".join(r.split(",")[0] + "," + r.split(",")[0] + "e9" for r in s.splitlines()[1:]), ""),
}  # fmt: skip

ANGLES = {
    "no angles": bad(arrays(lambda t, a: (t, a * np.nan)), "the angle must be numbers, no row has a number for it"),
    "an angle that never changes": bad(arrays(lambda t, a: (t, a * 0 + 0.3)), "never changes"),
    "noise alone": said(arrays(lambda t, a: (t, RNG.normal(0, 1e-3, t.size))), "no-motion"),
    "huge": bad(arrays(lambda t, a: (t, a * 1e200)), "samples"),
    "one huge": said(arrays(lambda t, a: (t, at(a, 500, 1e300))), "angle-missing"),
    "one outlier": said(arrays(lambda t, a: (t, at(a, 500, 3.0))), "outliers"),
    "two outliers together": said(arrays(lambda t, a: (t, at(a, [500, 501], [3.0, -2.0]))), "outliers"),
    "zeros for lost samples": said(arrays(lambda t, a: (t, at(a, [62, 131, 340, 541], 0.0))), "outliers"),
    "missed counts": said(arrays(lambda t, a: (t, a + 40 * COUNT * (t > 4))), "missed-counts"),
    "a zero that jumps": said(arrays(lambda t, a: (t, a + 0.1234 * (t > 4))), "missed-counts"),
    "degrees": said(arrays(lambda t, a: (t, np.degrees(a))), "angle-unit"),
    "turned by 90 degrees": said(arrays(lambda t, a: (t, a + math.pi / 2)), "gauge-turned"),
    "turned by 180 degrees": said(arrays(lambda t, a: (t, a + math.pi)), "gauge-turned"),
    "zero far off": said(arrays(lambda t, a: (t, a + 0.5)), "zero-offset"),
    "wrapped": said(arrays(lambda t, a: (t, np.mod(a, 2 * math.pi))), "angle-wrapped"),
    "clipped": said(arrays(lambda t, a: (t, np.clip(a, -0.7, 0.7))), "clipped"),
    "frozen": said(arrays(lambda t, a: (t, at(a, slice(425, 440), a[425]))), "frozen"),
    "coarse counts": said(arrays(lambda t, a: (t, np.round(a / 0.049) * 0.049)), "counts-seen"),
    "held at the start": said(arrays(lambda t, a: (np.arange(t.size + 200) / 100, np.r_[np.full(200, a[0]), a])), "held-start"),
    "two files in one": said(arrays(lambda t, a: (np.arange(2 * t.size) / 100, np.r_[a, a])), "missed-counts"),
    "taken and let go again": said(arrays(lambda t, a: _again(a)), "several-releases"),
    "scaled": said(arrays(lambda t, a: (t, 1.8 * a)), "angle-scale"),
}  # fmt: skip

DAMAGES = TEXTS | TIMES | ANGLES

RUN = '[[run]]\nfile = "run.csv"\n'
DESCRIPTIONS = {
    "not toml": ("[rig\n", "not a TOML file"),
    "no runs": ("[rig]\nw0 = 6\n", r"\[\[run\]\]"),
    "one table run": ('[run]\nfile = "run.csv"\n', r"\[\[run\]\]"),
    "run without file": ("[[run]]\nkind = 'free'\n", "file must be given"),
    "file that is not there": ('[[run]]\nfile = "other.csv"\n', "other.csv"),
    "folder for a file": ('[[run]]\nfile = "."\n', "is a folder"),
    "unknown table": (RUN + "[rigs]\nw0 = 6\n", "perhaps rig is meant"),
    "unknown rig key": (RUN + "[rig]\nlenght_m = 0.2\n", "perhaps length_m is meant"),
    "unknown run key": (RUN + "lab_time = 3\n", "perhaps lab_time_s is meant"),
    "drive in millimetres": (RUN + "drive = { stroke_mm = 20, Omega = 3 }\n", r"p = Y Omega\^2/g"),
    "drive in hertz": (RUN + "drive = { p = 0.1, frequency_hz = 3 }\n", "Omega = 2 pi f"),
    "edge that is none": (RUN + '[columns]\ntrigger = { edge = "up" }\n', '"rising" or "falling"'),
    "edge of an angle": (RUN + '[columns]\nangle = { edge = "rising" }\n', "edge is not known"),
    "kind": (RUN + "kind = 'driven'\n", "must be"),
    "free and driven": (RUN + "kind = 'free'\ndrive = { p = 1, Omega = 3 }\n", "kind must be"),
    "drive without Omega": (RUN + "drive = { p = 0.2 }\n", "Omega must be given"),
    "drive backwards": (RUN + "drive = { p = 0.2, Omega = -3 }\n", "Omega must be 1e-12"),
    "drive and pivot": (RUN + "drive = { p = 1, Omega = 3 }\npivot = { vertical = 'a' }\n", "one of drive and pivot must"),
    "pivot of no column": (RUN + "pivot = { unit = 'm' }\n", "must name a column"),
    "pivot's unit": (RUN + "pivot = { vertical = 'a', unit = 'inch' }\n", "unit must be .*, got 'inch'"),
    "pivot's column": (RUN + "pivot = { vertical = 'theta_rd' }\n", "perhaps 'theta_rad' is meant"),
    "text for a number": (RUN + "[rig]\nw0 = 'six'\n", "must be a number"),
    "negative gravity": (RUN + "[rig]\ngravity = -9.81\n", "gravity must be 1e-12"),
    "counts with a part": (RUN + "[rig]\nencoder_counts = 4096.5\n", "whole number"),
    "part that is turned": (RUN + "from_s = 5\nto_s = 2\n", "less than to_s"),
    "part outside": (RUN + "from_s = 500\n", "within 0 to 10 s"),
    "hold out": (RUN + "hold_out = 1\n", "True or False"),
    "delimiter of two": (RUN + "[reader]\ndelimiter = ';;'\n", "one character"),
    "delimiter that numbers need": (RUN + "[reader]\ndelimiter = '.'\n", "numbers"),
    "decimal": (RUN + "[reader]\ndecimal = ';'\n", "must be"),
    "skip all": (RUN + "[reader]\nskip_rows = 100000\n", "is empty"),
    "scale of zero": (RUN + "[columns]\nangle = { scale = 0 }\n", "any number but 0"),
    "unit nobody knows": (RUN + "[columns]\nangle = { unit = 'cubit' }\n", "'cubit'"),
    "volts without scale": (RUN + "[columns]\nangle = { unit = 'V' }\n", "scale"),
    "column that is not there": (RUN + "[columns]\nangle = { name = 'thta_rad' }\n", "perhaps"),
    "one column twice": (RUN + "[columns]\nangle = { name = 't_s' }\n", "both are"),
    "infinite": (RUN + "lab_time_s = inf\n", "finite"),
}  # fmt: skip
