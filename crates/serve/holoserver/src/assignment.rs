//! A packet in a worker's hands, and what becomes of it.

use holo_proto::bulk::Packet;
use holo_section::{BeamKey, NumberRun, Sample, SampleKind, Viewpoint};
use thiserror::Error;

use crate::{audits::Audit, claims::Check, events::ConnectionId, worker_id::WorkerId};

/// The purpose of a packet's samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PacketPurpose {
    /// They are stored.
    Store,
    /// They check whether a beam sees nothing.
    Claim(Check),
    /// They are compared with those of another worker.
    Again(Audit),
}

/// A packet that a worker has, with all that another worker would need.
#[derive(Clone, Copy, Debug)]
pub struct Assignment {
    /// The packet. Its `viewpoint` field is set when it is sent.
    pub packet: Packet,
    /// The viewpoint that its rays pass, if any.
    pub viewpoint: Option<Viewpoint>,
    /// The display whose view it serves, if any.
    pub display: Option<ConnectionId>,
    /// What its samples are for.
    pub purpose: PacketPurpose,
    /// A worker that gets it only if there is no other.
    pub not_for: Option<WorkerId>,
}

impl Assignment {
    /// Returns whether a worker may trace this packet. `is_alone` is true if there is no other
    /// worker.
    pub fn is_for(&self, worker: WorkerId, is_alone: bool) -> bool {
        match self.purpose {
            PacketPurpose::Store => is_alone || self.not_for != Some(worker),
            PacketPurpose::Claim(check) => check.is_for(worker),
            PacketPurpose::Again(audit) => audit.checker == worker,
        }
    }

    /// Returns its beam.
    pub fn key(&self) -> BeamKey {
        self.packet.key
    }

    /// Returns how its rays are chosen.
    pub fn kind(&self) -> SampleKind {
        match (self.packet.rays, self.viewpoint) {
            (Some(_), _) => SampleKind::SingleRay,
            (None, Some(_)) => SampleKind::ViewpointLimited,
            (None, None) => SampleKind::Uniform,
        }
    }

    /// Returns the samples that it asks for.
    pub fn run(&self) -> NumberRun {
        NumberRun { kind: self.kind(), ..self.packet.run() }
    }

    /// Returns whether samples belong to the rays that the packet names, if it names any.
    pub fn is_answered_by(&self, samples: &[Sample]) -> bool {
        let named = self.packet.rays.iter().flatten();
        named.zip(samples).all(|(ray, sample)| *ray == sample.coords)
    }

    /// Returns what it costs, in rays of `usual_paths` paths.
    pub fn work(&self, usual_paths: u16) -> f64 {
        f64::from(self.packet.count) * f64::from(self.packet.paths) / f64::from(usual_paths.max(1))
    }
}

/// The state of a packet whose results have arrived.
#[derive(Debug)]
pub enum PacketState<T> {
    /// They came in time.
    InTime(T),
    /// The packet was overdue and taken away. It may still wait under another name, unless it was
    /// one of live rays.
    Late(Option<u64>),
}

/// Why the server refused a worker's results.
#[derive(Debug, Error)]
pub enum ResultsError {
    #[error("it sent results for a packet that it was not given")]
    Unknown,
    #[error("it sent {found} samples for a packet of {asked} rays")]
    Count { found: u32, asked: u8 },
    #[error("it sent samples of other rays than those that it was given")]
    OtherRays,
    #[error("it says that a beam sees nothing, but it was not asked to look")]
    NotAsked,
}
