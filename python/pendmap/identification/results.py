"""What results of records have in common: parameters, residual, motion of the model; files."""

from __future__ import annotations

import abc
import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, NamedTuple, Protocol

import numpy as np
import pandas as pd
import xarray as xr

from pendmap.errors import InputError, short_repr
from pendmap.files.atomic import whole_file
from pendmap.files.saved import Saved
from pendmap.files.variables import variable
from pendmap.formatting import estimate_text, html_table, interval, moment
from pendmap.identification.fit import Motion, run_forward
from pendmap.model.effects import definition
from pendmap.model.labels import unit_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import ArrayLike

    from pendmap.files.saved import About
    from pendmap.formatting import Estimate
    from pendmap.identification.fit import TrajectoryFit
    from pendmap.identification.runs import FitRun
    from pendmap.model.effects import EffectDefinition
    from pendmap.records import Run
    from pendmap.signal import Floats

    Covariance = tuple[Sequence[str], Floats]
    import os


EXACT: Final = 1e-9  # Nominal noise that sets the integrator's tolerance of a prediction, rad
STEP: Final = 1e-3  # Time between samples that are added, since a run has three or more, s


class Followed(NamedTuple):
    """A fit of whole records."""

    fit: TrajectoryFit
    fitted: Sequence[FitRun]  # in the order of the fit
    runs: Sequence[Run]  # the records of each


OF_MODEL: Final = {
    "theta": ("reading", "rad", "angle of the model"),
    "velocity": ("reading", "rad/s", "velocity of the model"),
}
ARRAYS: Final[dict[str, About]] = {
    "Run.time": ("sample", "s", "time of a sample"),
    "Run.theta": ("sample", "rad", "angle from the downward rest, unwrapped"),
    "Run.trusted": ("sample", "", "whether a sample is for fitting"),
    "Run.velocity": ("sample", "rad/s", "measured velocity"),
    "Run.acceleration": ("sample", "m/s2", "measured acceleration"),
    "Run.pivot": ("sample", "1", "recorded motion of the pivot, in the unit of its run"),
    "Pivot.time": ("pivot_sample", "s", "time of a sample of the pivot"),
    "Pivot.vertical": ("pivot_sample", "1", "motion of the pivot upward, in its unit"),
    "Pivot.horizontal": ("pivot_sample", "1", "its motion toward positive theta"),
    "RodSensor.angle": ("reading", "rad", "initial guess of the angle"),
    "FitRun.time": ("reading", "s", "time of a reading; the phase of the drive is that at 0"),
    "FitRun.theta": ("reading", "rad", "reading, unwrapped; of a rod sensor over its gain"),
    "FitRun.sigma": ("reading", "rad", "standard error of a reading"),
    "FitRun.trusted": ("reading", "", "whether a reading is included"),
    "Reading.each": ("recorded", "rad", "standard error of a reading"),
    "Reading.shift": ("recorded", "rad", "bias by timing jitter, subtracted"),
    "TrajectoryFit.curves": OF_MODEL,
    "TrajectoryFit.residuals": ("reading", "rad", "reading less model; 0 if excluded"),
    "TrajectoryFit.white": ("reading", "1", "residual of unit variance"),
    "Peaks.time": ("peak", "s", "time of a peak"),
    "Peaks.amplitude": ("peak", "rad", "angle of a peak"),
    "Peaks.stderr_time": ("peak", "s", "standard error of the time"),
    "Peaks.stderr_amplitude": ("peak", "rad", "standard error of the angle"),
    "Peaks.index": ("peak", "1", "number of a peak"),
    "Peaks.crossing_time": ("crossing", "s", "time of a zero crossing"),
    "Peaks.crossing_stderr": ("crossing", "s", "standard error of this time"),
    "Peaks.crossing_index": ("crossing", "1", "number of its half cycle"),
    "PeakErrors.period_time": ("cycle", "s", "start of a full cycle"),
    "PeakErrors.period": ("cycle", "s", "measured period of a full cycle"),
    "PeakErrors.period_error": ("cycle", "percent", "error of a simulated period"),
    "PeakErrors.peak_index": ("simulated_peak", "1", "number of a peak"),
    "PeakErrors.peak": ("simulated_peak", "rad", "measured amplitude of a peak"),
    "PeakErrors.peak_error": ("simulated_peak", "percent", "error of a simulated peak"),
}
"""Dimension, unit and meaning of the arrays of records and fits, by class and field."""


