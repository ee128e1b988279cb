"""Write the JSON of 92 commands to a folder, to compare two versions of pendmap bit by bit.

Run it once with each version, then compare: ``diff -r before after``.

    python benchmarks/same_json.py before

The commands cover each analysis, each effect of the library, each kind of record and the diagnosis.
Computing times are replaced by 0, so that equal versions give equal bytes.
"""

from __future__ import annotations

import argparse
import json
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

SIZES = {
    "amplitude": 0.05,
    "n": 2.0,
    "psi": 0.3,
    "tau": 30.0,
    "th0": 0.4,
    "t0": 10.0,
    "J": 0.2,
    "vs": 0.2,
    "vc": 0.7,
    "zc": 0.01,
    "w": 0.2,
    "ws": 1.3,
    "wx": 4.0,
    "z": 0.05,
    "width": 0.3,
    "phase": 0.2,
}
"""Sizes of the parameters of effects; 0.01 for all others."""

TIMES = re.compile(r'(?<="seconds": )[-+.e\d]+|\b[.\d]+(?= s on \d+ thread)')
"""The computing time as a key and in a sentence."""

RIGS = """
decay: rig free_decay --seed 3 --out decay
forced: rig forced --seed 4 --duration 30 --out forced
none: rig hidden --seed 5 --effect none --free 3 --forced 2 --duration 40 --out none
drag: rig hidden --seed 6 --effect quadratic_drag --free 3 --forced 2 --duration 40 --out drag
magnet: rig hidden --seed 7 --effect magnet --free 3 --forced 2 --duration 40 --out magnet
"""

COMMANDS = """
info: effects --json
simulate: simulate --until 40 --json
simulate_preset: simulate --preset fig2b --theta-r 0.02 --until 60 --lyapunov --json
simulate_units: simulate --stroke-mm 20 --frequency-hz 1.9 --model si.toml --until 9 --json
basins: basins --p 1.7 --grid 60 --json
basins_friction: basins --p 0.6 --theta-r 0.05 --grid 50 --json
basins_long: basins --p 1.7 --gamma 0.05 --grid 30 --layer-periods 6 --max-periods 300 --json
basins_draws: basins --model drawn.toml --grid 24 --draws 8 --json
basins_preset: basins --preset fig2c --grid 40 --seed 3 --json
map: map --vary p 0.3:2:12 --vary omega 1.5:2.5:10 --starts 4 --json
map_friction: map --vary theta_r 0:0.2:8 --vary p 0.3:2:8 --starts 4 --json
map_draws: map --model drawn.toml --vary p 0.3:2:6 --vary omega 1.5:2.5:6 --draws 4 --json
map_curves: map --vary omega 1:3:8 --vary p 0.2:2:8 --curves --json
bifurcation: bifurcation --vary p 0.5:2:40 --json
bifurcation_omega: bifurcation --p 1.2 --vary omega 1.6:2.2:24 --theta-r 0.01 --json
orbit: orbit --p 1.7 --n 1 --w 1 --grid 40 --json
orbit_2: orbit --p 0.6 --n 2 --grid 40 --json
orbit_friction: orbit --p 0.6 --theta-r 0.02 --n 2 --grid 30 --json
lyapunov: lyapunov --p 1.7 --json
lyapunov_chaos: lyapunov --p 2.0 --gamma 0.1 --theta 0.4 --json
lyapunov_friction: lyapunov --p 0.6 --theta-r 0.05 --json
lifetime: lifetime --p 1.7 --starts 400 --json
lifetime_friction: lifetime --p 1.9 --theta-r 0.01 --starts 300 --max-periods 400 --json
lifetime_draws: lifetime --model drawn.toml --p 1.8 --starts 100 --draws 4 --json
tongues: tongues --json
tongues_window: tongues --gamma 0.05 --omega 0.5:3:40 --json
melnikov: melnikov --p 1.7 --json
melnikov_effects: melnikov --model si.toml --json
look_decay: look decay --json
look_forced: look forced --json
look_none: look none --json
identify_decay: identify decay --json
identify_runs: identify magnet --json
identify_none: identify none --json
identify_effect: identify drag --effect quadratic_drag --json
identify_method: identify none --method trajectory --method combined --json
compare: compare none.toml none --json
compare_forced: compare none.toml forced --members 20 --json
diagnose_none: diagnose none --json
diagnose_drag: diagnose drag --json
diagnose_magnet: diagnose magnet --max-effects 2 --json
paper: paper table1 --out figures --json
paper_3: paper 3 --out figures --json
paper_7: paper 7 --out figures --json
rig_list: rig --list --json
friction_refused: tongues --theta-r 0.03 --json
"""

