"""Make the pictures of the README: `python docs/pictures.py`, from anywhere."""

from __future__ import annotations

from pathlib import Path

from pendmap import Pendulum, basins, figures

HERE = Path(__file__).resolve().parent
SIZE = (6.4, 6.0)

figures.draw(basins(Pendulum(p=0.6)), HERE / "smooth.png", layer="labels", size=SIZE, dpi=110)
figures.draw(basins(Pendulum(p=1.7)), HERE / "fractal.png", layer="settle", size=SIZE, dpi=110)