class Parameters(Saved):
    """A result with parameters, which a file can hold."""

    ARRAYS = ARRAYS
    ROWS: ClassVar[str] = "parameter"
    COLUMNS: ClassVar[Mapping[str, str]] = {
        "parameter": "name of a parameter",
        "value": "value of a parameter",
        "stderr": "its standard error",
        "low": "lower end of its 95 % interval",
        "high": "upper end of its 95 % interval",
        "unit": "unit of a parameter, SI; empty for a pure number",
    }

    @property
    @abc.abstractmethod
    def parameters(self) -> Mapping[str, Estimate]:
        """Estimates by name, in SI."""

    @property
    @abc.abstractmethod
    def joint_covariance(self) -> Covariance | None:
        """Names and covariance matrix of jointly fitted parameters, SI; None if it is unknown."""

    definition: Callable[[str], EffectDefinition] = staticmethod(definition)
    """Function that returns the definition of an effect by its name."""

    @property
    def sensors(self) -> Sequence[str]:
        """Units of the readings of each fitted run."""
        return ()

    def unit(self, name: str) -> str:
        """Return the unit of a parameter; empty for a pure number."""
        parameter, _, run = name.partition("[")
        if parameter == "bias" and self.sensors:
            return self.sensors[int(run[:-1] or 0)]
        return unit_of(name, self.definition)

    def to_dataframe(self) -> pd.DataFrame:
        """Return one row a parameter.

        Returns
        -------
        pandas.DataFrame
            Index ``parameter``; ``value``, ``stderr`` (standard error), ``low`` and ``high`` (the
            95 % interval), nan where unknown, and ``unit`` (SI; empty for a pure number).
        """
        rows = [
            (name, e.value, e.stderr, *(e.ci95 or (None, None)), self.unit(name))
            for name, e in self.parameters.items()
        ]
        columns = ["parameter", "value", "stderr", "low", "high", "unit"]
        types = dict.fromkeys(columns[1:-1], "float64") | {"unit": "string"}
        return pd.DataFrame(rows, columns=columns).astype(types).set_index("parameter")

    def further(self) -> dict[str, Any]:
        """Return the covariance matrix; nan where a parameter was not fitted with the others."""
        if not self.parameters or self.joint_covariance is None:
            return {}
        names, matrix = self.joint_covariance
        every = list(self.parameters)
        table = pd.DataFrame(matrix, list(names), list(names)).reindex(every, columns=every)
        dims, text = ("parameter", "parameter_2"), "covariance of two parameters, SI"
        return {
            "covariance": variable(dims, table.to_numpy(), "", text),
            "parameter_2": variable("parameter_2", every, "", "name of a parameter"),
        }

    @property
    def correlation(self) -> pd.DataFrame:
        """Correlations of the jointly fitted parameters, by name; nan of undetermined ones.

        InputError is raised if the method gives no covariance.
        """
        if self.joint_covariance is None:
            raise InputError("correlation must be of a method with a covariance, this has none")
        names, matrix = self.joint_covariance
        sizes = np.sqrt(np.where(np.isfinite(np.diag(matrix)), np.diag(matrix), np.nan))
        with np.errstate(invalid="ignore", divide="ignore"):
            values = np.where(np.isfinite(matrix), matrix, np.nan) / np.outer(sizes, sizes)
        return pd.DataFrame(values, index=list(names), columns=list(names))

    def parameter_table(self) -> tuple[list[str], list[list[str]]]:
        """Return header and rows of the parameters with errors, intervals and units."""
        rows = [
            [name, estimate_text(e), interval(e), self.unit(name)]
            for name, e in self.parameters.items()
        ]
        return ["parameter", "value", "95 % interval", "unit"], rows

    def _repr_html_(self) -> str:
        head, rows = self.parameter_table()
        return super()._repr_html_() + (html_table(head, rows) if rows else "")


