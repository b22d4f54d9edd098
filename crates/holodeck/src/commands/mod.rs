//! The commands: each parses its options, calls the library, and prints the result.

use std::path::PathBuf;

use anyhow::{Context, Result};
use holo_server::Outside;

pub mod arguments;
pub mod bake;
pub mod check;
pub mod compare;
pub mod copy;
pub mod demo;
pub mod export;
pub mod fill;
pub mod forget;
pub mod import;
pub mod info;
mod light_args;
mod listen_args;
pub mod merge;
mod metrics;
pub mod optimize;
#[cfg(test)]
mod options_page;
pub mod picture;
pub mod render;
mod scene_args;
pub mod sections;
pub mod splats;
pub mod status;
pub mod tokens;
pub mod view;

/// Returns the path of this program, which contains the server and the worker.
fn program() -> Result<PathBuf> {
    std::env::current_exe().context("finding this program")
}

/// Prints the string that other machines join with, and the address.
fn print_invitation(Outside { address, invitation }: &Outside) {
    holo_progress::print_line!("join with {invitation}");
    holo_progress::print_line!("listening for other machines on {address}");
}
