//! Errors of models and poses.

use glam::DVec3;
use holo_raycast::BuildError;

/// Most triangles of a local object. Its hierarchy is built while a person waits: a second.
pub const MOST_TRIANGLES: usize = 1_000_000;

/// Why a model cannot be carried into a scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ObjectError {
    /// The model has too many triangles.
    #[error(
        "the model has {0} triangles, and a local object can have {MOST_TRIANGLES}: reduce it, or \
         make it a part of the scene"
    )]
    TooLarge(usize),
    /// The model has no triangles.
    #[error("the model has no triangles")]
    Empty,
    /// The length of the model's unit, or an up axis, is not possible.
    #[error("the model's unit or its up axis is not possible")]
    Axes,
    /// The model cannot be traced.
    #[error("the model cannot be traced: {0}")]
    Build(#[from] BuildError),
    /// The place is not finite, or too far away.
    #[error("{} {} {} is no place: write three numbers up to 1e12", .0.x, .0.y, .0.z)]
    Place(DVec3),
    /// The turn is not finite.
    #[error("{0} is no angle: write degrees")]
    Turn(f64),
    /// The scale is not possible.
    #[error("{0} is no scale: write a number from 1e-6 to 1e6")]
    Scale(f64),
}
