"""Fractality of basin boundaries: uncertainty exponent and basin entropy."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np
import xarray as xr
from scipy.special import gammaincc

from pendmap import _core
from pendmap.errors import InputError

if TYPE_CHECKING:
    import numpy.typing as npt

    from pendmap.signal import Floats

    Labels = npt.NDArray[np.int16]


_LEAST_SCALES: Final = 3  # Smallest number of distances for a fit of the power law
_TELLING: Final = 5.0
"""Variance of a count from which its deviation is nearly normal and included in the misfit."""
_UNLIKELY: Final = 0.01
"""p-value of a misfit up to which the largest distance is left out, beyond the power law."""
_PART: Final = 16  # Shorter side of a grid over the largest distance
_STRIPS: Final = 16  # Strips of a grid that the jackknife leaves out one by one
_ROUNDS: Final = 100  # Largest number of steps of Fisher scoring
_TIMES: Final = 1.96  # Half width of a 95 % interval, standard errors
_EPS: Final = 1e-12  # Change of the exponent at which its fit has converged; least share
BOX: Final = 5  # Side of a box of the basin entropy in cells, as in the core
_MOST_LABELS: Final = 32_767  # Largest number of labels of a map


@dataclasses.dataclass(frozen=True)
class UncertaintyExponent:
    """Exponent of ``f(eps) ~ eps^value``, and the counts that it was fitted to.

    Attributes
    ----------
    value, stderr : float
        The exponent and its standard error.
    ci95 : (float, float)
        Its 95 % interval.
    eps : ndarray, shape (N,)
        Distances, ascending, in ``unit``.
    uncertain, tried : ndarray of int, shape (N,)
        Starts whose label changes within ``eps``, and starts.
    unit : str
        ``"window"`` (sides of the window) or ``"cell"``.
    scales : int
        Number of distances, the smallest ones, that the law was fitted to.
    """

    value: float
    stderr: float
    ci95: tuple[float, float]
    eps: Floats = dataclasses.field(repr=False)
    uncertain: npt.NDArray[np.int64] = dataclasses.field(repr=False)
    tried: npt.NDArray[np.int64] = dataclasses.field(repr=False)
    unit: str
    scales: int

    @property
    def dimension(self) -> float:
        """Box-counting dimension ``2 - value`` of the boundary."""
        return 2.0 - self.value

    @property
    def share(self) -> Floats:
        """``f(eps)``, shape (N,)."""
        return np.asarray(self.uncertain / np.maximum(self.tried, 1))


def uncertainty_exponent(
    labels: npt.ArrayLike | xr.Dataset, *, periodic: tuple[bool, bool] = (False, False)
) -> UncertaintyExponent:
    """Estimate the uncertainty exponent of a basin boundary and the boundary's dimension.

    A start known to within ``eps`` is uncertain if its label is another at a distance ``eps`` on
    one side or the other. Their share falls as ``f(eps) ~ eps^alpha``, and ``2 - alpha`` is the
    box-counting dimension of the boundary in the plane: 1 where it is smooth (alpha = 1). Where
    alpha is small, much more precise starts hardly improve the prediction of ends.

    For a dataset of :func:`pendmap.basins` the counts are those of the map, of independent starts
    for each distance, in directions drawn at random, down to 1.5e-8 of the window's sides. For
    labels on a grid the distances are 1, 2, 3, 4, 6, ... cells, along both axes at once, from every
    cell; filaments thinner than a cell are not resolved.

    The law is fitted by its binomial likelihood to the smallest distances, up to where it fails (a
    misfit less likely than 1 %), and the interval is widened by the remaining misfit. On a grid
    neighbouring cells are not independent: their effective number follows from the spread between
    strips of the plane; at an edge that is not periodic the plane is continued by reflection.
    Starts with an unknown end nearby are left out; mirror images count as two attractors.

    Parameters
    ----------
    labels : array_like of int, shape (M, N), or xarray.Dataset
        Numbers of attractors from 1; 0 and below where the end is not known. Or a map of
        :func:`pendmap.basins`.
    periodic : (bool, bool)
        Whether the last row has the first one as its neighbour, and the last column likewise.
        Ignored for a dataset.

    Returns
    -------
    UncertaintyExponent
        ``value``, ``stderr``, ``ci95``, ``dimension`` and the counts.

    Raises
    ------
    InputError
        If these are no labels of a plane; if there is no boundary, or too few distances; of a
        dataset without counts (no basins, or ``check=False``) or of a part of a map.

    References
    ----------
    C. Grebogi, S. W. McDonald, E. Ott & J. A. Yorke (1983), Physics Letters A 99, 415;
    S. W. McDonald et al. (1985), Physica D 17, 125.

    Examples
    --------
    >>> import numpy as np
    >>> import pendmap
    >>> smooth = 1 + (np.arange(300)[:, None] < np.arange(400)).astype(int)
    >>> round(pendmap.uncertainty_exponent(smooth).value, 1)
    1.0
    """
    if isinstance(labels, xr.Dataset):
        return _of_map(labels)
    cells = _numbered(labels)
    eps, uncertain, tried = _on_grid(cells, periodic)
    hit, all_ = uncertain.sum(axis=(1, 2)), tried.sum(axis=(1, 2))
    # Neighbouring cells are correlated: their effective number follows from the spread.
    fewer = np.maximum.reduce(
        [_spread(uncertain.sum(axis=axis), tried.sum(axis=axis)) for axis in (1, 2)]
    )
    fit = fitted(eps, hit / fewer, all_ / fewer, "cell")
    if fit is None:
        raise InputError("labels have no boundary at enough distances: there is no exponent")
    hit, all_ = (values.astype(np.int64) for values in (hit, all_))
    return dataclasses.replace(fit, uncertain=hit, tried=all_)


def fitted(
    eps: npt.ArrayLike, uncertain: npt.ArrayLike, tried: npt.ArrayLike, unit: str = "window"
) -> UncertaintyExponent | None:
    """Fit ``f ~ eps^alpha`` to independent binomial counts; None with fewer than 3 distances."""
    far, hit, all_ = (np.asarray(values, dtype=float) for values in (eps, uncertain, tried))
    order = np.argsort(far)
    far, hit, all_ = (values[order] for values in (far, hit, all_))
    scales = far.size
    while True:
        if np.count_nonzero(hit[:scales]) < _LEAST_SCALES:
            return None
        value, error, misfit, degrees = _law(far[:scales], hit[:scales], all_[:scales])
        few = np.count_nonzero(hit[: scales - 1]) < max(_LEAST_SCALES + 1, hit.size // 3)
        if degrees <= 1 or few or gammaincc(degrees / 2, misfit / 2) > _UNLIKELY:
            break
        scales -= 1
    error *= math.sqrt(max(1.0, misfit / degrees)) if degrees > 0 else 1.0
    ci95 = (value - _TIMES * error, value + _TIMES * error)
    counts = hit.astype(np.int64), all_.astype(np.int64)
    return UncertaintyExponent(value, error, ci95, far, *counts, unit, scales)


def _law(eps: Floats, hit: Floats, tried: Floats) -> tuple[float, float, float, int]:
    """Return maximum-likelihood exponent, error, Pearson's chi squared, degrees of freedom."""
    log = np.log(eps)
    terms = np.stack([np.ones_like(log), log - log.mean()], axis=1)
    weight = np.sqrt(hit + 0.25)
    first = np.log((hit + 0.25) / (tried + 0.5))
    rates = np.linalg.lstsq(terms * weight[:, None], first * weight, rcond=None)[0]
    for _ in range(_ROUNDS):  # Fisher's scoring
        share = np.clip(np.exp(terms @ rates), _EPS, 1 - 1e-6)
        known = terms.T @ ((tried * share / (1 - share))[:, None] * terms)
        step = np.linalg.solve(known, terms.T @ ((hit - tried * share) / (1 - share)))
        rates += step / max(1.0, float(np.abs(step).max()))
        if np.abs(step).max() < _EPS:
            break
    share = np.clip(np.exp(terms @ rates), _EPS, 1 - 1e-6)
    spread = tried * share * (1 - share)
    telling = spread >= _TELLING
    misfit = float((((hit - tried * share) ** 2) / spread)[telling].sum())
    error = math.sqrt(max(float(np.linalg.inv(known)[1, 1]), 0.0))
    return float(rates[1]), error, misfit, int(telling.sum()) - 2


