"""The model that was identified, as a model file: with its covariance and where it comes from."""

from __future__ import annotations

import dataclasses
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap import checks
from pendmap.errors import InputError
from pendmap.identification.free import SENSOR
from pendmap.identification.from_start import OFFSET
from pendmap.identification.trajectory import METHOD as BEST

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pendmap.identification.report import IdentificationReport
    from pendmap.model import Rig

__all__ = ["identified_model", "provenance"]


def identified_model(report: IdentificationReport, command: str = "") -> Rig:
    """Return the model of the best method with the notes of its file.

    ``[covariance]`` has ``names``, ``matrix`` and the 95 % intervals ``ci95`` of all that was
    fitted together, both wider where the model leaves more than chance allows; ``[provenance]``
    the method, the records with their SHA-256, the version, the command, and of a fit of the whole
    record ``rms``, which it leaves, and ``noise``, both in rad.

    Parameters
    ----------
    report : IdentificationReport
        As of :func:`pendmap.identification.identify_experiment`.
    command : str
        How it was called.

    Raises
    ------
    InputError
        If no method could be applied.
    """
    best = report.best
    notes: dict[str, Any] = {}
    if best.covariance is not None:
        names, matrix = best.covariance
        # A sensor's bias and tilt are no part of the pendulum.
        kept = [k for k, name in enumerate(names) if name.partition("[")[0] not in SENSOR]
        names = tuple(names[k] for k in kept)
        matrix = np.asarray(matrix)[np.ix_(kept, kept)]
        own = {"offset": f"{OFFSET}.d"}
        notes["covariance"] = {
            "names": [own.get(name, name) for name in names],
            "matrix": np.asarray(matrix).tolist(),
            "ci95": {
                own.get(name, name): list(e.ci95)
                for name, e in best.estimates.items()
                if e.ci95 is not None and name in names
            },
        }
    sha256 = report.experiment.sha256
    runs = report.joint.runs if report.joint is not None else (report.run,)
    files = {run.file: run.sha256 or sha256.get(run.file, "") for run in runs}
    rms = noise = None
    if report.joint is not None and best.method == BEST:
        rms, noise = report.joint.fit.rms, report.joint.noise
    notes["provenance"] = provenance(files, command, rms=rms, noise=noise)
    notes["provenance"]["method"] = best.method
    try:
        return dataclasses.replace(report.model, notes=notes)
    except InputError as error:
        raise InputError(f"{report.run.name}: what was found is no model: {error}") from None


def provenance(
    files: Mapping[str, str],
    command: str,
    *,
    rms: float | None = None,
    noise: float | None = None,
) -> dict[str, Any]:
    """Return the table ``[provenance]`` of a model file.

    Parameters
    ----------
    files : mapping of str to str
        Records and their SHA-256.
    command : str
        How it was made; left out if empty.
    rms, noise : float, optional
        Root mean square of what the model leaves of the records, and the noise of a reading, rad:
        where the one is above 1.5 times the other every map of the model says so.
    """
    table: dict[str, Any] = {"version": version("pendmap"), "simd": checks.instruction_set()}
    if command:
        table["command"] = command
    table |= {name: x for name, x in (("rms", rms), ("noise", noise)) if x is not None}
    return table | {"records": [{"file": name, "sha256": code} for name, code in files.items()]}
