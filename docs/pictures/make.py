"""Make the pictures of the README and the pages: ``python docs/pictures/make.py``."""

from __future__ import annotations

import math
import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp

from pendmap import (
    Pendulum,
    Rig,
    basins,
    bifurcation,
    continuation,
    parameter_map,
    read_experiment,
    render,
    simulate,
    virtual_rig,
)
from pendmap.charts import comparison
from pendmap.charts import identification as charts
from pendmap.diagnosis import diagnose
from pendmap.paper import figures as paper_figures
from pendmap.paper import motions as paper_motions
from pendmap.render import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HERE = Path(__file__).resolve().parent
DOCS = HERE.parent
SIZE = (6.4, 6.0)
# Stick and slip under drive, then rest: a start of tests/truths.json.
STICKING = Pendulum(gamma=0.1, p=1.5, omega=0.87, theta_r=0.2)
START, UNTIL = (-0.43, 1.03), 60.0
WIDTHS = {0.1: ("#D55E00", "--"), 0.01: ("#009E73", "-.")}


def smoothed(width: float, times: np.ndarray) -> tuple[np.ndarray, int]:
    """Angles where friction is theta_r tanh(v / width), and the evaluations that it took."""
    q = STICKING

    def rhs(tau: float, state: np.ndarray) -> list[float]:
        theta, velocity = state
        pull = (1.0 + q.p * math.cos(q.omega * tau)) * math.sin(theta)
        rubbing = q.theta_r * math.tanh(velocity / width)
        return [velocity, -q.gamma * velocity - pull - rubbing]

    run = solve_ivp(rhs, (0.0, UNTIL), START, "LSODA", times, rtol=1e-9, atol=1e-12)
    return run.y[0], run.nfev


def friction() -> None:
    """Exact stick and slip against smoothed friction."""
    run = simulate(STICKING, *START, UNTIL, tol=1e-12, samples=400)
    tau, theta = run["time"].values, run["theta"].values
    with mpl.rc_context(style.RC):
        figure, axis = plt.subplots(figsize=(7.2, 3.6), layout="constrained")
        kinds, times = run["event_kind"].values, run["event_time"].values
        begin = None
        for kind, time in zip(kinds, times, strict=True):
            if kind in {"stick", "stuck for ever"}:
                begin = time if begin is None else begin
            elif kind == "release" and begin is not None:
                axis.axvspan(begin, time, color="0.88", lw=0)
                begin = None
        axis.axvspan(begin, UNTIL, color="0.88", lw=0, label="stuck")
        axis.plot(tau, theta, color="#0072B2", lw=2, label="exact (pendmap)")
        for width, (color, dashes) in WIDTHS.items():
            angles, _ = smoothed(width, tau)
            label = f"tanh(v / {width:g})"
            axis.plot(tau, angles, color=color, ls=dashes, lw=1.4, label=label)
        axis.set_xlabel("time \N{GREEK SMALL LETTER TAU}")
        axis.set_ylabel("angle \N{GREEK SMALL LETTER THETA} (rad)")
        axis.set_xlim(0, UNTIL)
        axis.legend(loc="upper right", ncols=2, frameon=True, framealpha=1.0)
        figure.savefig(HERE / "friction.png", dpi=110)


def record() -> None:
    """What `pendmap look` finds in a record that went wrong in several ways."""
    rig = Rig.of(w0=6.2, c_over_m=0.05, Tr=0.06)
    run = simulate(rig, 2.4, 0.0, 30.0, samples=1024)
    rng = np.random.default_rng(1)
    time = np.arange(3200) / 100
    swing = np.interp(time[:2950], run["time"].values, run["theta"].values)
    theta = np.concatenate([np.full(250, 2.4), swing])
    theta += rng.normal(0, 0.002, theta.size)
    theta[rng.choice(np.arange(300, 3200), 8)] += 0.7
    kept = np.r_[0:1700, 1760:3200]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run_00.csv"
        columns = np.column_stack([time + rng.normal(0, 4e-4, time.size), theta])[kept]
        np.savetxt(path, columns, "%.6f", ",", header="t_s,theta_rad", comments="")
        render.draw(read_experiment(path), HERE / "record.png", dpi=100)


