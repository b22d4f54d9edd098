//! Options of the display process, shared by every program that shows views.

mod driver;
mod look;
mod render_cache;
mod view;

pub use driver::{CellsArg, DenoiseArg, DriverArg, DriverArgs};
pub use look::{LookArgs, Range, ToneArg};
pub use render_cache::{EmptyArg, PointArgs, SmoothingArg};
pub use view::{ViewArgs, parse_size};
