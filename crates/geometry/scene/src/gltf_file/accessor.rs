//! Numbers of a glTF file.
//!
//! Invariant: every offset, stride and count is checked. Elements outside their buffer are an
//! error, in words for people. So are more elements than [`Buffers::count`] allows.

use gltf::Accessor;
use gltf::accessor::DataType;

use super::buffers::Buffers;

/// Most elements of an accessor that has no bytes of its own, and so is all zeros.
const MAX_ZEROS: usize = 1 << 20;

/// Returns an accessor's elements as `N` floats each. Elements with more components lose the
/// others, and those with fewer are an error. Normalized integers become shares.
pub(super) fn floats<const N: usize>(
    accessor: &Accessor,
    buffers: &Buffers,
) -> Result<Vec<[f32; N]>, String> {
    let components = accessor.dimensions().multiplicity();
    if components < N {
        let index = accessor.index();
        return Err(format!("accessor {index} has {components} components, and {N} are needed"));
    }
    let normalized = accessor.normalized();
    let convert = |kind: DataType, bytes: &[u8]| -> f32 {
        let share = |value: f32, most: f32| {
            if normalized { (value / most).max(-1.0) } else { value }
        };
        match (kind, bytes) {
            (DataType::I8, &[a, ..]) => share(f32::from(a as i8), 127.0),
            (DataType::U8, &[a, ..]) => share(f32::from(a), 255.0),
            (DataType::I16, &[a, b, ..]) => share(f32::from(i16::from_le_bytes([a, b])), 32767.0),
            (DataType::U16, &[a, b, ..]) => share(f32::from(u16::from_le_bytes([a, b])), 65535.0),
            (DataType::U32, &[a, b, c, d, ..]) => u32::from_le_bytes([a, b, c, d]) as f32,
            (DataType::F32, &[a, b, c, d, ..]) => f32::from_le_bytes([a, b, c, d]),
            _ => 0.0,
        }
    };
    let kind = accessor.data_type();
    let size = kind.size();
    elements(accessor, buffers, |bytes| {
        std::array::from_fn(|k| bytes.get(k * size..).map_or(0.0, |bytes| convert(kind, bytes)))
    })
}

/// Returns an accessor's elements as unsigned integers.
pub(super) fn indices(accessor: &Accessor, buffers: &Buffers) -> Result<Vec<u32>, String> {
    let kind = accessor.data_type();
    elements(accessor, buffers, |bytes| unsigned(kind, bytes))
}

fn unsigned(kind: DataType, bytes: &[u8]) -> u32 {
    match (kind, bytes) {
        (DataType::U8, &[a, ..]) => u32::from(a),
        (DataType::U16, &[a, b, ..]) => u32::from(u16::from_le_bytes([a, b])),
        (DataType::U32, &[a, b, c, d, ..]) => u32::from_le_bytes([a, b, c, d]),
        // No vertex has this index.
        _ => u32::MAX,
    }
}

fn elements<T: Clone>(
    accessor: &Accessor,
    buffers: &Buffers,
    convert: impl Fn(&[u8]) -> T,
) -> Result<Vec<T>, String> {
    let (count, size) = (accessor.count(), accessor.size());
    let mut elements = match accessor.view() {
        Some(view) => {
            let bytes = buffers.view(&view)?;
            let stride = view.stride().unwrap_or(size).max(1);
            let found = strided(bytes, accessor.offset(), stride, size, count);
            let found = found.ok_or_else(|| {
                let (index, bytes) = (accessor.index(), bytes.len());
                let cut = if bytes < view.length() { ", which end with its buffer" } else { "" };
                format!(
                    "accessor {index} of {count} elements is longer than its {bytes} bytes{cut}"
                )
            })?;
            buffers.count(count)?;
            found.map(&convert).collect()
        }
        None if count <= MAX_ZEROS => {
            buffers.count(count)?;
            vec![convert(&vec![0; size]); count]
        }
        None => {
            return Err(format!("accessor {} has {count} elements and no bytes", accessor.index()));
        }
    };
    if let Some(sparse) = accessor.sparse() {
        let failed = || format!("the sparse values of accessor {} do not exist", accessor.index());
        let (at, values) = (sparse.indices(), sparse.values());
        let (at_view, value_view) = (at.view(), values.view());
        let kind = match at.index_type() {
            gltf::accessor::sparse::IndexType::U8 => DataType::U8,
            gltf::accessor::sparse::IndexType::U16 => DataType::U16,
            gltf::accessor::sparse::IndexType::U32 => DataType::U32,
        };
        let at_stride = at_view.stride().unwrap_or(kind.size()).max(1);
        let at_bytes = buffers.view(&at_view)?;
        let ids = strided(at_bytes, at.offset(), at_stride, kind.size(), sparse.count());
        let value_stride = value_view.stride().unwrap_or(size).max(1);
        let value_bytes = buffers.view(&value_view)?;
        let values = strided(value_bytes, values.offset(), value_stride, size, sparse.count());
        for (id, value) in ids.ok_or_else(failed)?.zip(values.ok_or_else(failed)?) {
            let element = elements.get_mut(unsigned(kind, id) as usize);
            *element.ok_or_else(failed)? = convert(value);
        }
    }
    Ok(elements)
}

/// Returns `count` elements of `size` bytes, `stride` apart; `None` if they are not all there.
fn strided(
    bytes: &[u8],
    offset: usize,
    stride: usize,
    size: usize,
    count: usize,
) -> Option<impl Iterator<Item = &[u8]>> {
    let bytes = bytes.get(offset..)?;
    let last = count.saturating_sub(1).checked_mul(stride)?.checked_add(size)?;
    let is_there = count == 0 || last <= bytes.len();
    is_there.then(|| (0..count).map(move |k| &bytes[k * stride..][..size]))
}
