"""Analyses of one pendulum: one module a command."""