def identification() -> None:
    """The decay by each model, and what each misses, on a virtual rig like the paper's."""
    sheet = charts.whole(
        paper_figures.report(),
        parts=("decay",),
        title="The decay by each model",
        subtitle="virtual rig like the paper's, encoder zero off by 0.05\N{DEGREE SIGN}",
    )
    render.draw(sheet, HERE / "identification.png", size=(8.6, 7.6), dpi=90)


def diagnosis() -> None:
    """The report of docs/records/diagnose.md: what is hidden is named, and the gap shrinks."""
    with tempfile.TemporaryDirectory() as folder:
        request = virtual_rig.Request("hidden", seed=3, effects=("quadratic_drag",))
        places = virtual_rig.places(Path(folder) / "lab", replace=True)
        virtual_rig.write(virtual_rig.make(request), places)
        render.write_report(diagnose(read_experiment(places.experiment)), HERE / "lab.md")
    page = (HERE / "lab.md").read_text(encoding="utf-8").replace("](<lab_", "](<../pictures/lab_")
    (DOCS / "records" / "report.md").write_text(page, encoding="utf-8")
    (HERE / "lab.md").unlink()


def planes() -> None:
    """The attractors over p and omega, and against p."""
    plane = {"p": (0.05, 2.5, 200), "omega": (0.5, 3.0, 200)}
    found = parameter_map(Pendulum(), plane, curves=True)
    render.draw(found, HERE / "plane.png", dpi=90, layer="kinds", size=(9.4, 9.4))
    render.draw(bifurcation(Pendulum(), {"p": (0.9, 2.0, 2000)}), HERE / "bifurcation.png", dpi=110)
    branches = continuation(Pendulum(omega=1.8), {"p": (0.05, 1.3)}, n=2, longest=4)
    render.draw(branches, HERE / "continuation.png", dpi=110)
    weak = Pendulum(gamma=0.05, p=0.3, theta_r=0.02)
    resonance = continuation(weak, {"omega": (1.2, 2.4)}, n=2, longest=2)
    render.draw(resonance, HERE / "resonance.png", dpi=110, layer="resonance")
    ranges = {"p": (0.0, 2.5), "omega": (1.5, 3.0)}
    curves = continuation(Pendulum(), ranges, up_to=2)
    render.draw(curves, HERE / "bifurcation_set.png", dpi=110)
    rubbing, ranges = Pendulum(gamma=0.05, theta_r=0.4), {"p": (1.0, 2.5), "omega": (0.8, 1.2)}
    curves = continuation(rubbing, ranges, up_to=1)
    render.draw(curves, HERE / "bifurcation_set_friction.png", dpi=110)


def in_axes() -> None:
    """The figure of the first snippet of figures.md."""
    page = (DOCS / "figures.md").read_text(encoding="utf-8")
    code = re.findall(r"^```python\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL)[0]
    names: dict[str, Figure] = {}
    exec(code.replace('fig.savefig("four.pdf")', ""), names)  # noqa: S102 (our own page)
    names["fig"].savefig(HERE / "four.png", dpi=110)


def forced() -> None:
    """A rig's runs that tumble beside the ensemble of the model that its decay gives."""
    model = paper_figures.report().methods["combined_repaired"].rig
    sheet = comparison.tumbling(
        paper_motions.tumbling(model),
        "Tumbling until it settles",
        "virtual rig, and the model that was identified from its free decay",
    )
    render.draw(sheet, HERE / "tumbling.png", dpi=110)


if __name__ == "__main__":
    in_axes()
    planes()
    forced()
    render.draw(basins(Pendulum(p=0.6)), HERE / "smooth.png", layer="labels", size=SIZE, dpi=110)
    render.draw(basins(Pendulum(p=1.7)), HERE / "fractal.png", layer="settle", size=SIZE, dpi=110)
    friction()
    record()
    identification()
    diagnosis()
