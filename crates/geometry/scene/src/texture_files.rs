//! Textures that a model names, each read once.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::named_file::{beside, read_file};
use crate::shading::{MAX_BYTES_OF_TEXTURES, MAX_TEXTURES};
use crate::text::excerpt;
use crate::texture::{MAX_TEXTURE_BYTES, Texture};
use crate::texture_decode::decode_all;
use crate::texture_use::TextureUse;
use crate::{Bsdf, Rgb, SceneError};

/// A file, or nothing and a number within the model's file; and a use of it.
type Key = (PathBuf, usize, TextureUse);

/// The textures read so far.
#[derive(Default)]
pub(crate) struct TextureFiles {
    pub textures: Vec<Texture>,
    /// Index by file, or by number within a file, and use. `None` if it could not be read.
    known: HashMap<Key, Option<u32>>,
    /// Textures that are decoded before they are wanted.
    ahead: HashMap<Key, Result<Texture, String>>,
    bytes: usize,
    /// Number of pictures whose files ask for a turned or mirrored picture.
    pub turned: usize,
    /// True once a texture did not fit. No other one is decoded then, because a small file may take
    /// seconds.
    is_full: bool,
}

/// A warning about pictures whose files ask for a turn.
pub(crate) const TURNED: &str = "textures are shown as their files store them: the orientation in \
                                 their EXIF data is not applied, so turn the pictures themselves";

/// Returns the file of a texture that a model names.
fn file_of(model: &Path, name: &str) -> PathBuf {
    beside(model.parent().unwrap_or(Path::new("")), name, "png")
}

/// Reflectance of a texture of colours that cannot be read.
const GREY: f32 = 0.5;

/// Returns the scattering of a surface whose texture of colours cannot be read: as with a grey one.
/// White would be the format's default, but a room of white surfaces absorbs no light.
pub(crate) fn greyed(bsdf: Bsdf) -> Bsdf {
    let grey = |colour: Rgb| colour.map(|c| c * GREY);
    match bsdf {
        Bsdf::Diffuse { kd } => Bsdf::Diffuse { kd: grey(kd) },
        Bsdf::Mirror { ks } => Bsdf::Mirror { ks: grey(ks) },
        Bsdf::Conductor { ks, alpha } => Bsdf::Conductor { ks: grey(ks), alpha },
        Bsdf::ThinGlass { ior, transmittance } => {
            Bsdf::ThinGlass { ior, transmittance: grey(transmittance) }
        }
        Bsdf::Dielectric { ior, transmittance, alpha } => {
            Bsdf::Dielectric { ior, transmittance: grey(transmittance), alpha }
        }
        Bsdf::Coated { kd, ks, ior, alpha } => Bsdf::Coated { kd: grey(kd), ks, ior, alpha },
    }
}

impl TextureFiles {
    /// Decodes files in the folders of models on all cores, before [`file`](Self::file) wants them.
    pub(crate) fn decode_files<'a>(
        &mut self,
        wanted: impl Iterator<Item = (&'a Path, &'a str, TextureUse)>,
    ) {
        let mut pictures = Vec::new();
        let mut keys = HashSet::new();
        for (model, name, how) in wanted {
            let key = (file_of(model, name), 0, how);
            if key.0.is_file() && keys.insert(key.clone()) {
                let bytes = read_file(&key.0, MAX_TEXTURE_BYTES as u64).ok();
                pictures.extend(bytes.map(|bytes| (key, bytes)));
            }
        }
        self.decode_ahead(pictures);
    }

    /// Decodes pictures of a model's file on all cores, before [`embedded`](Self::embedded) wants
    /// them.
    pub(crate) fn decode_embedded(
        &mut self,
        wanted: impl Iterator<Item = (usize, TextureUse, Vec<u8>)>,
    ) {
        self.decode_ahead(
            wanted.map(|(number, how, bytes)| ((PathBuf::new(), number, how), bytes)).collect(),
        );
    }

    fn decode_ahead(&mut self, wanted: Vec<(Key, Vec<u8>)>) {
        let (keys, pictures): (Vec<Key>, Vec<_>) = wanted
            .into_iter()
            .take(MAX_TEXTURES)
            .map(|(key, bytes)| (key.clone(), (Arc::from(bytes), key.2)))
            .unzip();
        let mut bytes = 0;
        let _ = decode_all(&pictures, |number, texture| {
            bytes += texture.as_ref().map_or(0, Texture::bytes);
            self.ahead.insert(keys[number].clone(), texture);
            // The others are left out anyway.
            if bytes > MAX_BYTES_OF_TEXTURES { Err(()) } else { Ok(()) }
        });
    }

    /// Returns the index of a texture that lies in the folder of `model`. An error is a text for
    /// people, and is returned once for each file.
    pub(crate) fn file(
        &mut self,
        model: &Path,
        name: &str,
        how: TextureUse,
    ) -> Result<Option<u32>, String> {
        let file = file_of(model, name);
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
        how: TextureUse,
    ) -> Result<Option<u32>, String> {
        self.once((PathBuf::new(), number, how), bytes)
    }

    fn once(
        &mut self,
        key: Key,
        bytes: impl FnOnce() -> Result<Vec<u8>, String>,
    ) -> Result<Option<u32>, String> {
        if let Some(&known) = self.known.get(&key) {
            return Ok(known);
        }
        let how = key.2;
        let decode = |bytes: Vec<u8>| {
            Texture::decode(bytes.into(), how.wrap, how.is_linear, how.is_mask)
                .map_err(|error| format!("the texture cannot be read: {error}"))
        };
        let read = match self.ahead.remove(&key) {
            Some(Ok(texture)) => self.add(|| Ok(texture)),
            _ => bytes().and_then(|bytes| self.add(|| decode(bytes))),
        };
        self.known.insert(key, read.as_ref().ok().copied());
        read.map(Some)
    }

    fn add(&mut self, texture: impl FnOnce() -> Result<Texture, String>) -> Result<u32, String> {
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
        let texture = texture()?;
        self.is_full = self.bytes + texture.bytes() > MAX_BYTES_OF_TEXTURES;
        if self.is_full {
            return Err(full());
        }
        self.bytes += texture.bytes();
        self.turned += usize::from(texture.is_turned);
        self.textures.push(texture);
        Ok(self.textures.len() as u32 - 1)
    }
}
