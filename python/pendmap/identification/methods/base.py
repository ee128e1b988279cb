"""What every method of identification gives back."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Final

from pendmap.formatting import Estimate, counted, estimate_text
from pendmap.model import Rig

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray


_Z95: Final = 1.959963984540054
"""The 97.5 % point of the standard normal distribution."""


@dataclasses.dataclass(frozen=True, repr=False)
class Identification:
    """The damping that one method finds in a record.

    Parameters
    ----------
    method : str
        Its name, as in the JSON of ``pendmap identify``.
    estimates : mapping of str to Estimate
        By the names of :class:`pendmap.Rig` (``w0`` in rad/s, ``c_over_m`` in 1/s, ``Tr`` in
        rad/s^2, ...) and ``offset`` (rad), whatever the method knows. ``zeta`` and ``theta_r``
        follow from them. Empty where the method is not applicable.
    used : str
        Which data it used, in words.
    warnings : tuple of str
        What speaks against trusting it.
    applicable : bool
        Whether the method can be applied to the record; if not, ``warnings`` say why.
    covariance : tuple of (tuple of str, ndarray) or None
        Names and covariance matrix of what was fitted together.
    misfit : float or None
        chi^2 per degree of freedom of the method's own model, where it has one.
    model : Rig or None
        The pendulum, where the method finds more of it than ``estimates`` tell: effects.
    converged : bool
        Whether its search came to an end; a model is made of no other.
    """

    method: str
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
        """The method and what it found, in a line; numbers in SI, their errors in brackets."""
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

        Errors by the delta method from the covariance; without one the errors of the two numbers
        count as independent.
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
            shared = self._shared(numerator, "w0")
            variance = (scale * over.stderr) ** 2 + (lever * w0.stderr) ** 2
            error = math.sqrt(max(variance + 2 * scale * lever * shared, 0.0))
            made[name] = Estimate(value, error, (value - _Z95 * error, value + _Z95 * error))
        return made

    def _shared(self, one: str, other: str) -> float:
        """The covariance of two estimates."""
        if self.covariance is None:
            return 0.0
        names, matrix = self.covariance
        if one not in names or other not in names:
            return 0.0
        return float(matrix[names.index(one), names.index(other)])

    @property
    def rig(self) -> Rig:
        """The pendulum that was found; what the method does not know is 0, and so is a negative
        damping, which no pendulum has.
        """  # noqa: D205 (one sentence)
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


# What a method of peaks says where a record has too few of them.


def too_few(  # noqa: PLR0913 (what is counted, and how it is said)
    method: str,
    count: int,
    least: int,
    *,
    of: int | None = None,
    where: str = "",
    warnings: Sequence[str] = (),
    because: str = "",
) -> Identification:
    """Return a method that cannot be applied, and how many peaks it lacks.

    Parameters
    ----------
    method : str
        Its name.
    count, least : int
        Peaks that it could use, and how many it needs.
    of : int, optional
        Peaks that the record has, where some of them lie outside what the method may use.
    where : str
        What the method may use, in words, like ``under 12 degrees``.
    warnings : sequence of str
        What was said before.
    because : str
        Why there are no more, in words.
    """
    peaks = counted(count, "peak") if of is None else f"{count} of {counted(of, 'peak')}"
    text = " ".join(part for part in (peaks, where) if part)
    text = f"not applicable: {text}, {least} are needed" + (f": {because}" if because else "")
    return Identification(method, warnings=(*warnings, text), applicable=False)
