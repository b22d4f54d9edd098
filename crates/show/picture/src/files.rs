//! Picture files: formats, and reading and writing of whole files. Every error names the file.
//!
//! Invariants: memory is allocated only for a size within [`MAX_PIXELS`]. If the format allows it,
//! only pixels present in the file are counted. A file that is written appears whole or not at all.

mod conversion;
mod format;
mod hdr;
mod hdr_pixels;
mod openexr;
mod pfm;
mod rows;

pub use format::Format;
pub use rows::{PngRows, RadianceRows};

use crate::error::PictureError;
use crate::look::{Image, Look};
use crate::picture::Picture;
use crate::size::MAX_PIXELS;
use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// Most bytes of a file of [`MAX_PIXELS`] pixels: 16 a pixel, plus headers.
const MAX_FILE_BYTES: u64 = MAX_PIXELS * 16 + (1 << 20);

impl Picture {
    /// Reads a picture. The first bytes determine the format, or else the extension.
    ///
    /// - `.hdr`, `.pic`: Radiance RGBE, flat or with either run-length encoding. `EXPOSURE=` and
    ///   `COLORCORR=` are divided out, `VIEW=` is kept.
    /// - `.pfm`: colour or grey, either byte order, multiplied by the magnitude of its scale.
    /// - `.exr`: R, G and B of the first layer that has them.
    ///
    /// # Errors
    /// The file cannot be read, has another format, is damaged, or has more than [`MAX_PIXELS`]
    /// pixels. The error names the file.
    pub fn read(path: impl AsRef<Path>) -> Result<Picture, PictureError> {
        read(path.as_ref())
    }

    /// Decodes a picture from the bytes of a file. `.png` is not supported.
    ///
    /// # Errors
    /// As [`Picture::read`].
    pub fn decode(bytes: &[u8], format: Format) -> Result<Picture, PictureError> {
        decode(bytes, format)
    }

    /// Writes `.hdr` (or `.pic`), `.pfm`, `.exr` (32-bit floats) or `.png`, depending on the
    /// extension. A `.png` has the default [`Look`]; [`Image::write`] writes others.
    ///
    /// The file appears whole or not at all: it is written under another name, flushed, and
    /// renamed.
    ///
    /// # Errors
    /// An unknown extension, a picture whose fields disagree, or a failure of the disk. The error
    /// names the file.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), PictureError> {
        write(self, path.as_ref())
    }

    /// Encodes the picture as the bytes of a file.
    ///
    /// # Errors
    /// A picture whose fields disagree.
    pub fn encode(&self, format: Format) -> Result<Vec<u8>, PictureError> {
        encode(self, format)
    }
}

fn read(path: &Path) -> Result<Picture, PictureError> {
    let result = read_bytes(path).and_then(|bytes| {
        // Pictures older than 1991 lack `#?`. For them alone, Radiance's extension decides.
        let by_name = Format::of_path(path).filter(|format| *format == Format::Hdr);
        decode(&bytes, Format::of_bytes(&bytes).or(by_name).ok_or(PictureError::UnknownFormat)?)
    });
    result.map_err(|error| named(path, error))
}

fn decode(bytes: &[u8], format: Format) -> Result<Picture, PictureError> {
    match format {
        Format::Hdr => hdr::decode(bytes),
        Format::Pfm => pfm::decode(bytes),
        Format::Exr => openexr::decode(bytes),
        Format::Png => Err(PictureError::PngIsNotRadiance),
    }
}

fn write(picture: &Picture, path: &Path) -> Result<(), PictureError> {
    let written = Format::of_path(path)
        .ok_or_else(|| {
            PictureError::UnknownExtension(
                path.extension().unwrap_or_default().display().to_string(),
            )
        })
        .and_then(|format| encode(picture, format))
        .and_then(|bytes| write_whole(path, &bytes));
    written.map_err(|error| named(path, error))
}

fn encode(picture: &Picture, format: Format) -> Result<Vec<u8>, PictureError> {
    picture.check()?;
    match format {
        Format::Hdr => Ok(hdr::encode(picture)),
        Format::Pfm => Ok(pfm::encode(picture)),
        Format::Exr => openexr::encode(picture),
        Format::Png => Look::default().show(picture).png(),
    }
}

impl Image {
    /// Writes the image as a `.png`, without its legend. The file appears whole or not at all.
    ///
    /// # Errors
    /// The errors of [`Image::png`], or a failure of the disk. The error names the file.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), PictureError> {
        let path = path.as_ref();
        let written = self.png().and_then(|bytes| write_whole(path, &bytes));
        written.map_err(|error| named(path, error))
    }
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, PictureError> {
    let file = File::open(path)?;
    let stated = file.metadata()?.len();
    if stated > MAX_FILE_BYTES {
        return Err(PictureError::TooLong(stated));
    }
    // A pipe states no length, and a file may grow. So the bound applies to the bytes read, too.
    let mut bytes = Vec::new();
    file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(PictureError::TooLong(bytes.len() as u64));
    }
    Ok(bytes)
}

/// Writes a file next to `path`, flushes it, and renames it.
fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), PictureError> {
    let temporary = temporary_beside(path);
    let written = File::create_new(&temporary).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    let moved = written.and_then(|()| fs::rename(&temporary, path));
    if moved.is_err() {
        // Report the first error. A file that was never created cannot be removed either.
        let _ = fs::remove_file(&temporary);
    }
    Ok(moved?)
}

/// Returns a name in the same folder that no other process or thread uses. It is short, because the
/// file's own name may be as long as names can be.
fn temporary_beside(path: &Path) -> PathBuf {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    path.with_file_name(format!(".picture-{}-{number}.tmp", std::process::id()))
}

fn named(path: &Path, error: PictureError) -> PictureError {
    PictureError::File { path: path.to_owned(), error: Box::new(error) }
}
