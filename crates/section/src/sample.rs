//! A stored ray: 10 bytes (Larson & Simmons 1999, §2.1, Table 1).

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

use crate::cells::RayCoords;
use crate::{distance, rgbe};

/// One stored ray of a beam, in the layout of the wire and the disk.
#[repr(C)]
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, Hash, Pod, Zeroable)]
pub struct Sample {
    /// Where it passes the beam's two cells.
    pub coords: RayCoords,
    /// Radiance, shared exponent: see [`rgbe`].
    pub rgbe: [u8; 4],
    /// Distance code, little-endian: see [`distance`].
    distance: [u8; 2],
}

const _: () = assert!(size_of::<Sample>() == 10 && align_of::<Sample>() == 1);

impl Sample {
    /// Encodes a traced ray: `rgb` radiance, `distance` from the entry point in world units (infinity or NaN: nothing
    /// hit), the section's `diagonal`, and 32 random bits that make the colour's rounding unbiased.
    pub fn encode(
        coords: RayCoords,
        rgb: [f32; 3],
        distance: f64,
        diagonal: f64,
        dither: u32,
    ) -> Sample {
        Sample::from_codes(coords, rgbe::encode(rgb, dither), distance::encode(distance, diagonal))
    }

    /// A sample from its encoded parts.
    pub fn from_codes(coords: RayCoords, rgbe: [u8; 4], distance_code: u16) -> Sample {
        Sample { coords, rgbe, distance: distance_code.to_le_bytes() }
    }

    /// Radiance.
    pub fn rgb(&self) -> [f32; 3] {
        rgbe::decode(self.rgbe)
    }

    /// The distance as stored.
    pub fn distance_code(&self) -> u16 {
        u16::from_le_bytes(self.distance)
    }

    /// Distance from the entry point to the surface hit, in world units, for a section of this diagonal; infinity when
    /// nothing was hit.
    pub fn distance(&self, diagonal: f64) -> f64 {
        distance::decode(self.distance_code(), diagonal)
    }
}

/// How a packet's rays were chosen within their beam.
#[repr(u8)]
#[derive(Copy, Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum SampleKind {
    /// Spread over the whole beam.
    Uniform = 0,
    /// Passing near an eye.
    ViewpointLimited = 1,
    /// Asked for one by one: a pixel's.
    SingleRay = 2,
}

impl SampleKind {
    /// The kind of a stored code; `None` for codes that no kind has.
    pub fn from_code(code: u8) -> Option<SampleKind> {
        match code {
            0 => Some(SampleKind::Uniform),
            1 => Some(SampleKind::ViewpointLimited),
            2 => Some(SampleKind::SingleRay),
            _ => None,
        }
    }
}

impl TryFrom<u8> for SampleKind {
    /// The unknown code.
    type Error = u8;

    fn try_from(code: u8) -> Result<SampleKind, u8> {
        SampleKind::from_code(code).ok_or(code)
    }
}
