//! Values of a packed scene.

use bytemuck::Pod;

/// Returns the plain-old-data value at the beginning of `bytes`, and the rest.
pub(crate) fn split<T: Pod>(bytes: &[u8]) -> Option<(T, &[u8])> {
    let (head, rest) = bytes.split_at_checked(size_of::<T>())?;
    Some((bytemuck::pod_read_unaligned(head), rest))
}
