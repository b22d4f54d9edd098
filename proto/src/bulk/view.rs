//! What a display wants, display to server: beams and single rays.

use bytemuck::{Pod, Zeroable};
use holo_section::{BeamId, BeamKey, RayCoords, Viewpoint};

use super::{Counts, RawViewpoint, Reader, put};
use crate::ProtoError;

/// A beam that a display wants, and how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// The beam.
    pub key: BeamKey,
    /// Share of the picture that it serves, pixels; positive.
    pub weight: f32,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct RawWanted {
    beam: u64,
    weight: f32,
    section: u16,
    reserved: u16,
}
const _: () = assert!(size_of::<RawWanted>() == 16);

/// Display to server: a view, as the beams that it crosses.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewRequest {
    /// The display's number for the view; larger for later ones. The same number again only changes the viewpoint:
    /// stored samples are not sent twice.
    pub view: u32,
    /// Where the eye is and how near rays must pass (Appendix A).
    pub viewpoint: Viewpoint,
    /// The beams.
    pub beams: Vec<Wanted>,
}

impl ViewRequest {
    /// The payload of a view frame: view number and beam count, viewpoint, beams.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(40 + self.beams.len() * 16);
        put(&mut out, &Counts { first: self.view, second: self.beams.len() as u32 });
        put(&mut out, &RawViewpoint::new(&self.viewpoint));
        for &Wanted { key: BeamKey { section, beam }, weight } in &self.beams {
            put(&mut out, &RawWanted { beam: beam.0, weight, section, reserved: 0 });
        }
        out
    }

    /// Parses a view frame. Whether a beam exists is for whoever knows the sections.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts or numbers.
    pub fn decode(bytes: &[u8]) -> Result<ViewRequest, ProtoError> {
        let mut reader = Reader(bytes);
        let counts: Counts = reader.one("view message")?;
        let viewpoint = reader.one::<RawViewpoint>("viewpoint")?.parse()?;
        let beams = reader.many::<RawWanted>("beam list", u64::from(counts.second))?;
        reader.end()?;
        if !beams.iter().all(|wanted| wanted.weight.is_finite() && wanted.weight > 0.0) {
            return Err(ProtoError::Number("a beam's weight"));
        }
        let beams = beams
            .into_iter()
            .map(|raw| Wanted {
                key: BeamKey { section: raw.section, beam: BeamId(raw.beam) },
                weight: raw.weight,
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

/// Display to server: the rays that its view wants most, most wanted first, in place of those of its last such message that have not
/// been given to a worker yet. They come before the view's beams.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RaysWanted {
    /// The view that they are for; another than the display's last is passed over.
    pub view: u32,
    /// The rays.
    pub rays: Vec<WantedRay>,
}

impl RaysWanted {
    /// The payload of a frame of wanted rays: view, count, rays.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(8 + self.rays.len() * 16);
        put(&mut out, &Counts { first: self.view, second: self.rays.len() as u32 });
        for &WantedRay { key: BeamKey { section, beam }, coords } in &self.rays {
            put(&mut out, &RawWantedRay { beam: beam.0, section, coords, reserved: 0 });
        }
        out
    }

    /// Parses a frame of wanted rays. Whether a beam exists is for whoever knows the sections.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts.
    pub fn decode(bytes: &[u8]) -> Result<RaysWanted, ProtoError> {
        let mut reader = Reader(bytes);
        let counts: Counts = reader.one("message of wanted rays")?;
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
