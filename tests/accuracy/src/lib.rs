//! Each claim about centres and pose, simulated: a function that gives the figures of one case and one seed,
//! and a table over all of them. `cargo run --release -p accuracy` prints the tables, the tests assert them
//! in short.

pub mod bound;
pub mod centres;
pub mod drawn;
pub mod methods;
pub mod outliers;
pub mod picture;
pub mod plane;
pub mod random;
pub mod scatter;
pub mod sets;
pub mod shutter;
pub mod statistics;
pub mod table;
