//! Furniture, one kind per file.
//!
//! Invariant: coordinates are in metres, +z is up, and things stand on z = 0. Things against a
//! wall have their back at y = 0, face +y and are centred in x. Free-standing things are centred on
//! the z axis. Things that hang from a ceiling hang from z = 0.

pub mod bath;
pub mod bed;
pub mod decor;
pub mod kitchen;
pub mod lamp;
pub mod plant;
pub mod seat;
pub mod shelf;
pub mod table;
