//! Radiance pictures: text header, resolution line, RGBE pixels (Ward, "Real Pixels", Graphics Gems
//! II; Radiance's `filefmts.pdf` and `color.c`).
//!
//! Invariants: a pixel's value is (mantissa + ½)·2^(exponent - 136), divided by the product of all
//! `EXPOSURE=` and, by channel, `COLORCORR=` lines. If `PRIMARIES=` states other primaries than
//! ours, it is converted. Without that line, the primaries are taken for ours. Memory grows with
//! decoded rows, never with the sizes in the header.

use super::conversion::converted;
use super::hdr_pixels::{read_row, write_row};
use crate::error::PictureError;
use crate::picture::Picture;
use crate::view::View;
use crate::view_spec::ViewSpec;
use glam::DMat3;
use holo_color::Primaries;
use std::fmt::Write;

/// Most bytes of a header. Radiance adds a line for every program that processed a picture.
const MAX_HEADER: usize = 1 << 20;

/// Widths of scanlines that are written with the newer run-length encoding (Radiance color.c,
/// MINELEN and MAXELEN).
const RLE_WIDTHS: std::ops::RangeInclusive<usize> = 8..=0x7fff;

pub(super) fn encode(picture: &Picture) -> Vec<u8> {
    let mut bytes = header(picture.size(), picture.view.as_ref(), picture.exposure);
    write_rows(&mut bytes, &picture.pixels, picture.width, picture.exposure);
    bytes
}

/// Returns the bytes before the first row.
pub(super) fn header(size: (u32, u32), view: Option<&View>, exposure: f32) -> Vec<u8> {
    let mut header = String::from("#?RADIANCE\nSOFTWARE=Holodeck\n");
    let primaries = Primaries::REC709.numbers().map(|number| number.to_string()).join(" ");
    // Writing to a String cannot fail.
    let _ = writeln!(header, "PRIMARIES= {primaries}");
    if let Some(view) = view {
        let _ = writeln!(header, "VIEW= {}", view.to_vf_options());
    }
    if exposure != 1.0 {
        let _ = writeln!(header, "EXPOSURE={exposure:e}");
    }
    let _ = write!(header, "FORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n", size.1, size.0);
    header.into_bytes()
}

/// Appends whole rows of pixels.
pub(super) fn write_rows(bytes: &mut Vec<u8>, pixels: &[[f32; 3]], width: u32, exposure: f32) {
    let mut row_rgbe = Vec::new();
    for row in pixels.chunks_exact(width as usize) {
        row_rgbe.clear();
        let exposed = |rgb: &[f32; 3]| rgb.map(|value| f64::from(value) * f64::from(exposure));
        row_rgbe.extend(row.iter().map(|rgb| to_rgbe(exposed(rgb))));
        write_row(bytes, &row_rgbe, RLE_WIDTHS.contains(&row.len()));
    }
}

pub(super) fn decode(bytes: &[u8]) -> Result<Picture, PictureError> {
    let mut rest = bytes;
    let header = Header::read(&mut rest)?;
    let layout = PixelOrder::parse(line(&mut rest, MAX_HEADER)?)?;
    let (width, height) = layout.size();
    Picture::check_size(width, height)?;
    // A file of runs may be much smaller than its pixels, so memory is allocated row by row.
    let (length, rows) = (layout.row_length as usize, layout.rows);
    let mut scanned: Vec<[f32; 3]> = Vec::new();
    let converted = |rgb: [f32; 3]| match header.conversion {
        Some(conversion) => converted(conversion, rgb),
        None => rgb,
    };
    let mut row_rgbe = vec![[0u8; 4]; length];
    for row in 0..rows {
        let rle = RLE_WIDTHS.contains(&length);
        read_row(&mut rest, &mut row_rgbe, rle).map_err(|fault| fault.at(row, rows))?;
        scanned.extend(row_rgbe.iter().map(|rgbe| converted(from_rgbe(*rgbe, header.multiplier))));
    }
    let mut picture = Picture::from_pixels(width, height, layout.place(scanned))?;
    picture.view = header.view((width, height));
    picture.exposure = header.exposure;
    Ok(picture)
}

/// The contents of a header.
struct Header {
    /// Product of the `EXPOSURE=` lines.
    exposure: f32,
    /// Factor of decoded values by channel, which reverses exposure and colour correction.
    multiplier: [f64; 3],
    /// Conversion of the file's primaries to ours, if they differ.
    conversion: Option<DMat3>,
    view: Option<ViewSpec>,
}

