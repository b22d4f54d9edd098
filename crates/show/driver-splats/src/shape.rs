//! Shapes of splats.

/// The shape in which a splat is drawn: a trade of time for quality (Rusinkiewicz & Levoy 2000,
/// §4.3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SplatShape {
    /// A square that faces the eye.
    Square,
    /// A circle that faces the eye.
    Circle,
    /// The disc of the surface, seen in perspective.
    Ellipse,
    /// The disc of the surface, which fades towards its edge and blends with its neighbours.
    #[default]
    Fuzzy,
}
