"""``pendmap tongues``: critical curves of rest, hanging and inverted."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

from pendmap.cli.analysis import analysis_command
from pendmap.cli.parse.groups import group
from pendmap.cli.parse.model_options import model_options
from pendmap.cli.parse.options import option
from pendmap.cli.parse.types import VALUES

if TYPE_CHECKING:
    from pendmap.cli.show import Outputs


@analysis_command(
    "tongues",
    option(
        "--omega omegas",
        VALUES,
        "Frequencies Omega/w0 of the drive.  [default: 0.5:3:200]",
        group=group("Frequencies", "--omega 0.5:3:200"),
    ),
    "p_max plane",
    example="--p-max 6 --plane e-alpha2",
    examples=(
        "pendmap tongues --omega 0.5:3:200 --p-max 6",
        "pendmap tongues --gamma 0 --plane e-alpha2 --out mathieu.pdf",
    ),
    model=functools.partial(model_options, left_out=("omega", "frequency_hz")),
)
def command(_: object, outputs: Outputs, **given: Any) -> dict[str, Any]:  # noqa: ANN401
    """Find where rest, hanging and inverted, is stable: critical curves of eq. 1.3, exact.

    Also without damping; folds of the oscillation born there; curves by perturbation. For files,
    frequencies are added where curves turn back; --json lists the requested ones.
    """
    return {"omega": given.pop("omegas"), "refine": outputs.draws, **given}
