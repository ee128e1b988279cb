//! bifurcations
