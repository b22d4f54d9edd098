//! Work on the rows of a picture by all cores.
//!
//! Invariant: what is written to a row is a function of the row alone, so the number of threads
//! changes no bit.

use rayon::prelude::*;

/// Calls `work(number, rows)` for each band of `rows_per_band` rows of `width` items. The last
/// band may have fewer rows.
pub fn for_bands<T: Send>(
    items: &mut [T],
    width: usize,
    rows_per_band: usize,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    let bands = items.par_chunks_mut((width * rows_per_band).max(1)).enumerate();
    bands.for_each(|(number, band)| work(number, band));
}
