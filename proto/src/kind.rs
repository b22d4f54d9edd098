//! Kinds of frames, and the longest payload of each.

/// Longest control message. A welcome with 1024 sections and their texts fits many times over.
pub const MAX_CONTROL_BYTES: u64 = 1 << 20;
/// Longest bulk message: a million wanted beams, or 1.6 million samples.
pub const MAX_BULK_BYTES: u64 = 16 << 20;
/// Longest message of live rays: [`crate::bulk::MAX_LIVE_RAYS`] of them.
pub const MAX_LIVE_WANTED_BYTES: u64 = 1 << 20;
/// Longest hello or answer. It is small, because strangers send it.
pub const MAX_HELLO_BYTES: u64 = 4096;

/// The content of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum FrameKind {
    /// [`crate::hello::Hello`], the first frame of a peer.
    Hello = 1,
    /// [`crate::hello::Answer`], the first frame back.
    Answer = 2,
    /// [`crate::control::Control`], either way.
    Control = 3,
    /// [`crate::bulk::WorkPackets`], server to worker.
    Work = 4,
    /// [`crate::bulk::Results`], worker to server.
    Results = 5,
    /// [`crate::bulk::ViewRequest`], display to server.
    View = 6,
    /// [`crate::bulk::ViewSamples`], server to display.
    Samples = 7,
    /// [`crate::bulk::BlobChunk`], server to worker or display: a piece of the packed scene.
    BlobChunk = 8,
    /// [`crate::bulk::Unseen`], server to display.
    Unseen = 9,
    /// [`crate::bulk::Light`], worker to server, and server to peers that requested light.
    Light = 10,
    /// [`crate::bulk::RaysWanted`], display to server.
    Rays = 11,
    /// [`crate::bulk::LiveWanted`], display to server.
    LiveWanted = 12,
    /// [`crate::bulk::LiveWork`], server to worker.
    LiveWork = 13,
    /// [`crate::bulk::LiveResults`], worker to server.
    LiveResults = 14,
    /// [`crate::bulk::LiveSamples`], server to display.
    LiveSamples = 15,
    /// [`crate::proof::Challenge`], server to workers and to peers on other machines.
    Challenge = 16,
    /// [`crate::proof::Proof`], the answer to a challenge.
    Proof = 17,
    /// [`crate::proof::MachineProof`], a worker's answer to a challenge.
    MachineProof = 18,
    /// [`crate::bulk::CellBatch`], worker to server, and server to peers that requested light.
    Cells = 19,
}

impl FrameKind {
    /// Returns the kind with this number, if there is one.
    pub fn from_byte(byte: u8) -> Option<FrameKind> {
        [
            FrameKind::Hello,
            FrameKind::Answer,
            FrameKind::Control,
            FrameKind::Work,
            FrameKind::Results,
            FrameKind::View,
            FrameKind::Samples,
            FrameKind::BlobChunk,
            FrameKind::Unseen,
            FrameKind::Light,
            FrameKind::Rays,
            FrameKind::LiveWanted,
            FrameKind::LiveWork,
            FrameKind::LiveResults,
            FrameKind::LiveSamples,
            FrameKind::Challenge,
            FrameKind::Proof,
            FrameKind::MachineProof,
            FrameKind::Cells,
        ]
        .into_iter()
        .find(|&kind| kind as u8 == byte)
    }

    /// Returns the longest payload of this kind, bytes.
    pub fn max_bytes(self) -> u64 {
        match self {
            FrameKind::Hello
            | FrameKind::Answer
            | FrameKind::Challenge
            | FrameKind::Proof
            | FrameKind::MachineProof => MAX_HELLO_BYTES,
            FrameKind::Control => MAX_CONTROL_BYTES,
            FrameKind::Work
            | FrameKind::Results
            | FrameKind::View
            | FrameKind::Samples
            | FrameKind::BlobChunk
            | FrameKind::Unseen
            | FrameKind::Light
            | FrameKind::Cells
            | FrameKind::Rays
            | FrameKind::LiveWork
            | FrameKind::LiveResults
            | FrameKind::LiveSamples => MAX_BULK_BYTES,
            FrameKind::LiveWanted => MAX_LIVE_WANTED_BYTES,
        }
    }
}
