//! attractors
