"""The pendulum in SI, and its conversion to one without dimensions."""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING, Any

from pendmap.errors import InputError, check_keys, check_number, check_type
from pendmap.model import quantities
from pendmap.model.dynamics import Dynamics
from pendmap.model.effects import is_driven, library
from pendmap.model.pendulum import Pendulum, attributes_of, checked_effects, title_of
from pendmap.model.quantities import COUNTERPARTS, GROUPS, SI_KEYS
from pendmap.model.tables import model_arguments
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pendmap.model.effects import Effect


def own_name(effect: str) -> str | None:
    """Return the parameter of a :class:`Rig` with the same term as an effect, if any."""
    if effect not in library():
        return None
    parameters = library()[effect].parameters
    known = COUNTERPARTS.get(parameters[0].name)
    return known[0] if len(parameters) == 1 and known is not None else None


@dataclasses.dataclass(frozen=True)
class Rig(Dynamics):
    """The parametrically excited pendulum in SI.

    ``th'' + c_over_m th' + w0**2 (1 + p cos(Omega t + phi)) sin th = torque - Tr sign(th')``
    with further terms by ``effects``. :attr:`pendulum` is the same without dimensions, with
    ``tau = w0 t``: ``gamma = c_over_m / w0``, ``omega = Omega / w0``, ``theta_r = Tr / w0**2``.
    :meth:`of` takes length, damping ratio, stroke and hertz instead.

    Parameters
    ----------
    w0 : float
        Natural frequency ``sqrt(g / l)`` of small swings, rad/s; above 0.
    c_over_m : float
        Viscous damping ``c / m = 2 zeta w0``, 1/s; 0 or more.
    Tr : float
        Coulomb friction over the moment of inertia, rad/s^2; 0 or more.
    torque : float
        Constant torque over the moment of inertia, rad/s^2.
    p : float
        Amplitude ``Y Omega**2 / g`` of the pivot's vertical acceleration over gravity, where ``Y``
        is the amplitude of its motion: half the way from its lowest to its highest point.
    Omega : float
        Angular frequency of the drive, rad/s; above 0, or 0 where ``p`` is 0.
    phi : float
        Phase of the drive at ``t = 0``, rad.
    lab_time_s : float
        Time in the laboratory at ``t = 0``, s, for effects that drift.
    gravity : float
        Acceleration of gravity, m/s^2; above 0. Only stroke and length depend on it.
    effects : sequence of Effect
        Further terms, parameters in SI; kept as a tuple.
    notes : mapping
        Those of :class:`Pendulum`.
    given_stroke : float, optional
        Amplitude ``Y`` in m where :meth:`of` or a model file gives it in the place of ``p``: where
        the frequency varies it stays, else ``p``. None as soon as ``p`` is not ``Y Omega**2 / g``.

    Raises
    ------
    InputError
        If a value is not finite or outside its range, ``p`` has no frequency, an effect occurs
        twice, or one duplicates a parameter.

    References
    ----------
    Horton, Wiercigroch & Xu (2008), Phil. Trans. R. Soc. A, eqs. 1.1 and 2.1.
    """

    w0: float
    c_over_m: float = 0.0
    Tr: float = 0.0
    torque: float = 0.0
    p: float = 0.0
    Omega: float = 0.0
    phi: float = 0.0
    lab_time_s: float = 0.0
    gravity: float = quantities.GRAVITY
    effects: tuple[Effect, ...] = ()
    notes: Mapping[str, Any] = dataclasses.field(
        default_factory=dict, repr=False, compare=False, kw_only=True
    )
    given_stroke: float | None = dataclasses.field(
        default=None, repr=False, compare=False, kw_only=True
    )

    def __post_init__(self) -> None:
        for name in self.numbers():
            object.__setattr__(self, name, quantities.check(name, getattr(self, name)))
        if self.given_stroke is not None:
            stroke = check_number("given_stroke", self.given_stroke)
            if not self.Omega or self.p != quantities.amplitude(stroke, self.Omega, self.gravity):
                object.__setattr__(self, "given_stroke", None)
        parameters = {bare: (si, getattr(self, si)) for bare, (si, _) in COUNTERPARTS.items()}
        object.__setattr__(self, "effects", checked_effects(self.effects, parameters))
        if self.Omega == 0 and is_driven(self.p, self.effects):
            raise InputError("Omega must be a number above 0 where something is driven, got 0")
        try:
            _ = self.pendulum
        except InputError as error:
            raise InputError(f"{error} (without dimensions, w0 is {self.w0:g})") from None
        except ArithmeticError:
            raise InputError(
                f"effects must have smaller exponents: their powers of w0 = {self.w0:g} are no "
                "numbers"
            ) from None

    @classmethod
    def of(
        cls,
        *,
        effects: tuple[Effect, ...] = (),
        notes: Mapping[str, Any] | None = None,
        **given: float,
    ) -> Rig:
        """Return a rig from quantities in any of their notations.

        Parameters
        ----------
        effects, notes
            As for :class:`Rig`.
        **given : float
            ``w0`` or ``length_m`` (equivalent length ``g / w0**2``); ``c_over_m`` or ``zeta`` (the
            damping ratio ``c_over_m / (2 w0)``, which the paper's section 2 calls gamma); ``Omega``
            or ``frequency_hz``; ``p``, ``Y`` (amplitude of the pivot's motion, m) or ``stroke_mm``
            (the same in mm); ``Tr``, ``torque``, ``phi``, ``lab_time_s``, ``gravity``.

        Raises
        ------
        InputError
            If one is not known or outside its range, or two contradict: ``p`` and ``Omega`` a
            stroke, ``zeta`` a ``c_over_m``.

        Examples
        --------
        >>> rig = Rig.of(length_m=0.25, zeta=0.01, stroke_mm=20, frequency_hz=1.9)
        >>> round(rig.w0, 4), round(rig.p, 4), round(rig.pendulum.gamma, 4)
        (6.2642, 0.2906, 0.02)
        """
        check_keys("", given, SI_KEYS)
        numbers, stroke = quantities.resolve(given), quantities.stroke_of(given)
        return cls(**numbers, effects=effects, notes=notes or {}, given_stroke=stroke)

    def driven(self, **drive: float) -> Rig:
        """Return the rig with another drive; what is not given stays.

        Parameters
        ----------
        **drive : float
            ``p``, ``Y`` (amplitude of the pivot's motion, m) or ``stroke_mm`` (the same in mm);
            ``Omega`` or ``frequency_hz``; ``phi``.

        Raises
        ------
        InputError
            As for :meth:`of`.

        Examples
        --------
        >>> round(Rig(w0=6.2).driven(stroke_mm=20, frequency_hz=1.9).p, 4)
        0.2906
        """
        check_keys("", drive, (*GROUPS["p"], *GROUPS["Omega"], "phi"))
        return type(self).of(**model_arguments(self.to_dict(), drive)[1])

    @classmethod
    def from_pendulum(cls, pendulum: Pendulum, w0: float) -> Rig:
        """Return a pendulum without dimensions in SI, ``w0`` in rad/s; its covariance is dropped.

        Examples
        --------
        >>> Rig.from_pendulum(Pendulum(gamma=0.1, p=0.6, omega=2.0), 6.0).Omega
        12.0
        """
        check_type("pendulum", pendulum, Pendulum, "Pendulum(p=0.6)")
        units = Units(quantities.check("w0", w0), si=True)
        numbers = {
            si: units.given(getattr(pendulum, bare), power)
            for bare, (si, power) in COUNTERPARTS.items()
        }
        effects = tuple(effect.given(units) for effect in pendulum.effects)
        return cls(w0=units.w0, effects=effects, notes=_kept(pendulum.notes), **numbers)

    @property
    def units(self) -> Units:
        """The units of results."""
        return Units(self.w0, si=True)

    @functools.cached_property
    def pendulum(self) -> Pendulum:
        """The pendulum without dimensions; ``omega`` is 1 without drive."""
        units = self.units
        numbers = {
            bare: units.bare(getattr(self, si), power) for bare, (si, power) in COUNTERPARTS.items()
        }
        numbers["omega"] = numbers["omega"] or 1.0
        effects = tuple(effect.bare(units) for effect in self.effects)
        return Pendulum(**numbers, effects=effects, notes=_kept(self.notes))

    @property
    def zeta(self) -> float:
        """The damping ratio ``c_over_m / (2 w0)``, half of :attr:`Pendulum.gamma`."""
        return self.c_over_m / (2 * self.w0)

    @property
    def length_m(self) -> float:
        """The equivalent length ``gravity / w0**2``, m."""
        return self.gravity / self.w0**2

    @property
    def period(self) -> float:
        """The unit of "periods", s: ``2 pi / Omega``, or ``2 pi / w0`` without drive."""
        return float(self.units.given(self.pendulum.period, -1))

    @property
    def attributes(self) -> dict[str, float | str]:
        """The parameters as facts of a result, in SI, and the text of the model file.

        ``gamma``, ``omega``, ``phase`` and ``theta_r`` are among them, and ``misses_record``,
        residual over noise, of a model that misses the record it was fitted to.
        """
        return attributes_of(self, self.pendulum, ("gamma", "omega", "phase", "theta_r"))

    @property
    def title(self) -> str:
        """The parameters in one line, without zeros unless effects depend on them."""
        names = ("w0", "c_over_m", "p", "Omega", "phi", "torque", "Tr", "lab_time_s")
        return title_of(self, names, {"w0", "c_over_m", "p"})


def without_dimensions(model: Pendulum | Rig) -> tuple[Pendulum, Units]:
    """Return a model without dimensions, and the units of its results.

    Raises
    ------
    InputError
        If it is no model.

    Examples
    --------
    >>> pendulum, units = without_dimensions(Rig(w0=6.0, c_over_m=0.6))
    >>> round(pendulum.gamma, 3), units.name
    (0.1, 'SI')
    """
    if isinstance(model, Rig):
        return model.pendulum, model.units
    check_type("pendulum", model, Pendulum, "Pendulum(p=0.6)")
    return model, model.units


def _kept(notes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the notes that do not depend on units: all but the covariance."""
    return {name: table for name, table in notes.items() if name != "covariance"}
