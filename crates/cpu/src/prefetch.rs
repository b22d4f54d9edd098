//! Fetches memory into the processor's cache before it is needed.

/// Starts to fetch the cache line of `at`, for reading or writing. Changes only time.
#[inline(always)]
pub fn prefetch<T>(at: &T) {
    prefetch_at(std::slice::from_ref(at), 0);
}

/// Starts to fetch the cache line of element `index` of a slice. `index` may lie beyond the slice.
#[inline(always)]
#[allow(unsafe_code)]
pub fn prefetch_at<T>(slice: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: a prefetch never faults, whatever the address, and changes no memory. Every x86-64
    // processor has the instruction.
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(slice.as_ptr().wrapping_add(index).cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (slice, index);
}
