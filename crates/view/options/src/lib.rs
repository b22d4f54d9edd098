//! Options that choose a view and the look of pictures, shared by every program that shows or
//! writes pictures.
//!
//! Invariant: each option has the same name and the same meaning in all commands.

mod look;
mod view;

pub use look::{LookArgs, Range, ToneArg};
pub use view::{ViewArgs, parse_size};
