"""Common result type of all methods of identification, and helpers for methods of peaks."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np

from pendmap.formatting import Estimate, counted, estimate_text
from pendmap.identification.parameters import OPPOSING, PLACES, widened
from pendmap.identification.results import Parameters
from pendmap.identification.uncertainty import computed_from
from pendmap.model import Rig
from pendmap.signal.robust import Z95

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pendmap.formatting import Table
    from pendmap.identification.results import Covariance
    from pendmap.signal import Floats


NEEDS_SAMPLES: Final = "the record has peaks only, and this method needs every sample"
MISFIT: Final = 2.0  # chi^2 per degree of freedom above which a method of peaks warns


@dataclasses.dataclass(frozen=True, repr=False)
class Identification(Parameters):
    """Damping identified by one method from a record.

    Parameters
    ----------
    method : str
        Name in the registry, as in the JSON of ``pendmap identify``.
    estimates : mapping of str to Estimate
        Estimates by the names of :class:`pendmap.Rig` (``w0`` in rad/s, ``c_over_m`` in 1/s, ``Tr``
        in rad/s^2, ...) and ``offset`` (rad), as far as the method gives them. ``zeta`` and
        ``theta_r`` are derived from them. Empty if the method is not applicable.
    used : str
        Description of the data used.
    warnings : tuple of str
        Reasons to doubt the result.
    applicable : bool
        Whether the method can be applied to the record; if not, ``warnings`` give the reason.
    covariance : tuple of (tuple of str, ndarray) or None
        Names and covariance matrix of the jointly fitted parameters.
    misfit : float or None
        chi^2 per degree of freedom of the method's model, if it has one.
    model : Rig or None
        Identified model, if the method fits effects in addition to ``estimates``.
    converged : bool
        Whether the search converged; if not, no model is returned.
    """

    KIND: ClassVar[str] = "identification_by_method"

    method: str = ""
    estimates: Mapping[str, Estimate] = dataclasses.field(default_factory=dict)
    used: str = ""
    warnings: tuple[str, ...] = ()
    applicable: bool = True
    covariance: tuple[tuple[str, ...], Floats] | None = None
    misfit: float | None = None
    model: Rig | None = None
    converged: bool = True
    sensors: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<Identification {self.short}>"

    def text_parts(self) -> tuple[list[Table], list[str]]:
        """Return the table of the parameters, the data used and the warnings."""
        return [self.parameter_table()], [line for line in (self.used, *self.warnings) if line]

    @property
    def parameters(self) -> Mapping[str, Estimate]:
        """Estimates, and those derived from them."""
        return {**self.estimates, **self.derived}

    @property
    def joint_covariance(self) -> Covariance | None:
        """Names and covariance matrix of the estimates."""
        return self.covariance

    @property
    def short(self) -> str:
        """Method and estimates in one line; numbers in SI, standard errors in parentheses."""
        if not self.applicable:
            return f"{self.method}: {'; '.join(self.warnings)}"
        text = ", ".join(
            f"{name} = {estimate_text(estimate)}" for name, estimate in self.estimates.items()
        )
        return f"{self.method}: {text}" + ("" if self.converged else "; did not converge")

    @property
    def sound(self) -> bool:
        """Whether the result gives a model: it converged, with a positive finite w0.

        A damping coefficient whose whole 95 % interval is below 0 gives none.
        """
        w0 = self.estimates["w0"].value if "w0" in self.estimates else math.nan
        damping = [self.estimates[name] for name in OPPOSING if name in self.estimates]
        driven = any(estimate.ci95 is not None and estimate.ci95[1] < 0 for estimate in damping)
        return self.applicable and self.converged and 0 < w0 < math.inf and not driven

    def with_clock(self, stderr: float) -> Identification:
        """Return the result with the relative standard error of a sampling interval added."""
        further = {n: stderr * PLACES[n][1] * self[n] for n in self.estimates if n in PLACES}
        estimates = {}
        for name, e in self.estimates.items():
            more = further.setdefault(name, 0.0)
            error = None if e.stderr is None else math.hypot(e.stderr, more)
            ends = None if e.ci95 is None else widened(e.value, e.ci95, more)
            estimates[name] = Estimate(e.value, error, ends)
        covariance = self.covariance
        if covariance is not None:
            both = [further[name] for name in covariance[0]]
            covariance = covariance[0], covariance[1] + np.outer(both, both)
        return dataclasses.replace(self, estimates=estimates, covariance=covariance)

    @property
    def zero(self) -> float:
        """Zero error of the sensor, rad; 0 if the method estimates none."""
        return self["offset"] if "offset" in self.estimates else 0.0

    def __getitem__(self, name: str) -> float:
        """Return the value of one estimate."""
        return self.estimates[name].value

    @property
    def derived(self) -> dict[str, Estimate]:
        """Derived ``zeta = c_over_m / (2 w0)`` and ``theta_r = Tr / w0**2`` (rad), as far as known.

        Errors are by the delta method; without a covariance the parameters are independent.
        """
        given = {n: e for n, e in self.estimates.items() if n in ("w0", *OPPOSING)}

        def quantities(p: dict[str, float]) -> dict[str, float]:
            made = {"zeta": ("c_over_m", 2 * p["w0"]), "theta_r": ("Tr", p["w0"] ** 2)}
            return {n: p[over] / under for n, (over, under) in made.items() if over in p}

        return computed_from(given, self.covariance, quantities) if "w0" in given else {}

    @property
    def rig(self) -> Rig:
        """Identified pendulum; missing parameters and negative damping are 0."""
        if self.model is not None:
            return self.model
        known: dict[str, Any] = {
            n: e.value for n, e in self.estimates.items() if n in Rig.numbers()
        }
        known |= {n: max(known[n], 0.0) for n in OPPOSING if n in known}
        if not math.isfinite(known.get("w0", math.nan)):
            raise ValueError(f"{self.method} found no w0")
        return Rig(**known)


def inapplicable(reason: str, warnings: Sequence[str] = ()) -> Identification:
    """Return the result of a method that cannot be applied."""
    return Identification(warnings=(*warnings, f"not applicable: {reason}"), applicable=False)


def too_few(  # noqa: PLR0913, PLR0917 (what is counted, and why)
    count: int, least: int, total: int, where: str = "", warnings: Sequence[str] = (), why: str = ""
) -> Identification:
    """Return an inapplicable result: ``count`` of ``total`` peaks, but ``least`` are needed."""
    peaks = f"{count} of {counted(total, 'peak')} {where}".strip()
    return inapplicable(f"{peaks}, {least} are needed{why}", warnings)


def identified(  # noqa: PLR0913 (all of a result)
    names: tuple[str, ...],
    values: Floats,
    covariance: Floats,
    *,
    used: str,
    warnings: Sequence[str],
    misfit: float | None = None,
    intervals: Mapping[str, tuple[float, float]] | None = None,
) -> Identification:
    """Return a result with normal 95 % intervals unless they are given; errors of 0 are unknown.

    A warning is added for each negative damping parameter.
    """
    estimates, negative, known = {}, [], bool(np.any(covariance))
    for name, value, variance in zip(names, values.tolist(), np.diag(covariance), strict=True):
        error = math.sqrt(max(float(variance), 0.0))
        normal = (value - Z95 * error, value + Z95 * error)
        ci95 = (intervals or {}).get(name, normal)
        estimates[name] = Estimate(value, error, ci95) if known else Estimate(value)
        if name in OPPOSING and value < 0:
            negative.append(f"unphysical: {name} is {value:.4g}, below 0")
    return Identification(
        estimates=estimates,
        used=used,
        warnings=(*warnings, *negative),
        covariance=(names, np.asarray(covariance)) if known else None,
        misfit=misfit,
    )
