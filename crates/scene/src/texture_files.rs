//! Textures that a model names, each read once.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::SceneError;
use crate::named_file::{beside, read_file};
use crate::shading::{MAX_BYTES_OF_TEXTURES, MAX_TEXTURES};
use crate::text::excerpt;
use crate::texture::{MAX_TEXTURE_BYTES, Texture, Wrap};

/// How a picture is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Use {
    pub wrap: [Wrap; 2],
    /// True if its bytes are numbers, not colours in sRGB.
    pub is_linear: bool,
    /// True if its brightness is used as opacity.
    pub is_mask: bool,
}

/// The textures read so far.
#[derive(Default)]
pub(crate) struct TextureFiles {
    pub textures: Vec<Texture>,
    /// Index by file, or by number within a file, and use. `None` if it could not be read.
    known: HashMap<(PathBuf, usize, Use), Option<u32>>,
    bytes: usize,
    /// True once a texture did not fit. No other one is decoded then, because a small file may take
    /// seconds.
    is_full: bool,
}

impl TextureFiles {
    /// Returns the index of a texture that lies in the folder of `model`. An error is a text for
    /// people, and is returned once for each file.
    pub(crate) fn file(
        &mut self,
        model: &Path,
        name: &str,
        how: Use,
    ) -> Result<Option<u32>, String> {
        let file = beside(model.parent().unwrap_or(Path::new("")), name, "png");
        let key = (file.clone(), 0, how);
        self.once(key, || match file.is_file() {
            false => Err(format!("texture `{}` is not in the model's folder", excerpt(name))),
            true => read_file(&file, MAX_TEXTURE_BYTES as u64)
                .map_err(|error: SceneError| error.to_string()),
        })
    }

    /// Returns the index of a texture whose file is `bytes`, picture `number` of a model.
    pub(crate) fn embedded(
        &mut self,
        number: usize,
        bytes: impl FnOnce() -> Result<Vec<u8>, String>,
        how: Use,
    ) -> Result<Option<u32>, String> {
        self.once((PathBuf::new(), number, how), bytes)
    }

    fn once(
        &mut self,
        key: (PathBuf, usize, Use),
        bytes: impl FnOnce() -> Result<Vec<u8>, String>,
    ) -> Result<Option<u32>, String> {
        if let Some(&known) = self.known.get(&key) {
            return Ok(known);
        }
        let read = bytes().and_then(|bytes| self.add(bytes.into(), key.2));
        self.known.insert(key, read.as_ref().ok().copied());
        read.map(Some)
    }

    fn add(&mut self, encoded: Arc<[u8]>, how: Use) -> Result<u32, String> {
        if self.textures.len() == MAX_TEXTURES {
            return Err(format!("there are more than {MAX_TEXTURES} textures"));
        }
        let full = || {
            let limit = MAX_BYTES_OF_TEXTURES >> 20;
            format!("textures would take more than {limit} MiB of memory")
        };
        if self.is_full {
            return Err(full());
        }
        let texture = Texture::decode(encoded, how.wrap, how.is_linear, how.is_mask)
            .map_err(|error| format!("the texture cannot be read: {error}"))?;
        self.is_full = self.bytes + texture.bytes() > MAX_BYTES_OF_TEXTURES;
        if self.is_full {
            return Err(full());
        }
        self.bytes += texture.bytes();
        self.textures.push(texture);
        Ok(self.textures.len() as u32 - 1)
    }
}
