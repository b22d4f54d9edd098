//! The front end without a screen: follows a script and writes pictures.

mod parse;
mod player;

pub use parse::{Command, Script, Step, parse_seconds};
pub use player::play;
