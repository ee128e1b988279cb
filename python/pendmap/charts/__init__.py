"""Charts of results: names, shares, ticks and cells that figures and recordings share.

``layers``: which layers of a map lead, and their titles; ``legend``: names, colours and shares of
the attractors; ``plane``: cells, ticks and curves of the phase plane; ``names``: of axes, by units.
No drawing library is
imported here.
"""
