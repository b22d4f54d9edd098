//! What the program `holodeck` does, as functions that return values: its commands only parse
//! options and print results.
//!
//! | task | function |
//! | --- | --- |
//! | open a scene, and choose what is not stated | [`opening::open`] |
//! | make a file of a scene | [`prepare::make`] |
//! | trace a scene into a file | [`fill::fill`] |
//! | walk through a scene while it is traced | [`session::LiveSession`] |
//! | show a file, or make a picture of it | [`session::replay`], [`session::picture`] |
//! | a picture straight from the tracer | [`render::render`] |
//! | what a file holds, and its damage | [`info::info`], [`info::verify`] |
//! | merge files, remove samples | [`files::merge`], [`files::forget`] |
//! | objects that become part of a file's scene | [`bake::bake`] |
//! | static files that draw a file in a browser | [`export::export`] |
//! | splats of a file, for huge files and pages | [`splats::make`] |
//! | a file of captured pictures | [`import::import`] |
//! | a file that is read faster, or has other sections | [`files::optimize`], [`files::copy`] |
//! | what is odd in a model | [`check::check`] |
//! | the difference between two pictures | [`compare::compare`] |
//! | the state of a running server | [`status::QueriedServer`] |
//!
//! Invariants:
//! - Nothing here prints on standard output. Progress, notes and warnings go to standard error as
//!   they come.
//! - Another process is known by the reports that it sends ([`processes`]), never by what it
//!   prints.

pub mod bake;
mod brightness;
pub mod check;
pub mod compare;
pub mod config;
mod crew;
mod depths;
mod differences;
pub mod export;
pub mod files;
pub mod fill;
pub mod import;
pub mod info;
pub mod light;
mod limit;
pub mod listening;
mod loading;
mod objects;
pub mod opening;
mod passes;
pub mod places;
pub mod prepare;
mod preview;
pub mod processes;
pub mod render;
mod seen;
pub mod session;
pub mod settings;
pub mod splats;
mod standard_errors;
pub mod status;
mod sums;
pub mod value_ranges;
mod worker;
