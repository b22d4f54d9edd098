//! The programs that write MTL files, and the values that all of them mean.

/// A program whose meanings count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Exporter {
    /// `Ns` is a roughness, `Ks` is in units of 0.08, and `illum 3` is metal.
    Blender,
    /// `illum 7` is on every material and means nothing.
    Cinema4d,
    /// `Tf` is 1 - transparency, and `illum 4` is on every material.
    Maya,
    /// The format's own meanings count.
    #[default]
    Other,
}

/// Roughness of a metal that states none.
pub(crate) const DEFAULT_ROUGHNESS: f32 = 0.5;
