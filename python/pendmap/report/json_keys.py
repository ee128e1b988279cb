"""Keys of the JSON objects that commands on records print, by path, with unit and meaning.

``runs[].rms`` is the key ``rms`` of an item of the list ``runs``. A part of a path in capitals
stands for names: of parameters, effects, methods, channels. A key without a value is null.
"""

from __future__ import annotations

from typing import Final

from pendmap.analysis.result import FLAG
from pendmap.comparison.experiment import COLUMNS
from pendmap.identification.engineering import QUANTITIES
from pendmap.model.labels import LABELS

Keys = dict[str, tuple[str, str]]  # Unit and meaning by path; paths of one meaning have commas

SI: Final = "SI"  # Unit that depends on the parameter
READ: Final = "rad or rad/s"  # Unit of noise without a model: rad/s of a gyroscope
OTHER: Final = "that of unit"  # Unit that the key ``unit`` beside it gives


def _at(place: str, keys: Keys) -> Keys:
    """Return keys below a place."""
    return {
        ", ".join(f"{place}.{name}" for name in names.split(", ")): about
        for names, about in keys.items()
    }


_RECORDS: Final = {
    "experiment": ("", "path of the records"),
    "doubts[]": ("", "finding that makes the results doubtful: a wrong unit, scale or column"),
    "findings[]": ("", "text of a finding about the records"),
    "model": ("", "path of the model file; null if none is written"),
    "simd": ("", "instruction set of the computation"),
}
_ESTIMATE: Final = {"value, stderr": (SI, "value of the parameter, and standard error")}
_VALUE: Final = (SI, "value of the parameter")
_CI95: Final = {"ci95.PARAMETER[]": (SI, "lower and upper end of its 95 % interval")}
_NAME: Final = {"name": ("", "name of the run")}
_RUN: Final = {
    "kind": ("", "free or forced"),
    "hold_out": (FLAG, "whether the run is held out of fits"),
}
_FILE: Final = {
    "file": ("", "file of the record"),
    "lab_time_s": ("s", "start of the run on the clock of the laboratory"),
}
_SPAN: Final = {"from_s, to_s": ("s", "first and last time")}
_DRIVE: Final = {
    "p": ("1", "amplitude of the drive p cos(Omega t + phi) as given"),
    "Omega": (LABELS["Omega"].unit, LABELS["Omega"].meaning),
    "phi": ("rad", "phase of the drive at t = 0; null if it is fitted"),
}
_FINDING: Final = _SPAN | {
    "what": ("", "stable name of the finding, like time-gap"),
    "text": ("", "the finding in words"),
    "mended": (FLAG, "whether the readings were corrected"),
    "where": ("", "rows of the file, times or run"),
}
_CONTENT: Final = {
    "channels.CHANNEL": ("", "column that the channel was read from"),
    "unused[]": ("", "column without a channel"),
    "rate_hz": ("Hz", "sampling rate without gaps; of several runs the median"),
    "noise.sigma": (READ, "standard deviation about a smooth motion, rounding included"),
    "noise.stderr": (READ, "standard error of sigma"),
    "noise.limited_by_count": (FLAG, "whether it is that of rounding to counts, a lower bound"),
    "noise.samples": ("1", "residuals that it was computed from"),
    "noise.bound": (FLAG, "whether it is an upper bound: few samples a period"),
    "noise.unit": ("", "unit of sigma and stderr"),
    "noise.law.still": (READ, "noise at rest, where noise grows with speed"),
    "noise.law.tau": ("s", "standard deviation of the instants of sampling"),
    "noise.law.stderr": ("s", "standard error of tau"),
    "noise.law.fastest": ("rad/s", "largest phase velocity of the motion"),
    "noise.law.grows_with": ("", "what the noise grows with"),
    "segments[].what": ("", "state of the pendulum: held, driven, motion, rest or handled"),
    "segments[].used": (FLAG, "whether its samples are for fitting"),
    **_at("segments[]", _SPAN),
}
_CYCLE: Final = {
    "name": ("", "name of the steady state, like rotation 1:+1"),
    "kind": ("", "rest, inverted_rest, oscillation or rotation"),
    "n": ("periods", "its period, in periods of the drive"),
    "w": ("1", "turns in this period"),
}
_NOISE: Final = {"noise": ("rad", "noise of the readings; of a sensor on the rod over its gain")}
_FLOOR: Final = {"noise_floor": ("rad", "rms noise of the readings")}
_GAP: Final = _FLOOR | {"before, after": ("rad", "rms residual of baseline and selected model")}
_START: Final = {
    "theta": ("rad", "angle at the first sample in use, fitted"),
    "velocity": ("rad/s", "velocity there, fitted"),
}
_PERCENT: Final = {
    "period_rms_percent": ("percent", "rms error of the periods, relative to the measured ones"),
    "peak_rms_percent": ("percent", "rms error of the peaks, relative to the measured ones"),
}
_NO_TABLE: Final = {"table1_left_out": ("", "reason why periods and peaks are not compared")}
_UNITS: Final = {"chance": "1", "error_percent": "percent", "quantity": "", "unit": ""}
_QUANTITY: Final = {n: (_UNITS.get(n, OTHER), text) for n, text in COLUMNS.items() if n != "run"}

