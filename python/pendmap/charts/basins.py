"""The layers of a basin map: which of them tell something, which lead, and what each is called."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pendmap import _core
from pendmap.charts import names
from pendmap.errors import InputError
from pendmap.formatting import counted, with_error
from pendmap.model import effects_of
from pendmap.model.quantities import COUNTERPARTS
from pendmap.units import Units

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    import xarray as xr


BYTES_OF_CELL = 64
"""What a cell of a basin map takes in all while its figure and its recording are made."""

BYTES_OF_VALUE = 16
"""What a value of a dataset takes, whatever it is, while a picture of it is made."""

VARIABLES = {
    "labels": "label",
    "settle": "settle_periods",
    "turns": "net_turns",
    "exponent": "finite_time_exponent",
    "probability": "certainty",
    "entropy": "label_entropy",
}
"""Layers by the name a user types, and the variable that holds each."""

_SYMBOLS = {
    "gamma": "\N{GREEK SMALL LETTER GAMMA}",
    "p": "p",
    "omega": "\N{GREEK SMALL LETTER OMEGA}",
    "phase": "phase",
    "torque": "torque",
    "theta_r": "\N{GREEK SMALL LETTER THETA}r",
    "lab_time": "lab time",
}
_SI_SYMBOLS = {
    "w0": ("w0", "rad/s"),
    "c_over_m": ("c/m", "1/s"),
    "p": ("p", ""),
    "Omega": ("\N{GREEK CAPITAL LETTER OMEGA}", "rad/s"),
    "phi": ("phase", ""),
    "torque": ("torque", "rad/s\N{SUPERSCRIPT TWO}"),
    "Tr": ("Tr", "rad/s\N{SUPERSCRIPT TWO}"),
    "lab_time_s": ("lab time", "s"),
}

LABORATORY = {"stroke_mm": "p", "frequency_hz": "Omega"}
"""What varies in a laboratory, and which of a rig's parameters it is."""


def reliable(dataset: xr.Dataset) -> bool:
    """Whether the labels stand up to half the step and to mirroring."""
    return bool(int(dataset.attrs.get("labels_reliable", 1)))


def finite_time(dataset: xr.Dataset) -> bool:
    """Whether labels tell nothing: one chaotic attractor takes every start, or nothing attracts."""
    return bool(dataset.attrs.get("layers") == "finite_time")


def refuse_too_large(dataset: xr.Dataset) -> None:
    """Refuse a dataset whose picture would need more memory than is free.

    Raises
    ------
    MemoryError
        With what it needs and what is free.
    """
    _core.reckon(
        "values", sum(values.size for values in dataset.variables.values()), BYTES_OF_VALUE
    )


def settles(dataset: xr.Dataset) -> bool:
    """Whether any start settles on an attractor."""
    return int(dataset["settle_periods"].max()) >= 0


def warning(dataset: xr.Dataset) -> str:
    """Return the line that marks labels as unreliable."""
    share = 100 * float(dataset.attrs.get("unreliable", math.nan))
    return f"labels unreliable: {share:.3g} % change under half the step or mirroring"


def transients(dataset: xr.Dataset) -> str:
    """Return mean and longest settle time and the basin entropy in one line, as far as known."""
    attrs = dataset.attrs
    known = [
        (
            f"mean {float(attrs[key]):.3g}"
            if key == "mean_settle"
            else f"longest {float(attrs[key]):g}"
        )
        for key in ("mean_settle", "longest_settle")
        if float(attrs.get(key, -1.0)) >= 0
    ]
    settle = [f"settle time: {', '.join(known)} periods"] if known else []
    entropy = float(attrs.get("basin_entropy", math.nan))
    return "; ".join(
        [*settle, *([f"basin entropy {entropy:.3g}"] if math.isfinite(entropy) else [])]
    )


def exponents(dataset: xr.Dataset) -> str:
    """Return the largest exponents of the chaotic attractors in one line; empty where unknown."""
    chaotic = [str(kind).endswith("chaos") for kind in dataset["kind"].values]
    values = dataset["exponent"].values[chaotic]
    without = np.full(values.shape, np.nan)
    errors = dataset["exponent_stderr"].values[chaotic] if "exponent_stderr" in dataset else without
    known = [x for x in values if math.isfinite(x)]
    if len(known) == len(errors) == 1 and math.isfinite(errors[0]):
        listed = with_error(known[0], errors[0], "\N{PLUS-MINUS SIGN}")
    else:
        listed = ", ".join(f"{x:.3g}" for x in known)
    return f"largest exponent {listed} {names.per_time(Units.of(dataset.attrs))}" if known else ""


