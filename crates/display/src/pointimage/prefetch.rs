//! Asks for memory that will be needed soon.

/// Fetches the cache line of `at`, to be written or read. Changes nothing but time.
#[inline(always)]
#[allow(unsafe_code)]
pub(crate) fn prefetch<T>(at: &T) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: a prefetch accesses nothing, and never faults. Every x86-64 processor has it.
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(at).cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = at;
}
