//! One array for several threads to write.

use super::points::State;
use std::sync::atomic::{AtomicU8, AtomicU16};

/// The same numbers, for threads that write single ones of them.
#[allow(unsafe_code)]
pub(super) fn as_atomic(numbers: &mut [u8]) -> &[AtomicU8] {
    // SAFETY: the two types have the same size and alignment on all targets, the memory is borrowed for writing
    // as long as the result lives, and all access through it is atomic. (`AtomicU8::from_mut_slice` is not stable.)
    unsafe { &*(std::ptr::from_mut(numbers) as *const [AtomicU8]) }
}

/// The same states, for threads that each change some of them.
#[allow(unsafe_code)]
pub(super) fn states_as_atomic(states: &mut [State]) -> &[AtomicU16] {
    const _: () = assert!(align_of::<AtomicU16>() == align_of::<State>());
    // SAFETY: a state is a `u16` in memory, whose size and alignment `AtomicU16` has, as asserted; for the rest as above.
    unsafe { &*(std::ptr::from_mut(states) as *const [AtomicU16]) }
}
