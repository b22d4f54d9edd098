//! One table of all actions with their names and keys, and lines that say the same in words.
//! Browser, window and standard input use both.
//!
//! A key has the name that browsers give its place on the keyboard, such as `KeyW` or `ArrowUp`. A
//! key of one character, such as `?`, is what is typed, wherever it is on the keyboard.

mod line;
mod table;
mod typed;

pub use line::parse;
pub use table::{ACTIONS, Action, Does, GESTURES, Local, Part, Toggle, action_of};
pub use typed::follow_standard_input;
