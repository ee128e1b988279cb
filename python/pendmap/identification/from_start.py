"""From a record to a fit: a start that the record gives, then the search.

Where a rough start leads astray, a second one is taken from the methods of peaks.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.errors import FitDiverged, InputError
from pendmap.identification.fitting import TrajectoryFit, fit_runs
from pendmap.identification.rough import rough_start
from pendmap.identification.start import starting_values
from pendmap.model import Rig
from pendmap.model.effects import Effect

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from pendmap.identification.reading import Reading
    from pendmap.identification.runs import FitRun

__all__ = ["OFFSET", "TooShortError", "fit_from_start"]

OFFSET: Final = "encoder_offset"
"""The effect that is the sensor's zero."""
POOR: Final = 0.1
"""Residuals above this part of the record's own scatter are no fit: the search went astray."""


LACKING: Final = 4.0
"""Where the sum of squares is so many times what noise makes of it, the model lacks more than the
noise: by its law the slowest readings alone would say what the model is."""


class TooShortError(InputError):
    """The record gives no start: fewer than two half swings, or none that fall."""


def fit_from_start(  # noqa: PLR0913 (records, and what is known of them)
    runs: Sequence[FitRun],
    readings: Sequence[Reading],
    *,
    start: Rig | Mapping[str, float] | None = None,
    offset: bool = True,
    friction: bool = True,
    effects: Sequence[Effect | str] = (),
    free: Sequence[str] | None = None,
) -> tuple[TrajectoryFit, tuple[Reading, ...]]:
    """Return the fit to several records, from a start that the first gives, and their readings.

    Where a rough start leads to a poor fit, a second one begins where the methods of peaks, or a
    global search over their envelope, say; the better one counts. Readings whose noise grows with
    speed count by it, unless the model lacks more than the noise: then they count alike.

    Parameters
    ----------
    runs, readings : sequence
        The records, and what their readings are worth.
    start, offset, friction, effects, free
        As of :func:`identify`; effects may be names, whose sizes then begin small.

    Raises
    ------
    TooShortError
        If the first record gives no start and none is given.
    """
    first = runs[0]
    good = np.ones(first.time.shape, bool) if first.trusted is None else first.trusted
    time, theta = first.time[good], first.angle[good]
    doubt = max(reading.doubt for reading in readings)
    names = ["w0", "c_over_m", *(["Tr"] if friction else [])]
    # A sensor on the rod does not see where the angle is 0; it has a bias instead.
    zeroed = offset and any(run.rod_sensor is None for run in runs)

    def fitted(begin: Rig | Mapping[str, float] | None) -> TrajectoryFit:
        model = _start_of(begin, time, theta, readings[0].sigma)
        if not friction:
            model = dataclasses.replace(model, Tr=0.0)
        named = [Effect.blank(e, model.units) if isinstance(e, str) else e for e in effects]
        known = [*model.effects, *named]
        zero = [OFFSET] if zeroed and OFFSET not in {e.name for e in known} else []
        more = [Effect(name, {"d": 0.0}) for name in zero]
        model = dataclasses.replace(model, effects=(*known, *more))
        wanted = _sizes(known) if free is None else free
        return fit_runs(runs, model, [*names, *wanted, *_sizes(more)], sigma_doubt=doubt)

    found = fitted(start)
    if found.widening > LACKING and any(reading.law for reading in readings):
        readings = [dataclasses.replace(r, each=r.alike, law=None) for r in readings]
        runs = [
            dataclasses.replace(run, sigma=r.each) for run, r in zip(runs, readings, strict=True)
        ]
        found = fitted(start)
    poor = not found.converged or found.rms > POOR * float(np.std(theta))
    if isinstance(start, Rig) or not poor:
        return found, tuple(readings)
    try:
        found_by_peaks = _by_peaks(time, theta, readings[0].sigma)
        again = fitted(dict(start or {}) | found_by_peaks)
    except (FitDiverged, TooShortError):
        return found, tuple(readings)
    better = (again.converged, -again.chi2) > (found.converged, -found.chi2)
    return again if better else found, tuple(readings)


def _sizes(effects: Sequence[Effect]) -> list[str]:
    """Return the names of all parameters of effects but those of shape."""
    return [f"{effect.name}.{size}" for effect in effects for size in effect.sizes]


def _start_of(
    start: Rig | Mapping[str, float] | None,
    time: NDArray[np.float64],
    theta: NDArray[np.float64],
    sigma: float,
) -> Rig:
    """Return where a search starts: what is given, the rest from the half swings of the record.

    Raises
    ------
    TooShortError
        If ``w0`` is not known and the record gives no start.
    """
    if isinstance(start, Rig):
        return start
    known: dict[str, Any] = dict(start or {})
    if "w0" not in known:
        known = (rough_start(time, theta, sigma) or _by_peaks(time, theta, sigma)) | known
    return Rig(**known)


def _by_peaks(
    time: NDArray[np.float64], theta: NDArray[np.float64], sigma: float
) -> dict[str, float]:
    """Return a start from the methods of peaks, which know rotations too."""
    try:
        start = starting_values(time, theta, sigma=sigma)
    except InputError:
        start = None
    if start is None or start.source == "guess":
        raise TooShortError(
            "the record must show three half swings or more of a free decay, or a natural frequency"
            " must be given: w0 = 6.2 under [rig] in experiment.toml"
        )
    return {"w0": start.w0, "c_over_m": start.c_over_m, "Tr": start.Tr}
