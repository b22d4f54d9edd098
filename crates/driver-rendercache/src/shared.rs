//! One array for several threads to write.

use super::points::State;
use std::sync::atomic::AtomicU16;

/// The same states, for threads that each change some of them.
#[allow(unsafe_code)]
pub(super) fn states_as_atomic(states: &mut [State]) -> &[AtomicU16] {
    const _: () = assert!(align_of::<AtomicU16>() == align_of::<State>());
    // SAFETY: a state is a `u16` in memory, whose size and alignment `AtomicU16` has, as asserted, the memory is borrowed for writing
    // as long as the result lives, and all access through it is atomic.
    unsafe { &*(std::ptr::from_mut(states) as *const [AtomicU16]) }
}
