//! Bulk messages: packets, samples, views and live rays. A message is a fixed head, then arrays of
//! plain records.

mod cells;
mod live;
mod results;
mod samples;
mod shared;
mod view;
mod work;

use bytemuck::{Pod, Zeroable};
pub use cells::{CellBatch, MAX_ESTIMATES, WireCell};
use holo_section::Viewpoint;
pub use live::{
    LiveHit, LivePacket, LiveRay, LiveResult, LiveResults, LiveSamples, LiveWanted, LiveWork,
    MAX_LIVE_RAYS, MAX_LIVE_RAYS_HELD,
};
pub use results::{Results, TracedPacket};
pub use samples::{MAX_RUN, SampleSource, Unseen, ViewSamples};
pub use shared::{BlobChunk, Light, Record};
pub use view::{MAX_HELD, RaysWanted, RequestedBeam, ViewRequest, WantedRay};
pub use work::{Packet, WorkPackets};

use crate::{MAX_RAYS_PER_PACKET, ProtoError};

/// The two numbers at the beginning of a message: counts, or a view and a count.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Head {
    first: u32,
    second: u32,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct RawViewpoint {
    eye: [f64; 3],
    radius: f64,
}
const _: () = assert!(size_of::<RawViewpoint>() == 32);

impl RawViewpoint {
    fn new(viewpoint: &Viewpoint) -> Self {
        Self { eye: viewpoint.eye, radius: viewpoint.radius }
    }

    fn parse(self) -> Result<Viewpoint, ProtoError> {
        if !self.eye.iter().all(|x| x.is_finite()) {
            return Err(ProtoError::Number("an eye"));
        }
        if !(self.radius.is_finite() && self.radius >= 0.0) {
            return Err(ProtoError::Number("a viewpoint radius"));
        }
        Ok(Viewpoint { eye: self.eye, radius: self.radius })
    }
}

/// Reads records from a payload. A missing record is an error before memory is allocated for it.
struct RecordReader<'a>(&'a [u8]);

impl<'a> RecordReader<'a> {
    fn take(&mut self, what: &'static str, bytes: u64) -> Result<&'a [u8], ProtoError> {
        let found = self.0.len() as u64;
        let (head, rest) = usize::try_from(bytes)
            .ok()
            .and_then(|bytes| self.0.split_at_checked(bytes))
            .ok_or(ProtoError::Truncated { what, needed: bytes, found })?;
        self.0 = rest;
        Ok(head)
    }

    fn one<T: Pod>(&mut self, what: &'static str) -> Result<T, ProtoError> {
        Ok(bytemuck::pod_read_unaligned(self.take(what, size_of::<T>() as u64)?))
    }

    fn many<T: Pod>(&mut self, what: &'static str, count: u64) -> Result<Vec<T>, ProtoError> {
        let bytes = count.saturating_mul(size_of::<T>() as u64);
        Ok(bytemuck::pod_collect_to_vec(self.take(what, bytes)?))
    }

    fn end(self) -> Result<(), ProtoError> {
        if self.0.is_empty() { Ok(()) } else { Err(ProtoError::Trailing(self.0.len())) }
    }
}

fn put<T: Pod>(out: &mut Vec<u8>, record: &T) {
    out.extend_from_slice(bytemuck::bytes_of(record));
}

/// Checks that a list has as many entries as the records before it state.
fn expect_total<T>(what: &'static str, said: u64, list: &[T]) -> Result<(), ProtoError> {
    let (bytes, found) = (size_of::<T>() as u64, list.len() as u64);
    if said == found {
        return Ok(());
    }
    Err(ProtoError::Truncated { what, needed: said * bytes, found: found * bytes })
}

/// Checks that packets have 1 to 21 rays each, and that a list has as many entries as their sum.
fn expect_rays<T>(
    what: &'static str,
    said: impl Iterator<Item = u32>,
    list: &[T],
) -> Result<(), ProtoError> {
    let mut total = 0;
    for count in said {
        if !(1..=MAX_RAYS_PER_PACKET as u32).contains(&count) {
            return Err(ProtoError::RayCount(count));
        }
        total += u64::from(count);
    }
    expect_total(what, total, list)
}
