"""What figures and recordings share, so that both show the same names, shares, ticks and cells.

``layers``: which layers of a map lead, and their titles; ``legend``: names, colours and shares of
the attractors; ``plane``: cells, ticks and curves of the phase plane; ``names``: of axes, by units.
No drawing library is
imported here.
"""
