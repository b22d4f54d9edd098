//! What happens when the system gives no more memory: a sentence, and the end of the process.
//!
//! Without this, the standard library aborts with a number of bytes alone. If a panic is being
//! printed at that moment, the process hangs instead, because both hold one lock.
#![allow(unsafe_code)]

use std::{
    alloc::{GlobalAlloc, Layout, System},
    io::Write,
};

use rustix::process::{Resource, getrlimit};

/// Longest sentence, bytes.
const MAX_SENTENCE: usize = 256;

/// The system's allocator. If there is no memory, the process says so and aborts.
///
/// What was stored is safe, because a file survives the end of its process at any time.
pub struct AbortingAllocator;

// SAFETY: Every method passes its arguments on to `System` and returns what that returned, except
// that it does not return null.
unsafe impl GlobalAlloc for AbortingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: The caller upholds the contract of `alloc`.
        checked(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: The caller upholds the contract of `alloc_zeroed`.
        checked(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: The caller upholds the contract of `realloc`.
        checked(unsafe { System.realloc(memory, layout, size) }, size)
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: The caller upholds the contract of `dealloc`.
        unsafe { System.dealloc(memory, layout) }
    }
}

/// Returns the memory, which was to have `size` bytes, unless it is null.
#[inline]
fn checked(memory: *mut u8, size: usize) -> *mut u8 {
    if memory.is_null() {
        end(size);
    }
    memory
}

/// Writes that `size` bytes were not available, and ends the process. Allocates nothing.
#[cold]
fn end(size: usize) -> ! {
    let mut sentence = [0; MAX_SENTENCE];
    let mut rest = &mut sentence[..];
    let limit = getrlimit(Resource::As).current;
    let _ = match limit {
        Some(bytes) => writeln!(
            rest,
            "holodeck: no more memory: the limit of {} MiB is reached, and {} KiB more are needed; \
             raise it (ulimit -v) or free memory",
            bytes >> 20,
            size.div_ceil(1024)
        ),
        None => writeln!(
            rest,
            "holodeck: no more memory: {} KiB more are needed; end other programs, or use a smaller \
             picture or cache",
            size.div_ceil(1024)
        ),
    };
    let length = MAX_SENTENCE - rest.len();
    let _ = rustix::io::write(rustix::stdio::stderr(), &sentence[..length]);
    std::process::abort()
}
