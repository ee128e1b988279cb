"""Tables of the blind benchmark: rates, confusion matrix, calibration of probabilities.

Intervals are those of Wilson (1927), J. Am. Stat. Assoc. 22, 209, 95 %.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.blind.answer import STRONG, family
from benchmarks.blind.difficulty import CLEAR
from pendmap.model.effects import library

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    Row = dict[str, Any]

BINS = (0.0, 0.5, 0.8, 0.9, 0.95, 0.99, 1.0)
"""Edges of the bins in which probabilities are compared with frequencies."""

ENLARGED = 0.84
"""Probability from which the reliability diagram is magnified: most names are near 1."""

SEEN = 60.0
"""Score from which cases are included in the figures, together with ``STRONG``."""


def share_of(hits: int, of: int) -> tuple[float, float, float]:
    """Return a share with the ends of its interval."""
    z, share = 1.96, hits / of
    middle = (share + z * z / (2 * of)) / (1 + z * z / of)
    half = z * math.sqrt(share * (1 - share) / of + z * z / (4 * of * of)) / (1 + z * z / of)
    return share, max(middle - half, 0.0), min(middle + half, 1.0)


def wilson(hits: int, of: int) -> str:
    """Return a share with its interval as text."""
    if of == 0:
        return "no cases"
    share, low, high = (100 * x for x in share_of(hits, of))
    return f"{share:.1f} % ({hits} of {of}; {low:.1f} to {high:.1f} %)"


def true_names(row: Row) -> list[str]:
    """Return the names of the hidden effects, without their variants."""
    return [effect.split(":")[0] for effect in row["effects"] if effect != "none"]


def classes(row: Row) -> list[set[str]]:
    """Return for each claimed effect all names that the verdict holds possible."""
    return [{name, *next((c for c in row["classes"] if name in c), ())} for name in row["named"]]


def named_alone(row: Row) -> bool:
    """Return whether the claim is right, and its only alternatives are exact equals."""
    return right(row) and all(size == 1 for size in sizes(row))


def sizes(row: Row) -> list[int]:
    """Return the sizes of the claimed classes, with exact equals as one."""
    equals = {*row["equals"], *true_names(row)}
    return [len(own - equals) + bool(own & equals) for own in classes(row)]


def right(row: Row) -> bool:
    """Return whether the claimed effects equal the hidden ones, by name or by class.

    Two exact equals are one effect for these records: one class with both.
    """
    hidden = true_names(row)
    if len(hidden) > 1 and set(hidden) <= set(row["equals"]):
        return len(row["named"]) == 1 and set(hidden) <= classes(row)[0]
    return sound(row) and len(row["named"]) == len(hidden)


def sound(row: Row) -> bool:
    """Return whether each claimed effect is hidden, by its name or in its class."""
    hidden = true_names(row)
    for own in classes(row):
        name = next((name for name in hidden if name in own), None)
        if name is None:
            return False
        hidden.remove(name)
    return bool(row["named"])


def strength(row: Row) -> float:
    """Return the least score of the hidden effects."""
    return min(row["G"], default=0.0)


def confidently_wrong(row: Row) -> bool:
    """Return whether names are claimed without reserve, and none of them can be right."""
    return row["verdict"] in {"named", "ambiguous"} and not all(row["approximate"])


def careful(row: Row) -> bool:
    """Return whether a withheld effect got no name, or a reserved one of its family."""
    if not row["named"]:
        return True
    with_reserve = row["verdict"] == "partial" or all(row["approximate"])
    return with_reserve and of_family(row)


def figures(rows: list[Row]) -> list[list[str]]:
    """Return the lines of the table: what, target, measured."""

    def share(of: Iterable[Row], hit: Callable[[Row], bool]) -> str:
        chosen = list(of)
        return wilson(sum(map(hit, chosen)), len(chosen))

    def found(row: Row) -> bool:
        return bool(row["verdict"] != "none")

    def kind(what: str, least: float = 0.0) -> list[Row]:
        return [r for r in rows if r["what"] == what and strength(r) >= least]

    def told(of: list[Row]) -> list[Row]:
        return [r for r in of if r["s"] * strength(r) >= CLEAR]

    one, two = kind("one"), kind("two")
    clear, withheld = told(kind("one", STRONG)), told(kind("withheld", STRONG))
    many = [size for r in clear if right(r) for size in sizes(r)]
    inside, errors = _parameters([r for r in clear if r["named"] == true_names(r)])
    spoilt = [r for r in kind("nuisance") if not true_names(r)]
    hidden = [r for r in kind("nuisance") if true_names(r)]
    bent = kind("form", STRONG)
    seen = [r for r in hidden if strength(r) >= SEEN]
    main = [r for r in kind("mess", STRONG) if true_names(r) and min(r["G"]) >= r["disturbance"]]
    return [
        ["false alarms, nothing hidden", "at most 1 %", share(kind("none"), found)],
        ["right, G >= 100 and s G >= 25", "98 %", share(clear, right)],
        [
            "the name alone",
            "90 %",
            share(clear, named_alone),
        ],
        ["detected, G >= 60", "95 %", share(kind("one", SEEN), found)],
        ["detected, G >= 100", "99 %", share(kind("one", STRONG), found)],
        [
            "class size, G >= 100 and s G >= 25, mean",
            "1.5",
            f"{np.mean(many):.2f} of {len(many)}" if many else "no cases",
        ],
        ["both of a pair, G >= 100 and s G >= 25", "95 %", share(told(kind("two", STRONG)), right)],
        [
            "withheld, G >= 100 and s G >= 25: no name, or reserved and of the family",
            "90 %",
            share(withheld, careful),
        ],
        [
            "withheld, G >= 100 and s G >= 25: wrong name without reserve",
            "at most 5 %",
            share(withheld, confidently_wrong),
        ],
        ["wrongly unknown", "at most 2 %", share(one + two, lambda r: r["verdict"] == "unknown")],
        [
            "named without reserve, where right",
            "",
            share(
                (r for r in one + two if r["named"] and right(r)),
                lambda r: not any(r["approximate"]),
            ),
        ],
        ["95 % intervals that cover", "92 to 98 %", wilson(sum(inside), len(inside))],
        [
            "error times sqrt(G), median",
            "0.8",
            f"{np.median(errors):.2f} of {len(errors)}" if errors else "no cases",
        ],
        [
            "held-out chi^2/N afterwards, median",
            "1.03",
            f"{np.median([r['held'] for r in one + two]):.3f}" if one + two else "no cases",
        ],
        ["form differs, G >= 100: right family", "90 %", share(bent, of_family)],
        [
            "form differs, the library's leaves 100 or more: with reserve",
            "90 %",
            share((r for r in bent if r["beyond"] >= STRONG), reserved),
        ],
        ["nuisances: false alarms", "at most 2 %", share(spoilt, found)],
        ["nuisances: detected, G >= 60", "loss at most 5 points", share(seen, found)],
        [
            "nuisances: right, G >= 100 and s G >= 25",
            "loss at most 5 points",
            share(told([r for r in hidden if strength(r) >= STRONG]), right),
        ],
        ["mess: main effect named or first", "90 %", share(main, first)],
        ["mess: another name without reserve", "at most 5 %", share(main, another)],
        [
            "mess without a main effect: a name without reserve",
            "at most 5 %",
            share((r for r in kind("mess") if not true_names(r)), unreserved),
        ],
        [
            "seconds of one thread for 9 runs of 2,500 samples, median",
            "",
            f"{np.median([22500 * r['seconds'] / r['samples'] for r in rows]):.1f}" if rows else "",
        ],
    ]


def layouts(rows: Iterable[Row]) -> list[list[str]]:
    """Return false alarms, right names and impossible names by layout."""
    own = [row for row in rows if row["what"] == "layout"]
    lines = []
    for layout in dict.fromkeys(row["kind"] for row in own):
        those = [row for row in own if row["kind"] == layout]
        none = [r for r in those if not true_names(r)]
        seen = [r for r in those if strength(r) >= STRONG and r["s"] * strength(r) >= CLEAR]
        lines.append(
            [
                layout,
                wilson(sum(r["verdict"] != "none" for r in none), len(none)),
                wilson(sum(map(right, seen)), len(seen)),
                wilson(sum(map(another, those)), len(those)),
            ]
        )
    return lines


def first(row: Row) -> bool:
    """Return whether the first claimed effect is the main one, by its name or in its class."""
    return bool(row["named"]) and bool(classes(row)[0] & {*row["equals"], *true_names(row)})


def another(row: Row) -> bool:
    """Return whether a name is claimed without reserve that the main effect cannot have."""
    hidden = {*row["equals"], *true_names(row)}
    pairs = zip(classes(row), row["approximate"], strict=True)
    return any(not nearly and not own & hidden for own, nearly in pairs)


def unreserved(row: Row) -> bool:
    """Return whether any name is claimed without reserve."""
    return not all(row["approximate"])


def reserved(row: Row) -> bool:
    """Return whether no name is claimed, or none without reserve."""
    return row["verdict"] in {"unknown", "partial"} or all(row["approximate"])


def of_family(row: Row) -> bool:
    """Return whether the strongest claimed effect may be of the family of the hidden one.

    The hidden effect also has the families of its exact equals, which no record distinguishes.
    """
    if not row["named"]:
        return False
    kin = {family(name) for name in row["equals"] if name in library()} | set(row["families"])
    gains = [standing["gain"] for standing in row["standings"]]
    own = classes(row)[int(np.argmax(gains))]
    return any(family(name) in kin for name in own)


def _parameters(rows: Iterable[Row]) -> tuple[list[bool], list[float]]:
    """Return whether intervals of first parameters cover the truth, and the relative errors."""
    inside, errors = [], []
    for row in rows:
        name = row["named"][0]
        values, bounds = row["parameters"][name]
        size = next(iter(values))
        true = row["truth"].get(name, {}).get(size)
        if true is None or size not in bounds:
            continue
        low, high = bounds[size]
        inside.append(low <= true <= high)
        errors.append(abs(values[size] / true - 1) * math.sqrt(strength(row)))
    return inside, errors


def believed(rows: Iterable[Row]) -> tuple[list[float], list[bool]]:
    """Return all stated probabilities, and whether their names were right."""
    chances, true = [], []
    for row in rows:
        for name, chance in zip(row["named"], row["probability"], strict=True):
            chances.append(chance)
            true.append(name in true_names(row))
    return chances, true


def reliability(rows: Iterable[Row]) -> list[list[str]]:
    """Return, by bins of probability, the number of names, the mean, and the share right."""
    chances, true = (np.array(x) for x in believed(rows))
    lines = []
    for low, high in itertools.pairwise(BINS):
        own = (chances >= low) & ((chances < high) | (high == 1.0)) if chances.size else chances
        count = int(np.count_nonzero(own))
        if count:
            hits = int(np.count_nonzero(true[own]))
            mean = f"{float(np.mean(chances[own])):.3f}"
            lines.append([f"{low:g} to {high:g}", str(count), mean, wilson(hits, count)])
    return lines


def confusion(rows: Iterable[Row]) -> list[list[str]]:
    """Return the nonzero entries of the confusion matrix for single hidden effects."""
    counts: Counter[tuple[str, str]] = Counter()
    for row in rows:
        if row["what"] in {"one", "withheld", "form"} and strength(row) >= SEEN:
            said = (
                " + ".join(
                    "/".join([n, *sorted(c - {n})])
                    for n, c in zip(row["named"], classes(row), strict=True)
                )
                or row["verdict"]
            )
            reserve = "nearly " if row["named"] and all(row["approximate"]) else ""
            hidden = row["effects"][0] + (" (withheld)" if row["what"] == "withheld" else "")
            counts[hidden, reserve + said] += 1
    return [[hidden, said, str(times)] for (hidden, said), times in sorted(counts.items())]


def draw_reliability(rows: Iterable[Row], path: Path) -> None:
    """Plot the share of right names against their stated probability."""
    import matplotlib.pyplot as plt  # noqa: PLC0415 (for a picture only)

    chances, true = (np.array(x) for x in believed(rows))
    figure, axes = plt.subplots(figsize=(4.6, 4.6), layout="constrained")
    inner = axes.inset_axes((0.57, 0.08, 0.4, 0.4))
    for one in (axes, inner):
        one.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    for low, high in itertools.pairwise(BINS):
        own = (chances >= low) & ((chances < high) | (high == 1.0))
        count = int(np.count_nonzero(own))
        if not count:
            continue
        share, least, most = share_of(int(np.count_nonzero(true[own])), count)
        mean = float(np.mean(chances[own]))
        for one in (axes, inner):
            one.plot([mean, mean], [least, most], color="C0", linewidth=1.5)
            one.plot(mean, share, "o", color="C0", markersize=5)
        shown = inner if mean > ENLARGED else axes
        # The label of the last but one would overlap that of the last.
        beside = (-5, -11) if (low, high) == BINS[-3:-1] else (5, -11)
        side = "right" if beside[0] < 0 else "left"
        shown.annotate(
            str(count), (mean, share), xytext=beside, textcoords="offset points", ha=side
        )
    inner.set(xlim=(ENLARGED, 1.03), ylim=(0.75, 1.02))
    inner.tick_params(labelsize="small")
    axes.indicate_inset_zoom(inner, edgecolor="0.5")
    axes.set(xlim=(-0.02, 1.04), ylim=(-0.02, 1.04), aspect="equal")
    axes.set_xlabel("probability given to a name")
    axes.set_ylabel("share of names that were right")
    axes.set_title("Numbers: how many names; bars: 95 %", fontsize="medium", loc="left")
    figure.savefig(path, dpi=150)
    plt.close(figure)
