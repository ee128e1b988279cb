"""Charts of results, independent of drawing libraries, for figures and recordings.

One module builds the chart of one kind of result; ``chart`` and ``marks`` hold the data classes,
``legend`` names, colours and shares of attractors, ``plane`` cells, ticks and curves of the phase
plane, ``names`` axis names by units.
"""
