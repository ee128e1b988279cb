"""The pendulum without dimensions: its parameters, effects and presets."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from typing import TYPE_CHECKING, Any, Final

from pendmap.errors import InputError, check_number, check_type, core_errors, short_repr
from pendmap.model.covariance import misses
from pendmap.model.dynamics import Dynamics
from pendmap.model.effects import Effect, is_driven
from pendmap.model.labels import LABELS, unit_of
from pendmap.model.tables import effects_in, model_text
from pendmap.units import NONDIMENSIONAL, Units

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


@dataclasses.dataclass(frozen=True)
class Pendulum(Dynamics):
    """The parametrically excited pendulum, without dimensions.

    ``th'' + gamma th' + (1 + p cos(omega tau + phase)) sin th = torque - theta_r sign(th')`` with
    ``tau = w0 t``, ``w0 = sqrt(g / l)``; ``th = 0`` hangs down. At rest it stays there while the
    load, ``torque`` less the term with ``sin th``, is no greater than ``theta_r``.

    ``effects`` of the library, and formulas (:class:`pendmap.Formula`), add further terms.
    A parameter may be any real number; a float is kept.

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
    lab_time : float
        Time in the laboratory at ``tau = 0``, times ``w0``, for effects that drift.
    effects : sequence of Effect
        Further terms, parameters without dimensions; kept as a tuple.
    notes : mapping
        ``covariance`` and ``provenance`` of its model file, written back unchanged and not
        compared.

    Raises
    ------
    InputError
        If a value is not finite or outside its range, an effect occurs twice, or one duplicates a
        parameter: ``viscous_damping`` beside ``gamma``, ``coulomb_friction`` beside ``theta_r``,
        ``bias_torque`` beside ``torque``.

    References
    ----------
    Horton, Wiercigroch & Xu (2008), Phil. Trans. R. Soc. A, eqs. 1.2 and 2.1.

    Examples
    --------
    >>> Pendulum(gamma=0.2, p=0.6, omega=2.0).zeta
    0.1
    """

    gamma: float = 0.1
    p: float = 1.0
    omega: float = 2.0
    phase: float = 0.0
    torque: float = 0.0
    theta_r: float = 0.0
    lab_time: float = 0.0
    effects: tuple[Effect, ...] = ()
    notes: Mapping[str, Any] = dataclasses.field(
        default_factory=dict, repr=False, compare=False, kw_only=True
    )

    def __post_init__(self) -> None:
        for name in self.numbers():
            object.__setattr__(self, name, check_number(name, getattr(self, name)))
        for name in ("gamma", "theta_r"):
            if getattr(self, name) < 0:
                raise InputError(f"{name} must be 0 or more, got {getattr(self, name):g}")
        if self.omega <= 0:
            raise InputError(f"omega must be a number above 0, got {self.omega:g}")
        parameters = {name: (name, getattr(self, name)) for name in self.numbers()}
        object.__setattr__(self, "effects", checked_effects(self.effects, parameters))
        if self.effects:
            _ = self.period  # the core refuses effects that occur twice or are outside their range

    @property
    def units(self) -> Units:
        """The units of results."""
        return NONDIMENSIONAL

    @property
    def zeta(self) -> float:
        """The damping ratio ``gamma / 2``, gamma in the paper's section 2."""
        return self.gamma / 2

    @property
    def period(self) -> float:
        """The unit of "periods": ``2 pi / omega``, or ``2 pi`` without drive.

        Effects may change the drive's frequency, or drive where ``p`` is 0.
        """
        if not self.effects:
            return math.tau if self.p == 0 else math.tau / self.omega
        from pendmap import _core  # noqa: PLC0415 (only models with effects need it)

        with core_errors():
            return _core.period(self)

    @property
    def counts_turns(self) -> bool:
        """Whether the torque differs after a turn, so that angles are not wrapped."""
        if not self.effects:
            return False
        from pendmap import _core  # noqa: PLC0415 (only models with effects need it)

        return _core.counts_turns(self)

    @property
    def attributes(self) -> dict[str, float | str]:
        """The parameters as a dataset's attributes, like those of a :class:`pendmap.Rig`."""
        return attributes_of(self, self)

    @property
    def title(self) -> str:
        """The parameters in one line, without zeros unless effects depend on them."""
        driven = is_driven(self.p, self.effects)
        names = [name for name in self.numbers() if driven or name != "omega"]
        return title_of(self, names, {"gamma", "p"})


