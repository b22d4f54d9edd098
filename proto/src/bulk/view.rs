//! Requests of a display to the server: a view's beams, and single rays.

use bytemuck::{Pod, Zeroable};
use holo_section::{BeamId, BeamKey, RayCoords, Viewpoint};

use super::{Head, RawViewpoint, RecordReader, put};
use crate::ProtoError;

/// A beam that a display wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RequestedBeam {
    /// The beam.
    pub key: BeamKey,
    /// The number of pixels that the beam serves, positive.
    pub weight: f32,
    /// Number of the beam's samples of the present generation that the display has, at most
    /// [`MAX_HELD`], which stands for all larger numbers.
    pub held: u16,
    /// Whether the display has the beam's samples of an earlier generation.
    pub has_earlier: bool,
}

/// Greatest number of samples that [`RequestedBeam::held`] states.
pub const MAX_HELD: u16 = (1 << 15) - 1;

/// Bit that states [`RequestedBeam::has_earlier`].
const EARLIER: u16 = 1 << 15;

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct RawWantedBeam {
    beam: u64,
    weight: f32,
    section: u16,
    held: u16,
}
const _: () = assert!(size_of::<RawWantedBeam>() == 16);

/// Display to server: a view, by the beams that it crosses.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewRequest {
    /// The display's number for the view, greater than those of earlier views. A request with the
    /// same number only changes the viewpoint, and stored samples are not sent twice.
    pub view: u32,
    /// The eye, and the greatest distance of rays from it (Larson & Simmons 1999, Appendix A).
    pub viewpoint: Viewpoint,
    /// The beams.
    pub beams: Vec<RequestedBeam>,
}

impl ViewRequest {
    /// Returns the payload: view, number of beams, viewpoint, beams.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(40 + self.beams.len() * 16);
        put(&mut out, &Head { first: self.view, second: self.beams.len() as u32 });
        put(&mut out, &RawViewpoint::new(&self.viewpoint));
        for &RequestedBeam { key, weight, held, has_earlier } in &self.beams {
            let BeamKey { section, beam } = key;
            let held = held.min(MAX_HELD) | if has_earlier { EARLIER } else { 0 };
            put(&mut out, &RawWantedBeam { beam: beam.0, weight, section, held });
        }
        out
    }

    /// Parses a payload. It does not check whether the beams exist.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts or numbers.
    pub fn decode(bytes: &[u8]) -> Result<ViewRequest, ProtoError> {
        let mut reader = RecordReader(bytes);
        let counts: Head = reader.one("view message")?;
        let viewpoint = reader.one::<RawViewpoint>("viewpoint")?.parse()?;
        let beams = reader.many::<RawWantedBeam>("beam list", u64::from(counts.second))?;
        reader.end()?;
        if !beams.iter().all(|wanted| wanted.weight.is_finite() && wanted.weight > 0.0) {
            return Err(ProtoError::Number("a beam's weight"));
        }
        let beams = beams
            .into_iter()
            .map(|raw| RequestedBeam {
                key: BeamKey { section: raw.section, beam: BeamId(raw.beam) },
                weight: raw.weight,
                held: raw.held & MAX_HELD,
                has_earlier: raw.held & EARLIER != 0,
            })
            .collect();
        Ok(ViewRequest { view: counts.first, viewpoint, beams })
    }
}

/// A single ray that a display wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WantedRay {
    /// The beam.
    pub key: BeamKey,
    /// Positions in the beam's cells.
    pub coords: RayCoords,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct RawWantedRay {
    beam: u64,
    section: u16,
    coords: RayCoords,
    reserved: u16,
}
const _: () = assert!(size_of::<RawWantedRay>() == 16);

/// Display to server: the single rays that its view wants most, the most wanted first.
///
/// They replace the rays of the display's previous message of this kind that no worker has received
/// yet. They are traced before the view's beams.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RaysWanted {
    /// The view of the rays. The server ignores rays for any view except the present one.
    pub view: u32,
    /// The rays.
    pub rays: Vec<WantedRay>,
}

impl RaysWanted {
    /// Returns the payload: view, number of rays, rays.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(8 + self.rays.len() * 16);
        put(&mut out, &Head { first: self.view, second: self.rays.len() as u32 });
        for &WantedRay { key: BeamKey { section, beam }, coords } in &self.rays {
            put(&mut out, &RawWantedRay { beam: beam.0, section, coords, reserved: 0 });
        }
        out
    }

    /// Parses a payload. It does not check whether the beams exist.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts.
    pub fn decode(bytes: &[u8]) -> Result<RaysWanted, ProtoError> {
        let mut reader = RecordReader(bytes);
        let counts: Head = reader.one("message of wanted rays")?;
        let rays = reader.many::<RawWantedRay>("ray list", u64::from(counts.second))?;
        reader.end()?;
        let rays = rays
            .into_iter()
            .map(|raw| WantedRay {
                key: BeamKey { section: raw.section, beam: BeamId(raw.beam) },
                coords: raw.coords,
            })
            .collect();
        Ok(RaysWanted { view: counts.first, rays })
    }
}
