"""Models drawn from the covariance of a model file."""

from __future__ import annotations

import dataclasses
import warnings
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.sweep import with_values
from pendmap.errors import MOST_DRAWS, MOST_SEED, InputError, check_whole, short_repr
from pendmap.formatting import counted
from pendmap.model.covariance import covariance_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    import xarray as xr
    from numpy.typing import NDArray

    from pendmap.analysis.numerics import Progress
    from pendmap.model import Pendulum, Rig

    Run = Callable[..., xr.Dataset]
    """Function that computes the result of a model and reports to the keyword ``progress``."""


_TRIES: Final = 1000  # Largest number of successive draws outside the allowed values

_LEVELS: Final = (0.025, 0.975)  # Probabilities at the ends of a 95 % interval


@dataclasses.dataclass(frozen=True)
class Draws:
    """Models drawn from the covariance of a fitted model.

    Parameters
    ----------
    names : tuple of str
        Names of the K parameters that vary.
    values : ndarray of float, shape (N, K)
        Their values, in the model's own units.
    models : tuple of Pendulum or Rig
        The N models.
    seed : int
        Seed with which they were drawn.
    """

    names: tuple[str, ...]
    values: NDArray[np.float64]
    models: tuple[Pendulum | Rig, ...]
    seed: int

    def __len__(self) -> int:
        return len(self.models)

    @property
    def variables(self) -> dict[str, Any]:
        """The variable ``drawn`` over (draw, parameter), and the names of the parameters."""
        comment = {"comment": "parameters of each draw, in the units of the model"}
        return {
            "drawn": (("draw", "parameter"), self.values, comment),
            "parameter": ("parameter", np.array(self.names, dtype=str)),
        }

    def each(self, run: Run, progress: Progress | None) -> Iterator[xr.Dataset]:
        """Yield the result of each drawn model; the model itself is the first part of progress."""
        for k, model in enumerate(self.models):
            yield run(model, progress=part(progress, k + 1, len(self) + 1))

    def complete(self, found: xr.Dataset, lines: Iterable[str]) -> None:
        """Add the attributes of the draws and their summary lines to a result."""
        names = ", ".join(self.names)
        head = f"{counted(len(self), 'draw')} of {names} from the covariance of the fit."
        found.attrs |= {"draws": len(self), "draws_seed": self.seed}
        found.attrs["summary"] = "\n".join([found.attrs["summary"], head, *lines])


def drawn(model: Pendulum | Rig, count: object, seed: int) -> Draws:
    """Return models drawn from the Gaussian of a model's ``[covariance]``.

    ``x = m + A z``, ``A A^T`` the covariance with the variance between runs, ``m`` the model's own
    values, ``z`` standard normal. A draw is repeated if a damping or friction is below 0, the size
    of a damping effect changes sign, or a value is outside a model's range: the Gaussian is
    truncated there. The first draws do not depend on the number of draws.

    Parameters
    ----------
    model : Pendulum or Rig
        With ``notes`` as a model file has them (:func:`pendmap.load_model`).
    count : int
        Number of models, 2 to 10000.
    seed : int
        Seed of the draws.

    Raises
    ------
    InputError
        If the model has no valid covariance, or hardly any draw is allowed.

    Examples
    --------
    >>> from pendmap import Rig
    >>> notes = {"covariance": {"names": ["w0"], "matrix": [[0.01]]}}
    >>> found = drawn(Rig(w0=6.0, notes=notes), 100, seed=1)
    >>> bool(abs(found.values.std() - 0.1) < 0.02)
    True
    """
    number = check_whole("draws", count, 2, MOST_DRAWS)
    known = covariance_of(model.notes)
    if known is None:
        raise InputError(
            "draws: the model must have a [covariance], as the model files of identify and diagnose"
            " have, got none"
        )
    there = {name: getattr(model, name) for name in model.numbers()}
    for effect in model.effects:
        there |= {f"{effect.name}.{name}": x for name, x in effect.parameters.items()}
    for name in known.names:
        if name not in there:
            raise InputError(
                f"covariance: {short_repr(name)} must be a parameter of the model, got none"
            )
    middle = np.array([there[name] for name in known.names], dtype=float)
    root = known.root
    sizes = {
        f"{effect.name}.{entry.name}"
        for effect in model.effects
        if effect.brakes
        for entry in effect.definition.parameters
        if entry.role == "size"
    }
    signs = np.where([name in sizes for name in known.names], np.sign(middle), 0.0)
    source = np.random.default_rng(check_whole("seed", seed, 0, MOST_SEED))
    values, models = [], []
    for _ in range(number):
        for _ in range(_TRIES):
            x = middle + root @ source.standard_normal(len(known.names))
            if (x * signs < 0).any():
                continue
            try:
                one = with_values(model, dict(zip(known.names, x.tolist(), strict=True)))
            except InputError:
                continue
            break
        else:
            raise InputError(
                f"draws: the [covariance] must leave room for allowed values, got none in {_TRIES}"
                " draws"
            )
        values.append(x)
        models.append(one)
    return Draws(known.names, np.array(values), tuple(models), seed)


def interval(values: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return mean, standard deviation and ends of the 95 % interval of the finite values."""
    if not values.size:  # numpy has no quantiles of empty arrays
        none = np.full(values.shape[:-1], np.nan)
        return none, none, none, none
    known = np.where(np.isfinite(values), values, np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # no value, or one: nan
        low, high = np.nanquantile(known, _LEVELS, axis=-1)
        return np.nanmean(known, axis=-1), np.nanstd(known, axis=-1, ddof=1), low, high


def part(progress: Progress | None, number: int, parts: int) -> Progress | None:
    """Return the progress of one of ``parts`` equal parts of a computation."""
    if progress is None:
        return None

    def report(done: int, total: int) -> None:
        progress(number * total + done, parts * total)

    return report


def rows(dataset: xr.Dataset, *names: str) -> Iterator[tuple[Any, ...]]:
    """Yield the values of one-dimensional variables, index by index."""
    return zip(*(dataset[name].values for name in names), strict=True)
