"""Result of every method of identification, and what methods of peaks share."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.formatting import Estimate, counted, estimate_text
from pendmap.identification.uncertainty import Z95
from pendmap.model import Rig

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray


MISFIT: Final = 2.0  # chi^2 per degree of freedom above which a method of peaks warns


@dataclasses.dataclass(frozen=True, repr=False)
class Identification:
    """The damping that one method finds in a record.

    Parameters
    ----------
    method : str
        Its name in the registry, as in the JSON of ``pendmap identify``.
    estimates : mapping of str to Estimate
        By the names of :class:`pendmap.Rig` (``w0`` in rad/s, ``c_over_m`` in 1/s, ``Tr`` in
        rad/s^2, ...) and ``offset`` (rad), those that the method gives. ``zeta`` and ``theta_r``
        follow from them. Empty where the method is not applicable.
    used : str
        Data that it used, in words.
    warnings : tuple of str
        Reasons to doubt it.
    applicable : bool
        Whether the method can be applied to the record; if not, ``warnings`` say why.
    covariance : tuple of (tuple of str, ndarray) or None
        Names and covariance matrix of what was fitted together.
    misfit : float or None
        chi^2 per degree of freedom of the method's own model, where it has one.
    model : Rig or None
        The pendulum, where the method finds effects beside ``estimates``.
    converged : bool
        Whether its search converged; no model is made of others.
    """

    method: str = ""
    estimates: Mapping[str, Estimate] = dataclasses.field(default_factory=dict)
    used: str = ""
    warnings: tuple[str, ...] = ()
    applicable: bool = True
    covariance: tuple[tuple[str, ...], NDArray[np.float64]] | None = None
    misfit: float | None = None
    model: Rig | None = None
    converged: bool = True

    def __repr__(self) -> str:
        return f"<Identification {self.short}>"

    @property
    def short(self) -> str:
        """Method and estimates on a line; numbers in SI, standard errors in brackets."""
        if not self.applicable:
            return f"{self.method}: {'; '.join(self.warnings)}"
        found = ", ".join(
            f"{name} = {estimate_text(each)}" for name, each in self.estimates.items()
        )
        return f"{self.method}: {found}" + ("" if self.converged else "; did not converge")

    @property
    def sound(self) -> bool:
        """Whether a model can be made of it: it converged, to a w0 that a pendulum may have."""
        w0 = self.estimates["w0"].value if "w0" in self.estimates else math.nan
        return self.applicable and self.converged and 0 < w0 < math.inf

    def __getitem__(self, name: str) -> float:
        """Return the value of one estimate."""
        return self.estimates[name].value

    @property
    def derived(self) -> dict[str, Estimate]:
        """``zeta = c_over_m / (2 w0)`` and ``theta_r = Tr / w0**2`` (rad), as far as known.

        Errors follow by the delta method; without a covariance the two numbers are independent.
        """
        made = {}
        for name, numerator, power in (("zeta", "c_over_m", 1), ("theta_r", "Tr", 2)):
            if numerator not in self.estimates or "w0" not in self.estimates:
                continue
            over, w0 = self.estimates[numerator], self.estimates["w0"]
            scale = 1 / (2 * w0.value) if power == 1 else 1 / w0.value**2
            value = over.value * scale
            if over.stderr is None or w0.stderr is None:
                made[name] = Estimate(value)
                continue
            lever = -power * value / w0.value
            names, matrix = self.covariance or ((), np.empty((0, 0)))
            both = {numerator, "w0"} <= set(names)
            shared = float(matrix[names.index(numerator), names.index("w0")]) if both else 0.0
            variance = (scale * over.stderr) ** 2 + (lever * w0.stderr) ** 2
            error = math.sqrt(max(variance + 2 * scale * lever * shared, 0.0))
            made[name] = Estimate(value, error, (value - Z95 * error, value + Z95 * error))
        return made

    @property
    def rig(self) -> Rig:
        """The pendulum that was found; parameters not found, and negative damping, are 0."""
        if self.model is not None:
            return self.model
        known: dict[str, Any] = {
            n: e.value for n, e in self.estimates.items() if n in Rig.numbers()
        }
        for name in ("c_over_m", "Tr"):
            if name in known:
                known[name] = max(known[name], 0.0)
        if not math.isfinite(known.get("w0", math.nan)):
            raise ValueError(f"{self.method} found no w0")
        return Rig(**known)


def too_few(  # noqa: PLR0913, PLR0917 (what is counted, and how it is worded)
    count: int,
    least: int,
    total: int | None = None,
    where: str = "",
    warnings: Sequence[str] = (),
    because: str = "",
) -> Identification:
    """Return that a method needs ``least`` peaks ``where`` a record of ``total`` has ``count``."""
    peaks = counted(count, "peak") if total is None else f"{count} of {counted(total, 'peak')}"
    text = f"not applicable: {f'{peaks} {where}'.strip()}, {least} are needed" + (
        f": {because}" if because else ""
    )
    return Identification(warnings=(*warnings, text), applicable=False)


def unphysical(values: Mapping[str, float]) -> list[str]:
    """Return a warning for each damping below 0."""
    return [
        f"unphysical: {name} is {values[name]:.4g}, below 0"
        for name in ("c_over_m", "Tr")
        if values.get(name, 0.0) < 0
    ]
