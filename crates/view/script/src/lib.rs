//! The front end without a screen: follows a script in a session, and writes and reports pictures.
//!
//! Invariants:
//! - A picture at a script's second shows what had arrived by then.
//! - The last picture shows all that was requested, so a replay of the file draws the same one.

mod parse;
mod player;
mod report;
#[cfg(test)]
#[path = "../../session/src/tests/server.rs"]
mod server;

pub use parse::{Command, Script, ScriptStep, parse_seconds};
pub use player::{ScriptOptions, picture, play};
pub use report::PictureReport;
