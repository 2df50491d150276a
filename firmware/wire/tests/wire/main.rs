//! The wire as a whole: golden bytes, worst cases, portions, damages, versions, round trips.

mod capture;
mod damage;
mod golden;
mod line_load;
mod newer;
mod portions;
mod round_trip;
mod specification;
