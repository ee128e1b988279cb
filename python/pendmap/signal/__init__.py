"""Tools on sampled signals that know no pendulum."""
