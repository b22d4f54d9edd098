//! Portable float maps: `PF` (RGB) or `Pf` (grey), width, height, scale, then 32-bit floats, rows
//! from the **bottom** (<https://netpbm.sourceforge.net/doc/pfm.html>).
//!
//! The sign of the scale gives the byte order (negative: little-endian). Values are multiplied by
//! its magnitude. Files are written little-endian with scale -1, so that values are exact.

use crate::error::PictureError;
use crate::picture::Picture;

/// Longest word of a header.
const MAX_WORD: usize = 64;

pub(super) fn encode(picture: &Picture) -> Vec<u8> {
    let mut bytes = format!("PF\n{} {}\n-1.0\n", picture.width, picture.height).into_bytes();
    bytes.reserve(picture.pixels.len() * 12);
    for row in picture.pixels.chunks_exact(picture.width as usize).rev() {
        bytes.extend(row.as_flattened().iter().flat_map(|value| value.to_le_bytes()));
    }
    bytes
}

pub(super) fn decode(bytes: &[u8]) -> Result<Picture, PictureError> {
    let mut rest = bytes;
    let channels = match word(&mut rest)? {
        "PF" => 3,
        "Pf" => 1,
        other => return Err(PictureError::Header(format!("`{other}` where PF or Pf must be"))),
    };
    let (width, height) = (number::<u32>(&mut rest, "width")?, number::<u32>(&mut rest, "height")?);
    let scale = number::<f32>(&mut rest, "scale")?;
    if !scale.is_finite() || scale == 0.0 {
        return Err(PictureError::Header(format!("scale {scale} must be finite and not 0")));
    }
    Picture::check_size(width, height)?;
    let row_bytes = width as usize * channels * 4;
    if rest.len() < row_bytes * height as usize {
        return Err(PictureError::Truncated { row: (rest.len() / row_bytes) as u32, rows: height });
    }
    let value = |bytes: [u8; 4]| {
        scale.abs()
            * if scale < 0.0 { f32::from_le_bytes(bytes) } else { f32::from_be_bytes(bytes) }
    };
    let mut pixels = Vec::with_capacity(width as usize * height as usize);
    for row in rest[..row_bytes * height as usize].chunks_exact(row_bytes).rev() {
        let (values, _) = row.as_chunks::<4>();
        if channels == 3 {
            let (rgbs, _) = values.as_chunks::<3>();
            pixels.extend(rgbs.iter().map(|rgb| rgb.map(value)));
        } else {
            pixels.extend(values.iter().map(|grey| [value(*grey); 3]));
        }
    }
    Picture::from_pixels(width, height, pixels)
}

/// Returns the next word of the header. Consumes exactly one white space after it, because pixels
/// may begin there.
fn word<'a>(rest: &mut &'a [u8]) -> Result<&'a str, PictureError> {
    let bytes = rest.trim_ascii_start();
    let end = bytes.iter().take(MAX_WORD).position(u8::is_ascii_whitespace);
    let end =
        end.ok_or_else(|| PictureError::Header("it ends early, or is none of a .pfm".to_owned()))?;
    *rest = &bytes[end + 1..];
    std::str::from_utf8(&bytes[..end])
        .map_err(|_| PictureError::Header("it is not text".to_owned()))
}

fn number<T: std::str::FromStr>(rest: &mut &[u8], what: &str) -> Result<T, PictureError> {
    let text = word(rest)?;
    text.parse().map_err(|_| PictureError::Header(format!("{what} `{text}` is not a number")))
}
