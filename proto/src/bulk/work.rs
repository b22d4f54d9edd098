//! Packets to trace, server to worker.

use bytemuck::{Pod, Zeroable};
use holo_section::{BeamId, BeamKey, NumberRun, RayCoords, SampleKind, Viewpoint};

use super::{Head, RawViewpoint, RecordReader, put};
use crate::{MAX_RAYS_PER_PACKET, ProtoError};

/// A packet to trace. Its rays are a function of (section, beam, kind, first number, viewpoint)
/// alone, or it has their positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Packet {
    /// The server's name for the packet, repeated in the results.
    pub id: u64,
    /// The beam.
    pub key: BeamKey,
    /// Number of the first sample.
    pub first: u32,
    /// Number of samples, 1 to [`MAX_RAYS_PER_PACKET`].
    pub count: u8,
    /// Paths averaged into each sample, at least 1.
    pub paths: u16,
    /// Index into [`WorkPackets::viewpoints`], less than 65534. `None` if rays need not pass near
    /// an eye.
    pub viewpoint: Option<u16>,
    /// The positions of its rays, `count` of them and then zeros, if a display requested single
    /// rays. The packet then has no viewpoint.
    pub rays: Option<[RayCoords; MAX_RAYS_PER_PACKET]>,
}

impl Packet {
    /// Returns the kind of its samples.
    pub fn kind(&self) -> SampleKind {
        match (self.rays, self.viewpoint) {
            (Some(_), _) => SampleKind::SingleRay,
            (None, Some(_)) => SampleKind::ViewpointLimited,
            (None, None) => SampleKind::Uniform,
        }
    }

    /// Returns the samples of the packet.
    pub fn run(&self) -> NumberRun {
        let Packet { key, first, count, paths, .. } = *self;
        NumberRun { key, kind: self.kind(), first, count: u32::from(count), paths }
    }
}

/// Server to worker: packets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WorkPackets {
    /// The viewpoints that the packets refer to.
    pub viewpoints: Vec<Viewpoint>,
    /// The packets, the most urgent first.
    pub packets: Vec<Packet>,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct RawWorkPacket {
    id: u64,
    beam: u64,
    first: u32,
    section: u16,
    viewpoint: u16,
    paths: u16,
    count: u8,
    reserved: [u8; 5],
}
const _: () = assert!(size_of::<RawWorkPacket>() == 32);

/// `RawWorkPacket::viewpoint` of a uniform packet.
const NO_VIEWPOINT: u16 = u16::MAX;

/// `RawWorkPacket::viewpoint` of a packet of single rays.
const SINGLE_RAYS: u16 = u16::MAX - 1;

impl WorkPackets {
    /// Returns the payload: numbers of viewpoints and packets, viewpoints, packets, positions of
    /// single rays.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(8 + self.viewpoints.len() * 32 + self.packets.len() * 32);
        let (viewpoints, packets) = (self.viewpoints.len() as u32, self.packets.len() as u32);
        put(&mut out, &Head { first: viewpoints, second: packets });
        self.viewpoints.iter().for_each(|viewpoint| put(&mut out, &RawViewpoint::new(viewpoint)));
        self.packets.iter().for_each(|packet| put(&mut out, &RawWorkPacket::new(packet)));
        for packet in &self.packets {
            if let Some(rays) = &packet.rays {
                let count = usize::from(packet.count).min(MAX_RAYS_PER_PACKET);
                out.extend_from_slice(bytemuck::cast_slice(&rays[..count]));
            }
        }
        out
    }

    /// Parses a payload. It does not check whether the beams exist.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts, viewpoints, or numbers.
    pub fn decode(bytes: &[u8]) -> Result<WorkPackets, ProtoError> {
        let mut reader = RecordReader(bytes);
        let head: Head = reader.one("work message")?;
        let viewpoints = reader.many::<RawViewpoint>("viewpoint list", u64::from(head.first))?;
        let packets = reader.many::<RawWorkPacket>("packet list", u64::from(head.second))?;
        let single = packets.iter().filter(|raw| raw.viewpoint == SINGLE_RAYS);
        let rays =
            reader.many::<RayCoords>("ray list", single.map(|raw| u64::from(raw.count)).sum())?;
        reader.end()?;
        let mut rays = rays.into_iter();
        let viewpoints =
            viewpoints.into_iter().map(RawViewpoint::parse).collect::<Result<Vec<_>, _>>()?;
        let packets = packets
            .into_iter()
            .map(|raw| raw.parse(viewpoints.len(), &mut rays))
            .collect::<Result<Vec<_>, _>>()?;
        Ok(WorkPackets { viewpoints, packets })
    }
}

impl RawWorkPacket {
    fn new(packet: &Packet) -> RawWorkPacket {
        let BeamKey { section, beam } = packet.key;
        let viewpoint = match packet.rays {
            Some(_) => SINGLE_RAYS,
            None => packet.viewpoint.unwrap_or(NO_VIEWPOINT),
        };
        RawWorkPacket {
            id: packet.id,
            beam: beam.0,
            first: packet.first,
            section,
            viewpoint,
            paths: packet.paths,
            count: packet.count,
            reserved: [0; 5],
        }
    }

    /// Checks a packet of a message with this many viewpoints. If its rays are single ones, removes
    /// their positions from `rays`.
    fn parse(
        self,
        viewpoints: usize,
        rays: &mut impl Iterator<Item = RayCoords>,
    ) -> Result<Packet, ProtoError> {
        let count = usize::from(self.count);
        if !(1..=MAX_RAYS_PER_PACKET).contains(&count) {
            return Err(ProtoError::RayCount(u32::from(self.count)));
        }
        if self.paths == 0 {
            return Err(ProtoError::Number("a packet's number of paths"));
        }
        if self.first.checked_add(u32::from(self.count)).is_none() {
            return Err(ProtoError::Number("a packet's first sample number"));
        }
        let (viewpoint, rays) = match self.viewpoint {
            NO_VIEWPOINT => (None, None),
            SINGLE_RAYS => {
                let mut single = [RayCoords::default(); MAX_RAYS_PER_PACKET];
                single[..count].iter_mut().zip(rays).for_each(|(to, ray)| *to = ray);
                (None, Some(single))
            }
            index if usize::from(index) < viewpoints => (Some(index), None),
            index => return Err(ProtoError::Viewpoint { index, count: viewpoints }),
        };
        Ok(Packet {
            id: self.id,
            key: BeamKey { section: self.section, beam: BeamId(self.beam) },
            first: self.first,
            count: self.count,
            paths: self.paths,
            viewpoint,
            rays,
        })
    }
}
