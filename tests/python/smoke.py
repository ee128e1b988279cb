"""Run commands of the installed pendmap in an empty folder; needs nothing but pendmap."""

import contextlib
import json
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

import pendmap

COMMAND = shutil.which("pendmap", path=sysconfig.get_path("scripts"))


def run(*words: str) -> str:
    """Return what a command prints; end where it fails."""
    assert COMMAND is not None
    done = subprocess.run(
        [COMMAND, *words], capture_output=True, text=True, encoding="utf-8", check=False
    )
    if done.returncode:
        sys.exit(f"pendmap {' '.join(words)}: exit {done.returncode}: {done.stderr}")
    print(f"pendmap {' '.join(words)}: done")
    return done.stdout


with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
    assert run("--version").split() == ["pendmap", pendmap.__version__]
    facts = json.loads(run("info", "--json"))
    assert Path(pendmap.__file__).is_relative_to(sysconfig.get_path("platlib"))
    run("basins", "--p", "0.6", "--grid", "200")
    for simd in facts["simd_available"]:
        found = json.loads(run("basins", "--p", "0.6", "--grid", "200", "--simd", simd, "--json"))
        shares = {each["name"]: each["fraction"] for each in found["attractors"]}
        print(simd, {name: round(share, 4) for name, share in shares.items()})
        assert abs(max(shares.values()) - 0.83) < 0.01
    run("simulate", "--p", "1.7", "--until", "50")
    run("rig", "free_decay", "--out", "decay")
    run("identify", "decay", "--out", "rig.toml", "--plot", "identify.svg")
    run("basins", "--model", "rig.toml", "--grid", "20", "--out", "rig.nc")
    run("diagnose", "decay", "--max-effects", "0", "--report", "report.html")
    names = {"basins.nc", "basins.png", "simulate.nc", "simulate.png", "rig.toml", "identify.svg"}
    assert Path("report.html").exists()
    assert names <= {path.name for path in Path().iterdir()}
