"""Coefficients of pendmap/diagnosis/verdict.py from blind experiments.

    python -m benchmarks.blind.calibration blind.jsonl [more.jsonl ...]

A name is right if the effect is hidden, by itself or in its class. The method is logistic
regression with a normal prior of width 1 about the present coefficients, so that few experiments
change little. The experiments used for calibration must not be those that test the probabilities:
use another seed.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from benchmarks.blind.report import classes, true_names
from pendmap.diagnosis.verdict import COEFFICIENTS, features

WIDTH = 1.0
"""Standard deviation of the prior."""


def main() -> None:
    """Fit and print the coefficients."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", type=Path, nargs="+")
    lines = [
        line
        for file in parser.parse_args().files
        for line in file.read_text(encoding="utf-8").splitlines()
    ]
    rows = [row for row in map(json.loads, lines) if row.get("named")]
    x, y = [], []
    for row in rows:
        gains = {s["name"]: s["gain"] for s in row["standings"]}
        x += features(row["form"][0], [gains[name] for name in row["named"]])
        hidden = {*true_names(row), *(row["equals"] if row["what"] == "mess" else ())}
        y += [bool(own & hidden) for own in classes(row)]
    prior = np.array(COEFFICIENTS)

    def loss(b: np.ndarray) -> float:
        sign = np.where(y, 1.0, -1.0)
        fit = np.sum(np.logaddexp(0.0, -sign * (np.array(x) @ b)))
        return float(fit + 0.5 * np.sum(((b - prior) / WIDTH) ** 2))

    found = minimize(loss, prior)
    print(f"{len(y)} names, {int(np.sum(y))} right")
    print("COEFFICIENTS =", tuple(round(float(b), 2) for b in found.x))


if __name__ == "__main__":
    main()
