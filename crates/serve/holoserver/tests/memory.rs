//! The server's memory while many displays want more beams than fit. It is alone in its process,
//! because it counts all allocations.
#![allow(clippy::unwrap_used, clippy::panic)]

#[path = "it/common/mod.rs"]
mod common;

use common::{Peer, Place, run, view};
use holo_net::Message;
use holo_proto::{control::Control, frame::FrameKind, hello::Role};
use peak_alloc::PeakAlloc;

/// Beams of a view: about as many as a message holds.
const BEAMS: u64 = 1_000_000;

/// Displays: with all beams of each, the server would hold three times its limit.
const DISPLAYS: u32 = 12;

/// Memory that the server may use for all views: 2²² beams of 32 bytes.
const VIEWS: usize = (1 << 22) * 32;

/// Other growth that is allowed: buffers of connections on both sides, and memory that the
/// allocator keeps for later.
const OTHERS: usize = 48 << 20;

/// Counts the bytes that are allocated.
#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

#[test]
fn all_beam_views_of_many_displays_take_no_more_memory_than_a_few() {
    run(async {
        let place = Place::of(b"a scene", [16; 3]);
        let server = place.serve(|_| {}).await;
        let before = ALLOCATED.current_usage();
        let mut displays = Vec::new();
        // One after the other: the first views are taken whole.
        for _ in 0..DISPLAYS {
            let mut display = Peer::join(server.address, Role::Display).await;
            display.send(FrameKind::View, &view(1, BEAMS));
            let is_sent =
                |message: &Message| *message == Message::Control(Control::StoredSent { view: 1 });
            display.wait_for(is_sent).await;
            displays.push(display);
        }
        let held = ALLOCATED.current_usage().saturating_sub(before);
        assert!(held <= VIEWS + OTHERS, "{} MiB", held >> 20);
        // The limit is used, so the test measures what it says.
        assert!(held >= VIEWS / 2, "{} MiB", held >> 20);
        drop(displays);
        server.end().await;
    });
}
