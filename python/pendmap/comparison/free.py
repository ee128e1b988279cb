"""Comparison of a model with a free decay."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final

from pendmap.formatting import Estimate
from pendmap.identification.fit import fit_runs
from pendmap.identification.methods.base import Identification
from pendmap.identification.parameters import OFFSET
from pendmap.identification.peaks import find_peaks
from pendmap.identification.readings import as_fit_run, reading_of_run
from pendmap.identification.runs import rig_of
from pendmap.identification.table1 import table1

if TYPE_CHECKING:
    from pendmap.identification.peaks import Peaks
    from pendmap.identification.table1 import PeakErrors, Table1
    from pendmap.model import Rig
    from pendmap.records import Run
    from pendmap.signal import Floats

MODEL: Final = "model"  # Name of the model in table 1


@dataclasses.dataclass(frozen=True, repr=False)
class RunComparison:
    """Comparison of a model with one free decay."""

    run: Run  #: The record.
    sigma: float  #: Noise of the record, rad.
    start: tuple[float, float]  #: Angle (rad) and velocity (rad/s) fitted at the first free sample.
    curve: Floats  #: Angle and velocity of the model, rad and rad/s, shape (2, N).
    residual: Floats  #: Measured reading less the model's, rad, shape (N,); 0 at excluded samples.
    rms: float  #: Root mean square residual of the included samples, rad.
    peaks: Peaks  #: Peaks of the record.
    #: Table 1 and figure 7, with one column; the model starts at the first measured peak.
    table: Table1

    def __repr__(self) -> str:
        held = ", held out" if self.run.hold_out else ""
        return (
            f"<RunComparison {self.run.name}{held}: rms {self.rms:.3g} rad, noise "
            f"{self.sigma:.3g} rad>"
        )

    @property
    def errors(self) -> PeakErrors | None:
        """Errors of periods and peaks; None if there are too few."""
        return self.table.errors.get(MODEL)

    @property
    def left_out(self) -> str:
        """Reason why a record with peaks has no such errors, or empty."""
        lost = self.table.lost.get(MODEL)
        return f"periods and peaks are not compared: {lost}" if lost else self.table.left_out


def compare_free(model: Rig, run: Run) -> RunComparison:
    """Compare a model with a free decay; only its initial state is fitted."""
    reading = reading_of_run(run)
    given = as_fit_run(run, reading)
    model = rig_of(given, model)  # with the drive of the run
    fit = fit_runs([given], model, free=())
    peaks = find_peaks(run.time, run.theta, sigma=reading.sigma, trusted=run.trusted)
    estimates = {name: Estimate(getattr(model, name)) for name in ("w0", "c_over_m", "Tr")}
    for effect in model.effects:
        if effect.name == OFFSET:
            estimates["offset"] = Estimate(effect.parameters["d"])
    return RunComparison(
        run=run,
        sigma=reading.sigma,
        start=fit.windows[0][3:],
        curve=fit.curves[0],
        residual=fit.residuals[0],
        rms=fit.rms,
        peaks=peaks,
        table=table1(peaks, {MODEL: Identification(MODEL, estimates, model=model)}),
    )