impl Header {
    fn read(rest: &mut &[u8]) -> Result<Header, PictureError> {
        let (mut exposure, mut correction) = (1.0f64, [1.0f64; 3]);
        let (mut spec, mut has_view, mut conversion) = (ViewSpec::default(), false, None);
        let mut room = MAX_HEADER;
        loop {
            let text = line(rest, room)?;
            room = room.saturating_sub(text.len() + 1);
            let text = String::from_utf8_lossy(text);
            let text = text.strip_suffix('\r').unwrap_or(&text);
            if text.is_empty() {
                break;
            }
            if let Some(value) = text.strip_prefix("EXPOSURE=") {
                exposure *= positive("EXPOSURE", value)?;
            } else if let Some(values) = text.strip_prefix("COLORCORR=") {
                let values: Vec<&str> = values.split_whitespace().collect();
                if values.len() != 3 {
                    return Err(PictureError::Header("COLORCORR takes three numbers".to_owned()));
                }
                for (product, value) in correction.iter_mut().zip(values) {
                    *product *= positive("COLORCORR", value)?;
                }
            } else if let Some(numbers) = text.strip_prefix("PRIMARIES=") {
                conversion = primaries(numbers)?.to_rec709();
            } else if let Some(format) = text.strip_prefix("FORMAT=") {
                if format.trim() != "32-bit_rle_rgbe" {
                    return Err(PictureError::Header(format!(
                        "FORMAT={format}: only 32-bit_rle_rgbe can be read"
                    )));
                }
            } else {
                // A view of an unsupported type does not make the pixels unusable.
                has_view |= spec.apply_header_line(text).unwrap_or(false);
            }
        }
        let multiplier = correction.map(|correction| 1.0 / (exposure * correction));
        let kept = exposure as f32;
        let in_range =
            multiplier.iter().all(|m| m.is_finite() && *m > 0.0) && kept.is_finite() && kept > 0.0;
        if !in_range {
            return Err(PictureError::Header(format!(
                "the exposures multiply to {exposure:e}, which is out of range"
            )));
        }
        let view = has_view.then_some(spec);
        Ok(Header { exposure: kept, multiplier, conversion, view })
    }

    fn view(&self, size: (u32, u32)) -> Option<View> {
        // The size of the picture, not the one that `resolve` suggests.
        Some(self.view?.resolve(size).ok()?.0)
    }
}

/// Returns the primaries of a `PRIMARIES=` line: x and y of red, green, blue and white.
fn primaries(text: &str) -> Result<Primaries, PictureError> {
    let numbers: Option<Vec<f64>> =
        text.split_whitespace().map(|number| number.parse().ok()).collect();
    let numbers = numbers.and_then(|numbers| <[f64; 8]>::try_from(numbers).ok());
    numbers.and_then(Primaries::new).ok_or_else(|| {
        PictureError::Header(format!(
            "PRIMARIES={text} must be x and y of red, green, blue and white"
        ))
    })
}

fn positive(what: &str, text: &str) -> Result<f64, PictureError> {
    let value: Option<f64> = text.trim().parse().ok();
    value
        .filter(|value| value.is_finite() && *value > 0.0)
        .ok_or_else(|| PictureError::Header(format!("{what}={text} must be a positive number")))
}

/// Returns the next line without its end.
fn line<'a>(rest: &mut &'a [u8], room: usize) -> Result<&'a [u8], PictureError> {
    let end = rest.iter().take(room).position(|byte| *byte == b'\n');
    let end = end.ok_or_else(|| {
        PictureError::Header("it has no end, or is none of a Radiance picture".to_owned())
    })?;
    let (text, after) = rest.split_at(end);
    *rest = &after[1..];
    Ok(text)
}

/// The order of pixels in the file. `-Y 480 +X 640` is rows from the top; seven others rotate or
/// mirror the picture.
struct PixelOrder {
    rows: u32,
    row_length: u32,
    /// Scanlines are columns of the picture (X before Y).
    columns_first: bool,
    /// X runs from the right (`-X`); Y from the top (`-Y`).
    from_right: bool,
    from_top: bool,
}

