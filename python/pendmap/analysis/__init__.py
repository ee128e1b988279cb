"""Analyses of a pendulum, one a module: :data:`pendmap.ANALYSES` lists them."""
