"""Blind experiments: drawn, and recorded by the virtual rig."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from pendmap import virtual_rig
from pendmap.model.effects import library
from pendmap.records import read_experiment

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.records import Experiment

KINDS = {"mixed": (5, 4), "free": (5, 0), "single": (1, 0)}
SAMPLES = (100.0, 100.0, 100.0, 200.0, 500.0)
COUNTS = (1024, 2048, 4096, 8192)
BASE = ("viscous_damping", "coulomb_friction")
"""What the baseline has: not hidden."""

AGEING = {name for name, e in library().items() if "time in the laboratory" in e["formula"]}
"""What changes from run to run."""

FOREIGN = {"added_mass:late", "impulses:train"}
"""Variants that are no form of the library's effect of their name, but another effect: a mass put
on between two runs does nothing that one does which is there all along, one knock is not ten."""

SPOILT = {"correlation": 0.5, "dropouts": 0.02, "outliers": 0.003, "jitter": 0.0005}
"""What records are spoilt with, one thing in each experiment that is."""

SOUND = dict.fromkeys((*SPOILT, "mess"), 0.0)

MESS = (0.5, 10.0)
"""Least and greatest disturbance, in multiples of the sensor's noise."""

MAIN = 0.75
"""Share of experiments with disturbances that have a main effect."""


@dataclasses.dataclass(frozen=True)
class Case:
    """What is asked of the rig, and what is withheld from the search."""

    what: str
    kind: str
    seed: int
    effects: tuple[str, ...]
    size: float
    noise: float
    counts: int
    rate: float
    correlation: float = 0.0
    dropouts: float = 0.0
    outliers: float = 0.0
    jitter: float = 0.0
    mess: float = 0.0


def draw(what: str, rng: np.random.Generator) -> Case:
    """Draw a case: ``none``, ``one``, ``two``, ``withheld``, ``form``, ``nuisance`` or ``mess``."""
    kind = str(rng.choice(list(KINDS), p=(0.6, 0.25, 0.15)))
    counts = int(rng.choice(COUNTS))
    noise = max(float(np.exp(rng.uniform(math.log(0.05), math.log(0.5)))), 0.3 * 360 / counts)
    known = {e["name"]: e for e in virtual_rig.describe()}
    usable = [n for n in library() if n in known and n not in BASE]
    if kind == "single":
        usable = [n for n in usable if n not in AGEING]
    if kind != "mixed":
        usable = [n for n in usable if library()[n]["group"] != "drive" and not known[n]["needs"]]
    effects: tuple[str, ...] = ("none",)
    if what in {"one", "nuisance"} and (what == "one" or rng.random() < 0.5):  # noqa: PLR2004
        effects = (str(rng.choice(usable)),)
    elif what == "mess":
        effects = (str(rng.choice(usable)),) if rng.random() < MAIN else ("none",)
    elif what == "two":
        effects = tuple(str(e) for e in rng.choice(usable, 2, replace=False))
    elif what == "withheld":
        foreign = [n for n in known if n in FOREIGN or (":" not in n and n not in library())]
        foreign = [n for n in foreign if kind != "single" or n not in FOREIGN]
        foreign = [n for n in foreign if kind == "mixed" or not known[n]["needs"]]
        name = str(rng.choice(foreign if rng.random() < 0.5 else usable))  # noqa: PLR2004
        effects = (name,)
    elif what == "form":
        variants = [n for n in known if ":" in n and n.split(":")[0] in library()]
        effects = (str(rng.choice([n for n in variants if n not in FOREIGN])),)
    size = (
        1.0 if effects == ("none",) else float(np.exp(rng.uniform(math.log(0.08), math.log(1.2))))
    )
    case = Case(
        what,
        kind,
        int(rng.integers(2**31)),
        effects,
        size,
        math.degrees(math.radians(noise)),
        counts,
        float(rng.choice(SAMPLES)),
    )
    if what == "mess":
        return dataclasses.replace(case, mess=float(np.exp(rng.uniform(*np.log(MESS)))))
    if what != "nuisance":
        return case
    name = list(SPOILT)[int(rng.integers(len(SPOILT)))]
    return dataclasses.replace(case, **{name: SPOILT[name]})


def record(case: Case, folder: Path, *, clean: bool = False) -> tuple[Experiment, float]:
    """Write and read a case's experiment; return it with the noise's standard deviation, rad."""
    free, forced = KINDS[case.kind]
    request = virtual_rig.Request(
        "hidden",
        seed=case.seed,
        effects=case.effects,
        size=case.size,
        free=free,
        forced=forced,
        noise=0.0 if clean else case.noise,
        counts=0 if clean else case.counts,
        rate=case.rate,
        correlation=0.0 if clean else case.correlation,
        dropouts=0.0 if clean else case.dropouts,
        outliers=0.0 if clean else case.outliers,
        jitter=0.0 if clean else case.jitter,
        mess=0.0 if clean else case.mess,
    )
    where = virtual_rig.places(folder / ("clean" if clean else "noisy"), replace=True)
    virtual_rig.write(virtual_rig.make(request), where)
    count = math.tau / case.counts / math.sqrt(12)
    return read_experiment(where.experiment), math.hypot(math.radians(case.noise), count)
