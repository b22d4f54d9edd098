//! Reading a file of either format.

use crate::{MAX_PHOTOMETRY_BYTES, Photometry, PhotometryError, eulumdat, lm63};

impl Photometry {
    /// Reads an IES LM-63 or EULUMDAT file. The format follows from the contents.
    ///
    /// # Errors
    /// If the file has another format, ends too early, or states something impossible.
    pub fn read(bytes: &[u8]) -> Result<Photometry, PhotometryError> {
        if bytes.len() as u64 > MAX_PHOTOMETRY_BYTES {
            return Err(PhotometryError::TooLong(bytes.len() as u64));
        }
        // Names of makers are not always UTF-8.
        let text = String::from_utf8_lossy(bytes);
        let text = text.trim_start_matches('\u{feff}');
        let mut read = match lm63::tilt_line(text) {
            Some(line) => lm63::read(text, line)?,
            None => eulumdat::read(text)?,
        };
        let flux = read.web.flux();
        // Rounded intensities give a lamp a little more.
        if let Some(lamps) = read.lamp_lumens.filter(|lamps| flux > 1.05 * lamps) {
            read.notes.push(format!(
                "its intensities bring {flux:.0} lm, more than its lamps have ({lamps:.0} lm)"
            ));
        }
        Ok(read)
    }
}
