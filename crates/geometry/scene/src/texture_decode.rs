//! Decodes several pictures at once. A picture of 2048 × 2048 texels takes a tenth of a second or
//! more, and models have dozens.

use std::sync::Arc;
use std::thread;

use crate::texture::Texture;
use crate::texture_use::TextureUse;

/// Most pictures that are decoded at once. Each may take 1 GiB for a moment.
const MAX_AT_ONCE: usize = 8;

/// Decodes pictures on all cores. `take` receives each result with its number, in order, and ends
/// the decoding with an error. At most [`MAX_AT_ONCE`] pictures are decoded ahead.
pub(crate) fn decode_all<E>(
    pictures: &[(Arc<[u8]>, TextureUse)],
    mut take: impl FnMut(usize, Result<Texture, String>) -> Result<(), E>,
) -> Result<(), E> {
    let cores = thread::available_parallelism().map_or(1, usize::from).min(MAX_AT_ONCE);
    let decode = |(encoded, how): &(Arc<[u8]>, TextureUse)| {
        Texture::decode(encoded.clone(), how.wrap, how.is_linear, how.is_mask)
    };
    let mut first = 0;
    for batch in pictures.chunks(cores) {
        let decoded: Vec<Result<Texture, String>> = match batch {
            [one] => vec![decode(one)],
            _ => thread::scope(|scope| {
                let threads: Vec<_> =
                    batch.iter().map(|picture| scope.spawn(move || decode(picture))).collect();
                let failed = |_| Err("its decoder failed".to_owned());
                threads.into_iter().map(|thread| thread.join().unwrap_or_else(failed)).collect()
            }),
        };
        for (number, texture) in (first..).zip(decoded) {
            take(number, texture)?;
        }
        first += batch.len();
    }
    Ok(())
}
