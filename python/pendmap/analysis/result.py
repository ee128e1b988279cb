"""Schema of a result: facts of its dataset and keys of its JSON object, from one table.

Files follow the CF conventions 1.11: units are those of UDUNITS-2, and what it does not have is the
unit 1 with its meaning in the long name.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendmap import ANALYSES, _core
from pendmap.files import facts
from pendmap.files.variables import CONVENTIONS, flag, variable
from pendmap.model.covariance import misses
from pendmap.model.labels import LABELS

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping

    import xarray as xr
    from numpy.typing import NDArray

    from pendmap.model import Pendulum, Rig
    from pendmap.signal import Floats
    from pendmap.units import Units

OF_TIME: Final = "1/w0 or s"  # Unit of times: without dimensions or in SI, as the model is
OF_RATE: Final = "1/tau or 1/s"  # Unit of exponents: without dimensions or in SI
OF_VELOCITY: Final = "1 or rad/s"  # Unit of velocities: without dimensions or in SI
_OF: Final = {OF_TIME: "of_time", OF_RATE: "of_rate", OF_VELOCITY: "of_velocity"}
FLAG: Final = "no or yes"  # Unit of a fact that is 0 or 1

PAPER: Final = (
    "Horton, Wiercigroch & Xu (2008), Phil. Trans. R. Soc. A 366, 767, doi:10.1098/rsta.2007.2126"
)
"""The paper whose equation of motion all results solve."""
_WITHOUT_INDEX: Final = ("bound", "eigenvalue", "part")  # Dimensions with two places each


@dataclasses.dataclass(frozen=True)
class Field:
    """A fact of a dataset and the key of its JSON object, or one of the two alone."""

    name: str
    unit: str
    meaning: str
    core: str | None = ""
    """Name in the core's result if it differs; None if the core's result does not have it."""
    json: bool = True  # Whether the JSON object has the key
    convert: Callable[[Any], Any] | None = None  # Converts the fact to the JSON value
    read: Callable[[xr.Dataset], Any] | None = None
    """Function that computes the JSON value from the dataset, if no fact holds it."""
    when: str = ""  # Fact that must be true for the JSON object to have the key
    variable: str = ""
    """Variable without dimensions that holds it, if another variable has the name of the field."""
    computed: bool = False  # Whether a variable holds it, not an attribute

    @property
    def hidden(self) -> Field:
        """The field without its key in the JSON object."""
        return dataclasses.replace(self, json=False)

    @property
    def place(self) -> str:
        """Name of the attribute or variable that holds the value."""
        return self.variable or self.name

    def value(self, dataset: xr.Dataset, known: Mapping[str, Any]) -> Any:  # noqa: ANN401 (JSON)
        """Return the JSON value from a dataset and its facts; null where the fact is absent."""
        if self.read is not None:
            return self.read(dataset)
        value = known.get(self.place)
        return value if value is None or self.convert is None else self.convert(value)

    def put(self, dataset: xr.Dataset, value: Any, units: Units) -> None:  # noqa: ANN401
        """Set the value in a dataset."""
        if not self.computed:
            dataset.attrs[self.place] = value
        elif self.unit == FLAG:
            dataset[self.place] = flag((), value, self.meaning)
        else:
            unit = getattr(units, _OF[self.unit]) if self.unit in _OF else self.unit
            dataset[self.place] = variable((), value, unit, self.meaning)


Found: Final = functools.partial(Field, computed=True)
"""A number or text that was computed: a variable without dimensions, not an attribute."""


class Schema:
    """The fields of one kind of dataset, in the order of the JSON object."""

    def __init__(self, kind: str, *fields: Field, references: str = "") -> None:
        self.kind = kind
        self.fields = fields
        self.references = "; ".join(filter(None, (PAPER, references)))

    def complete(
        self,
        dataset: xr.Dataset,
        model: Pendulum | Rig,
        values: Mapping[str, Any],
        raw: object = None,
        replaced: Collection[str] = (),
    ) -> None:
        """Set the facts of a dataset, and as coordinates the parameters that are not replaced."""
        from pendmap.files.dataset import history_of  # noqa: PLC0415 (xarray takes a while)

        for name in [name for name in dataset.variables if not dataset[name].dims]:
            del dataset[name]
        known = model.attributes
        dataset.attrs = {"kind": self.kind, "title": model.title}
        dataset.attrs |= {name: value for name, value in known.items() if name not in LABELS}
        values = {"section": model.units.section, **values}
        for field in self.fields:
            value = values.get(field.name)
            if not (field.name in values or field.read or field.core is None or raw is None):
                value = of_core(field.core or field.name, raw)
            if value is not None:
                field.put(dataset, value, model.units)
        bare = dataset.attrs["units"] != "SI"
        for name, label in LABELS.items():
            there = name in dataset.variables or name in dataset.dims
            if name in known and name not in replaced and not there:
                unit = "1" if bare and name == "torque" else label.unit or "1"
                dataset.coords[name] = variable((), float(known[name]), unit, label.meaning)
        dataset.coords.update(indices(dataset))
        dataset.attrs |= {
            "Conventions": CONVENTIONS,
            "comment": ANALYSES[self.kind][2],
            "source": f"pendmap {dataset.attrs.get('pendmap_version', _core.__version__)}",
            "references": self.references,
            "history": history_of(dataset),
        }

    def json(self, dataset: xr.Dataset) -> dict[str, Any]:
        """Return the JSON object of a dataset."""
        known = facts(dataset)
        return {
            field.name: field.value(dataset, known)
            for field in self.fields
            if field.json and (not field.when or known[field.when])
        }


def of_core(name: str, raw: object) -> Any:  # noqa: ANN401 (whatever it is)
    """Return a value of the core's result, or of the first of a tuple that has it."""
    sources = raw if isinstance(raw, tuple) else (raw,)
    return getattr(next(one for one in sources if hasattr(one, name)), name)


