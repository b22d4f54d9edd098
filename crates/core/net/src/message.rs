//! Messages that may arrive on a connection after its handshake.

use holo_proto::{
    ProtoError,
    bulk::{
        BlobChunk, Cells, LiveResults, LiveSamples, LiveWanted, LiveWork, RaysWanted, Results,
        Samples, Unseen, ViewRequest, Work,
    },
    control::Control,
    frame::Kind,
};

/// Any message that may follow the handshake, parsed.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// A control message.
    Control(Control),
    /// Packets for a worker to trace.
    Work(Work),
    /// Samples that a worker has traced.
    Results(Results),
    /// A view that a display wants.
    View(ViewRequest),
    /// Samples for a display.
    Samples(Samples),
    /// One piece of the scene or of the stand-ins.
    BlobChunk(BlobChunk),
    /// Beams whose rays hit nothing, for a display.
    Unseen(Unseen),
    /// Cells of surface light.
    Cells(Cells),
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
    pub(crate) fn decode(kind: Kind, payload: &[u8]) -> Result<Message, ProtoError> {
        Ok(match kind {
            Kind::Hello | Kind::Answer | Kind::Challenge | Kind::Proof | Kind::MachineProof => {
                return Err(ProtoError::Kind(kind as u8));
            }
            Kind::Control => Message::Control(Control::decode(payload)?),
            Kind::Work => Message::Work(Work::decode(payload)?),
            Kind::Results => Message::Results(Results::decode(payload)?),
            Kind::View => Message::View(ViewRequest::decode(payload)?),
            Kind::Samples => Message::Samples(Samples::decode(payload)?),
            Kind::BlobChunk => Message::BlobChunk(BlobChunk::decode(payload)?),
            Kind::Unseen => Message::Unseen(Unseen::decode(payload)?),
            Kind::Cells => Message::Cells(Cells::decode(payload)?),
            Kind::Rays => Message::Rays(RaysWanted::decode(payload)?),
            Kind::LiveWanted => Message::LiveWanted(LiveWanted::decode(payload)?),
            Kind::LiveWork => Message::LiveWork(LiveWork::decode(payload)?),
            Kind::LiveResults => Message::LiveResults(LiveResults::decode(payload)?),
            Kind::LiveSamples => Message::LiveSamples(LiveSamples::decode(payload)?),
        })
    }
}
