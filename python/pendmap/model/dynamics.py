"""The equation of motion of a model as functions of time and state, evaluated by the core."""

from __future__ import annotations

import abc
import tomllib
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from pendmap.errors import InputError, check_type, core_errors, short_repr
from pendmap.model.tables import model_arguments, model_text
from pendmap.units import TIME, VELOCITY

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from pendmap.units import Units

    Floats = NDArray[np.float64]

ACCELERATION = 2  # Power of ``w0`` of an acceleration


class Dynamics(abc.ABC):
    """Acceleration, its derivatives, and the right-hand side of the equation of motion.

    Time in the laboratory goes on, as in :func:`pendmap.simulate`. Friction opposes the velocity;
    at a velocity 0 it holds the pendulum, whose acceleration and derivatives are 0 then, unless the
    load exceeds it, and opposes the motion that the load begins. Effects on the reading have no
    part in the motion.
    """

    @property
    @abc.abstractmethod
    def units(self) -> Units:
        """The units of arguments and results."""

    @classmethod
    def numbers(cls) -> tuple[str, ...]:
        """Return the names of the parameters that are numbers."""
        return tuple(name for name, kind in cls.__annotations__.items() if kind == "float")

    def to_dict(self) -> dict[str, Any]:
        """Return the model as the tables of its file: dicts, lists, numbers and texts.

        Raises
        ------
        TypeError, ValueError
            If the notes are no tables for TOML.

        Examples
        --------
        >>> import pendmap
        >>> pendmap.Rig(w0=6.2, c_over_m=0.05).to_dict()["pendulum"]["c_over_m"]
        0.05
        """
        return tomllib.loads(model_text(self))

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        """Return the model of :meth:`to_dict`, or of tables like those of a model file.

        Parameters
        ----------
        content : dict
            ``pendulum``, and if there are any ``effect``, ``formula``, ``covariance`` and
            ``provenance``.

        Raises
        ------
        InputError
            As for :func:`pendmap.load_model`, or if it is a model of the other class.

        Examples
        --------
        >>> import pendmap
        >>> pendmap.Pendulum.from_dict({"pendulum": {"gamma": 0.2, "p": 0.6, "omega": 2}}).gamma
        0.2
        """
        check_type("content", content, dict, "{'pendulum': {'w0': 6.2}}")
        in_si, arguments = model_arguments(content, {})
        of = getattr(cls, "of", None)
        if in_si != (of is not None):
            wanted = "without dimensions" if of is None else "in SI"
            raise InputError(f"content must be a model {wanted}, got one of the other kind")
        return (of or cls)(**arguments)

    def acceleration(self, t: ArrayLike, theta: ArrayLike, v: ArrayLike) -> Floats:
        """Return ``th''``, with all effects and friction.

        Parameters
        ----------
        t, theta, v : array_like
            Time, angle in rad and velocity, ``1 / w0`` and ``w0`` being the units of a
            :class:`pendmap.Pendulum`, s and rad/s those of a :class:`pendmap.Rig`; of shapes that
            broadcast.

        Returns
        -------
        ndarray
            In units of ``w0**2`` or rad/s^2, of the common shape.

        Raises
        ------
        InputError
            If one is not finite, shapes do not broadcast, or an effect depends on more than these
            three: on the last turn or on a mode of the rig.

        Examples
        --------
        >>> import pendmap
        >>> pendmap.Pendulum(gamma=0.1, p=0.5).acceleration(0.0, [0.0, 1.0], 0.2).round(4)
        array([-0.02  , -1.2822])
        """
        return self._rates(t, theta, v)[0]

    def jacobian(self, t: ArrayLike, theta: ArrayLike, v: ArrayLike) -> Floats:
        """Return the derivative of :meth:`rhs` by the state: ``[[0, 1], [da/dth, da/dv]]``, exact.

        Arguments and errors are those of :meth:`acceleration`.

        Returns
        -------
        ndarray, shape (..., 2, 2)
            One matrix for each state, rows ``th'`` and ``v'``, columns ``th`` and ``v``.

        Examples
        --------
        >>> import pendmap
        >>> pendmap.Pendulum(gamma=0.1, p=0.5).jacobian(0.0, 0.0, 0.2)
        array([[ 0. ,  1. ],
               [-1.5, -0.1]])
        """
        _, by_theta, by_velocity = self._rates(t, theta, v)
        numbers = np.zeros((*by_theta.shape, 2, 2))
        numbers[..., 0, 1], numbers[..., 1, 0], numbers[..., 1, 1] = 1.0, by_theta, by_velocity
        return numbers

    def rhs(self, t: float, y: ArrayLike) -> Floats:
        """Return ``[th', th'']`` of a state, for ``scipy.integrate.solve_ivp``.

        Coulomb friction jumps where the velocity changes its sign: a general integrator takes ever
        smaller steps there, and does not end once the pendulum sticks. :func:`pendmap.simulate`
        passes such points exactly.

        Parameters
        ----------
        t : float
            Time, as for :meth:`acceleration`.
        y : array_like, shape (2,) or (2, k)
            Angle and velocity, of k states with ``vectorized=True``.

        Raises
        ------
        InputError
            If ``y`` has another shape; else as for :meth:`acceleration`.

        Examples
        --------
        >>> from scipy.integrate import solve_ivp
        >>> import pendmap
        >>> model = pendmap.Pendulum(gamma=0.1, p=0.6, omega=2.0)
        >>> run = solve_ivp(model.rhs, (0.0, 20.0), [1.0, 0.0], rtol=1e-10, atol=1e-10)
        >>> round(float(run.y[0, -1]), 3)
        0.446
        """
        state = np.asarray(y, dtype=np.float64)
        if state.ndim not in {1, 2} or state.shape[0] != 2:  # noqa: PLR2004 (angle and velocity)
            raise InputError(f"y must have the shape (2,) or (2, k), got {state.shape}")
        return np.stack([state[1], self.acceleration(t, *state)])

    def _rates(self, *given: ArrayLike) -> list[Floats]:
        """Return the acceleration and its derivatives by angle and velocity."""
        from pendmap import _core  # noqa: PLC0415 (deferred import of the core)

        bare: Any = getattr(self, "pendulum", self)
        units = self.units
        arrays = [_finite(name, x) for name, x in zip(("t", "theta", "v"), given, strict=True)]
        try:
            shape = np.broadcast_shapes(*(array.shape for array in arrays))
        except ValueError:
            shapes = ", ".join(str(array.shape) for array in arrays)
            raise InputError(
                f"t, theta and v must have shapes that broadcast, got {shapes}"
            ) from None
        scaled = units.bare(arrays[0], TIME), arrays[1], units.bare(arrays[2], VELOCITY)
        flat = [np.ascontiguousarray(np.broadcast_to(array, shape)).ravel() for array in scaled]
        with core_errors():
            numbers = _core.rates(bare, *flat)
        powers = (ACCELERATION, ACCELERATION, ACCELERATION - VELOCITY)
        return [
            units.given(values.reshape(shape), power)
            for values, power in zip(numbers, powers, strict=True)
        ]


def _finite(name: str, given: ArrayLike) -> Floats:
    try:
        array = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.array(np.nan)
    if not np.isfinite(array).all():
        raise InputError(f"{name} must be finite numbers, got {short_repr(given)}")
    return array