def layers(dataset: xr.Dataset) -> tuple[str, ...]:
    """Return the layers of a map that tell something, the leading ones first.

    Usually labels, then settle time and net turns. Where the labels are unreliable, settle time and
    net turns come before them; where labels tell nothing, there are only the net turns and the
    finite-time exponent. Settle time is left out where no start settles. Over draws of the
    parameters the probability of the most likely end comes second.
    """
    if finite_time(dataset):
        order: tuple[str, ...] = ("turns", "exponent")
    elif reliable(dataset):
        order = ("labels", "probability", "settle", "turns", "exponent", "entropy")
    else:
        # Three of them lead, and the labels are one.
        middle = ("labels", "turns") if "certainty" in dataset else ("turns", "labels")
        order = ("settle", "probability", *middle, "exponent", "entropy")
    present = [layer for layer in order if VARIABLES[layer] in dataset]
    if "settle" in present and not settles(dataset):
        present.remove("settle")
    return tuple(present)


def named(dataset: xr.Dataset, layer: str) -> str:
    """Return the name of the layer that ``layer`` names, itself or by its variable.

    Raises
    ------
    InputError
        If the map has no such layer; the message lists those it has.
    """
    for name, variable in VARIABLES.items():
        if layer in (name, variable) and variable in dataset:
            return name
    known = ", ".join(name for name, variable in VARIABLES.items() if variable in dataset)
    raise InputError(f"no layer {layer!r} in this map; it has {known}")


def what(dataset: xr.Dataset, layer: str) -> str:
    """Return what a layer shows, in words, for a title."""
    periods = counted(int(dataset.attrs.get("layer_periods", 0)), "period")
    draws = counted(int(dataset.attrs.get("draws", 0)), "draw")
    turns = "until settled"
    if finite_time(dataset):
        turns = f"after {periods}"
    elif not settles(dataset):
        turns = f"after {counted(int(dataset.attrs['max_periods']), 'period')}"
    return {
        "labels": "basins of attraction",
        "settle": "settle time",
        "turns": f"net turns {turns}",
        "exponent": f"finite-time exponent over {periods}",
        "probability": f"most likely end over {draws}",
        "entropy": f"doubt of the end over {draws}",
    }[layer]


def unit(dataset: xr.Dataset, layer: str) -> str:
    """Return what a scalar layer counts, for a colour bar; without drive also what a period is."""
    driven = float(dataset.attrs.get("p", 1.0)) != 0.0
    units = Units.of(dataset.attrs)
    own = units.own_period.replace(" pi", "\N{GREEK SMALL LETTER PI}").replace(" ", "")
    return {
        "settle": "periods to settle" if driven else f"periods of {own} to settle",
        "turns": "net turns",
        "exponent": f"exponent {names.per_time(units)}",
        "probability": "probability",
        "entropy": "entropy (nat)",
    }[layer]


def symbol(name: str, unit: str = "1") -> str:
    """Return the symbol of a parameter with its unit, a blank between them."""
    own = _SYMBOLS.get(name) or _SI_SYMBOLS.get(name, (name, ""))[0]
    return own if unit in ("", "1") else f"{own} ({unit})"


def parameters(attrs: Mapping[Any, Any], without: Collection[str] = ()) -> str:
    """Return the model's parameters in one line, in its units, then its effects.

    Phase, torque and friction stand there only where they are not 0, and without drive, p = 0,
    there is no frequency and no phase; nor do those of ``without``, which vary.
    """
    without = {LABORATORY.get(name, name) for name in without}
    driven = float(attrs.get("p", 1.0)) != 0.0 or "p" in without
    units = Units.of(attrs)
    symbols = _SI_SYMBOLS if units.si else {key: (text, "") for key, text in _SYMBOLS.items()}
    always = {"w0", "gamma", "c_over_m", "p", *(("omega", "Omega") if driven else ())}
    never = set(without) | (set() if driven else {"omega", "phase", "Omega", "phi"})
    never |= {COUNTERPARTS[name][0] for name in without if name in COUNTERPARTS}
    parts = [
        f"{symbol} = {float(attrs[key]):.6g} {unit}".rstrip().replace("-", "\N{MINUS SIGN}")
        for key, (symbol, unit) in symbols.items()
        if key in attrs and key not in never and (key in always or float(attrs[key]) != 0.0)
    ]
    acting = [effect.title(units, without) for effect in effects_of(attrs)]
    said = ",  ".join(text.replace("_", " ").replace("-", "\N{MINUS SIGN}") for text in acting)
    return ";   ".join([",  ".join(parts), *([said] if said else [])])
