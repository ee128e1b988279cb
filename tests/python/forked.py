"""Call every public function, then each of them again in a forked child."""

from __future__ import annotations

import importlib
import inspect
import os
import signal
import sys
import tempfile
import traceback
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import decays
import pendmap
from pendmap import comparison, diagnosis, identification, render, viewer

if TYPE_CHECKING:
    from collections.abc import Callable


ROOMS = ("pendmap", "pendmap.comparison", "pendmap.identification", "pendmap.diagnosis")
PATIENCE = 60
"""Seconds after which a child is assumed to be blocked."""

EXPERIMENT = """
[[run]]
file = "r.csv"
kind = "free"
[[run]]
file = "r.csv"
kind = "forced"
drive = { p = 0.001, Omega = 3.0, phi = 0.0 }
"""


FORMULA = """
[[formula]]
name = "root_drag"
term = "-k*sqrt(abs(v))*sign(v)"
parameters = { k = { power = 1.5 } }
"""


def public() -> set[str]:
    """Return the names of all public functions defined in pendmap."""
    found: set[str] = set()
    for room in ROOMS:
        module = importlib.import_module(room)
        found |= {n for n in module.__all__ if inspect.isfunction(getattr(module, n))}
    return found


def jobs(folder: Path) -> dict[str, Callable[[], object]]:
    """Return a cheap call of each public function, and of each kind of output."""
    time, theta = decays.record(decays.decay(until=12.0), seconds=8.0, rate=25.0)
    rows = "\n".join(f"{t:.6f},{x:.6f}" for t, x in zip(time, theta, strict=True))
    (folder / "r.csv").write_text(f"t_s,theta_rad\n{rows}\n", encoding="utf-8")
    (folder / "experiment.toml").write_text(EXPERIMENT, encoding="utf-8")
    (folder / "formula.toml").write_text(FORMULA, encoding="utf-8")
    free = pendmap.read_experiment(folder / "r.csv")
    both = pendmap.read_experiment(folder)
    report = identification.identify(free)
    model = identification.identified_model(report)
    found = diagnosis.diagnose(free, max_effects=0)
    methods = identification.identify(time, theta).methods
    pendulum = pendmap.Pendulum(p=0.6)
    small = pendmap.Grid.square(12)
    basins = pendmap.basins(pendulum, small)
    pendmap.save(basins, folder / "given.nc")
    pendmap.save_model(model, folder / "given.toml")
    starts = np.linspace(-1.0, 1.0, 5)
    plane = {"p": (0.5, 1.0, 2), "gamma": (0.1, 0.2, 2)}
    halves = np.where(np.arange(200) < 97, 1, 2)[:, None].repeat(200, axis=1)
    few = comparison.Ensemble(members=20)

    return {
        "advance": lambda: pendmap.advance(pendulum, starts, starts, 3),
        "basin_entropy": lambda: pendmap.basin_entropy(basins.label),
        "basins": lambda: pendmap.basins(pendulum, small),
        "basins_of": lambda: pendmap.basins_of(pendulum, starts, starts),
        "bifurcation": lambda: pendmap.bifurcation(pendulum, {"p": (0.6, 0.8, 3)}),
        "compare": lambda: comparison.compare(model, both, ensemble=few),
        "diagnose": lambda: diagnosis.diagnose(free, max_effects=1),
        "diagnosed_model": lambda: diagnosis.diagnosed_model(found),
        "effects": pendmap.effects,
        "find_peaks": lambda: identification.find_peaks(time, theta),
        "identified_model": lambda: identification.identified_model(report),
        "identify": lambda: identification.identify(time, theta),
        "lifetime": lambda: pendmap.lifetime(pendmap.Pendulum(p=1.2), starts=100),
        "load": lambda: pendmap.load(folder / "given.nc"),
        "load_formulas": lambda: pendmap.load_formulas(folder / "formula.toml"),
        "load_model": lambda: pendmap.load_model(folder / "given.toml"),
        "lyapunov": lambda: pendmap.lyapunov(pendmap.Pendulum(p=2.0), 1.0, 0.0, precision=0.1),
        "melnikov": lambda: pendmap.melnikov(pendulum, [1.0]),
        "sweep": lambda: pendmap.sweep(pendulum, {"p": (0.6, 0.8, 3)}, grid=small),
        "noise_floor": lambda: pendmap.noise_floor(free.runs[0]),
        "orbit": lambda: pendmap.orbit(pendulum, 1, 1, small),
        "parameter_map": lambda: pendmap.parameter_map(pendulum, plane),
        "read_experiment": lambda: pendmap.read_experiment(folder),
        "save": lambda: pendmap.save(basins, folder / "again.nc"),
        "save_model": lambda: pendmap.save_model(model, folder / "again.toml"),
        "simulate": lambda: pendmap.simulate(pendulum, 1.0, 0.0, 20.0, lyapunov=True),
        "table1": lambda: identification.table1(identification.find_peaks(time, theta), methods),
        "tongues": lambda: pendmap.tongues(pendulum, [1.0, 2.0]),
        "uncertainty_exponent": lambda: pendmap.uncertainty_exponent(halves),
        "draw": lambda: render.draw(basins, folder / "basins.png"),
        "view": lambda: pendmap.view(basins, folder / "view.rrd"),
        "pendulum_of": lambda: pendmap.pendulum_of(basins),
        "record": lambda: viewer.record(basins, folder / "basins.rrd"),
        "save zarr": lambda: pendmap.save(basins, folder / "again.zarr"),
    }


def in_child(job: Callable[[], object]) -> str:
    """Call a job in a forked child; return a description of its failure, or ``None``."""
    child = os.fork()
    if child == 0:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(PATIENCE)
        try:
            job()
        except BaseException:  # noqa: BLE001 (the child ends here on any exception)
            traceback.print_exc()
            os._exit(1)
        os._exit(0)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return {0: "", -signal.SIGALRM: "waits for ever"}.get(code, f"ends with {code}")


def main() -> int:
    """Print the failures of calls in a child; return their number."""
    with tempfile.TemporaryDirectory() as folder:
        all_jobs = jobs(Path(folder))
        wrong = dict.fromkeys(public() - set(all_jobs), "is not tried")
        for job in all_jobs.values():
            job()
        wrong |= {name: said for name, job in all_jobs.items() if (said := in_child(job))}
    for name, said in wrong.items():
        sys.stdout.write(f"{name} {said}\n")
    return len(wrong)


if __name__ == "__main__":
    sys.exit(main())