def indices(dataset: xr.Dataset) -> dict[str, Any]:
    """Return numbers from 0 for each dimension without a coordinate, so that results align."""
    return {
        str(name): variable(name, np.arange(size, dtype=np.int32), "1", f"number of the {name}")
        for name, size in dataset.sizes.items()
        if name not in dataset.variables and name not in _WITHOUT_INDEX
    }


def summarised(dataset: xr.Dataset, lines: Iterable[str], model: Pendulum | Rig, what: str) -> None:
    """Set the summary of a dataset; ``what`` begins the note on effects on the reading."""
    lines, ratio = [*lines], misses(model.notes)
    if math.isfinite(ratio):
        lines.append(f"This model misses its record by {ratio:.3g} times the noise.")
    names = [effect.name for effect in model.effects if effect.reads]
    if names:
        verb = "acts" if len(names) == 1 else "act"
        lines.append(
            f"{', '.join(names)} {verb} on the sensor's reading alone: {what} of the motion itself."
        )
    dataset.attrs["summary"] = "\n".join(lines)


def point(
    dims: Hashable | tuple[Hashable, ...],
    theta: Any,  # noqa: ANN401 (an array)
    velocity: Any,  # noqa: ANN401 (an array)
    unit: str,
    name: str,
) -> dict[str, Any]:
    """Return stroboscopic points as two variables, named by a format like ``entry_{}``."""
    return {
        name.format("theta"): variable(dims, theta, "rad", "angle of a stroboscopic point"),
        name.format("velocity"): variable(dims, velocity, unit, "velocity of this point"),
    }


def labels(
    dims: tuple[str, ...],
    values: Any,  # noqa: ANN401 (an array)
    names: Iterable[str],
) -> tuple[Any, ...]:
    """Return the attractor of each start as a variable; ``names`` are those of the attractors."""
    comment = "number of the attractor; 0 undecided within the bound, -1 failed or diverged"
    flags = dict(enumerate(["failed", "undecided", *names], -1))
    return variable(dims, values, long_name="attractor", comment=comment, flags=flags)


