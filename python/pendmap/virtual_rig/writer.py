"""Files of an experiment: its folder, and the truth file next to it."""

from __future__ import annotations

import dataclasses
import errno
import importlib.metadata
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from pendmap.errors import InputError
from pendmap.files import check_room, toml_text, whole_file, whole_folder

if TYPE_CHECKING:
    import os

    from pendmap.virtual_rig.effects.base import Effect
    from pendmap.virtual_rig.experiment import Experiment, Run

FORMAT_VERSION: Final = 1  # Version of the layout of the truth file

_FILES: Final = re.compile(r"experiment\.toml|run_\d+\.csv")  # Names of the files of an experiment
_GRAVITY: Final = 9.81
_ENOUGH: Final = 3  # Least number of runs of one kind for a run to be held out


class Places(NamedTuple):
    """Paths of an experiment and of its truth."""

    experiment: Path  # The folder
    truth: Path  # The file next to it, ``FOLDER.truth.toml``


def places(out: str | os.PathLike[str], *, replace: bool) -> Places:
    """Return the paths of an experiment, checked before anything is computed.

    Raises
    ------
    InputError
        If the folder is not empty, or there is a truth already, and they may not be replaced; or
        if the folder is not an experiment and shall be replaced.
    OSError
        If the folder above does not exist, the path is a file, or nothing may be written there.
    """
    folder = Path(out).resolve() if Path(out).name in {"", ".."} else Path(out)
    if not folder.name:
        raise InputError(f"{folder}: must be a folder in another one, got the root")
    truth = folder.with_name(f"{folder.name}.truth.toml")
    if not folder.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "the folder does not exist", str(folder.parent))
    files = list(folder.iterdir()) if folder.exists() else []
    if (files or truth.exists()) and not replace:
        there = f"{folder}: is not empty" if files else f"{truth}: exists"
        raise InputError(f"{there}: without --overwrite it must be a new or empty folder")
    if files and not (truth.is_file() and all(_FILES.fullmatch(file.name) for file in files)):
        raise InputError(
            f"{folder}: is not an experiment of the virtual rig only, with its truth next to it: "
            "--overwrite replaces nothing else"
        )
    check_room(truth)
    return Places(folder, truth)


def write(experiment: Experiment, where: Places) -> None:
    """Write the folder and the truth of an experiment: both complete, or neither.

    They are written to temporary paths and renamed at the end; an interrupt waits until then.

    Raises
    ------
    OSError
        If they cannot be written.
    """
    with whole_file(where.truth, [".toml"]) as truth, whole_folder(where.experiment) as folder:
        folder.mkdir()
        for k, run in enumerate(experiment.runs):
            # 12 digits distinguish all counts, and give an angle without counts to 1e-11 rad.
            rows = zip(run.time.tolist(), run.angle.tolist(), strict=True)
            lines = ["t_s,theta_rad", *(f"{time:.6f},{angle:.12g}" for time, angle in rows)]
            (folder / _file(k)).write_text("\n".join(lines) + "\n", encoding="utf-8")
        pairs = (
            (folder / "experiment.toml", _description(experiment)),
            (truth, _truth(experiment)),
        )
        for path, content in pairs:
            path.write_text(toml_text(content), encoding="utf-8", newline="\n")


def _file(k: int) -> str:
    return f"run_{k:02d}.csv"


def _description(experiment: Experiment) -> dict[str, Any]:
    """Return the description known to an experimenter: no truth."""
    rig: dict[str, Any] = {"gravity": _GRAVITY, "w0": round(experiment.parameters.w0, 1)}
    if experiment.sensor.counts:
        rig["encoder_counts"] = experiment.sensor.counts
    runs, held = [], held_out(experiment)
    for k, run in enumerate(experiment.runs):
        plan = run.plan
        entry: dict[str, Any] = {"file": _file(k), "kind": plan.kind, "lab_time_s": plan.lab_time}
        if k in held:
            entry["hold_out"] = True
        if plan.kind == "forced":
            entry["drive"] = {"p": plan.p, "Omega": plan.frequency, "phi": plan.phase}
        runs.append(entry)
    return {"rig": rig, "run": runs}


def held_out(experiment: Experiment) -> set[int]:
    """Return the held-out runs: of each kind with 3 or more runs, the last but one.

    Runs before and after it, faster and slower ones, are fitted.
    """
    kinds: dict[str, list[int]] = {}
    for k, run in enumerate(experiment.runs):
        kinds.setdefault(run.plan.kind, []).append(k)
    return {runs[-2] for runs in kinds.values() if len(runs) >= _ENOUGH}


def _truth(experiment: Experiment) -> dict[str, Any]:
    """Return the truth: all drawn and hidden values."""
    request, parameters, sensor = experiment.request, experiment.parameters, experiment.sensor
    asked = {k: v for k, v in dataclasses.asdict(request).items() if v not in (None, ())}
    return {
        "format_version": FORMAT_VERSION,
        "equation": "th'' + c_over_m th' + w0^2 (1 + p cos(Omega t + phi)) sin th = "
        "-Tr sign(th') + effects, per unit of inertia, SI",
        "provenance": {"pendmap_version": importlib.metadata.version("pendmap"), "request": asked},
        "pendulum": {
            "w0": parameters.w0,
            "c_over_m": parameters.c_over_m,
            "Tr": parameters.friction,
            "zeta": parameters.c_over_m / (2 * parameters.w0),
            "theta_r": parameters.friction / parameters.w0**2,
        },
        "effect": [_effect(effect) for effect in experiment.effects],
        "sensor": {
            "rate_hz": sensor.rate,
            "encoder_counts": sensor.counts,
            "noise_rad": sensor.noise,
            "noise_deg": math.degrees(sensor.noise),
            "correlation": sensor.correlation,
            "dropouts": sensor.dropouts,
            "outliers": sensor.outliers,
            "jitter_s": sensor.jitter,
        },
        "run": [_run(k, run) for k, run in enumerate(experiment.runs)],
    }


def _effect(effect: Effect) -> dict[str, Any]:
    fields = dataclasses.fields(effect)
    entry: dict[str, Any] = {"name": effect.name, "group": effect.group, "formula": effect.formula}
    if effect.variant:
        entry["variant"] = effect.variant
    entry["parameters"] = {field.name: getattr(effect, field.name) for field in fields}
    entry["units"] = {field.name: field.metadata["unit"] or "1" for field in fields}
    return entry


def _run(k: int, run: Run) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "file": _file(k),
        "kind": run.plan.kind,
        "theta0_rad": float(run.plan.theta),
        "velocity0_rad_s": float(run.plan.velocity),
        "samples_lost": run.lost,
    }
    if run.path.events and run.path.events[-1].what == "stick":
        entry["rests_from_s"] = run.path.events[-1].time
        entry["rests_at_rad"] = run.path.events[-1].theta
    return entry
