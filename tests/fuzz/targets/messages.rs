//! Every message of the protocol, in both directions: the first byte is the kind, the rest the
//! payload. What is taken means the same when it is sent on.
#![no_main]

use holo_proto::{
    bulk::{
        BlobChunk, CellBatch, Light, LiveResults, LiveSamples, LiveWanted, LiveWork, RaysWanted,
        Results, Unseen, ViewRequest, ViewSamples, WorkPackets,
    },
    control::Control,
    frame::{FrameHeader, FrameKind, HEADER_BYTES},
    hello::{Answer, Hello},
    proof::{Challenge, MachineProof, Proof},
    stand_ins,
};
use libfuzzer_sys::fuzz_target;

/// A payload that is taken is written again, and then stays as it is.
macro_rules! stays {
    ($payload:expr, $type:ty) => {
        if let Ok(message) = <$type>::decode($payload) {
            let sent = message.encode();
            let again = <$type>::decode(&sent).expect("it is taken again");
            assert!(again.encode() == sent, "it means something else");
        }
    };
}

fuzz_target!(|bytes: &[u8]| {
    let Some((&kind, payload)) = bytes.split_first() else { return };
    if let Some(header) = bytes.first_chunk::<HEADER_BYTES>()
        && let Ok(header) = FrameHeader::parse(*header)
    {
        assert!(u64::from(header.length) <= header.kind.max_bytes());
    }
    let Some(kind) = FrameKind::from_byte(kind) else {
        if let Ok(found) = stand_ins::decode(payload) {
            assert!(stand_ins::encode(&found) == payload);
        }
        return;
    };
    match kind {
        FrameKind::Hello => stays!(payload, Hello),
        FrameKind::Answer => stays!(payload, Answer),
        FrameKind::Challenge => stays!(payload, Challenge),
        FrameKind::Proof => stays!(payload, Proof),
        FrameKind::MachineProof => stays!(payload, MachineProof),
        FrameKind::Control => {
            if let Ok(message) = Control::decode(payload) {
                // Texts may grow: what is no UTF-8 becomes U+FFFD.
                let Ok(sent) = message.encode() else { return };
                let again = Control::decode(&sent).expect("it is taken again");
                assert!(again.encode().is_ok_and(|again| again == sent));
            }
        }
        FrameKind::Work => stays!(payload, WorkPackets),
        FrameKind::Results => stays!(payload, Results),
        FrameKind::View => stays!(payload, ViewRequest),
        FrameKind::Samples => stays!(payload, ViewSamples),
        FrameKind::BlobChunk => stays!(payload, BlobChunk),
        FrameKind::Unseen => stays!(payload, Unseen),
        FrameKind::Light => stays!(payload, Light),
        FrameKind::Cells => stays!(payload, CellBatch),
        FrameKind::Rays => stays!(payload, RaysWanted),
        FrameKind::LiveWanted => stays!(payload, LiveWanted),
        FrameKind::LiveWork => stays!(payload, LiveWork),
        FrameKind::LiveResults => stays!(payload, LiveResults),
        FrameKind::LiveSamples => stays!(payload, LiveSamples),
    }
});
