//! Packets to trace, server to worker.

use bytemuck::{Pod, Zeroable};
use holo_section::{BeamId, BeamKey, RayCoords, Run, SampleKind, Viewpoint};

use super::{Counts, RawViewpoint, Reader, put};
use crate::{MAX_RAYS_PER_PACKET, ProtoError};

/// A packet to trace: which rays is a function of (section, beam, kind, first, viewpoint) alone, or it names them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Packet {
    /// The server's name for this assignment, given back with the results.
    pub id: u64,
    /// The beam.
    pub key: BeamKey,
    /// First sample number.
    pub first: u32,
    /// Rays, 1 to [`MAX_RAYS_PER_PACKET`].
    pub count: u8,
    /// Paths averaged into each sample, at least 1.
    pub paths: u16,
    /// Index into [`Work::viewpoints`], less than 65534; `None`: uniform in the beam.
    pub viewpoint: Option<u16>,
    /// Its rays, `count` of them and then zeros, if they were asked for one by one; it then has no viewpoint.
    pub rays: Option<[RayCoords; MAX_RAYS_PER_PACKET]>,
}

impl Packet {
    /// How its rays are chosen.
    pub fn kind(&self) -> SampleKind {
        match (self.rays, self.viewpoint) {
            (Some(_), _) => SampleKind::SingleRay,
            (None, Some(_)) => SampleKind::ViewpointLimited,
            (None, None) => SampleKind::Uniform,
        }
    }

    /// The samples that it asks for.
    pub fn run(&self) -> Run {
        let Packet { key, first, count, paths, .. } = *self;
        Run { key, kind: self.kind(), first, count: u32::from(count), paths }
    }
}

/// Server to worker: packets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Work {
    /// Viewpoints that the packets refer to.
    pub viewpoints: Vec<Viewpoint>,
    /// The packets, in the order wanted.
    pub packets: Vec<Packet>,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct RawPacket {
    id: u64,
    beam: u64,
    first: u32,
    section: u16,
    viewpoint: u16,
    paths: u16,
    count: u8,
    reserved: [u8; 5],
}
const _: () = assert!(size_of::<RawPacket>() == 32);

/// `RawPacket::viewpoint` of a uniform packet.
const NO_VIEWPOINT: u16 = u16::MAX;

/// `RawPacket::viewpoint` of a packet that names its rays.
const NAMED_RAYS: u16 = u16::MAX - 1;

impl Work {
    /// The payload of a work frame: counts, viewpoints, packets, rays that packets name.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(8 + self.viewpoints.len() * 32 + self.packets.len() * 32);
        put(
            &mut out,
            &Counts { first: self.viewpoints.len() as u32, second: self.packets.len() as u32 },
        );
        for viewpoint in &self.viewpoints {
            put(&mut out, &RawViewpoint::new(viewpoint));
        }
        for packet in &self.packets {
            put(
                &mut out,
                &RawPacket {
                    id: packet.id,
                    beam: packet.key.beam.0,
                    first: packet.first,
                    section: packet.key.section,
                    viewpoint: if packet.rays.is_some() {
                        NAMED_RAYS
                    } else {
                        packet.viewpoint.unwrap_or(NO_VIEWPOINT)
                    },
                    paths: packet.paths,
                    count: packet.count,
                    reserved: [0; 5],
                },
            );
        }
        for (rays, packet) in
            self.packets.iter().filter_map(|packet| Some((packet.rays.as_ref()?, packet)))
        {
            out.extend_from_slice(bytemuck::cast_slice(
                &rays[..usize::from(packet.count).min(MAX_RAYS_PER_PACKET)],
            ));
        }
        out
    }

    /// Parses a work frame. Whether a beam exists is for whoever knows the sections.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts, viewpoints, or numbers.
    pub fn decode(bytes: &[u8]) -> Result<Work, ProtoError> {
        let mut reader = Reader(bytes);
        let counts: Counts = reader.one("work message")?;
        let viewpoints = reader.many::<RawViewpoint>("viewpoint list", u64::from(counts.first))?;
        let packets = reader.many::<RawPacket>("packet list", u64::from(counts.second))?;
        let named = packets
            .iter()
            .filter(|raw| raw.viewpoint == NAMED_RAYS)
            .map(|raw| u64::from(raw.count))
            .sum();
        let rays = reader.many::<RayCoords>("ray list", named)?;
        reader.end()?;
        let mut rays = rays.into_iter();
        let viewpoints =
            viewpoints.into_iter().map(RawViewpoint::parse).collect::<Result<Vec<_>, _>>()?;
        let packets = packets
            .into_iter()
            .map(|raw| {
                if !(1..=MAX_RAYS_PER_PACKET).contains(&usize::from(raw.count)) {
                    return Err(ProtoError::RayCount(u32::from(raw.count)));
                }
                if raw.paths == 0 {
                    return Err(ProtoError::Number("a packet's number of paths"));
                }
                if raw.first.checked_add(u32::from(raw.count)).is_none() {
                    return Err(ProtoError::Number("a packet's first sample number"));
                }
                let named = (raw.viewpoint == NAMED_RAYS).then(|| {
                    let mut named = [RayCoords::default(); MAX_RAYS_PER_PACKET];
                    named
                        .iter_mut()
                        .zip(rays.by_ref().take(usize::from(raw.count)))
                        .for_each(|(to, ray)| *to = ray);
                    named
                });
                let viewpoint =
                    (raw.viewpoint != NO_VIEWPOINT && named.is_none()).then_some(raw.viewpoint);
                if let Some(index) =
                    viewpoint.filter(|&index| usize::from(index) >= viewpoints.len())
                {
                    return Err(ProtoError::Viewpoint { index, count: viewpoints.len() });
                }
                Ok(Packet {
                    id: raw.id,
                    key: BeamKey { section: raw.section, beam: BeamId(raw.beam) },
                    first: raw.first,
                    count: raw.count,
                    paths: raw.paths,
                    viewpoint,
                    rays: named,
                })
            })
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Work { viewpoints, packets })
    }
}
