"""Randomly drawn bad input: options, models, formulas, experiments, tables, results, system faults.

Each function of ``KINDS`` draws one :class:`Case` from a generator of random numbers.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click
import netCDF4
import numpy as np
import pandas as pd

from pendmap.cli.main import command

if TYPE_CHECKING:
    import random
    from collections.abc import Callable

__all__ = ["KINDS", "SEEDS", "Case"]


@dataclasses.dataclass
class Case:
    """A command and its input files.

    ``files`` maps names to contents: bytes, or ``"pipe"``, ``"endless"`` and ``"folder"``. The size
    of a file is limited to ``most`` bytes; the signal ``stop`` is sent after ``after`` seconds.
    """

    words: list[str]
    files: dict[str, bytes | str] = dataclasses.field(default_factory=dict)
    most: int | None = None
    stop: str | None = None
    after: float = 0.0


SEEDS: Final[dict[str, bytes]] = {}
"""Results by name, written by pendmap at the request of :mod:`fuzz`."""

NUMBERS: Final = (
    *("nan", "inf", "-inf", "0", "-0", "-1", "1e-320", "1e-12", "0.1", "1", "3.7", "1e3", "1e16"),
    *("1e300", "-1e308", "1e309", "9007199254740993", "pi/0", "1e400pi", "0x10", "1_000", "1,5"),
    *("", " ", "--1", "\u0661\u0662", "9" * 5000, "1\n2", "None", "\u00bd"),
)
WHOLES: Final = (
    *("0", "-1", "1", "2", "3", "1.0", "1e3", str(2**31), str(2**63), "1" + "0" * 4400, "nan", ""),
)
AXES: Final = (
    *("1:2:3", "-pi:pi:8", "0:0:3", "3:1:4", "nan:1:3", "0:inf:3", "0:1:0", "0:1:-3", "0:1:1"),
    *("0:1", ":::", "", "-1e308:1e308:4", "0:1e-320:4", "1:1.0000000000000002:5", "-1e18:1e18:5"),
)
PLACES: Final = (
    *("", "a", "../x", "/", "/dev/full", "/proc/self/mem", "nowhere/x.nc", "x.nc"),
    *("x" * 300 + ".nc", "\u202e.nc", "\x1b[31m.nc", "a\nb.nc", "-x.nc", ".nc", "x.png", "x.pdf"),
    *("x.rrd", "x.toml", "x.html", "kept.zarr", "kept", "in.nc", "run.csv", "pipe.csv", "pipe.nc"),
)
SMALL: Final = {
    "basins": ["--grid=8"],
    "bifurcation": ["--p=0.5:1:4"],
    "compare": ["rig.toml", "run.csv"],
    "diagnose": ["run.csv", "--max-effects=0"],
    "effects": [],
    "identify": ["run.csv", "--method=logarithmic"],
    "info": [],
    "lifetime": ["--starts=100", "--max-periods=50"],
    "look": ["run.csv"],
    "lyapunov": ["--precision=0.1", "--max-periods=50"],
    "map": ["--p=0.5:1:3", "--omega=1.8:2:2"],
    "melnikov": [],
    "orbit": ["--grid=12"],
    "paper": ["3"],
    "plot": ["in.nc"],
    "rig": ["free_decay", "--duration=3"],
    "simulate": ["--until=10"],
    "tongues": ["--omega=1.8:2.2:4"],
    "view": ["x.rrd"],
}
"""Options by command that keep its computation small."""

MODEL: Final = b"""[pendulum]
w0 = 6.2
c_over_m = 0.05
Tr = 0.08
stroke_mm = 20
frequency_hz = 1.9
[[effect]]
name = "quadratic_drag"
parameters = { q = 0.01 }
[[formula]]
name = "root_drag"
term = "-k*sqrt(abs(v))*sign(v)"
parameters = { k = { power = 1.5, typical = [1e-4, 0.3] } }
"""
EXPERIMENT: Final = b"""[rig]
gravity = 9.81
encoder_counts = 4096
[columns]
time = { name = "t_s", unit = "s" }
angle = { name = "theta_rad", unit = "rad", scale = 1.0, zero = 0.0 }
[reader]
delimiter = ","
skip_rows = 0
[[run]]
file = "run.csv"
from_s = 0.0
to_s = 9.0
[[run]]
file = "run.csv"
kind = "forced"
drive = { p = 0.2, Omega = 12.1, phi = 0.1 }
"""
VALUES: Final = (
    *("nan", "inf", "0", "-1", "1e308", "-1e-320", "true", "[]", "{}", "''", '"x"', "1979-05-27"),
    *("[1, 2]", "99999999999999999999", '"\\u001b[31m"', '"../../../etc/passwd"', "07:32:00"),
    *("[" * 60 + "]" * 60, '"' + "y" * 3000 + '"', "9" * 5000),
)
TERMS: Final = (
    *("", "(" * 1000, "(" * 100 + "k*v" + ")" * 100, "-" * 900 + "k*v", "k*v" + "^2" * 300),
    *("k*v/0", "k*v/theta", "k*log(0)", "k*exp(exp(exp(theta)))", "k*v\0", "k*1e308*v*1e308"),
    *("k*cos(1/theta)", "min(" * 60 + "k*v" + ",v)" * 60, "k*tanh(v/1e-300)", "k*sign(v)/v"),
    *("k", "v", "k*v;import os"),
)


def _decay(rows: int = 1000) -> tuple[Any, Any]:
    time = np.arange(rows) * 0.01
    return time, 2 * np.exp(-0.05 * time) * np.cos(6 * time)


@functools.cache
def _record() -> bytes:
    rows = zip(*_decay(), strict=True)
    lines = [f"{t:.4f},{x + 1e-3 * math.sin(977 * t):.6f}" for t, x in rows]
    return "\n".join(["t_s,theta_rad", *lines, ""]).encode()


def _files() -> dict[str, bytes | str]:
    return {
        "run.csv": _record(),
        "rig.toml": MODEL,
        "in.nc": SEEDS["basins.nc"],
        "pipe.csv": "pipe",
        "pipe.nc": "endless",
        "kept.zarr/thesis.tex": b"mine",
        "kept/thesis.tex": b"mine",
    }


def mangled(rng: random.Random, data: bytes) -> bytes:
    """Return bytes of which some are changed, lost, doubled or cut off."""
    out = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 5, 30])):
        at, count = rng.randrange(len(out) + 1), rng.choice([1, 1, 2, 8, 100])
        new = [
            rng.randbytes(count),
            b"",
            out[at : at + count] * rng.choice([2, 20]),
            rng.choice([b"\0", b"\xff\xfe", b"nan", b"1e400", b"\r", b'"', b"[", b"=", b"\x1b[2J"]),
        ]
        out[at : at + count] = rng.choice(new)
        if rng.random() < 0.1:
            del out[at:]
    return bytes(out)


def _toml(rng: random.Random, text: bytes) -> bytes:
    """Return TOML with values replaced, lines lost or doubled; sometimes bytes are changed."""
    if rng.random() < 0.25:
        return mangled(rng, text)
    lines = text.decode().splitlines()
    for _ in range(rng.choice([1, 1, 2, 3])):
        at = rng.randrange(len(lines))
        parts = re.split(r"(=\s*)([^=,{}\[\]\s][^=,{}\[\]]*)", lines[at])
        if len(parts) > 1 and rng.random() < 0.75:
            parts[rng.choice(range(2, len(parts), 3))] = rng.choice(VALUES)
            lines[at] = "".join(parts)
        else:
            lines[at : at + 1] = lines[at : at + 1] * rng.choice([0, 2])
            lines = lines or [""]
    return "\n".join(lines).encode()


def options(rng: random.Random) -> Case:
    """Draw options of a command with values of all kinds."""
    name = rng.choice(sorted(SMALL))
    loaded = command.get_command(click.Context(command), name)
    assert loaded is not None
    words = [name, *SMALL[name]]
    if len(words) > 1 and not words[1].startswith("-") and rng.random() < 0.3:
        words[1] = rng.choice(PLACES)
    given = [p for p in loaded.params if isinstance(p, click.Option) and p.name != "live"]
    for option in rng.sample(given, min(len(given), rng.choice([1, 1, 2, 3]))):
        flag, kind = option.opts[0], option.type.name
        pools = {"number": NUMBERS, "A:B:N": AXES, "number|A:B:N": AXES + NUMBERS}
        pool = WHOLES if kind.startswith("integer") else pools.get(kind, PLACES)
        if option.is_flag:
            words.append(flag)
        elif option.nargs == 2:
            words += [flag, rng.choice(["p", "x", "", "quadratic_drag.q"]), rng.choice(AXES)]
        else:
            words.append(f"{flag}={rng.choice(pool)}")
    return Case(words, _files())


def model(rng: random.Random) -> Case:
    """Draw an invalid model file."""
    words = rng.choice(
        [
            ["simulate", "--until=3"],
            ["basins", "--grid=6", "--max-periods=50"],
            ["tongues", "--omega=1.9:2:2"],
            ["orbit", "--grid=8"],
        ]
    )
    return Case([*words, "--model=m.toml", "--json"], {"m.toml": _toml(rng, MODEL)})


def formula(rng: random.Random) -> Case:
    """Draw a formula."""
    term = rng.choice(TERMS) if rng.random() < 0.4 else "k*" + _term(rng, 0)
    parameters = rng.choice(
        ["{ k = 1 }", "{ k = 0 }", "{ k = { power = 1, typical = [nan, 1] } }", "{}", "{ sin = 1 }"]
    )
    name = rng.choice(["mine", "mine", "quadratic_drag", "", "a b", "x" * 10000, "<b>"])
    text = f"[[formula]]\nname = {json.dumps(name)}\nterm = {json.dumps(term)}\n"
    text += f"parameters = {parameters}\n[[effect]]\nname = {json.dumps(name)}\n"
    text += f"parameters = {{ k = {rng.choice(NUMBERS[:18])} }}\n[pendulum]\ngamma = 0.1\n"
    words = rng.choice([["simulate", "--until=5"], ["basins", "--grid=6", "--max-periods=50"]])
    return Case([*words, "--model=m.toml", "--json"], {"m.toml": text.encode()})


def _term(rng: random.Random, depth: int) -> str:
    if depth > 4 or rng.random() < 0.25:
        return rng.choice(["k", "v", "theta", "phase", "t", "w0", "pi", "0", "2", "1e308", "x"])
    inner = functools.partial(_term, rng, depth + 1)
    if rng.random() < 0.6:
        return f"({inner()}{rng.choice('+-*/^')}{inner()})"
    if rng.random() < 0.8:
        return (
            f"{rng.choice(['sqrt', 'exp', 'log', 'sin', 'tanh', 'abs', 'sign', 'wrap'])}({inner()})"
        )
    return f"{rng.choice(['min', 'max', 'eval'])}({inner()},{inner()})"


def experiment(rng: random.Random) -> Case:
    """Draw the description of an experiment."""
    words = rng.choice([["look", "lab", "--json"], ["look", "lab", "--plot=x.png"]])
    return Case(words, {"lab/experiment.toml": _toml(rng, EXPERIMENT), "lab/run.csv": _record()})


def table(rng: random.Random) -> Case:
    """Draw a record: text or Parquet, with columns of all kinds, then with bytes changed."""
    time, angle = _decay()
    scale = rng.choice([1.0, 1.0, 1e-12, 1e3, 1e9, 1e15, -1.0])
    columns: dict[str, Any] = {"t_s": scale * time, "theta_rad": angle}
    columns |= rng.choice(
        [
            {},
            {"theta_rad": rng.choice([1e-9, 57.3, 1e9, 1e300]) * angle},
            {"theta_rad": np.full(1000, rng.choice([0, math.nan, math.inf, 3.14]))},
            {"theta_rad": np.array([rng.gauss(0, 1) for _ in time])},
            {"theta_rad": [None, *angle[1:]]},
            {"theta_rad": [str(x) for x in angle]},
            {"theta_rad": angle > 0},
            {"theta_rad": [[x] for x in angle]},
            {"t_s": time[::-1]},
            {"t_s": np.round(time, 1)},
            {"t_s": time + 1.7e9},
            {"t_s": pd.to_datetime(time * 1e9)},
            {"t_s": [b"\xff"] * 1000},
            {rng.choice(["", "\x1b[31m", "x" * 50000, "=1+1"]): angle},
            {f"c{k}": angle[:1].repeat(1000) for k in range(rng.choice([5, 300, 1500]))},
        ]
    )
    frame = pd.DataFrame(columns).iloc[: rng.choice([1, 2, 5, 20, 1000, 1000, 1000])]
    name = rng.choice(["run.csv", "run.csv", "run.parquet", "run"])
    if name == "run.parquet":
        try:
            data = frame.to_parquet()
        except Exception:  # noqa: BLE001 (a table that cannot be written is drawn as random bytes)
            data = rng.randbytes(5000)
    else:
        text = frame.to_csv(index=False, sep=rng.choice(",,,;\t "), header=rng.random() < 0.8)
        data = text.encode(rng.choice(["utf-8", "utf-8", "utf-16", "utf-32", "cp037"]), "replace")
    if rng.random() < 0.4:
        data = mangled(rng, data)
    words = rng.choice(
        [
            ["look", name, "--json"],
            ["look", name, "--quiet", "--plot=x.png"],
            ["identify", name, "--json", "--method=logarithmic"],
            ["identify", name, "--json", "--method=energy"],
        ]
    )
    return Case(words, {name: data})


def result(rng: random.Random) -> Case:
    """Draw a damaged result to plot: bytes changed, or impossible attributes and numbers."""
    name = rng.choice(sorted(SEEDS))
    data = SEEDS[name]
    if rng.random() < 0.3:
        data = mangled(rng, data)
    else:
        place = Path("drawn.nc")
        place.write_bytes(data)
        with netCDF4.Dataset(place, "a") as content:
            for _ in range(rng.choice([1, 1, 2, 4])):
                _spoil(rng, content)
        data = place.read_bytes()
        place.unlink()
    layers = [[], [], ["--layer=settle"], ["--layer=theta"], ["--layer=exponent"], ["--layer="]]
    size = rng.choice(["11x9", "11x9", "4x3", "nanxnan", "100x1"])
    words = ["plot", "r.nc", f"--out=p{rng.choice(['.png', '.png', '.svg'])}", "--dpi=30"]
    return Case([*words, f"--size={size}", *rng.choice(layers)], {"r.nc": data})


def _spoil(rng: random.Random, content: netCDF4.Dataset) -> None:
    """Change an attribute or a variable of an open file."""
    if rng.random() < 0.5:
        key = rng.choice(content.ncattrs())
        if rng.random() < 0.3:
            content.delncattr(key)
        else:
            new = [math.nan, "x", "", -1, [1.0, 2.0], 1e308, "{", "[]", "null", "\x1b[31m", 2**40]
            content.setncattr(key, rng.choice(new))
        return
    key = rng.choice(sorted(content.variables))
    variable = content.variables[key]
    if variable.dtype is str:
        if variable.ndim:
            variable[:] = np.full(variable.shape, rng.choice(["", "x", "y" * 400]), object)
    elif rng.random() < 0.2 and "other" not in content.variables:
        content.renameVariable(key, "other")
    elif variable.dtype.kind == "f":
        variable[...] = rng.choice([math.nan, math.inf, 1e308, -1.0, 0.0, 1e-320])
    elif variable.dtype.kind in "iu":
        variable[...] = rng.choice([99, 0, 120, -1])


def fault(rng: random.Random) -> Case:
    """Draw a full disk, or a signal, while a command runs and writes."""
    name = rng.choice(["basins", "simulate", "map", "melnikov", "rig", "identify", "bifurcation"])
    words = [name, *SMALL[name], *(["--out=lab"] if name == "rig" else [])]
    if name in ("basins", "simulate") and rng.random() < 0.5:
        words.append("--out=m.zarr")
    if rng.random() < 0.5:
        return Case(words, _files(), most=int(2 ** rng.uniform(8, 19)))
    stop = rng.choice(["SIGTERM", "SIGINT", "SIGHUP"])
    return Case(words, _files(), stop=stop, after=rng.uniform(0, 1.5))


KINDS: Final[dict[str, Callable[[random.Random], Case]]] = {
    each.__name__: each for each in (options, model, formula, experiment, table, result, fault)
}
