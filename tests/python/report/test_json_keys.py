"""The table of the keys of ``--json`` against what the four commands on records print."""

from __future__ import annotations

import dataclasses
import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np

import pendmap
from decays import decay
from fits import written
from pendmap import Effect, Rig
from pendmap.diagnosis.summary import as_json as diagnosed
from pendmap.formatting import json_text
from pendmap.identification.report import as_json as identified
from pendmap.model.effects import library
from pendmap.report.json_keys import KEYS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from conftest import Run

RIG = Rig(w0=6.2, c_over_m=0.3, Tr=0.08)
DRIVE = 'file = "../forced.csv", kind = "forced", drive = { p = 0.6, Omega = 12.0'
FORCED = f"{{ {DRIVE} }}, to_s = 50 }}, {{ {DRIVE}, phi = 0.4 }}, from_s = 50 }}"
FOLDERS = {
    "lab": "rig = { w0 = 6.2, inertia = 1 }\n"
    f'run = [{{ file = "../a.csv" }}, {{ file = "../rest.csv" }}, {FORCED}]',
    "unlike": 'run = [{ file = "../coarse.csv" }, { file = "../stiff.csv" }]',
    "peaks": 'columns.peaks = "peak_rad"\nrun = [{ file = "../peaks.csv" }]',
    "wrong": """columns.angle = { name = "theta_rad", unit = "V", scale = 1.4 }
        run = [{ file = "../drag.csv" }]""",
}
COMMANDS = """
look lab; look peaks; look gyro.csv; look jitter.csv; look unlike
identify lab; identify peaks; identify gyro.csv; identify unlike --method energy_balance
identify drag.csv --out a.nc; identify drag.csv --effect quadratic_drag --out drag.toml
compare m.toml lab --members 20 --spread 0.002; compare m.toml unlike
diagnose bias.csv --max-effects 1 --out b.nc; diagnose wrong --max-effects 0
diagnose drag.csv --max-effects 1 --without quadratic_drag
"""
EFFECT, SENSOR = f"({'|'.join(library())})", r"bias(\[\d+\])?"
NAMES = {"EFFECT": EFFECT, "SENSOR": SENSOR, "PARAMETER": r"[\w.]+(\[\d+\])?"}


def sampled(path: Path, release: float = 1.0, step: float = 0.04, **changes: Any) -> None:  # noqa: ANN401
    """Write a record of a changed rig in counts, with noise, a gap and a column of no channel."""
    rig = dataclasses.replace(RIG, **changes)
    time = np.delete(np.arange(1500 if rig.p else 250) * step, range(150, 160))
    theta = pendmap.simulate(rig, release, 0.0, t_eval=time).theta.values
    theta += np.random.default_rng(0).normal(0.0, 1e-3, time.size)
    written(path, time, 2e-3 * np.round(theta / 2e-3), time**2, names="theta_rad,bench")


def records(folder: Path) -> None:
    """Write records of all kinds, and a model."""
    for name, text in FOLDERS.items():
        (folder / name).mkdir()
        (folder / name / "experiment.toml").write_text(text, encoding="utf-8")
    (folder / "m.toml").write_text("[pendulum]\nw0 = 6.2\nc_over_m = 0.3\nTr = 0.08\n")
    sampled(folder / "a.csv")
    sampled(folder / "forced.csv", 0.9, p=0.6, Omega=12.0, phi=0.4)
    sampled(folder / "coarse.csv", step=0.15)
    sampled(folder / "stiff.csv", w0=6.8)
    sampled(folder / "drag.csv", 2.0, effects=(Effect("quadratic_drag", {"q": 0.1}),))
    sampled(folder / "bias.csv", effects=(Effect("bias_torque", {"torque": 0.5}),))
    time, motion = np.arange(0, 20, 0.01), decay()
    noise = np.random.default_rng(0).normal(0.0, 1e-3, time.size)
    written(folder / "rest.csv", time, noise)
    written(folder / "jitter.csv", time, motion.angle(time + noise) + 0.3 * noise[::-1])
    written(folder / "gyro.csv", time, motion.spline(time, 1) + 5 * noise, names="Gyro z (rad/s)")
    written(folder / "peaks.csv", motion.peak_time[:40], motion.peak[:40], names="peak_rad")


def paths(value: object, place: str = "") -> Iterator[str]:
    """Yield the path of each value, with a question mark where it is null or empty."""
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            yield from paths(inner, f"{place}.{key}")
    elif isinstance(value, list) and value:
        for inner in value:
            yield from paths(inner, f"{place}[]")
    else:
        yield place.removeprefix(".") + "?" * (value in (None, [], {}))


def pattern(keys: Iterable[str]) -> re.Pattern[str]:
    """Return the pattern of keys of the table."""
    text = "|".join(map(re.escape, keys))
    return re.compile(re.sub("[A-Z]{2,}", lambda m: NAMES.get(m[0], r"\w+"), text))


def test_the_table_has_the_keys_that_are_printed(tmp_path: Path, pendmap_command: Run) -> None:
    records(tmp_path)
    printed: dict[str, set[str]] = {command: set() for command in KEYS}
    for line in re.split("[;\n] *", COMMANDS.strip()):
        command, *words = line.split()
        run = pendmap_command(command, *words, "--json")
        assert run.stdout, run.stderr
        printed[command].update(paths(json.loads(run.stdout)))
    # What no small record leads to: a part that diverges, equally good fits, a shape that is tried.
    report, result = (pendmap.load(tmp_path / name) for name in ("a.nc", "b.nc"))
    table = dataclasses.replace(report.table, lost={"log_decrement": "it diverges"})
    report = dataclasses.replace(report, table=table)
    twin = dataclasses.replace(result.effects[0], elsewhere={"torque": -0.5})
    tried = dataclasses.replace(result.attempts[0], shape={"n": 2.0}, held_out_gain=1.0)
    changes: dict[str, Any] = {"effects": (twin,), "attempts": (tried,)}
    result = dataclasses.replace(result, reasons={"forecast": "it diverges"}, **changes)
    printed["identify"].update(paths(json.loads(json_text(identified(report)))))
    printed["diagnose"].update(paths(json.loads(json_text(diagnosed(result)))))

    for command, keys in printed.items():
        table = ", ".join(KEYS[command]).split(", ")
        empty = {f"{p[: m.start()]}?" for p in table for m in re.finditer(r"\.|\[\]|$", p)}
        known = pattern([*table, *empty])
        assert not [key for key in keys if not known.fullmatch(key)], command
        assert not [p for p in table if not any(map(pattern([p]).fullmatch, keys))], command
