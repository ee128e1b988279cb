//! orbits
