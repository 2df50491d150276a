//! Simulated rides: motion, optics, light, noise and exact truth.
