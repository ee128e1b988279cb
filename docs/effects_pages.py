"""Pages of the effects of the library: definition, signature, hidden example.

A signature comes from the virtual rig, without noise: a free decay and a forced run, each with and
without the effect.
"""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl

mpl.use("agg")
import matplotlib.pyplot as plt
import numpy as np
from scipy.interpolate import make_interp_spline

import pendmap
from pendmap import virtual_rig
from pendmap.files import toml_text
from pendmap.formatting import wrapped

if TYPE_CHECKING:
    from pendmap import EffectDefinition

HERE = Path(__file__).resolve().parent
PAGES = HERE / "effects"
EXAMPLES = HERE / "effects_examples.json"
COLOURS = {"free": "#0072B2", "forced": "#D55E00"}
RIG = {"w0": 6.2, "c_over_m": 0.05, "friction": 0.06}
PLANS = (
    virtual_rig.RunPlan("free", 2.5, 0.0, 8.0),
    virtual_rig.RunPlan("forced", 0.6, 0.0, 8.0, 0.8, 12.4, lab_time=60.0),
)
ACROSS = {"damping": "v", "dry friction": "v", "position torque": "theta"}
"""What the missing torque is drawn against, by family; time otherwise."""
AXES = {"v": "velocity (rad/s)", "theta": "angle (rad)", "t": "time since the run began (s)"}
MAPPABLE = {
    "yes": "yes",
    "frozen": "with the time in the laboratory held at `lab_time`",
    "no": "no: `pendmap simulate` takes it",
}


@functools.cache
def records(name: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return times (s) and angles (rad) of both runs, without noise and counts."""
    request = virtual_rig.Request(
        "hidden", seed=1, effects=(name,), plans=PLANS, noise=0.0, counts=0, rate=200.0, **RIG
    )
    return [(run.time, run.angle) for run in virtual_rig.make(request).runs]


def missing(
    plan: virtual_rig.RunPlan, time: np.ndarray, angle: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the torque that the model lacks along a record, with time, angle and velocity."""
    curve = make_interp_spline(time, angle, k=5)
    drive = {"p": plan.p, "Omega": plan.frequency, "phi": plan.phase} if plan.p else {}
    rig = pendmap.Rig(w0=RIG["w0"], c_over_m=RIG["c_over_m"], Tr=RIG["friction"], **drive)
    found = {"t": time, "theta": curve(time), "v": curve(time, 1)}
    found["torque"] = curve(time, 2) - rig.acceleration(time, found["theta"], found["v"])
    # A spline does not follow the jumps of the acceleration where the motion turns or sticks.
    smooth = np.abs(found["v"]) > 0.05 * np.abs(found["v"]).max()
    smooth[:10] = smooth[-10:] = False
    return {name: values[smooth] for name, values in found.items()}


def draw(effect: EffectDefinition) -> None:
    """Draw the change of the records and the missing torque."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.4), layout="constrained")
    across = ACROSS.get(effect.family, "t")
    for plan, (time, before), (_, after) in zip(
        PLANS, records("none"), records(effect.name), strict=True
    ):
        colour = COLOURS[plan.kind]
        left.plot(time, 1e3 * (after - before), color=colour, lw=1.0, label=plan.kind)
        states = missing(plan, time, after)
        right.plot(states[across], states["torque"], ".", ms=2, color=colour)
    left.set(xlabel=AXES["t"], ylabel="with less without (mrad)", title="Change of the record")
    right.set(xlabel=AXES[across], ylabel="torque (rad/s²)", title="Missing torque")
    left.legend(frameon=False)
    figure.savefig(PAGES / f"{effect.name}.png", dpi=80)
    plt.close(figure)


def examples(name: str, stored: dict[str, list[str] | None]) -> str:
    """Return the section of the hidden example; of a larger effect, too, if it was not found."""
    mine = {words: found for words, found in stored.items() if words.split()[0] == name and found}
    parts = [_example(words, found, last=words == [*mine][-1]) for words, found in mine.items()]
    return "\n## A hidden example\n" + "".join(parts) if parts else ""


def _example(words: str, found: list[str], *, last: bool) -> str:
    """Return commands, what they print, and whether it is right."""
    name, lines = words.split(maxsplit=1)[0], "\n".join(found)
    printed = wrapped(lines)
    right = f"\n  {name}: " in f"\n{lines}"
    if right and "Verdict: named" in lines:
        note = "The name is the right one."
    elif right:
        note = "The effect that was hidden is among the names; these records do not settle it."
    elif name in lines:
        note = "The effect that was hidden is in the class of indistinguishable names."
    elif "Verdict: none" in lines and last:
        note = "The baseline has this term."
    elif "Verdict: none" in lines:
        note = "These records do not show an effect of this size, but one that is larger:"
    else:
        note = "The effect that was hidden is not named."
    return f"""
```text
$ pendmap rig hidden --effect {words} --seed 1 --out hidden
$ pendmap diagnose hidden
{printed}
```

{note}
"""


def page(effect: EffectDefinition, stored: dict[str, list[str] | None]) -> str:
    """Return the page of an effect."""
    rows = "\n".join(
        f"| `{each.name}` | {each.role} | {each.unit} | {each.typical[0]:.4g} to"
        f" {each.typical[1]:.4g} | {each.meaning} |"
        for each in effect.parameters
    )
    middle = {each.name: float(f"{each.middle:.3g}") for each in effect.parameters}
    entry = toml_text({"effect": [{"name": effect.name, "parameters": middle}]})
    return f"""# {effect.name}

```text
{effect.formula}
```

| | |
|---|---|
| group | {effect.group} |
| family | {effect.family} |
| revealed by | {effect.revealed_by} |
| in maps | {MAPPABLE[effect.mappable]} |

| parameter | role | unit in SI | of interest, without dimensions | meaning |
|---|---|---|---|---|
{rows}

In a model file without dimensions:

```toml
{entry.strip()}
```

## Signature

![Change of two records by {effect.name}, and the missing torque]({effect.name}.png)

Two records of the virtual rig, without noise. Left: the record with the effect less the record
without it. Right: the torque that the model without the effect lacks along the record with it. The
size of the effect is that of `pendmap rig hidden --effect {effect.name} --seed 1`.
{examples(effect.name, stored)}"""


def index(effects: list[EffectDefinition]) -> str:
    """Return the page that lists all effects."""
    rows = "\n".join(
        f"| [{each.name}]({each.name}.md) | {each.group} | {each.revealed_by} |" for each in effects
    )
    names = "\n".join(effect.name for effect in effects)
    return f"""# Effects

```sh
pendmap effects magnet
```

shows an effect and its entry in a model file. Formulas are terms on the right of `th'' = ...`;
those of drives give the motion of the pivot, those of readings what the sensor shows.

| effect | group | revealed by |
|---|---|---|
{rows}

```{{toctree}}
:hidden:

{names}
```
"""


def write() -> None:
    """Write all pages; a picture that exists is not drawn again."""
    PAGES.mkdir(exist_ok=True)
    effects = pendmap.effects()
    stored = json.loads(EXAMPLES.read_text(encoding="utf-8")) if EXAMPLES.exists() else {}
    pages = {effect.name: page(effect, stored) for effect in effects} | {"index": index(effects)}
    for effect in effects:
        if not (PAGES / f"{effect.name}.png").exists():
            draw(effect)
    for name, text in pages.items():
        path = PAGES / f"{name}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