def checked_effects(
    effects: object, parameters: Mapping[str, tuple[str, float]]
) -> tuple[Effect, ...]:
    """Return effects as a tuple; refuse one that repeats a parameter of a model.

    ``parameters`` has the model's name and value of each parameter of a :class:`Pendulum`.
    """
    if not isinstance(effects, list | tuple):
        raise InputError(f"effects must be a tuple of Effect, got {short_repr(effects)}")
    for effect in effects:
        check_type("effects", effect, Effect, "Effect('quadratic_drag', {'q': 0.01})")
        if effect.formula is not None:
            continue
        # The only parameter of an effect that duplicates one of the model has its name.
        names = [parameter.name for parameter in effect.definition.parameters]
        if len(names) == 1 and names[0] in parameters:
            called, value = parameters[names[0]]
            if value != 0:
                raise InputError(
                    f"{called} is {value:g}, the same term as the effect {effect.name}: "
                    f"one of them must be left out (or {called} = 0)"
                )
    return tuple(effects)


def title_of(
    model: Any,  # noqa: ANN401 (a Pendulum or a Rig)
    names: Sequence[str],
    always: set[str],
) -> str:
    """Return one line: parameters not 0 or shown ``always``, the last if effects drift; effects."""
    shown = always | ({names[-1]} if any(effect.drifts for effect in model.effects) else set())
    parts = []
    for name in names:
        value = getattr(model, name)
        if value != 0 or name in shown:
            unit = unit_of(name) if model.units.si and name != "phi" else ""
            parts.append(f"{LABELS[name].symbol} = {value:g} {unit}".rstrip())
    return ", ".join([*parts, *(effect.title(model.units) for effect in model.effects)])


def attributes_of(
    model: Any,  # noqa: ANN401 (a Pendulum or a Rig)
    pendulum: Pendulum,
    further: tuple[str, ...] = (),
) -> dict[str, float | str]:
    """Return a model's facts in a result, with ``further`` ones of the pendulum without dimensions.

    ``model`` is the text of its model file; ``angle`` is ``line`` where an effect counts turns.
    """
    numbers = {name: getattr(model, name) for name in model.numbers()}
    bare = {name: getattr(pendulum, name) for name in further}
    try:
        text = model_text(model)
    except (TypeError, ValueError):  # notes that no file can hold
        text = model_text(dataclasses.replace(model, notes={}))
    angle = {"angle": "line"} if pendulum.counts_turns else {}
    facts = {"units": model.units.name} | numbers | bare | {"model": text} | angle
    ratio = misses(model.notes)
    return facts | ({"misses_record": ratio} if math.isfinite(ratio) else {})


def effects_of(attributes: Mapping[Any, Any]) -> tuple[Effect, ...]:
    """Return the effects of the model that a result's attributes contain, formulas included.

    Examples
    --------
    >>> effects_of(Pendulum(effects=(Effect("quadratic_drag", {"q": 0.01}),)).attributes)[0].values
    [0.01]
    """
    return effects_in(tomllib.loads(attributes.get("model", "")))


PRESETS: Final = {
    "fig2a": Pendulum(gamma=0.1, p=1.03, omega=0.87),
    "fig2b": Pendulum(gamma=0.1, p=1.7, omega=0.87),
    "fig2c": Pendulum(gamma=0.1, p=1.5, omega=1.8),
}
"""The three points of tumbling chaos in figure 2 of Horton, Wiercigroch & Xu (2008)."""
