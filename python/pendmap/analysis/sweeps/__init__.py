"""Sweeps of basin maps: their tiles, the matching of attractors, their table and their report."""
