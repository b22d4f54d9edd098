//! How a picture is used as a texture.

use crate::texture::Wrap;

/// How a picture is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct TextureUse {
    pub wrap: [Wrap; 2],
    /// True if its bytes are numbers, not colours in sRGB.
    pub is_linear: bool,
    /// True if its brightness is used as opacity.
    pub is_mask: bool,
}
