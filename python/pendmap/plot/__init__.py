"""Results in matplotlib Axes of one's own: ``pendmap.plot``.

Each function draws one part of a result, ``layer``, into ``ax`` and returns the Axes; fonts and
sizes are those of the user's style. ``plt.style.use("pendmap.figures")`` sets the style of
pendmap's files.

>>> import matplotlib.pyplot as plt
>>> import pendmap
>>> fig, (left, right) = plt.subplots(1, 2, layout="constrained")
>>> map_ = pendmap.basins(pendmap.Pendulum(p=0.6), pendmap.Grid.square(40))
>>> ax = pendmap.plot.basins(map_, left)
>>> ax = pendmap.plot.basins(map_, right, layer="settle", title=False)
>>> plt.close(fig)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from matplotlib.axes import Axes

from pendmap.charts import registry
from pendmap.charts.selection import member
from pendmap.errors import InputError, check_type, short_repr
from pendmap.render import axes, drawing, figure_of, style
from pendmap.render import draw as _save

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.colors import Colormap

    from pendmap.charts.chart import Chart, Sheet
    from pendmap.comparison import Comparison
    from pendmap.diagnosis import Discrepancy
    from pendmap.identification import IdentificationReport
    from pendmap.records import Experiment, Run

__all__ = [
    "Look",
    "basins",
    "bifurcation",
    "comparison",
    "diagnosis",
    "draw",
    "entries",
    "figure",
    "identification",
    "lifetime",
    "lyapunov",
    "map",
    "melnikov",
    "orbit",
    "parameter_map",
    "record",
    "save",
    "section",
    "sweep",
    "tongues",
    "trajectory",
]

figure = figure_of
save = _save

_FIRST = {
    "Experiment": "history",
    "Run": "history",
    "IdentificationReport": "peaks",
    "Comparison": "record",
    "Discrepancy": "ranking",
}
"""Part of a result that its function draws if none is asked for, where it is not the first."""


class Look(TypedDict, total=False):
    """Options of all functions.

    ``title`` is False for none, or a text; ``legend`` is True or False, by default a legend higher
    than half the panel is left out; ``colormap`` is a matplotlib colour map, or the name of one,
    for layers of numbers.
    """

    title: bool | str
    legend: bool
    colormap: str | Colormap


def draw(
    result: Any,  # noqa: ANN401 (a dataset, records, or what was found in records)
    ax: Axes | None = None,
    *,
    layer: str | None = None,
    **look: Unpack[Look],
) -> Axes:
    """Draw one part of any result into Axes.

    Parameters
    ----------
    result : xarray.Dataset or other result
        Result of an analysis, of ``load``, ``read_experiment``, ``identify``, ``compare`` or
        ``diagnose``. A selection of a dataset is drawn with its own cells and shares.
    ax : matplotlib.axes.Axes, optional
        By default those of a new figure of pyplot, which a notebook shows.
    layer : str, optional
        The part; an unknown one is answered with those of the result.
    **look
        ``title``, False or a text; ``legend``, True or False, without which one higher than half
        the panel is left out; ``colormap``, one of matplotlib or its name.

    Returns
    -------
    matplotlib.axes.Axes
        ``ax``, with marks, limits, ticks and labels.

    Raises
    ------
    InputError
        For what has no figure, and for an unknown layer or colour map.

    Examples
    --------
    >>> import pendmap
    >>> run = pendmap.simulate(pendmap.Pendulum(p=1.7), 1.0, 0.0, 60.0)
    >>> pendmap.plot.draw(run, layer="phase").get_xlabel()
    '$θ$ (rad)'
    """
    chart = _chart(result, layer)
    for name in look.keys() - Look.__annotations__.keys():
        known = ", ".join(Look.__annotations__)
        raise InputError(f"{name}: options must be among layer, {known}, or set on the Axes")
    if "colormap" in look:
        chart = drawing.in_colours(chart, look["colormap"])
    title, legend = look.get("title", True), look.get("legend")
    if legend is not None:
        check_type("legend", legend, bool, "False")
    with style.DRAWING:
        if ax is None:
            from matplotlib import pyplot as plt  # noqa: PLC0415 (a display, only if needed)

            ax = plt.figure(layout="constrained").add_subplot()
        check_type("ax", ax, Axes, "plt.gca()")
        axes.into(ax, chart, title=title is True, legend=legend)
        if isinstance(title, str):
            ax.set_title(title)
    return ax


def entries(result: Any, *, layer: str | None = None) -> tuple[list[Any], list[str]]:  # noqa: ANN401
    """Return the handles and the texts of a part's legend, for a legend of one's own.

    ``result`` and ``layer`` are those of :func:`draw`.

    >>> import matplotlib.pyplot as plt
    >>> import pendmap
    >>> fig, axes = plt.subplots(1, 2, layout="constrained")
    >>> map_ = pendmap.basins(pendmap.Pendulum(p=0.6), 40)
    >>> for ax, layer in zip(axes, ("labels", "settle")):
    ...     ax = pendmap.plot.basins(map_, ax, layer=layer, legend=False)
    >>> handles, texts = pendmap.plot.entries(map_)
    >>> legend = fig.legend(handles, texts, loc="outside lower center", ncols=3)
    >>> texts[-1]
    'rotation 1:+1, 8.81 %'
    >>> plt.close(fig)
    """
    with style.DRAWING:
        return axes.entries(axes.first(_chart(result, layer)))


def _chart(result: Any, layer: str | None) -> Chart | Sheet:  # noqa: ANN401 (as of draw)
    """Return the chart of one part of a result, by default of the leading one."""
    if layer is None:
        layer = _FIRST.get(type(result).__name__)
        if layer == "history" and len(getattr(result, "runs", [])) > 1:
            layer = "0"
    chart = registry.of_result(result, layer=layer)
    # Alone a part has no names that the other parts explain.
    return chart if layer else registry.of_result(result, layer=chart.panels[0].name)


def _draw(kind: str, result: Any, ax: Axes | None, layer: str | None, look: Look) -> Axes:  # noqa: ANN401
    own = registry.RESULTS.get(type(result).__name__)
    if kind == "basins" and hasattr(result, "coords"):
        result = member(result)
    given = own or getattr(result, "attrs", {}).get("kind") or short_repr(result)
    if given != kind:
        raise InputError(f"plot.{kind} draws results of kind {kind}, got {given}")
    return draw(result, ax, layer=layer, **look)


def basins(
    dataset: xr.Dataset, ax: Axes | None = None, *, layer: str | None = None, **look: Unpack[Look]
) -> Axes:
    """Draw a basin map, or one map of a sweep, like ``swept.sel(p=0.6)``.

    ``layer``: ``labels`` (by default; fractal maps: ``settle``, without attractors: ``turns``),
    ``settle``, ``turns``, ``exponent``; over draws ``probability`` and ``entropy``.
    """
    return _draw("basins", dataset, ax, layer, look)


def sweep(
    dataset: xr.Dataset, ax: Axes | None = None, *, layer: str | None = None, **look: Unpack[Look]
) -> Axes:
    """Draw basins along one or two parameters.

    ``layer`` along one parameter: ``fraction`` (by default), ``entropy``, ``uncertainty``,
    ``exponent``; over two: ``entropy`` (by default), ``boundary``, ``uncertainty``,
    ``attractors``, ``main``, ``share K``, ``undecided``.
    """
    return _draw("basin_sweep", dataset, ax, layer, look)


def parameter_map(
    dataset: xr.Dataset, ax: Axes | None = None, *, layer: str | None = None, **look: Unpack[Look]
) -> Axes:
    """Draw a map over two parameters.

    ``layer``: ``kinds`` (by default), ``exponent``, ``attractors``, ``period``, ``winding``,
    ``undecided``, ``share KIND``; over draws ``certainty``.
    """
    return _draw("parameter_map", dataset, ax, layer, look)


def bifurcation(
    dataset: xr.Dataset, ax: Axes | None = None, *, layer: str | None = None, **look: Unpack[Look]
) -> Axes:
    """Draw a bifurcation diagram.

    ``layer``: ``theta`` (by default), ``velocity``, ``sweeps``, ``exponent``.
    """
    return _draw("bifurcation", dataset, ax, layer, look)


def orbit(
    dataset: xr.Dataset, ax: Axes | None = None, *, layer: str | None = None, **look: Unpack[Look]
) -> Axes:
    """Draw closed orbits in the phase plane."""
    return _draw("orbits", dataset, ax, layer, look)


def lyapunov(
    dataset: xr.Dataset, ax: Axes | None = None, *, layer: str | None = None, **look: Unpack[Look]
) -> Axes:
    """Draw a largest Lyapunov exponent.

    ``layer``: ``growth`` (by default), ``average``, ``distribution``.
    """
    return _draw("lyapunov", dataset, ax, layer, look)


def lifetime(
    dataset: xr.Dataset, ax: Axes | None = None, *, layer: str | None = None, **look: Unpack[Look]
) -> Axes:
    """Draw the lifetime of transient chaos; ``layer`` is ``survival`` (by default), ``tail``."""
    return _draw("lifetime", dataset, ax, layer, look)


def tongues(
    dataset: xr.Dataset, ax: Axes | None = None, *, layer: str | None = None, **look: Unpack[Look]
) -> Axes:
    """Draw critical curves of rest.

    ``layer``: the plane, ``omega-p`` (by default) or ``e-alpha2``.
    """
    return _draw("tongues", dataset, ax, layer, look)


def melnikov(
    dataset: xr.Dataset, ax: Axes | None = None, *, layer: str | None = None, **look: Unpack[Look]
) -> Axes:
    """Draw Melnikov's threshold."""
    return _draw("melnikov", dataset, ax, layer, look)