SI = """format_version = 1
[pendulum]
w0 = 6.2
c_over_m = 0.05
Tr = 0.08
stroke_mm = 20
frequency_hz = 1.9
[[effect]]
name = "quadratic_drag"
parameters = { q = 0.012 }
"""

DRAWN = """format_version = 1
[pendulum]
w0 = 6.2
c_over_m = 0.6
Tr = 0.3
stroke_mm = 60
frequency_hz = 1.97
[covariance]
names = ["c_over_m", "Tr"]
matrix = [[1e-4, 0.0], [0.0, 1e-4]]
"""


def pendmap(folder: Path, words: str) -> subprocess.CompletedProcess[str]:
    """Run the command installed with this Python."""
    command = [str(Path(sys.executable).with_name("pendmap")), *shlex.split(words)]
    return subprocess.run(command, capture_output=True, check=False, text=True, cwd=folder)  # noqa: S603 (own words)


def effect_commands(folder: Path) -> list[str]:
    """Write one model per library effect; return a trajectory and a map of each."""
    lines = []
    for effect in json.loads(pendmap(folder, "effects --json").stdout)["effects"]:
        name = effect["name"]
        sizes = {p["name"]: SIZES.get(p["name"], 0.01) for p in effect["parameters"]}
        values = ", ".join(f"{key} = {value}" for key, value in sizes.items())
        gamma = 0.0 if name == "viscous_damping" else 0.1
        text = f"format_version = 1\n[pendulum]\ngamma = {gamma}\np = 1.2\nomega = 2.0\n"
        text += f'[[effect]]\nname = "{name}"\nparameters = {{ {values} }}\n'
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
        lines.append(f"effect_{name}: simulate --model {name}.toml --until 30 --json")
    return lines


def run(folder: Path, out: Path, line: str) -> str:
    """Run one command of the list and save its output."""
    name, _, words = line.partition(": ")
    answer = pendmap(folder, words)
    printed = TIMES.sub("0", answer.stdout)
    body = printed or f"exit {answer.returncode}\n{answer.stderr}"
    (out / f"{name}.json").write_text(body, encoding="utf-8")
    return f"{name}: exit {answer.returncode}, {len(answer.stdout)} characters"


def main() -> None:
    """Run all commands and write into one folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="Folder for the JSON, made if it is not there.")
    out = parser.parse_args().out
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(2) as pool:
        folder = Path(name)
        (folder / "si.toml").write_text(SI, encoding="utf-8")
        (folder / "drawn.toml").write_text(DRAWN, encoding="utf-8")
        prepared = [line for line in RIGS.split("\n") if line]
        for line in prepared:
            print(run(folder, out, line + " --json"))
        for words in ("identify none --out none.toml", "basins --grid 30 --out basins.nc"):
            pendmap(folder, words).check_returncode()
        lines = [line for line in COMMANDS.split("\n") if line] + effect_commands(folder)
        for said in pool.map(lambda line: run(folder, out, line), lines):
            print(said)
    print(len(prepared) + len(lines), "commands", file=sys.stderr)


if __name__ == "__main__":
    main()
