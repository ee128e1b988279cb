"""Models drawn from the covariance of fitted parameters.

``draws.basins`` computes statistics of basin maps over the draws; other analyses compute their own.
"""

from __future__ import annotations

import dataclasses
import warnings
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap.analysis.result import Field, indices
from pendmap.analysis.varied import with_values
from pendmap.errors import MOST_DRAWS, InputError, check_whole, short_repr
from pendmap.files.variables import variable
from pendmap.formatting import counted
from pendmap.model.covariance import covariance_of

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterable, Iterator

    import xarray as xr
    from numpy.typing import NDArray

    from pendmap.analysis.run import RunOptions
    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats

    Analysis = Callable[..., xr.Dataset]
    """Function that computes the result of a model, with the keyword ``run``."""


_TRIES: Final = 1000  # Largest number of successive draws outside the allowed values

_LEVELS: Final = (0.025, 0.975)  # Probabilities at the ends of a 95 % interval
_SURE: Final = 0.95  # Probability of an outcome from which a cell is sure


@dataclasses.dataclass(frozen=True)
class Draws:
    """Models drawn from the covariance of a fitted model."""

    names: tuple[str, ...]
    values: Floats
    """Parameters of each draw in the units of the model, shape (N, K)."""
    models: tuple[Pendulum | Rig, ...]
    run: RunOptions
    """Options of the results of the model itself and of all draws."""

    def __len__(self) -> int:
        return len(self.models)

    @property
    def first(self) -> RunOptions:
        """Options of the result of the model itself."""
        return self.run.part(0, len(self) + 1)

    def each(self, analysis: Analysis) -> Iterator[xr.Dataset]:
        """Yield the result of each drawn model."""
        for k, model in enumerate(self.models, 1):
            yield analysis(model, run=self.run.part(k, len(self) + 1))

    def complete(self, dataset: xr.Dataset, lines: Iterable[str]) -> xr.Dataset:
        """Return a result with the drawn parameters, and with summary lines on the draws."""
        names = ", ".join(self.names)
        head = f"{counted(len(self), 'draw')} of {names} from the covariance of the fit."
        dataset.attrs |= {"draws": len(self), "draws_seed": self.run.seed}
        dataset.attrs["summary"] = "\n".join([dataset.attrs["summary"], head, *lines])
        text, comment = "parameters of each draw", "each in the units of the model"
        dataset = dataset.assign(
            drawn=variable(("draw", "parameter"), self.values, "", text, comment),
            parameter=variable("parameter", np.array(self.names, dtype=str), long_name="name"),
        )
        return dataset.assign_coords(indices(dataset))


def drawn_field(entries_of: Callable[[xr.Dataset], dict[str, Any]]) -> Field:
    """Return the JSON key ``draws``: the drawn models and their results, null without draws."""

    def read(dataset: xr.Dataset) -> dict[str, Any] | None:
        a = dataset.attrs
        if "draws" not in a:
            return None
        names = dataset["parameter"].values.tolist()
        common = {"count": a["draws"], "seed": a["draws_seed"], "parameters": names}
        return common | entries_of(dataset)

    return Field("draws", "", "models drawn from the covariance, and their results", read=read)


def drawn(model: Pendulum | Rig, count: object, run: RunOptions) -> Draws:
    """Return models drawn from the Gaussian of a model's ``[covariance]``.

    ``x = m + A z``, ``A A^T`` the covariance with the variance between runs, ``m`` the model's own
    values, ``z`` standard normal. A draw is repeated if a damping or friction is below 0, the size
    of a damping effect changes sign, or a value is outside a model's range: the Gaussian is
    truncated there. The first draws do not depend on the number of draws. Raises InputError if the
    model has no valid covariance, or hardly any draw is allowed.
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
    brakes = (effect for effect in model.effects if effect.brakes)
    sizes = {f"{effect.name}.{size}" for effect in brakes for size in effect.sizes}
    signs = np.where([name in sizes for name in known.names], np.sign(middle), 0.0)
    source = np.random.default_rng(run.in_memory("draws").seed)
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
    return Draws(known.names, np.array(values), tuple(models), run)


def interval(values: Floats) -> tuple[Floats, ...]:
    """Return mean, standard deviation and ends of the 95 % interval of the finite values."""
    if not values.size:  # numpy has no quantiles of empty arrays
        none = np.full(values.shape[:-1], np.nan)
        return none, none, none, none
    known = np.where(np.isfinite(values), values, np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # no value, or one: nan
        low, high = np.nanquantile(known, _LEVELS, axis=-1)
        return np.nanmean(known, axis=-1), np.nanstd(known, axis=-1, ddof=1), low, high


def outcomes(
    dims: tuple[Hashable, ...], probability: NDArray[Any], share: Floats
) -> dict[str, Any]:
    """Return the probability of each outcome in cells over ``dims``, and its shares of the draws.

    Shapes are (outcome, M, N) and (outcome, D).
    """
    mean, _, low, high = interval(share)
    certain = probability.max(axis=0)
    of_share = "of the outcome's share of the cells over the draws"
    likely, per_draw = "probability of the most likely outcome", "share of the cells in each draw"
    return {
        "probability": variable(("outcome", *dims), probability, "1", "probability"),
        "certainty": variable(dims, certain, "1", likely),
        "drawn_share": variable(("outcome", "draw"), share, "1", per_draw),
        "share_mean": variable("outcome", mean, "1", f"mean {of_share}"),
        "share_low": variable("outcome", low, "1", f"lower end of 95 % {of_share}"),
        "share_high": variable("outcome", high, "1", f"upper end of 95 % {of_share}"),
        "sure_cells": variable(
            (), (certain >= _SURE).mean(), "1", "share of the cells with a sure outcome"
        ),
    }


def sure_line(dataset: xr.Dataset, what: str) -> str:
    """Return a summary line on the share of sure cells."""
    return (
        f"{100 * float(dataset['sure_cells']):.1f} % of the cells have {what} with a probability "
        f"of {100 * _SURE:g} % or more."
    )
