"""Choice of SINDy's sparse model: the optimizers of pysindy, and BIC over their paths."""

from __future__ import annotations

import dataclasses
import math
import warnings
from typing import TYPE_CHECKING

import numpy as np
import pysindy

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from benchmarks.blind.sindy_forms import Regression, Setting

    Floats = NDArray[np.float64]

MOST = 3
"""Largest number of effects in a model, as in pendmap."""

ALIKE = 0.9999
"""Squared cosine above which two features, with the base projected out, are identical."""


@dataclasses.dataclass(frozen=True)
class Model:
    """The chosen effects, each with those of identical features."""

    names: list[str]
    classes: list[list[str]]


def choose(data: Regression, setting: Setting, penalties: Sequence[float]) -> list[Model]:
    """Return the sparse model with the least BIC of an optimizer's whole path, by penalty."""
    found = models(data, setting.optimizer, best=setting.best)
    known: dict[int, Model] = {}
    chosen = []
    for penalty in penalties:
        scores = [gain - penalty * count for _, gain, count in found]
        k = int(np.argmax(scores))
        if k not in known:
            known[k] = _model(data, found[k][0])
        chosen.append(known[k])
    return chosen


def _model(data: Regression, support: tuple[int, ...]) -> Model:
    names: list[str] = []
    classes: list[list[str]] = []
    for name in dict.fromkeys(data.features[i].effect for i in support):
        if any(name in same for same in classes):
            continue  # a duplicate of a feature, for effects that are not linear in it
        names.append(name)
        classes.append(_same(data, [i for i in support if data.features[i].effect == name]))
    return Model(names, classes)


def models(
    data: Regression, optimizer: str, *, best: bool
) -> list[tuple[tuple[int, ...], float, float]]:
    """Return the models on an optimizer's path: support, gain in -2 ln L, BIC's penalty.

    The first has no effect. Coefficients are refitted without the optimizer's shrinkage; a chosen
    shape is penalised as a coefficient.
    """
    columns = _best_shapes(data) if best else np.arange(len(data.features))
    y, samples = data.target, data.freedom
    paths = {tuple(columns[list(one)]) for one in _path(data.columns[:, columns], y, optimizer)}
    found: list[tuple[tuple[int, ...], float, float]] = [((), 0.0, 0.0)]
    for support in sorted(paths):
        chosen = [data.features[k] for k in support]
        if not 1 <= len({feature.effect for feature in chosen}) <= MOST:
            continue
        own = data.columns[:, list(support)]
        rest = y - own @ np.linalg.lstsq(own, y)[0]
        gain = samples * math.log(float(y @ y) / float(rest @ rest))
        shapes = {(feature.effect, feature.shape) for feature in chosen if feature.shape}
        found.append((support, gain, (len(support) + len(shapes)) * math.log(samples)))
    return found


def _groups(data: Regression) -> dict[tuple[str, tuple[tuple[str, float], ...]], list[int]]:
    """Return the columns of each effect in each shape."""
    found: dict[tuple[str, tuple[tuple[str, float], ...]], list[int]] = {}
    for k, feature in enumerate(data.features):
        found.setdefault((feature.effect, feature.shape), []).append(k)
    return found


def _best_shapes(data: Regression) -> NDArray[np.intp]:
    """Return the columns of each effect in the shape that alone explains most."""
    best: dict[str, tuple[float, list[int]]] = {}
    for (name, _), own in _groups(data).items():
        q = np.linalg.qr(data.columns[:, own])[0]
        gain = float(np.sum((q.T @ data.target) ** 2))
        if name not in best or gain > best[name][0]:
            best[name] = gain, own
    return np.array([k for _, own in best.values() for k in own], np.intp)


def _same(data: Regression, chosen: list[int]) -> list[str]:
    """Return the effects whose features span those of a chosen effect."""
    q = np.linalg.qr(data.columns[:, chosen])[0]
    found = {data.features[chosen[0]].effect}
    for (name, _), own in _groups(data).items():
        if len(own) != len(chosen):
            continue
        cosines = np.linalg.svd(q.T @ np.linalg.qr(data.columns[:, own])[0], compute_uv=False)
        if cosines[-1] ** 2 > ALIKE:
            found.add(name)
    return sorted(found)


def _path(x: Floats, y: Floats, optimizer: str) -> Iterator[tuple[int, ...]]:
    """Yield the supports on the path of an optimizer of pysindy, from sparse to dense."""
    # A rotation of the rows changes only their number.
    q, x = np.linalg.qr(x)
    y = (q.T @ y)[:, None]
    scale = float(np.linalg.norm(y))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if optimizer == "frols":
            yield from _forward(x, y)
        elif optimizer == "ssr":
            found = pysindy.SSR(alpha=1e-6, max_iter=x.shape[1], criteria="model_residual")
            found.fit(x, y)
            yield from (_support(c) for c in found.history_)
        else:
            for threshold in scale * np.geomspace(0.01, 30.0, 70):
                if optimizer == "sr3":
                    found = pysindy.SR3(reg_weight_lam=threshold**2 / 2, max_iter=300)
                else:
                    found = pysindy.STLSQ(threshold=threshold, alpha=1e-3, max_iter=50)
                found.fit(x, y)
                yield _support(found.coef_)


def _forward(x: Floats, y: Floats) -> Iterator[tuple[int, ...]]:
    """Yield supports of forward regression; fewer if other columns depend on the chosen ones."""
    for count in range(2 * MOST, 0, -1):
        found = pysindy.FROLS(max_iter=count, alpha=1e-6)
        try:
            found.fit(x, y)
        except ValueError:  # a column that is zero after projection on the chosen ones
            continue
        yield from (_support(c) for c in found.history_)
        return


def _support(coefficients: Floats) -> tuple[int, ...]:
    return tuple(np.flatnonzero(np.ravel(coefficients)).tolist())