def records(dataset: xr.Dataset, **variables: str) -> list[dict[str, Any]]:
    """Return a JSON object for each index of a dimension, from variables named by its keys."""
    return [dict(zip(variables, row, strict=True)) for row in rows(dataset, *variables.values())]


def rows(dataset: xr.Dataset, *names: str) -> Iterator[tuple[Any, ...]]:
    """Return an iterator over the values of variables, index by index of a dimension."""
    return zip(*(dataset[name].values.tolist() for name in names), strict=True)


def missed(starts: int) -> float:
    """Return the share that no start of this number hits with a probability of 5 %."""
    return 1 - math.pow(0.05, 1 / starts)


def binomial_ci95(share: Any, starts: int) -> NDArray[Any]:  # noqa: ANN401 (an array)
    """Return 95 % intervals of shares, one-sided of 0 and 1 (Clopper & Pearson 1934)."""
    from scipy.special import betaincinv  # noqa: PLC0415 (heavy)

    def low(hits: Floats) -> Floats:
        some = betaincinv(np.maximum(hits, 1), starts - hits + 1, 0.025)
        return np.select([hits < 1, hits == starts], [0.0, 1 - missed(max(starts, 1))], some)

    hits = np.rint(np.asarray(share, dtype=float) * starts)
    return np.stack([low(hits), 1 - low(starts - hits)], axis=-1)


def shares(dims: tuple[str, ...], share: Any, starts: int) -> dict[str, Any]:  # noqa: ANN401
    """Return shares of the starts as variables, with standard errors and 95 % intervals."""
    stderr = np.sqrt(share * (1 - share) / max(starts, 1))
    ci95, text = binomial_ci95(share, starts), "95 % interval of the share, binomial"
    return {
        "fraction": variable(dims, share, "1", "share of the starts", "0 where no start ends"),
        "stderr": variable(dims, stderr, "1", "standard error of the share"),
        "ci95": variable((*dims, "bound"), ci95, "1", text),
    }


def none_below_0(value: float) -> float | None:
    """Return a number, or None if it is negative: an event that did not happen."""
    return None if value < 0 else value


UNITS: Final = Field("units", "", "SI or nondimensional", None)
SECTION: Final = Field("section", "", "where the stroboscopic section lies", json=False)
TOL: Final = Field("tol", "1", "error after 5 periods that was asked for")
REACHED: Final = Found("reached_error", "1", "error after 5 periods that was reached")
STEPS: Final = Field("steps_per_period", "1", "steps of the integrator in a forcing period")
BOUND: Final = Field("max_periods", "periods", "bound after which a start is undecided", "bound")
CHAOS_BOUND: Final = Field("chaos_bound", "periods", "bound within which chaos was watched")
SECONDS: Final = Field("seconds", "s", "time of the computation")
SIMD: Final = Field("simd", "", "instruction set of the computation")
THREADS: Final = Field("threads", "1", "threads of the computation")
SEED: Final = Field("seed", "1", "seed of the samples")
VERSION: Final = Field("pendmap_version", "", "version of pendmap")
FORMAT: Final = Field("format_version", "1", "version of the dataset's layout")
BOX: Final = (
    Field("low_theta", "rad", "lower end of the angles of the box", json=False),
    Field("high_theta", "rad", "upper end of its angles", json=False),
    Field("low_velocity", OF_VELOCITY, "lower end of its velocities", json=False),
    Field("high_velocity", OF_VELOCITY, "upper end of its velocities", json=False),
)
OWN: Final = (
    Found("own_p", "1", "amplitude p of the model itself", json=False),
    Found("own_omega", "1", "frequency omega of the model itself", json=False),
)
TIMED: Final = (SECONDS, SIMD, THREADS)
RUN: Final = (*TIMED, SEED, VERSION, FORMAT)
VERSIONS: Final = (VERSION.hidden, FORMAT.hidden)  # Versions, as attributes only
SUMMARY: Final = Field("summary", "", "findings, a line each", None, convert=str.splitlines)
MISSES: Final = Field("misses_record", "1", "residual over noise where it is too large", None)
END: Final = (SUMMARY, MISSES)
