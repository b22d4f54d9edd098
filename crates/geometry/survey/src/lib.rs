//! Surveys a scene without metadata. It determines what a person sees at first sight: the up
//! direction, the length of the unit, the rooms, and where to stand.
//!
//! A [`UprightAxes`] states which way is up. [`Survey::new`] divides the scene into cells, finds
//! the places where a person's eyes can be, and puts boxes into the rooms among them.
//! [`Survey::limit`] limits their number, and joins the remaining ones through doors. A scene
//! without rooms is an object, and its view is from outside. So is that of a thing with rooms, such
//! as a car.
//!
//! Invariants:
//! - Each guess comes with its reason, in words for people.
//! - A result is a function of the scene, the frame and the stated unit. It does not depend on
//!   threads or clocks.
//! - Memory is bounded by [`grid::MAX_CELLS`], time by the number of triangles and cells.

mod clip;
mod columns;
mod doors;
mod findings;
mod frame;
pub mod grid;
mod level;
mod lit;
mod names;
mod outside;
mod plan;
mod rectangle;
mod rooms;
mod sight;
mod unit;
mod up;

pub use findings::{Finding, findings, memory, white_materials};
pub use frame::UprightAxes;
pub use lit::{LEAST_LAMP, has_lamps, is_lit_by_lamps};
pub use plan::FloorPlan;
pub use rooms::{Door, Room, Survey};
pub use sight::ChosenView;
pub use unit::{Unit, unit_words};
pub use up::guess_up;

/// A value that was guessed, and the reason.
#[derive(Clone, Debug, PartialEq)]
pub struct Guess<T> {
    /// The guessed value.
    pub value: T,
    /// The reason, for people.
    pub reason: String,
}

impl<T> Guess<T> {
    pub(crate) fn new(value: T, reason: impl Into<String>) -> Guess<T> {
        Guess { value, reason: reason.into() }
    }
}
