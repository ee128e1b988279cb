"""Reading and writing of model files: TOML, without dimensions or in SI."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pendmap.errors import InputError, check_type, named
from pendmap.files import read_toml, whole_file
from pendmap.model.pendulum import Pendulum
from pendmap.model.rig import Rig
from pendmap.model.tables import model_arguments, model_text

if TYPE_CHECKING:
    from collections.abc import Mapping


def load_model(
    path: str | os.PathLike[str], typed: Mapping[str, float] | None = None
) -> Pendulum | Rig:
    """Read a model file.

    The table ``[pendulum]`` has the parameters of a :class:`Pendulum`, or those of a :class:`Rig`
    in SI with the other ways to write them that :meth:`Rig.of` takes; without dimensions ``zeta``
    may replace ``gamma`` = 2 zeta. A missing key is 0. Each ``[[effect]]`` has a ``name`` and
    ``parameters`` and may have ``ci95``, ``probability`` and ``approximate``; each ``[[formula]]``
    is a :class:`Formula`, which effects may name; ``[covariance]`` and ``[provenance]`` are kept in
    the model's ``notes``; typed parameters are known exactly and are removed from the covariance.

    Parameters
    ----------
    path : str or path
        The file.
    typed : mapping of str to float, optional
        Parameters that replace the file's: those of a pendulum without dimensions, also where the
        file is in SI, and there ``stroke_mm`` and ``frequency_hz``.

    Returns
    -------
    Pendulum or Rig
        By the file's keys.

    Raises
    ------
    InputError
        If the file is not TOML, has unknown keys, keys of both kinds, values outside their ranges,
        or numbers that contradict; on one line that names the file.
    OSError
        If it cannot be read.

    Examples
    --------
    >>> import pendmap
    >>> path = pendmap.save_model(pendmap.Rig(w0=6.2, c_over_m=0.05, Tr=0.08), "rig.toml")
    >>> pendmap.load_model(path).w0
    6.2
    """
    return _model(read_toml(path), os.fspath(path), typed)


def save_model(model: Pendulum | Rig, path: str | os.PathLike[str]) -> Path:
    """Write a model file; it is complete or absent, and reads back as the same model.

    Parameters
    ----------
    model : Pendulum or Rig
        Its ``notes`` are written as the tables ``[covariance]`` and ``[provenance]``.
    path : str or path
        A .toml file.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If it is no model, the suffix is not .toml, or the notes are no tables for TOML.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> path = save_model(Pendulum(gamma=0.2, p=0.6), "model.toml")
    >>> load_model(path).gamma
    0.2
    """
    if not isinstance(model, Rig):
        check_type("model", model, Pendulum, "Pendulum(p=0.6)")
    try:
        text = model_text(model)
    except (TypeError, ValueError) as error:
        raise InputError(f"{os.fspath(path)}: notes: {error}") from None
    with whole_file(path, (".toml",)) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
    return Path(path)


def parse_model(text: str, where: str, typed: Mapping[str, float] | None = None) -> Pendulum | Rig:
    """Return the model of :func:`model_text`, with ``typed`` values; ``where`` is for errors."""
    return _model(tomllib.loads(text), where, typed)


def _model(
    content: dict[str, Any], where: str, typed: Mapping[str, float] | None
) -> Pendulum | Rig:
    with named(where):
        in_si, arguments = model_arguments(content, typed or {})
        return Rig.of(**arguments) if in_si else Pendulum(**arguments)
