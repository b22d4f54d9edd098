//! One array for several threads to write.

use std::sync::atomic::AtomicU8;

/// The same numbers, for threads that write single ones of them.
#[allow(unsafe_code)]
pub(super) fn as_atomic(numbers: &mut [u8]) -> &[AtomicU8] {
    // SAFETY: the two types have the same size and alignment on all targets, the memory is borrowed for writing
    // as long as the result lives, and all access through it is atomic. (`AtomicU8::from_mut_slice` is not stable.)
    unsafe { &*(std::ptr::from_mut(numbers) as *const [AtomicU8]) }
}
