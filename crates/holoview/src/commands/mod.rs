//! What a person can have a session do: one table of actions with their names and keys, and lines
//! that say the same in words. Browser, window and standard input all use these.
//!
//! A key has the name that browsers give it, such as `KeyW` or `ArrowUp`: the place on the keyboard.
//! A key of one character, such as `?`, is what is typed, wherever it is on the keyboard.

mod line;
mod table;
mod typed;

pub use line::parse;
pub use table::{ACTIONS, Action, Does, GESTURES, Local, Part, Toggle, action_of};
pub use typed::follow_standard_input;
