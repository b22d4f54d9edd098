//! Live rays: rays that belong to no section. They are traced for one display, shown there, and
//! never stored.

use bytemuck::{Pod, Zeroable};

use super::{Head, RecordReader, TracedPacket, expect_rays, put};
use crate::ProtoError;

/// Most live rays in one message of a display: some hundredths of a second of work.
pub const MAX_LIVE_RAYS: usize = 1 << 14;

/// Most live rays of one view that a display may have sent without an answer. They take 4 MB.
///
/// Workers get work for 150 ms in advance, so the server must have the next rays by then.
pub const MAX_LIVE_RAYS_HELD: usize = 1 << 16;

/// Greatest difference of a direction's squared length from 1.
const UNIT_SLACK: f64 = 1e-6;

/// A ray by its geometry. 56 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct LiveRay {
    /// Its origin, world coordinates.
    pub origin: [f64; 3],
    /// Its direction, of length 1.
    pub direction: [f64; 3],
    /// The display's name for the ray, repeated in its sample: see [`number`](Self::number).
    pub number: u64,
}
const _: () = assert!(size_of::<LiveRay>() == 56);

impl LiveRay {
    /// Returns the number of a pixel's ray; its first ray has round 0. The random numbers of rays
    /// of one pixel are stratified together, and those of different pixels are independent.
    #[must_use]
    pub fn number(pixel: u32, round: u32) -> u64 {
        u64::from(round) << 32 | u64::from(pixel)
    }

    /// Returns the pixel and the round of a number.
    #[must_use]
    pub fn pixel_and_round(number: u64) -> (u32, u32) {
        (number as u32, (number >> 32) as u32)
    }

    fn check(&self) -> Result<(), ProtoError> {
        if !self.origin.iter().all(|x| x.is_finite()) {
            return Err(ProtoError::Number("a ray's origin"));
        }
        let squared: f64 = self.direction.iter().map(|x| x * x).sum();
        // Also refuses NaN.
        if (squared - 1.0).abs() <= UNIT_SLACK {
            Ok(())
        } else {
            Err(ProtoError::Number("a ray's direction"))
        }
    }
}

/// Display to server: rays to trace without storing them.
///
/// They are traced after those of earlier messages for the same view, and replace those of other
/// views.
#[derive(Clone, Debug, PartialEq)]
pub struct LiveWanted {
    /// The view of the rays: the number of its first request, even if it was requested again under
    /// other numbers.
    pub view: u32,
    /// Number of pixels of the view that need live rays. It determines their share of the tracing.
    pub pixels: u32,
    /// The rays, at most [`MAX_LIVE_RAYS`].
    pub rays: Vec<LiveRay>,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct WantedHead {
    view: u32,
    pixels: u32,
    rays: u32,
    reserved: u32,
}
const _: () = assert!(size_of::<WantedHead>() == 16);

impl LiveWanted {
    /// Returns the payload: view, pixels, number of rays, rays.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(16 + self.rays.len() * 56);
        let head = WantedHead {
            view: self.view,
            pixels: self.pixels,
            rays: self.rays.len() as u32,
            reserved: 0,
        };
        put(&mut out, &head);
        out.extend_from_slice(bytemuck::cast_slice(&self.rays));
        out
    }

    /// Parses a payload.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts; [`ProtoError::Number`] for an impossible ray.
    pub fn decode(bytes: &[u8]) -> Result<LiveWanted, ProtoError> {
        let mut reader = RecordReader(bytes);
        let head: WantedHead = reader.one("message of live rays")?;
        if head.rays > MAX_LIVE_RAYS as u32 {
            let (found, limit) = (u64::from(head.rays), MAX_LIVE_RAYS as u64);
            return Err(ProtoError::TooMany { what: "live rays", found, limit });
        }
        let rays = reader.many::<LiveRay>("live ray list", u64::from(head.rays))?;
        reader.end()?;
        rays.iter().try_for_each(LiveRay::check)?;
        Ok(LiveWanted { view: head.view, pixels: head.pixels, rays })
    }
}

/// Live rays that one worker traces together.
#[derive(Clone, Debug, PartialEq)]
pub struct LivePacket {
    /// The server's name for the packet, repeated in the results.
    pub id: u64,
    /// Paths averaged into each ray, at least 1.
    pub paths: u16,
    /// The rays, 1 to [`crate::MAX_RAYS_PER_PACKET`].
    pub rays: Vec<LiveRay>,
}

/// Server to worker: live rays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LiveWork {
    /// The packets, the most urgent first.
    pub packets: Vec<LivePacket>,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct RawLivePacket {
    id: u64,
    count: u32,
    paths: u16,
    reserved: u16,
}
const _: () = assert!(size_of::<RawLivePacket>() == 16);

