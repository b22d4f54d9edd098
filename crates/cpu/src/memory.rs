//! Memory in large pages, where the system has them.
//!
//! A frame goes through all of its memory, a good part of it in no order: with pages of 4 kB the processor's list of pages is too short
//! for pictures from about 512×512 on. With pages of 2 MB a frame of 2048×2048 took 17 % less.
//!
//! Always true: nothing but time depends on whether the system gives them.

use bytemuck::Zeroable;

/// `count` times `value`.
pub fn filled<T: Clone>(value: T, count: usize) -> Vec<T> {
    let mut memory = reserved(count);
    memory.resize(count, value);
    memory
}

/// `count` zeros: what is never touched takes no time, if the alignment is no larger than the allocator's.
pub fn zeroed<T: Zeroable>(count: usize) -> Vec<T> {
    /// Beyond, the standard library writes the zeros itself: that must not be before large pages are asked for.
    const ALIGNMENT: usize = 16;
    if align_of::<T>() > ALIGNMENT {
        let mut memory = reserved(count);
        memory.resize_with(count, T::zeroed);
        return memory;
    }
    let mut memory = bytemuck::zeroed_vec(count);
    advise(&mut memory);
    memory
}

/// A copy of these.
pub fn copied<T: Copy>(values: &[T]) -> Vec<T> {
    let mut memory = reserved(values.len());
    memory.extend_from_slice(values);
    memory
}

/// Empty, with room for `count`.
pub fn reserved<T>(count: usize) -> Vec<T> {
    let mut memory = Vec::with_capacity(count);
    // Before it is written: pages are given when they are first touched.
    advise(memory.spare_capacity_mut());
    memory
}

/// Asks for large pages for memory that is about to be used.
#[allow(unsafe_code)]
fn advise<T>(memory: &mut [T]) {
    #[cfg(target_os = "linux")]
    {
        use rustix::mm::{Advice, madvise};
        /// Bytes from which it is worth asking: below, the memory is not the system's to give page by page.
        const LEAST: usize = 1 << 18;
        /// Smallest page of any processor that Linux runs on here.
        const PAGE: usize = 4096;
        let bytes = size_of_val(memory);
        if bytes >= LEAST {
            let start = memory.as_mut_ptr().addr() / PAGE * PAGE;
            let before = memory.as_mut_ptr().addr() - start;
            let first = memory.as_mut_ptr().cast::<u8>().wrapping_sub(before);
            // SAFETY: this advice changes no content and no permission of any memory, whosever it is: the page at either end may
            // also hold something else. An address that the system does not accept is an error, which does no harm.
            let _ = unsafe { madvise(first.cast(), before + bytes, Advice::LinuxHugepage) };
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = memory;
}

#[cfg(test)]
mod tests {
    use super::{filled, zeroed};

    #[test]
    fn memory_is_filled_whatever_its_size() {
        for count in [0, 1, 1 << 17, (1 << 20) + 3] {
            let memory = filled(0x1234_5678_u32, count);
            assert_eq!(memory.len(), count);
            assert!(memory.iter().all(|&number| number == 0x1234_5678));
            let memory: Vec<u32> = zeroed(count);
            assert!(memory.len() == count && memory.iter().all(|&number| number == 0));
        }
    }
}
