//! Splits the rows of a picture among all cores.
//!
//! Invariant: the number of bands does not depend on the number of threads. If `work` is a
//! function of the band alone, the number of threads changes no bit.

use rayon::prelude::*;

/// Calls `work(number, items)` once for each band, on several threads. `number` counts bands from
/// the first one. A band is `rows_per_band` rows of `width` items; the last one may have fewer
/// rows.
pub fn for_bands<T: Send>(
    items: &mut [T],
    width: usize,
    rows_per_band: usize,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    let bands = items.par_chunks_mut((width * rows_per_band).max(1)).enumerate();
    bands.for_each(|(number, band)| work(number, band));
}
