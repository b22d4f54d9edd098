//! Every message of the protocol, in both directions: the first byte is the kind, the rest the
//! payload. What is taken means the same when it is sent on.
#![no_main]

use holo_proto::{
    bulk::{
        BlobChunk, Cells, LiveResults, LiveSamples, LiveWanted, LiveWork, RaysWanted, Results,
        Samples, Unseen, ViewRequest, Work,
    },
    control::Control,
    frame::{HEADER_BYTES, Header, Kind},
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
        && let Ok(header) = Header::parse(*header)
    {
        assert!(u64::from(header.length) <= header.kind.max_bytes());
    }
    let Some(kind) = Kind::from_byte(kind) else {
        if let Ok(found) = stand_ins::decode(payload) {
            assert!(stand_ins::encode(&found) == payload);
        }
        return;
    };
    match kind {
        Kind::Hello => stays!(payload, Hello),
        Kind::Answer => stays!(payload, Answer),
        Kind::Challenge => stays!(payload, Challenge),
        Kind::Proof => stays!(payload, Proof),
        Kind::MachineProof => stays!(payload, MachineProof),
        Kind::Control => {
            if let Ok(message) = Control::decode(payload) {
                // Texts may grow: what is no UTF-8 becomes U+FFFD.
                let Ok(sent) = message.encode() else { return };
                let again = Control::decode(&sent).expect("it is taken again");
                assert!(again.encode().is_ok_and(|again| again == sent));
            }
        }
        Kind::Work => stays!(payload, Work),
        Kind::Results => stays!(payload, Results),
        Kind::View => stays!(payload, ViewRequest),
        Kind::Samples => stays!(payload, Samples),
        Kind::BlobChunk => stays!(payload, BlobChunk),
        Kind::Unseen => stays!(payload, Unseen),
        Kind::Cells => stays!(payload, Cells),
        Kind::Rays => stays!(payload, RaysWanted),
        Kind::LiveWanted => stays!(payload, LiveWanted),
        Kind::LiveWork => stays!(payload, LiveWork),
        Kind::LiveResults => stays!(payload, LiveResults),
        Kind::LiveSamples => stays!(payload, LiveSamples),
    }
});
