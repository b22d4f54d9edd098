//! A stored ray: 10 bytes (Larson & Simmons 1999, §2.1, Table 1).

use bytemuck::{Pod, Zeroable};

use crate::cells::RayCoords;
use crate::{distance, rgbe};

/// One stored ray of a beam, in the layout of the wire and the disk.
#[repr(C)]
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, Hash, Pod, Zeroable)]
pub struct Sample {
    /// Its positions in the beam's two cells.
    pub coords: RayCoords,
    /// Radiance with a shared exponent: see [`rgbe`].
    pub rgbe: [u8; 4],
    /// Distance code, little-endian: see [`distance`].
    distance: [u8; 2],
}

const _: () = assert!(size_of::<Sample>() == 10 && align_of::<Sample>() == 1);

impl Sample {
    /// Encodes a traced ray.
    ///
    /// `rgb` is its radiance. `distance` counts from the entry point in world units; infinity or
    /// NaN means that nothing was hit. `diagonal` is the section's. `dither` is 32 random bits that
    /// make the colour's rounding unbiased.
    pub fn encode(
        coords: RayCoords,
        rgb: [f32; 3],
        distance: f64,
        diagonal: f64,
        dither: u32,
    ) -> Sample {
        Sample::from_codes(coords, rgbe::encode(rgb, dither), distance::encode(distance, diagonal))
    }

    /// Returns a sample of encoded parts.
    pub fn from_codes(coords: RayCoords, rgbe: [u8; 4], distance_code: u16) -> Sample {
        Sample { coords, rgbe, distance: distance_code.to_le_bytes() }
    }

    /// Returns the radiance.
    pub fn rgb(&self) -> [f32; 3] {
        rgbe::decode(self.rgbe)
    }

    /// Returns the distance as stored.
    pub fn distance_code(&self) -> u16 {
        u16::from_le_bytes(self.distance)
    }

    /// Returns the distance from the entry point to the surface that the ray hit, in world units,
    /// for a section of this diagonal. Infinity if nothing was hit.
    pub fn distance(&self, diagonal: f64) -> f64 {
        distance::decode(self.distance_code(), diagonal)
    }
}

/// The choice of a sample's ray within its beam.
#[repr(u8)]
#[derive(Copy, Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SampleKind {
    /// Spread over the whole beam.
    Uniform = 0,
    /// Chosen to pass near an eye.
    ViewpointLimited = 1,
    /// Requested as single rays, one for each pixel.
    SingleRay = 2,
}

impl SampleKind {
    /// Returns the kind of a stored code; `None` for codes that no kind has.
    pub fn from_code(code: u8) -> Option<SampleKind> {
        match code {
            0 => Some(SampleKind::Uniform),
            1 => Some(SampleKind::ViewpointLimited),
            2 => Some(SampleKind::SingleRay),
            _ => None,
        }
    }
}
