//! Furniture, one kind to a file.
//!
//! Always: metres, +z up, standing on z = 0. What stands or hangs against a wall has its back at y = 0 and looks towards
//! +y, centred in x; what stands free is centred on the z axis; what hangs from a ceiling hangs from z = 0.

pub mod bath;
pub mod bed;
pub mod decor;
pub mod kitchen;
pub mod lamp;
pub mod plant;
pub mod seat;
pub mod shelf;
pub mod table;
