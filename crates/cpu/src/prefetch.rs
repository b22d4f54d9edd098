//! Asks for memory that will be needed soon.

/// Fetches the cache line of `at`, to be written or read. Changes nothing but time.
#[inline(always)]
pub fn prefetch<T>(at: &T) {
    prefetch_at(std::slice::from_ref(at), 0);
}

/// As [`prefetch`], of the `index`-th element of a slice, or of what would be there if the slice were longer.
#[inline(always)]
#[allow(unsafe_code)]
pub fn prefetch_at<T>(slice: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: a prefetch accesses nothing, and never faults, whatever the address. Every x86-64 processor has it.
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(slice.as_ptr().wrapping_add(index).cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (slice, index);
}
