//! Tests that a header's sizes allocate no memory; only existing pixels do. It is alone in its
//! process, because it counts all allocations.

// Clippy allows these only inside test functions, but helpers need them too.
#![allow(clippy::unwrap_used, clippy::panic)]

use holo_picture::{Format, Picture, PictureError};
use std::sync::atomic::{AtomicUsize, Ordering};

#[allow(unsafe_code)]
mod counting {
    use std::alloc::{GlobalAlloc, Layout, System};
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// The largest single allocation so far.
    pub static LARGEST: AtomicUsize = AtomicUsize::new(0);

    struct Counting;

    // SAFETY: every call goes to the system's allocator unchanged. `realloc` and `alloc_zeroed` are
    // those of the trait, which call `alloc`.
    unsafe impl GlobalAlloc for Counting {
        unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
            LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
            // SAFETY: the caller keeps the contract of `alloc`, which is the same here.
            unsafe { System.alloc(layout) }
        }

        unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
            // SAFETY: `pointer` came from `System.alloc` with this layout.
            unsafe { System.dealloc(pointer, layout) }
        }
    }

    #[global_allocator]
    static ALLOCATOR: Counting = Counting;
}

fn largest_allocation(
    decode: impl FnOnce() -> Result<Picture, PictureError>,
) -> (usize, PictureError) {
    let largest: &AtomicUsize = &counting::LARGEST;
    largest.store(0, Ordering::Relaxed);
    let error = decode().unwrap_err();
    (largest.load(Ordering::Relaxed), error)
}

#[test]
fn sizes_in_a_header_allocate_no_memory() {
    // Within the limits, 8192×8192 would be 805 MB; one row of the widest .hdr is 65535 pixels.
    let mut exr = Picture::new(64, 64).encode(Format::Exr).unwrap();
    let name = b"dataWindow\0box2i\0";
    let at = exr.windows(name.len()).position(|bytes| bytes == name).unwrap() + name.len() + 4;
    for corner in [8, 12] {
        exr[at + corner..at + corner + 4].copy_from_slice(&8191i32.to_le_bytes());
    }
    let claims: [(&str, Format, Vec<u8>); 4] = [
        ("hdr", Format::Hdr, b"#?RADIANCE\n\n-Y 8192 +X 8192\n\x02\x02\x20\x00".to_vec()),
        ("wide hdr", Format::Hdr, b"#?RADIANCE\n\n-Y 1000 +X 65535\n\x80\x80\x80\x80".to_vec()),
        ("pfm", Format::Pfm, b"PF\n8192 8192\n-1.0\nabcd".to_vec()),
        ("exr", Format::Exr, exr),
    ];
    for (name, format, bytes) in claims {
        let (largest, error) = largest_allocation(|| Picture::decode(&bytes, format));
        assert!(
            largest < 1 << 20,
            "{name}: {largest} bytes for a file of {}: {error}",
            bytes.len()
        );
    }
    // The counter works: it notices a picture of this size.
    let pixels = Picture::new(512, 512).encode(Format::Pfm).unwrap();
    let (largest, _) = largest_allocation(|| {
        Picture::decode(&pixels, Format::Pfm)?;
        Err(PictureError::UnknownFormat)
    });
    assert!(largest >= 512 * 512 * 12);
}
