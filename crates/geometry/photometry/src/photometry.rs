//! What a photometric file says of a luminaire.

use crate::{LuminousOpening, PhotometricWeb};

/// Most bytes of a photometric file. Those of 0.5° have 1 MB.
pub const MAX_PHOTOMETRY_BYTES: u64 = 16 << 20;

/// What a photometric file says of a luminaire.
#[derive(Clone, Debug, PartialEq)]
pub struct Photometry {
    /// Its name, for people; may be empty.
    pub name: String,
    /// Its luminous intensity.
    pub web: PhotometricWeb,
    /// What of it shines.
    pub opening: LuminousOpening,
    /// Luminous flux of its lamps, lumens, if it is stated.
    pub lamp_lumens: Option<f64>,
    /// How its light depends on its tilt, if it does.
    pub tilt: Option<TiltTable>,
    /// What of the file is odd, for people.
    pub notes: Vec<String>,
}

/// How a lamp's light depends on its angle to the vertical: angles in degrees, ascending, and
/// factors.
#[derive(Clone, Debug, PartialEq)]
pub struct TiltTable(pub(crate) Vec<[f64; 2]>);

impl TiltTable {
    /// Returns the factor at an angle, degrees.
    #[must_use]
    pub fn factor(&self, angle: f64) -> f64 {
        let Some(&[_, first]) = self.0.first() else { return 1.0 };
        let next = self.0.iter().position(|[at, _]| *at >= angle);
        match next {
            Some(0) => first,
            Some(next) => {
                let ([from, low], [to, high]) = (self.0[next - 1], self.0[next]);
                low + (high - low) * (angle - from) / (to - from)
            }
            None => self.0[self.0.len() - 1][1],
        }
    }
}
