//! The results of packets, worker to server.

use bytemuck::{Pod, Zeroable};
use holo_section::Sample;

use super::{RecordReader, expect_rays, put};
use crate::ProtoError;

/// Worker to server: the results of packets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Results {
    /// The traced packets, in the order of their samples.
    pub packets: Vec<TracedPacket>,
    /// Samples of all traced packets, one after the other.
    pub samples: Vec<Sample>,
    /// Ids of packets that were not traced because their beams are unseen: no ray of them hits
    /// anything.
    pub unseen: Vec<u64>,
}

/// One packet of a [`Results`]. 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct TracedPacket {
    /// The packet's id.
    pub id: u64,
    /// Number of samples: as many as in the packet.
    pub count: u32,
    /// Time that one thread took, nanoseconds. Longer times are `u32::MAX`.
    pub nanoseconds: u32,
}
const _: () = assert!(size_of::<TracedPacket>() == 16);

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct ResultCounts {
    packets: u32,
    samples: u32,
    unseen: u32,
}
const _: () = assert!(size_of::<ResultCounts>() == 12);

impl Results {
    /// Returns the payload: numbers of packets, samples and unseen packets, then the list of each.
    pub fn encode(&self) -> Vec<u8> {
        let bytes = 12 + self.packets.len() * 16 + self.samples.len() * 10 + self.unseen.len() * 8;
        let mut out = Vec::with_capacity(bytes);
        let counts =
            [self.packets.len(), self.samples.len(), self.unseen.len()].map(|count| count as u32);
        put(&mut out, &ResultCounts { packets: counts[0], samples: counts[1], unseen: counts[2] });
        out.extend_from_slice(bytemuck::cast_slice(&self.packets));
        out.extend_from_slice(bytemuck::cast_slice(&self.samples));
        out.extend_from_slice(bytemuck::cast_slice(&self.unseen));
        out
    }

    /// Parses a payload. Every traced packet has 1 to 21 samples, and all are there.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts.
    pub fn decode(bytes: &[u8]) -> Result<Results, ProtoError> {
        let mut reader = RecordReader(bytes);
        let counts: ResultCounts = reader.one("results message")?;
        let packets =
            reader.many::<TracedPacket>("traced packet list", u64::from(counts.packets))?;
        let samples = reader.many::<Sample>("sample list", u64::from(counts.samples))?;
        let unseen = reader.many::<u64>("unseen packet list", u64::from(counts.unseen))?;
        reader.end()?;
        expect_rays("sample list", packets.iter().map(|packet| packet.count), &samples)?;
        Ok(Results { packets, samples, unseen })
    }
}
