"""Closed orbits over draws: how far each moves, how often it is there, and how often stable."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pendmap.analysis.draws.match import matched, names_of, points_of
from pendmap.analysis.draws.sample import interval
from pendmap.analysis.draws.summary import draws_line
from pendmap.formatting import counted, with_error

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from numpy.typing import NDArray

    from pendmap.analysis.draws.sample import Draws, Progress
    from pendmap.model import Pendulum, Rig

    Floats = NDArray[np.float64]


def orbits_over(
    dataset: xr.Dataset,
    draws: Draws,
    run: Callable[[Pendulum | Rig, Progress | None], xr.Dataset],
    progress: Progress | None,
) -> xr.Dataset:
    """Return closed orbits with what becomes of each over draws of the parameters.

    An orbit is found again by its name, and among those of one name by its points. Its point is
    the one next to that of the model's own orbit; of its multipliers each is the one next to that
    of the own orbit.

    Parameters
    ----------
    dataset : xarray.Dataset
        The orbits of the model's own values, K.
    draws : Draws
        The models, D.
    run : callable
        Finds the orbits of one of them in the same box.
    progress : callable, optional
        As of :func:`pendmap.orbit`; the search for the own orbits is one more.

    Returns
    -------
    xarray.Dataset
        The orbits with ``drawn_theta``, ``drawn_velocity`` (K, D) and ``drawn_multipliers``
        (K, eigenvalue, part, D), nan where a draw has no such orbit; ``theta_spread``,
        ``velocity_spread`` and ``multipliers_spread``, their standard deviations over the draws;
        ``exists`` and ``stable_share``, the shares of the draws in which it is there, and there and
        stable; ``drawn`` (D, parameter). Attribute ``drawn_others``: orbits of the draws that the
        own model has not, a draw on average.
    """
    names, points = names_of(dataset, "orbit"), points_of(dataset, "orbit")
    count, total = len(names), len(draws)
    state = np.full((count, 2, total), np.nan)
    multipliers = np.full((*dataset["multipliers"].shape, total), np.nan)
    there, stable = np.zeros((count, total), bool), np.zeros((count, total), bool)
    others = 0
    for d, (model, report) in enumerate(draws.each(progress)):
        one = run(model, report)
        theirs = points_of(one, "orbit")
        for j, k in enumerate(matched(names, points, names_of(one, "orbit"), theirs)):
            if k < 0:
                others += 1
                continue
            own = np.array([dataset["theta_point"][k], dataset["velocity_point"][k]])
            there[k, d], stable[k, d] = True, bool(one["stable"][j])
            state[k, :, d] = _next_to(own, theirs[j])
            multipliers[k, ..., d] = _paired(
                dataset["multipliers"].values[k], one["multipliers"].values[j]
            )
    spread = interval(state)[1]
    dims = dataset["multipliers"].dims
    found = dataset.assign(
        {
            "drawn_theta": (("orbit", "draw"), state[:, 0], {"units": "rad"}),
            "drawn_velocity": (("orbit", "draw"), state[:, 1], dataset["velocity_point"].attrs),
            "drawn_multipliers": ((*dims, "draw"), multipliers),
            "theta_spread": ("orbit", spread[:, 0], {"units": "rad"}),
            "velocity_spread": ("orbit", spread[:, 1], dataset["velocity_point"].attrs),
            "multipliers_spread": (dims, interval(multipliers)[1]),
            "exists": ("orbit", there.mean(axis=1)),
            "stable_share": ("orbit", stable.mean(axis=1)),
            **draws.variables,
        }
    )
    found.attrs = {**dataset.attrs, **draws.attributes, "drawn_others": others / total}
    found.attrs["summary"] = "\n".join([dataset.attrs["summary"], *_said(found)])
    return found


def _next_to(own: Floats, points: Floats) -> Floats:
    """Return the point nearest to one, its angle within half a turn of it."""
    away = points - own
    away[:, 0] = np.remainder(away[:, 0] + math.pi, math.tau) - math.pi
    nearest: Floats = own + away[np.argmin(np.hypot(*away.T))]
    return nearest


def _paired(own: Floats, pairs: Floats) -> Floats:
    """Return multipliers, shape (2, 2), in the order in which they are nearer to the own ones."""
    swapped = pairs[::-1]
    nearer = np.abs(swapped - own).sum() < np.abs(pairs - own).sum()
    return swapped if nearer else pairs


def _said(found: xr.Dataset) -> list[str]:
    lines = [draws_line(found)]
    for k, name in enumerate(found["orbit"].values):
        theta, velocity = (
            with_error(float(found[f"{what}_point"][k]), float(found[f"{what}_spread"][k]))
            for what in ("theta", "velocity")
        )
        sizes = np.hypot(*np.moveaxis(found["drawn_multipliers"].values[k], 1, 0))
        mean, error, _, _ = interval(sizes.max(axis=0))
        largest = f", largest multiplier {with_error(float(mean), float(error))} in size"
        lines.append(
            f"{name}: there in {100 * float(found['exists'][k]):.3g} % of the draws, stable in "
            f"{100 * float(found['stable_share'][k]):.3g} %; theta = {theta}, velocity = {velocity}"
            f"{largest if math.isfinite(mean) else ''}."
        )
    if found.attrs["drawn_others"]:
        more = counted(round(found.attrs["drawn_others"] * found.attrs["draws"]), "orbit")
        lines.append(f"All draws together have {more} more, which the own model has not.")
    return lines