KEYS: Final[dict[str, Keys]] = {
    "look": {
        "path": ("", "path of the records"),
        "known.NAME": (SI, "value that the description of the experiment gives"),
        **_CONTENT,
        "noise.run": ("", "run with the greatest noise, if there are several: this is its noise"),
        "segments[].run": ("", "run of the segment, if there are several"),
        **_at("findings[]", _FINDING),
        "findings[].run": ("", "run of the finding; absent if it concerns the whole experiment"),
        **_at("runs[]", _NAME | _RUN | _FILE | _SPAN),
        "runs[].sha256": ("", "SHA-256 of the file"),
        **_at("runs[].drive", _DRIVE),
        "runs[].samples, runs[].trusted": ("1", "number of samples, and of those for fitting"),
        "runs[].theta_min, runs[].theta_max": ("rad", "range of the samples for fitting"),
        "runs[].count_rad": ("rad", "resolution of the readings; null if none shows"),
        "runs[].peaks_only": (FLAG, "whether the samples are turning points only"),
        **_at("runs[]", _CONTENT | _at("findings[]", _FINDING)),
    },
    "identify": {
        **_RECORDS,
        "run": ("", "free decay of the methods of peaks and of table 1"),
        "noise": ("rad", "noise of the readings of this run"),
        "best": ("", "method of the model; null if none gives one"),
        **{
            f"methods.METHOD.{name}": (LABELS[name].unit or "1", LABELS[name].meaning)
            for name in ("w0", "c_over_m", "zeta", "Tr", "theta_r", "offset")
        },
        **{
            f"quantities.{name}.{part}": (unit, f"{text}: {part}")
            for name, (unit, _, text) in QUANTITIES.items()
            for part in ("value", "stderr", "ci95[]")
        },
        "q_amplitude_rad": ("rad", "amplitude of Q: half of the record's largest swing"),
        "methods.METHOD.EFFECT.NAME": (SI, "parameter of a fitted effect"),
        "methods.METHOD.SENSOR": (SI, "bias or tilt of a sensor on the rod"),
        "methods.METHOD.stderr.PARAMETER": (SI, "standard error of the parameter"),
        **_at("methods.METHOD", _CI95),
        "methods.METHOD.warnings[]": ("", "reason to doubt the result, or why there is none"),
        "methods.METHOD.used": ("", "data that the method used"),
        "methods.METHOD.applicable": (FLAG, "whether the method can be applied to the record"),
        "methods.METHOD.misfit": ("1", "chi-squared per degree of freedom of the fit"),
        "rms": ("rad", "rms residual of the fitted trajectory in all runs"),
        **_at("runs[]", _NAME | _FILE | _SPAN),
        "runs[].samples": ("1", "samples in use"),
        "runs[].rms": ("rad", "rms residual of the fitted trajectory in this run"),
        **_at("runs[]", _NOISE),
        "table1[].what": ("", "period or peak"),
        "table1[].asked, table1[].measured": ("s or rad", "value of the paper, nearest measured"),
        "table1[].errors_percent.METHOD": ("percent", "absolute error of the simulated value"),
        **_NO_TABLE,
        "not_simulated.METHOD": ("", "reason why the model of a method cannot be simulated"),
        "with_drag.rms": ("rad", "rms residual with quadratic drag, tried above the noise"),
        "with_drag.parameters.PARAMETER": _VALUE,
    },
    "compare": {
        **_RECORDS,
        "findings[]": ("", "text of a finding about the whole experiment"),
        **_at("runs[]", _NAME | _RUN | _NO_TABLE | _PERCENT),
        "runs[].samples": ("1", "samples in use"),
        **_at("runs[]", _NOISE),
        "runs[].rms": ("rad", "rms residual of the model"),
        **_at("runs[].start", _START),
        **_at("runs[].quantities[]", _QUANTITY),
        "runs[].windows": ("1", "windows of a forced run, with a fitted start each"),
        **_at("runs[].start_stderr", {n: (u, "standard error") for n, (u, _) in _START.items()}),
        **_at("runs[].drive", _DRIVE),
        "runs[].phi.value, runs[].phi.stderr": ("rad", "fitted phase and its standard error"),
        "runs[].members": ("1", "simulated records of the ensemble"),
        "runs[].spread": ("rad", "standard deviation of their starts; in velocity times w0"),
        **_at("runs[].steady", _CYCLE),
        "runs[].steady.cycles": ("1", "cycles at the end of the record, averaged"),
        "runs[].steady.amplitude": ("rad", "half of the range of the angle, less the rotation"),
        **_at("runs[].steady.model[]", _CYCLE),
        "runs[].steady.model[].share": ("1", "share of the starts from which the model reaches it"),
        "runs[].steady.rms_theta": ("rad", "rms difference of the angles in a cycle"),
        "runs[].steady.rms_velocity": ("rad/s", "rms difference of the velocities"),
        "runs[].steady.amplitude_error_percent": ("percent", "error of the model's amplitude"),
        "runs[].findings[]": ("", "text of a finding about the run"),
        "left_out[].name, left_out[].why": ("", "run that is not compared, and the reason"),
    },
    "diagnose": {
        **_RECORDS,
        "verdict": ("", "none, named, partial, ambiguous or unknown"),
        "effects[].name": ("", "effect that the model lacks"),
        "effects[].parameters.PARAMETER": _VALUE,
        **_at("effects[]", _CI95),
        "effects[].probability": ("1", "probability of the name, if the library has the effect"),
        "effects[].approximate": (FLAG, "whether the form may only resemble the true one"),
        "effects[].closes": ("1", "share of the squared gap that it closes beside the others"),
        "effects[].elsewhere.PARAMETER": (SI, "other place, frequency or instant that fits too"),
        "equivalent[][]": ("", "effect of a class that the records do not distinguish"),
        **_at("gap", _GAP),
        "gap.held_out_noise_floor": ("rad", "noise_floor of what is held out"),
        "gap.held_out_before, gap.held_out_after": ("rad", "before and after, held out"),
        "gap.closed": ("1", "share of the squared gap that the named effects close"),
        "gap.closed_by_nearest": ("1", "share that the nearest effects close, claimed or not"),
        **_at("gap.runs[]", _NAME | _GAP),
        "gap.runs[].held_out": (FLAG, "whether these readings are held out"),
        "forecast[].runs": ("", "free or forced: the runs of the forecasts"),
        "forecast[].starts": ("1", "number of forecasts"),
        **_at("forecast[]", _FLOOR),
        "forecast[].horizon_s[]": ("s", "middle of a bin of the time ahead"),
        "forecast[].before[], forecast[].after[]": ("rad", "rms error of both, modulo a turn"),
        **_at("cycles[]", _NAME),
        "cycles[].held_out": (FLAG, "whether the whole run is held out"),
        **_at("cycles[]", {f"{n}.before, {n}.after": about for n, about in _PERCENT.items()}),
        "where[].over": ("", "angle, velocity, amplitude, drive_phase or lab_time"),
        "where[].unit": ("", "unit of from and to"),
        "where[].along_motion": (FLAG, "whether the torque is positive along the motion"),
        "where[].from, where[].to": (OTHER, "ends of a bin in which a torque is missing"),
        "where[].torque, where[].stderr": ("rad/s^2", "torque per inertia, and standard error"),
        "where[].z": ("1", "torque over standard error"),
        "next_experiment": ("", "record that would tell most, in words"),
        "detection_limits.EFFECT": (SI, "smallest size that is detected with 95 % probability"),
        "nearest[]": ("", "effect of the best model, claimed or not"),
        "left.z": ("1", "slow residuals beyond the noise, in standard errors"),
        "left.uneven": ("1", "scatter of parameters between runs, in standard errors"),
        "left.torque_by_chance": ("1", "p-value of the torque that the best model lacks"),
        "left.chance": ("1", "p-value of all tests of the best model together"),
        "left.chances.TEST": ("1", "p-value of a test: effects, torque, slow, runs, held_out"),
        "left.further": ("", "further effect with the most significant score"),
        "left.chi2_per_degree": ("1", "mean squared residual over noise, in the worst run"),
        "left.chi2_per_degree_held_out": ("1", "chi-squared per degree of freedom, held out"),
        "left.allowed": ("1", "largest chi2_per_degree that noise explains"),
        "baseline.PARAMETER": (SI, "value of a parameter of the baseline"),
        "set_to_zero[]": ("", "coefficient held at 0, which the fit would make negative"),
        "model_file.rms": ("rad", "rms residual of the written model"),
        "model_file.parameters.PARAMETER": (SI, "value in the model file"),
        **_at("parameters.PARAMETER", _ESTIMATE),
        **_at("runs.PARAMETER[]", {"value, stderr": (SI, "the same from one of the fitted runs")}),
        "ranking[].name": ("", "candidate, the best score first"),
        "ranking[].shape.PARAMETER": (SI, "shape with the best score"),
        "ranking[].score": ("1", "expected fall of chi-squared, in independent readings"),
        "ranking[].size": (SI, "expected size"),
        "not_computed.PART": ("", "reason why a part of this object was not computed"),
        "attempts[].effects[]": ("", "candidate that was fitted"),
        "attempts[].shape.PARAMETER": (SI, "shape of the first one"),
        "attempts[].score": ("1", "fall of chi-squared that its score promised"),
        "attempts[].bic_gain": ("1", "fall of chi-squared with the penalty of Schwarz"),
        "attempts[].held_out_gain": (
            "1",
            "smallest fall on a held-out set; null where it was not computed",
        ),
        "attempts[].accepted": (FLAG, "whether the search went on with it"),
        "attempts[].stage": ("1", "number of effects before"),
    },
}
"""Unit and meaning of all keys, by command and path."""
