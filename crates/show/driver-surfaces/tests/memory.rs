//! Tests that the light on surfaces takes the memory that it was given, also while it is gathered.
//! It is alone in its process, because it counts all memory.

// Clippy allows these only inside test functions, but helpers need them too.
#![allow(clippy::unwrap_used)]

#[path = "it/common/mod.rs"]
mod common;

use common::{eye, rays, room};
use holo_driver_surfaces::{Gathered, LightStore, Materials, Placer, SurfaceView};
use std::sync::Arc;
use std::sync::atomic::Ordering;

#[allow(unsafe_code)]
mod counting {
    use std::alloc::{GlobalAlloc, Layout, System};
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Bytes that are allocated.
    pub static PRESENT: AtomicUsize = AtomicUsize::new(0);

    /// Most bytes that were allocated at once.
    pub static PEAK: AtomicUsize = AtomicUsize::new(0);

    struct Counting;

    // SAFETY: every call goes to the system's allocator unchanged. `realloc` and `alloc_zeroed` are
    // those of the trait, which call `alloc`.
    unsafe impl GlobalAlloc for Counting {
        unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
            let present = PRESENT.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
            PEAK.fetch_max(present, Ordering::Relaxed);
            // SAFETY: the caller keeps the contract of `alloc`, which is the same here.
            unsafe { System.alloc(layout) }
        }

        unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
            PRESENT.fetch_sub(layout.size(), Ordering::Relaxed);
            // SAFETY: `pointer` came from `System.alloc` with this layout.
            unsafe { System.dealloc(pointer, layout) }
        }
    }

    #[global_allocator]
    static ALLOCATOR: Counting = Counting;
}

/// Returns what `made` made, and the most bytes that this took at once beyond those before.
fn peak<T>(made: impl FnOnce() -> T) -> (T, usize) {
    let before = counting::PRESENT.load(Ordering::Relaxed);
    counting::PEAK.store(before, Ordering::Relaxed);
    let made = made();
    (made, counting::PEAK.load(Ordering::Relaxed) - before)
}

#[test]
fn light_takes_its_share_of_memory_while_it_is_stored_and_gathered() {
    const SHARE: usize = 32 << 20;
    let raycaster = room();
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let placer = Placer::new(&raycaster, &materials);
    let mut store = LightStore::new(0.0004, SHARE);
    // 2.7 million samples, of which 1.6 million fit.
    let (_, stored) = peak(|| {
        for round in 0..15_u16 {
            let mut placed = Vec::new();
            let light = |x: f64, y: f64| (x * y + f64::from(round)).abs() as f32;
            placer.place_rays(&rays(425, light), &mut placed);
            store.add(&placed);
        }
    });
    assert!(store.kept() > 1_000_000, "{} samples", store.kept());
    // The samples of a round, and their places, are not part of the store.
    let round = 425 * 425 * 160;
    assert!(stored < SHARE * 11 / 10 + round, "{stored} bytes for the store");

    let (size, pixels) = ((256, 256), 256 * 256);
    let view = SurfaceView::new(Arc::clone(&raycaster), Arc::clone(&materials), &eye(), size);
    let (gathered, bytes) = peak(|| Gathered::new(&view, &store));
    assert!(gathered.samples() > 900_000, "{} samples", gathered.samples());
    assert!(bytes < 12 << 20, "{bytes} bytes to gather {pixels} pixels");
}
