"""Schema of a result: attributes of its dataset and keys of its JSON object, from one table."""

from __future__ import annotations

import dataclasses
import math
import operator
from typing import TYPE_CHECKING, Any, Final

from pendmap.model.covariance import misses

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping

    import xarray as xr

    from pendmap.model import Pendulum, Rig

OF_TIME: Final = "1/w0 or s"  # Unit of times: without dimensions or in SI, as the model is
OF_RATE: Final = "1/tau or 1/s"  # Unit of exponents: without dimensions or in SI
OF_VELOCITY: Final = "1 or rad/s"  # Unit of velocities: without dimensions or in SI


@dataclasses.dataclass(frozen=True)
class Field:
    """An attribute of a dataset and the key of its JSON object, or one of the two alone."""

    name: str
    unit: str
    meaning: str
    core: str | None = ""
    """Path of the value in the core's result if the name differs, like ``texture.chance``; None if
    the core's result does not have it."""
    json: bool = True
    """Whether the JSON object has the key."""
    convert: Callable[[Any], Any] | None = None
    """Function that converts the attribute to the JSON value."""
    read: Callable[[xr.Dataset], Any] | None = None
    """Function that computes the JSON value from the dataset, if no attribute holds it."""
    when: str = ""
    """Attribute that must be true for the JSON object to have the key."""

    @property
    def hidden(self) -> Field:
        """The field without its key in the JSON object."""
        return dataclasses.replace(self, json=False)

    def value(self, dataset: xr.Dataset) -> Any:  # noqa: ANN401 (any part of a JSON object)
        """Return the JSON value; null where the attribute is absent."""
        if self.read is not None:
            return self.read(dataset)
        value = dataset.attrs.get(self.name)
        return value if value is None or self.convert is None else self.convert(value)


class Schema:
    """The fields of one kind of dataset, in the order of the JSON object."""

    def __init__(self, kind: str, *fields: Field) -> None:
        self.kind = kind
        self.fields = fields

    def complete(
        self,
        dataset: xr.Dataset,
        model: Pendulum | Rig,
        values: Mapping[str, Any],
        raw: object = None,
    ) -> None:
        """Set the attributes of a dataset: values given, else those of the core's result."""
        values = {"section": model.units.section, **values}
        dataset.attrs = {"kind": self.kind, "title": model.title, **model.attributes}
        for field in self.fields:
            value = values.get(field.name)
            if not (field.name in values or field.read or field.core is None or raw is None):
                value = operator.attrgetter(field.core or field.name)(raw)
            if value is not None:
                dataset.attrs[field.name] = value

    def json(self, dataset: xr.Dataset) -> dict[str, Any]:
        """Return the JSON object of a dataset."""
        return {
            field.name: field.value(dataset)
            for field in self.fields
            if field.json and (not field.when or dataset.attrs[field.when])
        }


def of_model(model: Pendulum | Rig, what: str) -> list[str]:
    """Return summary lines on a model that misses its record or has effects on its reading."""
    ratio = misses(model.notes)
    lines = []
    if math.isfinite(ratio):
        lines.append(f"This model misses its record by {ratio:.3g} times the noise.")
    names = [effect.name for effect in model.effects if effect.reads]
    if names:
        verb = "acts" if len(names) == 1 else "act"
        lines.append(
            f"{', '.join(names)} {verb} on the sensor's reading alone: {what} of the motion itself."
        )
    return lines


def summarised(dataset: xr.Dataset, lines: Iterable[str], model: Pendulum | Rig, what: str) -> None:
    """Set the summary of a dataset; ``what`` begins the note on effects on the reading."""
    dataset.attrs["summary"] = "\n".join([*lines, *of_model(model, what)])


def variable(
    dims: str | tuple[Hashable, ...],
    values: Any,  # noqa: ANN401 (an array)
    units: str = "",
    long_name: str = "",
    comment: str = "",
) -> tuple[str | tuple[Hashable, ...], Any, dict[str, str]]:
    """Return a variable of a dataset with the attributes that are not empty."""
    attributes = {"units": units, "long_name": long_name, "comment": comment}
    return dims, values, {key: text for key, text in attributes.items() if text}


def records(dataset: xr.Dataset, **variables: str) -> list[dict[str, Any]]:
    """Return a JSON object for each index of a dimension, from variables named by its keys."""
    return [dict(zip(variables, row, strict=True)) for row in rows(dataset, *variables.values())]


def rows(dataset: xr.Dataset, *names: str) -> Iterator[tuple[Any, ...]]:
    """Return an iterator over the values of variables, index by index of a dimension."""
    return zip(*(dataset[name].values.tolist() for name in names), strict=True)


def none_below_0(value: float) -> float | None:
    """Return a number, or None if it is negative: an event that did not happen."""
    return None if value < 0 else value


UNITS: Final = Field("units", "", "SI or nondimensional", None)
SECTION: Final = Field("section", "", "where the stroboscopic section lies", json=False)
TOL: Final = Field("tol", "1", "error after 5 periods that was asked for")
REACHED: Final = Field("reached_error", "1", "error after 5 periods that was reached")
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
    Field("own_p", "1", "amplitude of the model itself", json=False),
    Field("own_omega", "1", "frequency of the model itself", json=False),
)
TIMED: Final = (SECONDS, SIMD, THREADS)
RUN: Final = (*TIMED, SEED, VERSION, FORMAT)
VERSIONS: Final = (VERSION.hidden, FORMAT.hidden)  # Versions, as attributes only
SUMMARY: Final = Field(
    "summary", "", "findings, a sentence a line", None, convert=lambda text: text.split("\n")
)
MISSES: Final = Field(
    "misses_record", "1", "residual over noise of a model that misses its record", None
)
END: Final = (SUMMARY, MISSES)
