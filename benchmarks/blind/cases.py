"""Blind experiments, drawn at random and recorded by the virtual rig."""

from __future__ import annotations

import dataclasses
import functools
import math
import tempfile
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.blind import mess
from pendmap import virtual_rig
from pendmap.model.effects import library
from pendmap.records import read_experiment

if TYPE_CHECKING:
    from pendmap.records import Experiment

KINDS = {"mixed": (5, 4), "free": (5, 0), "single": (1, 0)}
"""Numbers of free and forced runs."""

LAYOUTS = {
    "one forced run among free ones": (5, 1),
    "only free runs held out": (5, 4),
    "single decay": (1, 0),
    "three free runs": (3, 0),
}
"""Numbers of free and forced runs of laboratories that record less."""

RATES = (10.0, 25.0, 50.0, 100.0, 200.0, 500.0)
LENGTHS = (10.0, 140.0)
"""Ranges of the sampling rate (1/s) and of the length (s) of these records."""

SAMPLES = (100.0, 100.0, 100.0, 200.0, 500.0)
COUNTS = (1024, 2048, 4096, 8192)
BASE = ("viscous_damping", "coulomb_friction")
"""Effects of the baseline, which are not hidden."""

AGEING = {name for name, e in library().items() if "time in the laboratory" in e.formula}
"""Effects that change between runs."""

FOREIGN = {"added_mass:late", "impulses:train"}
"""Variants unlike the library's effect of their name: a mass added between two runs is not one
present from the start, one impulse is not ten."""

SPOILT = {"correlation": 0.5, "dropouts": 0.02, "outliers": 0.003, "jitter": 0.0005}
"""Faults of records and their sizes; a faulty experiment has one of them."""

SOUND = dict.fromkeys((*SPOILT, "mess"), 0.0)

MESS = (0.5, 10.0)
"""Least and greatest disturbance, in multiples of the sensor's noise."""

MAIN = 0.75
"""Share of experiments with disturbances that have a main effect."""


@dataclasses.dataclass(frozen=True)
class Case:
    """A request to the rig, and the effects that are withheld from the search."""

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
    duration: float | None = None


def draw(what: str, rng: np.random.Generator) -> Case:
    """Draw a case: ``none``, ``one``, ``two``, ``withheld``, or a kind scored separately."""
    kind = str(rng.choice(list(KINDS), p=(0.6, 0.25, 0.15)))
    if what == "layout":
        kind = str(rng.choice(list(LAYOUTS)))
    counts = int(rng.choice(COUNTS))
    noise = max(float(np.exp(rng.uniform(math.log(0.05), math.log(0.5)))), 0.3 * 360 / counts)
    effects = _effects(what, kind, rng)
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
    if what == "layout":
        duration = float(np.exp(rng.uniform(*np.log(LENGTHS))))
        return dataclasses.replace(case, rate=float(rng.choice(RATES)), duration=duration)
    if what != "nuisance":
        return case
    name = list(SPOILT)[int(rng.integers(len(SPOILT)))]
    return dataclasses.replace(case, **{name: SPOILT[name]})


def _effects(what: str, kind: str, rng: np.random.Generator) -> tuple[str, ...]:
    """Draw the hidden effects."""
    free, forced = runs_of(kind)
    known = {e["name"]: e for e in virtual_rig.describe() if e["name"] not in mess.NAMES}
    usable = [n for n in library() if n in known and n not in BASE]
    if free == 1:
        usable = [n for n in usable if n not in AGEING]
    if forced == 0:
        usable = [n for n in usable if library()[n].group != "drive" and not known[n]["needs"]]
    if what == "one" or (what == "nuisance" and rng.random() < 0.5):  # noqa: PLR2004
        return (str(rng.choice(usable)),)
    if what in {"mess", "layout"} and rng.random() < MAIN:
        return (str(rng.choice(usable)),)
    if what == "two":
        return tuple(str(e) for e in rng.choice(usable, 2, replace=False))
    if what == "withheld":
        foreign = [n for n in known if n in FOREIGN or (":" not in n and n not in library())]
        foreign = [n for n in foreign if free > 1 or n not in FOREIGN]
        foreign = [n for n in foreign if forced or not known[n]["needs"]]
        among = foreign if foreign and rng.random() < 0.5 else usable  # noqa: PLR2004
        return (str(rng.choice(among)),)
    if what == "form":
        variants = [n for n in known if ":" in n and n.split(":")[0] in library()]
        return (str(rng.choice([n for n in variants if n not in FOREIGN])),)
    return ("none",)


def runs_of(kind: str) -> tuple[int, int]:
    """Return the numbers of free and forced runs of a kind of experiment."""
    return (KINDS | LAYOUTS)[kind]


@dataclasses.dataclass(frozen=True)
class Recorded:
    """An experiment, and its truth, known to the rig alone."""

    experiment: Experiment
    sigma: float  # Standard deviation of the sensor's noise, rad
    truth: dict[str, dict[str, float]]  # Parameters of the hidden effects


@functools.lru_cache(maxsize=4)
def record(case: Case, *, clean: bool = False) -> Recorded:
    """Write and read the experiment of a case; the last four are cached."""
    free, forced = runs_of(case.kind)
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
        duration=case.duration,
        correlation=0.0 if clean else case.correlation,
        dropouts=0.0 if clean else case.dropouts,
        outliers=0.0 if clean else case.outliers,
        jitter=0.0 if clean else case.jitter,
    )
    sigma = math.hypot(math.radians(case.noise), math.tau / case.counts / math.sqrt(12))
    if case.mess and not clean:
        request = mess.added(request, case.mess * sigma)
    with tempfile.TemporaryDirectory() as folder:
        where = virtual_rig.places(Path(folder) / "rig", replace=False)
        virtual_rig.write(virtual_rig.make(request), where)
        experiment = read_experiment(where.experiment)
        table = tomllib.loads((Path(folder) / "rig.truth.toml").read_text(encoding="utf-8"))
    if case.kind == "only free runs held out":
        seen = [k for k, run in enumerate(experiment.runs) if run.kind == "free"]
        runs = tuple(
            dataclasses.replace(run, hold_out=k in seen[1:3])
            for k, run in enumerate(experiment.runs)
        )
        experiment = dataclasses.replace(experiment, runs=runs)
    truth = {e["name"]: e["parameters"] for e in table.get("effect", [])}
    truth = {name: values for name, values in truth.items() if name not in mess.NAMES}
    return Recorded(experiment, sigma, truth)