def trajectory(
    dataset: xr.Dataset, ax: Axes | None = None, *, layer: str | None = None, **look: Unpack[Look]
) -> Axes:
    """Draw a trajectory.

    ``layer``: ``history`` (by default), ``energy``, ``phase``, ``section``.
    """
    return _draw("trajectory", dataset, ax, layer, look)


map = parameter_map  # noqa: A001 (the command's name)


def section(dataset: xr.Dataset, ax: Axes | None = None, **look: Unpack[Look]) -> Axes:
    """Draw the Poincare section of a trajectory, once a period of the drive."""
    return trajectory(dataset, ax, layer="section", **look)


def record(
    records: Experiment | Run,
    ax: Axes | None = None,
    *,
    layer: str | None = None,
    **look: Unpack[Look],
) -> Axes:
    """Draw a record: the samples for fitting and the others, against time.

    ``layer`` of a single record: ``history`` (by default), ``clock`` (intervals between samples),
    ``last`` (the noise); of several the number of the run from ``0``.
    """
    return _draw("record", records, ax, layer, look)


def identification(
    report: IdentificationReport,
    ax: Axes | None = None,
    *,
    layer: str | None = None,
    **look: Unpack[Look],
) -> Axes:
    """Draw an identification: measured peaks and those of each method's model.

    ``layer`` is ``peaks`` (by default) or one that the message on an unknown one lists.
    """
    return _draw("identification", report, ax, layer, look)


def comparison(
    compared: Comparison,
    ax: Axes | None = None,
    *,
    layer: str | None = None,
    **look: Unpack[Look],
) -> Axes:
    """Draw a model against a record, of several the first.

    ``layer`` is ``record`` (by default), ``residual`` or ``errors`` of a free run.
    """
    return _draw("comparison", compared, ax, layer, look)


def diagnosis(
    found: Discrepancy,
    ax: Axes | None = None,
    *,
    layer: str | None = None,
    **look: Unpack[Look],
) -> Axes:
    """Draw a diagnosis: how much each effect of the library would explain.

    ``layer`` is ``ranking`` (by default), ``by run``, ``angle`` or ``velocity`` (the missing
    torque), ``residual 0``, or one that the message on an unknown one lists.
    """
    return _draw("diagnosis", found, ax, layer, look)


def __dir__() -> list[str]:
    return __all__