impl LiveWork {
    /// Returns the payload: numbers of packets and rays, packets, rays.
    pub fn encode(&self) -> Vec<u8> {
        let rays: usize = self.packets.iter().map(|packet| packet.rays.len()).sum();
        let mut out = Vec::with_capacity(8 + self.packets.len() * 16 + rays * 56);
        put(&mut out, &Head { first: self.packets.len() as u32, second: rays as u32 });
        for packet in &self.packets {
            let count = packet.rays.len() as u32;
            put(
                &mut out,
                &RawLivePacket { id: packet.id, count, paths: packet.paths, reserved: 0 },
            );
        }
        self.packets
            .iter()
            .for_each(|packet| out.extend_from_slice(bytemuck::cast_slice(&packet.rays)));
        out
    }

    /// Parses a payload. Every packet has 1 to 21 rays, and all are there.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts; [`ProtoError::Number`] for an impossible ray.
    pub fn decode(bytes: &[u8]) -> Result<LiveWork, ProtoError> {
        let mut reader = RecordReader(bytes);
        let counts: Head = reader.one("live work message")?;
        let packets = reader.many::<RawLivePacket>("live packet list", u64::from(counts.first))?;
        let rays = reader.many::<LiveRay>("live ray list", u64::from(counts.second))?;
        reader.end()?;
        expect_rays("live ray list", packets.iter().map(|packet| packet.count), &rays)?;
        rays.iter().try_for_each(LiveRay::check)?;
        if packets.iter().any(|packet| packet.paths == 0) {
            return Err(ProtoError::Number("a packet's number of paths"));
        }
        let mut rays = rays.into_iter();
        let parse = |raw: RawLivePacket| LivePacket {
            id: raw.id,
            paths: raw.paths,
            rays: rays.by_ref().take(raw.count as usize).collect(),
        };
        Ok(LiveWork { packets: packets.into_iter().map(parse).collect() })
    }
}

/// The result of a live ray. 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct LiveHit {
    /// Radiance; finite and not negative.
    pub radiance: [f32; 3],
    /// Distance from the ray's origin to the surface that it hit, not negative; infinite if it hit
    /// nothing.
    pub distance: f32,
}
const _: () = assert!(size_of::<LiveHit>() == 16);

impl LiveHit {
    fn check(&self) -> Result<(), ProtoError> {
        if !self.radiance.iter().all(|x| x.is_finite() && *x >= 0.0) {
            return Err(ProtoError::Number("a ray's radiance"));
        }
        // Also refuses NaN.
        if self.distance >= 0.0 { Ok(()) } else { Err(ProtoError::Number("a ray's distance")) }
    }
}

/// Worker to server: the results of live rays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LiveResults {
    /// The packets, in the order of their hits.
    pub packets: Vec<TracedPacket>,
    /// The results, one for each ray of each packet, in the order of the rays.
    pub hits: Vec<LiveHit>,
}

impl LiveResults {
    /// Returns the payload: numbers of packets and rays, packets, hits.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(8 + (self.packets.len() + self.hits.len()) * 16);
        put(&mut out, &Head { first: self.packets.len() as u32, second: self.hits.len() as u32 });
        out.extend_from_slice(bytemuck::cast_slice(&self.packets));
        out.extend_from_slice(bytemuck::cast_slice(&self.hits));
        out
    }

    /// Parses a payload. Every packet has 1 to 21 rays, and all are there.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts; [`ProtoError::Number`] for an impossible radiance or
    /// distance.
    pub fn decode(bytes: &[u8]) -> Result<LiveResults, ProtoError> {
        let mut reader = RecordReader(bytes);
        let counts: Head = reader.one("live results message")?;
        let packets = reader.many::<TracedPacket>("live packet list", u64::from(counts.first))?;
        let hits = reader.many::<LiveHit>("live hit list", u64::from(counts.second))?;
        reader.end()?;
        expect_rays("live hit list", packets.iter().map(|packet| packet.count), &hits)?;
        hits.iter().try_for_each(LiveHit::check)?;
        Ok(LiveResults { packets, hits })
    }
}

/// The result of one of a display's live rays. 24 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct LiveResult {
    /// The display's name for the ray.
    pub number: u64,
    /// Its result.
    pub hit: LiveHit,
}
const _: () = assert!(size_of::<LiveResult>() == 24);

/// Server to display: the results of its live rays.
#[derive(Clone, Debug, PartialEq)]
pub struct LiveSamples {
    /// The view of the rays.
    pub view: u32,
    /// The results.
    pub samples: Vec<LiveResult>,
}

impl LiveSamples {
    /// Returns the payload: view, number of samples, samples.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(8 + self.samples.len() * 24);
        put(&mut out, &Head { first: self.view, second: self.samples.len() as u32 });
        out.extend_from_slice(bytemuck::cast_slice(&self.samples));
        out
    }

    /// Parses a payload.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts; [`ProtoError::Number`] for an impossible radiance or
    /// distance.
    pub fn decode(bytes: &[u8]) -> Result<LiveSamples, ProtoError> {
        let mut reader = RecordReader(bytes);
        let counts: Head = reader.one("live samples message")?;
        let samples = reader.many::<LiveResult>("live sample list", u64::from(counts.second))?;
        reader.end()?;
        samples.iter().try_for_each(|sample| sample.hit.check())?;
        Ok(LiveSamples { view: counts.first, samples })
    }
}
