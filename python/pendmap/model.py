"""The pendulum: its parameters, presets and model files."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from typing import TYPE_CHECKING, Final

from pendmap import checks
from pendmap.errors import InputError

if TYPE_CHECKING:
    import os

__all__ = ["PRESETS", "Pendulum"]


@dataclasses.dataclass(frozen=True)
class Pendulum:
    """The parametrically excited pendulum, without dimensions.

    ``th'' + gamma th' + (1 + p cos(omega tau + phase)) sin th = torque - theta_r sign(th')`` with
    ``tau = w0 t``, ``w0 = sqrt(g / l)``; ``th = 0`` hangs down. At rest it stays there while the
    load, ``torque`` less the term with ``sin th``, is no greater than ``theta_r``.

    Any real number will do for a parameter, numpy's too; a float is kept.

    Parameters
    ----------
    gamma : float
        Viscous damping ``c / (m w0)``, twice the damping ratio; 0 or more.
    p : float
        Amplitude ``Y Omega**2 / g`` of the pivot's vertical acceleration.
    omega : float
        Drive frequency ``Omega / w0``; above 0.
    phase : float
        Phase of the drive at ``tau = 0``, rad.
    torque : float
        Constant torque over ``m l**2 w0**2``.
    theta_r : float
        Coulomb friction ``Tr / w0**2``; 0 or more.

    Raises
    ------
    InputError
        If a value is not finite or outside its range.

    References
    ----------
    Horton, Wiercigroch & Xu (2008), Phil. Trans. R. Soc. A, eqs. 1.2 and 2.1.
    """

    gamma: float = 0.1
    p: float = 1.0
    omega: float = 2.0
    phase: float = 0.0
    torque: float = 0.0
    theta_r: float = 0.0

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = checks.number(field.name, getattr(self, field.name))
            object.__setattr__(self, field.name, value)
        for name in ("gamma", "theta_r"):
            if getattr(self, name) < 0:
                raise InputError(f"{name} is {getattr(self, name):g}: allowed is 0 or more")
        if self.omega <= 0:
            raise InputError(f"omega is {self.omega:g}: allowed is a number above 0")

    @property
    def period(self) -> float:
        """The unit of "periods": ``2 pi / omega``, or ``2 pi`` without drive."""
        return math.tau if self.p == 0 else math.tau / self.omega

    @property
    def parameters(
        self,
    ) -> tuple[float, float, float, float, float, float, float, list[tuple[str, list[float]]]]:
        """All that the kernel takes: the six of the class, time in the laboratory, effects."""
        own = (self.gamma, self.p, self.omega, self.phase, self.torque, self.theta_r)
        return (*own, 0.0, [])

    @property
    def title(self) -> str:
        """The parameters in one line, zeros left out."""
        shown = [("γ", self.gamma), ("p", self.p)]
        if self.p != 0:
            shown.append(("ω", self.omega))
        others = (("φ", self.phase), ("torque", self.torque), ("θr", self.theta_r))
        shown += [(name, value) for name, value in others if value != 0]
        return ", ".join(f"{name} = {value:g}" for name, value in shown)

    @classmethod
    def from_toml(cls, path: str | os.PathLike[str]) -> Pendulum:
        """Read a model file: a table ``[pendulum]`` with the parameters as keys.

        A key that the file leaves out is 0 (``omega``: 1, which has no effect without ``p``).

        Raises
        ------
        InputError
            If the file is not TOML, lacks the table, or has keys that are not known.
        OSError
            If it cannot be read.
        """
        with open(path, "rb") as file:  # noqa: PTH123 (any path-like)
            try:
                content = tomllib.load(file)
            except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
                raise InputError(f"{path}: not a TOML file: {error}") from error
        table = content.pop("pendulum", None)
        if not isinstance(table, dict):
            raise InputError(f"{path}: has no table [pendulum]")
        names = [field.name for field in dataclasses.fields(cls)]
        unknown = [*sorted(set(table) - set(names)), *(f"[{key}]" for key in sorted(content))]
        if unknown:
            allowed = ", ".join(names)
            raise InputError(
                f"{path}: {unknown[0]} is not known: allowed in [pendulum] are {allowed}"
            )
        if table.get("p", 0) != 0 and "omega" not in table:
            raise InputError(f"{path}: p without omega: a drive needs a frequency above 0")
        try:
            return cls(**({name: float(name == "omega") for name in names} | table))
        except InputError as error:
            raise InputError(f"{path}: {error}") from None


PRESETS: Final = {
    "fig2a": Pendulum(gamma=0.1, p=1.03, omega=0.87),
    "fig2b": Pendulum(gamma=0.1, p=1.7, omega=0.87),
    "fig2c": Pendulum(gamma=0.1, p=1.5, omega=1.8),
}
"""The three points of tumbling chaos in figure 2 of Horton, Wiercigroch & Xu (2008)."""