impl PixelOrder {
    fn parse(line: &[u8]) -> Result<PixelOrder, PictureError> {
        let wrong = || {
            let shown: String = String::from_utf8_lossy(line).chars().take(80).collect();
            PictureError::Header(format!("resolution `{shown}` is not like `-Y 480 +X 640`"))
        };
        let text = std::str::from_utf8(line).map_err(|_| wrong())?;
        let words: Vec<&str> = text.split_whitespace().collect();
        let [first, rows, second, row_length] = words[..] else { return Err(wrong()) };
        let (columns_first, x, y) = match (first, second) {
            ("+Y" | "-Y", "+X" | "-X") => (false, second, first),
            ("+X" | "-X", "+Y" | "-Y") => (true, first, second),
            _ => return Err(wrong()),
        };
        let (rows, row_length) =
            (rows.parse().map_err(|_| wrong())?, row_length.parse().map_err(|_| wrong())?);
        Ok(PixelOrder {
            rows,
            row_length,
            columns_first,
            from_right: x == "-X",
            from_top: y == "-Y",
        })
    }

    fn size(&self) -> (u32, u32) {
        if self.columns_first { (self.rows, self.row_length) } else { (self.row_length, self.rows) }
    }

    /// Returns the pixels in rows from the top, each from the left.
    fn place(&self, scanned: Vec<[f32; 3]>) -> Vec<[f32; 3]> {
        if !self.columns_first && self.from_top && !self.from_right {
            return scanned;
        }
        let (width, height) = self.size();
        let at = |row: u32, column: u32| {
            let x = if self.from_right { width - 1 - column } else { column };
            let y = if self.from_top { row } else { height - 1 - row };
            let (major, minor) = if self.columns_first { (x, y) } else { (y, x) };
            scanned[major as usize * self.row_length as usize + minor as usize]
        };
        (0..height)
            .flat_map(|row| (0..width).map(move |column| (row, column)))
            .map(|(row, column)| at(row, column))
            .collect()
    }
}

/// Encodes as Radiance's `setcolr`: mantissas are truncated, not rounded, because decoding adds ½.
/// Negative values and NaN become 0. Values above the greatest exponent become the greatest value.
fn to_rgbe(rgb: [f64; 3]) -> [u8; 4] {
    let rgb = rgb.map(|value| if value > 0.0 { value.min(MOST) } else { 0.0 });
    let largest = rgb[0].max(rgb[1]).max(rgb[2]);
    if largest < LEAST {
        return [0; 4];
    }
    // The exponent field of an f64 is exact where log2 is not: 2^(exponent-1) <= largest <
    // 2^exponent.
    let exponent = (largest.to_bits() >> 52) as i32 - 1022;
    let scale = 2f64.powi(8 - exponent);
    let mantissa = rgb.map(|value| (value * scale) as u8);
    [mantissa[0], mantissa[1], mantissa[2], (exponent + 128) as u8]
}

/// Values below this are black, because only the exponent byte 0 is left: 2^-128.
const LEAST: f64 = 0.5 / (1u128 << 127) as f64;

/// The largest value with exponent byte 255, just below 2^127.
const MOST: f64 = 255.9 * (1u128 << 119) as f64;

fn from_rgbe(rgbe: [u8; 4], multiplier: [f64; 3]) -> [f32; 3] {
    if rgbe[3] == 0 {
        return [0.0; 3];
    }
    let scale = 2f64.powi(i32::from(rgbe[3]) - 136);
    // An exposure below 1 may move bright pixels beyond f32.
    let value = |c: usize| {
        ((f64::from(rgbe[c]) + 0.5) * scale * multiplier[c]).min(f64::from(f32::MAX)) as f32
    };
    [value(0), value(1), value(2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limits_of_rgbe_are_those_of_its_exponent_byte() {
        assert_eq!(LEAST, 2f64.powi(-128));
        assert_eq!(MOST, 255.9 * 2f64.powi(119));
        assert_eq!(to_rgbe([f64::INFINITY, 0.0, 1e300]), [255, 0, 255, 255]);
        assert_eq!(to_rgbe([2f64.powi(-128), 0.0, 0.0]), [128, 0, 0, 1]);
        assert_eq!(to_rgbe([2f64.powi(-129), f64::NAN, -1.0]), [0; 4]);
        // From Radiance: setcolr(1, 0.5, 0.25) gives 128 64 32 129.
        assert_eq!(to_rgbe([1.0, 0.5, 0.25]), [128, 64, 32, 129]);
    }

    #[test]
    fn every_code_that_radiance_writes_reads_back_as_itself() {
        for exponent in 1..=255u8 {
            for mantissa in 128..=255u8 {
                let code = [mantissa, mantissa / 3, 0, exponent];
                let value = from_rgbe(code, [1.0; 3]);
                assert_eq!(to_rgbe(value.map(f64::from)), code);
            }
        }
    }
}
