"""The virtual rig's integrator: many runs in parallel, with exact dry friction.

Each iteration makes one step for every run, each with its own length. The signs of the velocity
and of the load on the bearing are held through a step, so that the equation is smooth there; a
step ends at a change of sign. A pendulum at rest sticks exactly while the sum of all other torques
is at most the dry friction.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendmap.virtual_rig.events import first_switches
from pendmap.virtual_rig.lanes import Lanes, Starts, solve
from pendmap.virtual_rig.path import NODES, basis

if TYPE_CHECKING:
    from pendmap.virtual_rig.equation import Equation
    from pendmap.virtual_rig.lanes import Step
    from pendmap.virtual_rig.path import Path


def integrate(equation: Equation, starts: Starts) -> list[Path]:
    """Integrate runs, or parts of them, from start to end; return a path for each start."""
    lanes = Lanes(equation, starts)
    live = np.flatnonzero(starts.end > starts.begin)
    while live.size:
        step = solve(lanes, live)
        lanes.wish[live] = step.wish
        if step.good.any():
            _commit(lanes, step)
        live = live[lanes.time[live] < starts.end[live]]
    return lanes.paths


def _commit(lanes: Lanes, step: Step) -> None:
    """Apply the accepted steps, each up to its first event."""
    rows = np.flatnonzero(step.good)
    lane, length = step.lane[rows], step.length[rows]
    switches = first_switches(lanes, step, rows)
    for k, i in zip(rows.tolist(), lane.tolist(), strict=True):
        if step.length[k] > 0:
            begin, long = float(lanes.time[i]), float(step.length[k])
            lanes.paths[i].add(begin, long, step.theta[k], step.velocity[k])
    places = np.array([switches[k].place if k in switches else 1.0 for k in rows.tolist()])
    polynomials = basis(places, NODES + 2)
    ends = lanes.time[lane] + length >= lanes.stop[lane]
    lanes.theta[lane] = np.einsum("nk,nk->n", polynomials, step.theta[rows])
    lanes.velocity[lane] = np.einsum("nk,nk->n", polynomials[:, :-1], step.velocity[rows])
    lanes.own[lane] = np.einsum("nk,nkm->nm", polynomials[:, :-1], step.own[rows])
    lanes.time[lane] += places * length
    for k, i, end in zip(rows.tolist(), lane.tolist(), ends, strict=True):
        if k in switches:
            lanes.happen(i, switches[k].what)
        elif end:
            lanes.time[i] = lanes.stop[i]
            lanes.kick(i)