def _spread(hit: Floats, tried: Floats) -> Floats:
    """Return the ratio of the jackknife to the binomial variance of shares, at least 1."""
    count = hit.shape[1]
    whole = np.maximum(tried.sum(axis=1), 1.0)
    share = hit.sum(axis=1) / whole
    rest = np.maximum(tried.sum(axis=1, keepdims=True) - tried, 1.0)
    without = (hit.sum(axis=1, keepdims=True) - hit) / rest
    variance = (count - 1) * without.var(axis=1)
    binomial = np.maximum(share * (1 - share), _EPS) / whole
    fewer: Floats = np.maximum(variance / binomial, 1.0)
    return fewer


def _on_grid(cells: Labels, periodic: tuple[bool, bool]) -> tuple[Floats, Floats, Floats]:
    """Return distances in cells, and counts of uncertain and of all cells by strips."""
    shorter = min(cells.shape)
    powers = 2 ** np.arange(max(1, int(math.log2(max(shorter, 2)))))
    steps = np.unique(np.concatenate([powers, 3 * powers[:-1]]))
    steps = steps[steps <= max(shorter // _PART, 1)]
    strips = [np.linspace(0, side, min(_STRIPS, side) + 1)[:-1].astype(int) for side in cells.shape]
    counts: list[list[Floats]] = [[], []]
    far, (height, width) = int(steps[-1]), cells.shape
    # Beyond an edge the plane is continued, periodic or mirrored: the boundary is as dense.
    wider = cells
    for axis in (0, 1):
        beyond = [(far, far) if k == axis else (0, 0) for k in (0, 1)]
        wider = np.pad(wider, beyond, mode="wrap" if periodic[axis] else "symmetric")
    for step in steps.tolist():
        tried, uncertain = cells > 0, np.zeros(cells.shape, dtype=bool)
        for down, right in ((step, 0), (-step, 0), (0, step), (0, -step)):
            top, left = far + down, far + right
            beside = wider[top : top + height, left : left + width]
            tried &= beside > 0
            uncertain |= beside != cells
        for sums, which in zip(counts, (tried & uncertain, tried), strict=True):
            rows = np.add.reduceat(which.astype(float), strips[0], axis=0)
            sums.append(np.add.reduceat(rows, strips[1], axis=1))
    return steps.astype(float), np.array(counts[0]), np.array(counts[1])


def fitted_map(dataset: xr.Dataset) -> UncertaintyExponent | None:
    """Return the uncertainty exponent of a map with counts; None if they are too few."""
    names = "uncertainty_eps", "uncertain", "uncertainty_tried"
    eps, uncertain, tried = (dataset[name].values for name in names)
    return fitted(eps, uncertain, tried)


def _of_map(dataset: xr.Dataset) -> UncertaintyExponent:
    """Return the uncertainty exponent of a whole map with counts, or raise InputError."""
    whole = "label" in dataset and dataset["label"].size == dataset.attrs["cells"]
    if not (whole and "uncertainty_eps" in dataset):
        raise InputError(
            "this dataset has no counts of uncertain starts of all its cells: it must be a whole "
            "map of pendmap.basins of 10,000 cells or more whose labels distinguish basins, made "
            "with check=True; or labels on a grid, dataset['label']"
        )
    fit = fitted_map(dataset)
    if fit is None:
        raise InputError("too few starts of this map are uncertain: there is no exponent")
    return fit


@dataclasses.dataclass(frozen=True)
class BasinEntropy:
    """Entropies of the labels in boxes of 5 x 5 cells.

    Attributes
    ----------
    value : float
        Basin entropy: the mean over all boxes.
    boundary, boundary_stderr : float
        Boundary basin entropy: the mean over the boxes that hold more than one label, 0 without;
        its standard error, from the spread over those boxes, infinite with fewer than two.
    boxes, boundary_boxes : int
        Numbers of all boxes, and of those with more than one label.
    """

    value: float
    boundary: float
    boundary_stderr: float
    boxes: int
    boundary_boxes: int

    @property
    def is_fractal(self) -> bool:
        """Whether ``boundary`` exceeds ``ln 2`` by two standard errors."""
        return passes_log2(self.boundary, self.boundary_stderr)


def basin_entropy(labels: npt.ArrayLike | xr.Dataset) -> BasinEntropy:
    """Compute basin entropy and boundary basin entropy of labels on a grid.

    In a box of 5 x 5 cells ``S_i = -sum p ln p``, ``p`` the shares of the labels in it. Basin
    entropy is ``S_b = sum S_i / N`` over all N boxes, boundary basin entropy
    ``S_bb = sum S_i / N_b`` over the N_b boxes with more than one label. ``S_b`` measures how
    unpredictable ends are: 0 in one basin, ``ln K`` where K labels are spread at random. On a
    smooth boundary ``S_bb`` is below ``ln 2``; above it the boundary is fractal. Below it nothing
    follows. Both depend on the size of a cell; compare maps with cells of one size.

    Parameters
    ----------
    labels : array_like of int, shape (M, N), or xarray.Dataset
        A basin map; or numbers of attractors from 1; 0 and below where the end is not known. Those
        cells are left out, as are cells beyond the last whole box; mirror images count as two.

    Returns
    -------
    BasinEntropy
        Both entropies and the numbers of boxes.

    Raises
    ------
    InputError
        If these are no whole numbers in a plane.

    References
    ----------
    A. Daza, A. Wagemakers, B. Georgeot, D. Guery-Odelin & M. A. F. Sanjuan (2016), Scientific
    Reports 6, 31416.

    Examples
    --------
    >>> import numpy as np
    >>> import pendmap
    >>> labels = np.random.default_rng(0).integers(1, 3, (100, 100))
    >>> round(pendmap.basin_entropy(labels).value, 2)
    0.67
    """
    if isinstance(labels, xr.Dataset):
        if "label" not in labels:
            raise InputError("this dataset has no labels: it must be a map of pendmap.basins")
        labels = labels["label"]
    cells = _numbered(labels)
    texture = _core.TextureSum(cells.shape[1], cells.shape[0])
    texture.add(np.ascontiguousarray(cells).ravel())
    total = texture.total()
    boundary = total.boundary_basin_entropy, total.boundary_stderr
    return BasinEntropy(total.basin_entropy, *boundary, total.boxes, total.boundary_boxes)


def passes_log2(boundary: float, stderr: float) -> bool:
    """Return whether a boundary basin entropy exceeds ln 2 by more than two standard errors."""
    return boundary - _TIMES * stderr > math.log(2)


def _numbered(labels: npt.ArrayLike) -> Labels:
    """Return labels of a plane renumbered from 1, 0 where unknown."""
    given = np.asarray(labels)
    if given.ndim != 2 or not given.size:  # noqa: PLR2004 (a plane)
        raise InputError(f"labels must have the shape (M, N), both above 0, got {given.shape}")
    if given.dtype.kind not in "iu":
        raise InputError(f"labels must be whole numbers, got {given.dtype}")
    known, place = np.unique(np.maximum(given, 0), return_inverse=True)
    if known.size > _MOST_LABELS:
        raise InputError(f"labels must be at most {_MOST_LABELS} different ones, got {known.size}")
    first = 0 if known[0] == 0 else 1
    return (place.reshape(given.shape) + first).astype(np.int16)
