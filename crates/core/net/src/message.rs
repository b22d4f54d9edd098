//! Messages that may arrive on a connection after its handshake.

use holo_proto::{
    ProtoError,
    bulk::{
        BlobChunk, CellBatch, Light, LiveResults, LiveSamples, LiveWanted, LiveWork, RaysWanted,
        Results, Unseen, ViewRequest, ViewSamples, WorkPackets,
    },
    control::Control,
    frame::FrameKind,
};

/// Any message that may follow the handshake, parsed.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// A control message.
    Control(Control),
    /// Packets for a worker to trace.
    Work(WorkPackets),
    /// Samples that a worker has traced.
    Results(Results),
    /// A view that a display wants.
    View(ViewRequest),
    /// Samples for a display.
    Samples(ViewSamples),
    /// One piece of the scene or of the stand-ins.
    BlobChunk(BlobChunk),
    /// Beams whose rays hit nothing, for a display.
    Unseen(Unseen),
    /// Records of indirect light.
    Light(Light),
    /// Cells of surface light.
    Cells(CellBatch),
    /// Single rays that a display wants traced and stored.
    Rays(RaysWanted),
    /// Rays that a display wants traced and not stored.
    LiveWanted(LiveWanted),
    /// Rays for a worker to trace that are not stored.
    LiveWork(LiveWork),
    /// Radiances of such rays, from a worker.
    LiveResults(LiveResults),
    /// Radiances of such rays, for the display that asked.
    LiveSamples(LiveSamples),
}

impl Message {
    pub(crate) fn decode(kind: FrameKind, payload: &[u8]) -> Result<Message, ProtoError> {
        Ok(match kind {
            FrameKind::Hello
            | FrameKind::Answer
            | FrameKind::Challenge
            | FrameKind::Proof
            | FrameKind::MachineProof => {
                return Err(ProtoError::Kind(kind as u8));
            }
            FrameKind::Control => Message::Control(Control::decode(payload)?),
            FrameKind::Work => Message::Work(WorkPackets::decode(payload)?),
            FrameKind::Results => Message::Results(Results::decode(payload)?),
            FrameKind::View => Message::View(ViewRequest::decode(payload)?),
            FrameKind::Samples => Message::Samples(ViewSamples::decode(payload)?),
            FrameKind::BlobChunk => Message::BlobChunk(BlobChunk::decode(payload)?),
            FrameKind::Unseen => Message::Unseen(Unseen::decode(payload)?),
            FrameKind::Light => Message::Light(Light::decode(payload)?),
            FrameKind::Cells => Message::Cells(CellBatch::decode(payload)?),
            FrameKind::Rays => Message::Rays(RaysWanted::decode(payload)?),
            FrameKind::LiveWanted => Message::LiveWanted(LiveWanted::decode(payload)?),
            FrameKind::LiveWork => Message::LiveWork(LiveWork::decode(payload)?),
            FrameKind::LiveResults => Message::LiveResults(LiveResults::decode(payload)?),
            FrameKind::LiveSamples => Message::LiveSamples(LiveSamples::decode(payload)?),
        })
    }
}
