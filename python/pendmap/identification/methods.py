"""All methods by their names, run on one record."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Protocol

from pendmap.errors import InputError
from pendmap.identification import combined, de_paula, energy_balance, log_decrement, repair

if TYPE_CHECKING:
    from collections.abc import Iterable

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from pendmap.identification.result import Identification

__all__ = ["METHODS", "Method", "identify"]


class Method(Protocol):
    """What every method is: a record in, an identification out."""

    def __call__(
        self,
        time: ArrayLike,
        theta: ArrayLike,
        *,
        sigma: float | None = None,
        trusted: ArrayLike | None = None,
    ) -> Identification:
        """Identify the damping in a record."""
        ...


METHODS: Final[dict[str, Method]] = {
    "combined": combined.identify,
    "combined_odd_ends": combined.identify_odd_ends,
    "combined_odd_triplets": combined.identify_odd_triplets,
    "combined_repaired": repair.identify,
    "log_decrement": log_decrement.identify,
    "de_paula": de_paula.identify,
    "energy_balance": energy_balance.identify,
}
"""Every method by its name, in the order of tables."""


class _Run(Protocol):
    """A run of an experiment, as far as it matters here."""

    @property
    def kind(self) -> str: ...
    @property
    def hold_out(self) -> bool: ...
    @property
    def time(self) -> NDArray[np.float64]: ...
    @property
    def theta(self) -> NDArray[np.float64]: ...
    @property
    def trusted(self) -> NDArray[np.bool_]: ...


class _Experiment(Protocol):
    """An experiment, as far as it matters here."""

    @property
    def runs(self) -> tuple[_Run, ...]: ...


def identify(
    record: _Experiment | ArrayLike,
    theta: ArrayLike | None = None,
    *,
    sigma: float | None = None,
    trusted: ArrayLike | None = None,
    methods: Iterable[str] | None = None,
) -> dict[str, Identification]:
    """Identify the damping of a pendulum by several methods.

    Parameters
    ----------
    record : experiment or array, shape (N,)
        An experiment, of which the longest free run that is not held out is used (each of these
        methods reads one decay), or times in s.
    theta : array, shape (N,), optional
        Angles from the downward rest, unwrapped, rad, where ``record`` holds times.
    sigma : float, optional
        Noise of a sample, rad; by default each method estimates it from the record.
    trusted : array of bool, shape (N,), optional
        Samples that may be used; an experiment brings its own.
    methods : iterable of str, optional
        Names of :data:`METHODS`; by default all.

    Returns
    -------
    dict of str to Identification
        By method. One that is not applicable is there too, and says why.

    Raises
    ------
    InputError
        If a method is not known, there is no free run, or the arrays are not a record.
    """
    names = list(METHODS) if methods is None else list(methods)
    unknown = [name for name in names if name not in METHODS]
    if unknown:
        raise InputError(f"method {unknown[0]!r} is not known: allowed are {', '.join(METHODS)}")
    runs: tuple[_Run, ...] | None = getattr(record, "runs", None)
    if runs is not None:
        if theta is not None or trusted is not None:
            raise InputError("theta is given with an experiment: allowed is one of them")
        free = [run for run in runs if run.kind == "free" and not run.hold_out]
        if not free:
            raise InputError("no run is free and not held out: allowed is a free decay to identify")
        run = max(free, key=lambda each: float(each.time[-1] - each.time[0]))
        time, theta, trusted = run.time, run.theta, run.trusted
    elif theta is None:
        raise InputError("theta is missing: allowed are times and angles, or an experiment")
    else:
        time = record  # type: ignore[assignment]
    return {n: METHODS[n](time, theta, sigma=sigma, trusted=trusted) for n in names}
