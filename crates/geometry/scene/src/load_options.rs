//! Options for what the files of models cannot express.

use serde::{Deserialize, Serialize};

use crate::Rgb;

/// Options for what a file cannot express.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LoadOptions {
    /// Radiance of the sky, the same in all directions, W·sr⁻¹·m⁻².
    pub sky: Rgb,
    /// Surfaces with `Ke` emit on both sides.
    pub two_sided_lights: bool,
}