class FitResult(Parameters):
    """A result with a fit of whole records: residual and motion of the model too."""

    @abc.abstractmethod
    def followed(self) -> Followed:
        """Return the fit of the whole records; InputError is raised if there is none."""

    @property
    def sensors(self) -> Sequence[str]:
        """Units of the readings of each fitted run."""
        return ["rad/s" if run.gyroscope else "rad" for run in self.followed().runs]

    def further(self) -> dict[str, Any]:
        """Return the covariance, and time and run of each reading that is fitted."""
        try:
            _, fitted, runs = self.followed()
        except InputError:
            return super().further()
        pairs = zip(fitted, runs, strict=True)
        times = [given.time + _begin(given, run) for given, run in pairs]
        owner = np.repeat(np.arange(len(runs), dtype=np.int16), [time.size for time in times])
        names = {k: run.name for k, run in enumerate(runs)}
        text = "time of a reading on the clock of its run"
        return super().further() | {
            "time": variable("reading", np.concatenate(times), "s", text),
            "reading_of": variable("reading", owner, "", "run of a reading", flags=names),
        }

    @property
    def residual(self) -> dict[str, xr.DataArray]:
        """Reading less fitted model of each fitted run, rad, over ``time``, s on the run's clock.

        Samples that are not fitted are nan. A diagnosis fits block means of dense readings.
        InputError is raised without a fit of whole records.
        """
        fit, fitted, runs = self.followed()
        residuals = {}
        for given, run, values in zip(fitted, runs, fit.residuals, strict=True):
            time = given.time + _begin(given, run)
            residuals[run.name] = xr.DataArray(
                np.where(given.counted, values, np.nan),
                {"time": ("time", time, {"units": "s", "long_name": "time of the record"})},
                name="residual",
                attrs={"units": "rad", "long_name": "reading less fitted model"},
            )
        return residuals

    def predict(self, t: ArrayLike, run: str | None = None) -> Floats:
        """Return the angle of the fitted model in a run: its motion, without the sensor's errors.

        Between the samples of a window, and after the last one, the model moves from the fitted
        state at the window's first sample. A forced run has windows of up to three swings.

        Parameters
        ----------
        t : array_like
            Times on the run's clock, s, from its first fitted sample on.
        run : str, optional
            Name of a fitted run; by default the first.

        Returns
        -------
        ndarray
            Angle, rad, not wrapped, of the shape of ``t``.

        Raises
        ------
        InputError
            If there is no fit of whole records or no such run, or a time is before it.
        FitDiverged
            If the model diverges after the record.
        """
        fit, fitted, runs = self.followed()
        names = [fitted_run.name for fitted_run in runs]
        if run is not None and run not in names:
            raise InputError(f"run must be one of {', '.join(names)}, got {short_repr(run)}")
        place = 0 if run is None else names.index(run)
        given, begin = fitted[place], _begin(fitted[place], runs[place])
        try:
            times = np.asarray(t, dtype=np.float64) - begin
        except (TypeError, ValueError, OverflowError):
            times = np.array(np.nan)
        windows = [(given.time[a], (x, v)) for k, a, _, x, v in fit.windows if k == place]
        firsts = np.array([first for first, _ in windows])
        if not np.isfinite(times).all() or (times.size and times.min() < firsts[0]):
            least = moment(begin + float(firsts[0]))
            raise InputError(f"t must be finite times from {least} s on, got {short_repr(t)}")
        angle, owner = np.empty(times.shape), np.searchsorted(firsts, times, side="right") - 1
        given = dataclasses.replace(given, sigma=EXACT, trusted=None, rod_sensor=None, count=None)
        given = dataclasses.replace(given, drive=fit.drive_of(given, place))
        for k in np.unique(owner):
            (first, state), in_window = windows[k], owner == k
            grid = np.union1d(times[in_window], first + STEP * np.arange(3))
            ahead = dataclasses.replace(given, time=grid, theta=np.zeros(grid.size))
            ((_, (theta, _)),) = run_forward(Motion.of(fit), [ahead], [state])
            angle[in_window] = theta[np.searchsorted(grid, times[in_window])]
        return angle


def _begin(given: FitRun, run: Run) -> float:
    """Return the time on the clock of a run at time 0 of its fit, s."""
    return 0.0 if given.drive is not None else float(run.time[0])


SUFFIXES: Final = (".csv", ".xlsx", ".mat")
MOST_ROWS: Final = 2**20 - 1  # Rows of a sheet of Excel below its header


class _Read(Protocol):
    @property
    def readings(self) -> pd.DataFrame: ...


def write_readings(report: _Read, path: str | os.PathLike[str]) -> Path:
    """Write the ``readings`` of a report; ``.mat`` has a variable a column, runs as cells."""
    table, suffix = report.readings, Path(path).suffix.lower()
    if suffix == ".xlsx" and len(table) > MOST_ROWS:
        text = f"must have {MOST_ROWS} readings at most, got {len(table)}: .csv and .mat take all"
        raise InputError(f"{path}: {text}")
    with whole_file(path, SUFFIXES) as part:
        if suffix == ".csv":
            table.to_csv(part, index=False)
        elif suffix == ".xlsx":
            table.to_excel(part, index=False, sheet_name="readings", engine="openpyxl")
        else:
            from scipy.io import savemat  # noqa: PLC0415 (where it is needed)

            columns = {name: values.to_numpy() for name, values in table.items()}
            savemat(part, columns, do_compression=True, oned_as="column")
    return Path(path)
