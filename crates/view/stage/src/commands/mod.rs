//! The table of all actions with their names and keys, and the command lines that do the same.
//! Browser, window and standard input use both.
//!
//! A key is named after its place on the keyboard, as in browsers: `KeyW` or `ArrowUp`. A key of
//! one character, such as `?`, is named after what it types, wherever it is on the keyboard.

mod line;
mod table;
mod typed;

pub use line::parse;
pub use table::{ACTIONS, Action, Does, GESTURES, Local, Part, Toggle, action_of};
pub use typed::follow_standard_input;
