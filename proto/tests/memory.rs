//! The memory that decoders take: a few bytes that claim millions of records take none.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
};

use holo_proto::{
    ProtoError,
    bulk::{
        BlobChunk, Light, LiveResults, LiveSamples, LiveWanted, LiveWork, Results, Unseen,
        ViewRequest, ViewSamples, WorkPackets,
    },
    control::Control,
    frame::MAX_CONTROL_BYTES,
    hello::{Answer, Hello, MAGIC},
};

thread_local! {
    static NOW: Cell<usize> = const { Cell::new(0) };
    static PEAK: Cell<usize> = const { Cell::new(0) };
}

/// The system's allocator, with a count of the bytes that the thread holds.
struct Counting;

#[allow(unsafe_code)]
// SAFETY: every call goes on to the system's allocator unchanged, and the counters allocate
// nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let now = NOW.get().wrapping_add(layout.size());
        NOW.set(now);
        PEAK.set(PEAK.get().max(now));
        // SAFETY: the caller promises a valid `layout`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.set(NOW.get().wrapping_sub(layout.size()));
        // SAFETY: the caller promises that `alloc` above, and so the system, gave `pointer` with
        // this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Returns the most bytes that `act` holds at once.
fn peak(act: impl FnOnce()) -> usize {
    NOW.set(1 << 40);
    PEAK.set(1 << 40);
    act();
    PEAK.get() - (1 << 40)
}

#[test]
fn allocations_are_counted() {
    assert!((1 << 20..2 << 20).contains(&peak(|| drop(std::hint::black_box(vec![1u8; 1 << 20])))));
    assert!(
        peak(|| drop(std::hint::black_box(vec![0u8; 1 << 20]))) >= 1 << 20,
        "zeroed memory, too"
    );
}

#[test]
fn bulk_messages_that_claim_more_than_they_bring_take_no_memory() {
    let huge = [u32::MAX, 0x7fff_ffff, 1 << 28, 1 << 20];
    for count in huge {
        for at in 0..6 {
            let mut payload = vec![0; 300];
            payload[4 * at..4 * at + 4].copy_from_slice(&count.to_le_bytes());
            let taken = peak(|| {
                let _ = WorkPackets::decode(&payload);
                let _ = Results::decode(&payload);
                let _ = ViewRequest::decode(&payload);
                let _ = ViewSamples::decode(&payload);
                let _ = Unseen::decode(&payload);
                let _ = Light::decode(&payload);
                let _ = LiveWanted::decode(&payload);
                let _ = LiveWork::decode(&payload);
                let _ = LiveResults::decode(&payload);
                let _ = LiveSamples::decode(&payload);
                let _ = Hello::decode(&payload);
                let _ = Answer::decode(&payload);
            });
            assert!(taken <= 4 * payload.len(), "count {count} at {at}: {taken} bytes");
        }
    }
    let full = WorkPackets {
        packets: Vec::new(),
        viewpoints: vec![holo_section::Viewpoint { eye: [0.0; 3], radius: 1.0 }; 1 << 15],
    };
    let payload = full.encode();
    let taken = peak(|| drop(WorkPackets::decode(&payload)));
    assert!(
        (payload.len() - 8..=3 * payload.len()).contains(&taken),
        "{taken} of {}",
        payload.len()
    );
    let chunk = vec![7; 1 << 20];
    assert!(peak(|| drop(BlobChunk::decode(&chunk))) <= chunk.len());
    // Few bytes that stand for many: as many as a frame may have, and no more.
    let most = BlobChunk { offset: 0, bytes: vec![0; 16 << 20] };
    let short = most.encode_compressed();
    assert!(short.len() < 1 << 17);
    assert!(peak(|| assert_eq!(BlobChunk::decode(&short), Ok(most.clone()))) <= 33 << 20);
    for length in [(16 << 20) + 1, u32::MAX] {
        let mut longer = short.clone();
        longer[8..12].copy_from_slice(&length.to_le_bytes());
        let refused = || assert_eq!(BlobChunk::decode(&longer), Err(ProtoError::Compressed));
        assert!(peak(refused) < 1 << 10, "{length} bytes");
    }
}

#[test]
fn control_messages_take_a_few_times_the_longest_at_most() {
    // bincode takes memory for a text up to its limit, and serde for at most 1 MiB of a list.
    let most = 4 * MAX_CONTROL_BYTES as usize;
    for variant in 0..14u8 {
        for at in 4..120 {
            for claimed in
                [u64::MAX, 1 << 62, 1 << 40, 1 << 32, 1 << 24, 1 << 20, 1_000_000, 500_000]
            {
                let mut payload = vec![0; 200];
                payload[0] = variant;
                payload[at..at + 8].copy_from_slice(&claimed.to_le_bytes());
                let taken = peak(|| drop(Control::decode(&payload)));
                assert!(taken <= most, "variant {variant}, {claimed} at {at}: {taken} bytes");
            }
        }
    }
}

#[test]
fn a_hello_that_claims_a_long_name_takes_no_memory_for_it() {
    let mut hello = MAGIC.to_vec();
    hello.extend([1, 0, 1, 0, 0xff, 0xff, b'x']);
    assert_eq!(peak(|| assert!(Hello::decode(&hello).is_err())), 0);
}
