//! Work on the rows of a picture by all cores.
//!
//! Invariant: what is written to a row is a function of the row alone, so the number of threads changes no bit.

use std::sync::{Mutex, PoisonError};

/// Threads at the most: a picture has not work for more.
const MAX_THREADS: usize = 32;

/// Calls `work(number, rows)` for each part of `items`, `rows_a_part` rows of `width` items (the last may have fewer).
pub(crate) fn for_parts<T: Send>(
    items: &mut [T],
    width: usize,
    rows_a_part: usize,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    let parts = Mutex::new(items.chunks_mut((width * rows_a_part).max(1)).enumerate());
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(MAX_THREADS);
    std::thread::scope(|scope| {
        let run = || {
            loop {
                let next = parts.lock().unwrap_or_else(PoisonError::into_inner).next();
                let Some((number, part)) = next else { return };
                work(number, part);
            }
        };
        (1..threads).for_each(|_| {
            scope.spawn(run);
        });
        run();
    });
}
