//! Arrays in a file that is written once, with a hash of all of it.
//!
//! Numbers are in the machine's own byte order, because such a file never leaves its machine.
//!
//! ```text
//! 0         8     magic of the kind
//! 8         4     version of the kind, u32
//! 12        4     A, number of arrays of the kind, u32
//! 16        32    BLAKE3 hash of all that follows
//! 48        32    what the file belongs to, a hash
//! 80        8·A   length of each array in bytes, u64
//!                 the arrays, each from the next multiple of 64 bytes on; zeros between them
//! ```

use std::{
    fmt,
    fs::File,
    io::{self, Write},
    ops::Range,
    sync::Arc,
};

use bytemuck::{Pod, Zeroable};

use crate::{Array, FileBytes, map::FileSlice};

/// Alignment of arrays: that of a cache line, and of the largest vector register.
const ALIGNMENT: usize = 64;

/// Zeros that stand between arrays.
const ZEROS: [u8; ALIGNMENT] = [0; ALIGNMENT];

/// Most arrays of a file: a limit for the length of the table.
const MAX_ARRAYS: usize = 64;

/// A kind of sealed file.
#[derive(Clone, Copy, Debug)]
pub struct FileKind {
    /// Its first bytes.
    pub magic: [u8; 8],
    /// The version of what its arrays mean.
    pub version: u32,
    /// Number of its arrays, at most 64.
    pub arrays: usize,
}

/// The bytes before the table of lengths.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct SealedHeader {
    magic: [u8; 8],
    version: u32,
    arrays: u32,
    content: [u8; 32],
    owner: [u8; 32],
}
const _: () = assert!(size_of::<SealedHeader>() == 80);

/// Bytes that the hash of the content does not cover.
const UNHASHED: usize = 48;

/// The reason why a sealed file is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SealError {
    /// Another version of this program wrote it, or another program.
    Version,
    /// It belongs to another scene.
    Owner,
    /// Its length or its hash is wrong, its content is impossible, or it cannot be read.
    Damaged,
}

impl fmt::Display for SealError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Version => "it is of another version of this program",
            Self::Owner => "it belongs to another scene",
            Self::Damaged => "it is damaged",
        })
    }
}

impl std::error::Error for SealError {}

/// A mapped file whose bytes have their hash.
pub struct SealedFile {
    bytes: Arc<FileBytes>,
    /// The place of each array.
    places: Vec<Range<usize>>,
}

impl SealedFile {
    /// Maps a file, and compares its kind, its owner, its length and the hash of its content.
    ///
    /// # Errors
    /// The reason why it cannot be used.
    pub fn open(file: &File, kind: FileKind, owner: &[u8; 32]) -> Result<SealedFile, SealError> {
        // Nothing can be mapped of an empty file.
        if file.metadata().map_or(0, |about| about.len()) < size_of::<SealedHeader>() as u64 {
            return Err(SealError::Damaged);
        }
        let bytes = FileBytes::map(file).map_err(|_| SealError::Damaged)?;
        let header = bytes.get(..size_of::<SealedHeader>()).ok_or(SealError::Damaged)?;
        let header: SealedHeader = bytemuck::pod_read_unaligned(header);
        let is_kind = header.magic == kind.magic && header.version == kind.version;
        if !is_kind || header.arrays as usize != kind.arrays || kind.arrays > MAX_ARRAYS {
            return Err(SealError::Version);
        }
        if header.owner != *owner {
            return Err(SealError::Owner);
        }
        let places = places(&bytes, kind.arrays).ok_or(SealError::Damaged)?;
        let mut hasher = blake3::Hasher::new();
        hasher.update_rayon(&bytes[UNHASHED..]);
        if *hasher.finalize().as_bytes() != header.content {
            return Err(SealError::Damaged);
        }
        Ok(SealedFile { bytes: Arc::new(bytes), places })
    }

    /// Returns an array of the file.
    ///
    /// # Errors
    /// [`SealError::Damaged`] if there is no such array, or if it ends within a value.
    pub fn array<T: Pod>(&self, index: usize) -> Result<Array<T>, SealError> {
        let place = self.places.get(index).ok_or(SealError::Damaged)?.clone();
        FileSlice::new(&self.bytes, place).map(Array::mapped).ok_or(SealError::Damaged)
    }
}

/// Reads the table of lengths. `None` if the arrays do not end where the file does.
fn places(bytes: &[u8], arrays: usize) -> Option<Vec<Range<usize>>> {
    let mut end = size_of::<SealedHeader>().checked_add(8 * arrays)?;
    let table = bytes.get(size_of::<SealedHeader>()..end)?;
    let mut places = Vec::with_capacity(arrays);
    for length in table.chunks_exact(8) {
        let length = usize::try_from(bytemuck::pod_read_unaligned::<u64>(length)).ok()?;
        let start = end.checked_next_multiple_of(ALIGNMENT)?;
        end = start.checked_add(length)?;
        places.push(start..end);
    }
    (end == bytes.len()).then_some(places)
}

/// Writes a file that belongs to `owner`. There are as many arrays as the kind has.
///
/// # Errors
/// If `out` cannot be written to.
pub fn write_sealed(
    kind: FileKind,
    owner: [u8; 32],
    arrays: &[&[u8]],
    out: &mut dyn Write,
) -> io::Result<()> {
    let lengths: Vec<u64> = arrays.iter().map(|array| array.len() as u64).collect();
    let lengths: &[u8] = bytemuck::cast_slice(&lengths);
    let mut parts: Vec<&[u8]> = vec![&owner, lengths];
    let mut end = size_of::<SealedHeader>() + lengths.len();
    for array in arrays {
        let start = end.next_multiple_of(ALIGNMENT);
        parts.extend([&ZEROS[..start - end], *array]);
        end = start + array.len();
    }
    let mut hasher = blake3::Hasher::new();
    for part in &parts {
        hasher.update_rayon(part);
    }
    let header = SealedHeader {
        magic: kind.magic,
        version: kind.version,
        arrays: arrays.len() as u32,
        content: *hasher.finalize().as_bytes(),
        owner,
    };
    out.write_all(&bytemuck::bytes_of(&header)[..UNHASHED])?;
    parts.iter().try_for_each(|part| out.write_all(part))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use proptest::prelude::*;

    use super::*;

    const KIND: FileKind = FileKind { magic: *b"atestof\n", version: 3, arrays: 3 };
    const OWNER: [u8; 32] = [9; 32];

    fn written() -> Vec<u8> {
        let numbers: Vec<u32> = (0..50).collect();
        let mut bytes = Vec::new();
        let arrays = [bytemuck::cast_slice(&numbers), &[], b"text"];
        write_sealed(KIND, OWNER, &arrays, &mut bytes).unwrap();
        bytes
    }

    fn open(bytes: &[u8], kind: FileKind, owner: [u8; 32]) -> Result<SealedFile, SealError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sealed");
        fs::write(&path, bytes).unwrap();
        SealedFile::open(&File::open(path).unwrap(), kind, &owner)
    }

    #[test]
    fn what_is_written_is_read_without_a_copy() {
        let file = open(&written(), KIND, OWNER).unwrap();
        let numbers = file.array::<u32>(0).unwrap();
        assert!(numbers.is_mapped() && numbers[..] == (0..50).collect::<Vec<u32>>());
        assert!(file.array::<[f32; 3]>(1).unwrap().is_empty());
        assert_eq!(file.array::<u8>(2).unwrap()[..], *b"text");
        assert!(file.array::<u8>(3).is_err() && file.array::<[u8; 3]>(2).is_err());
    }

    #[test]
    fn other_kinds_other_owners_and_other_lengths_are_named() {
        let bytes = written();
        let refused = |bytes: &[u8]| open(bytes, KIND, OWNER).err();
        let other = |kind| open(&bytes, kind, OWNER).err();
        assert_eq!(other(FileKind { version: 4, ..KIND }), Some(SealError::Version));
        assert_eq!(other(FileKind { arrays: 2, ..KIND }), Some(SealError::Version));
        assert_eq!(other(FileKind { magic: *b"another\n", ..KIND }), Some(SealError::Version));
        assert_eq!(open(&bytes, KIND, [8; 32]).err(), Some(SealError::Owner));
        for end in [0, 5, 79, 80, 100, bytes.len() - 1] {
            assert_eq!(refused(&bytes[..end]), Some(SealError::Damaged), "{end}");
        }
        assert_eq!(refused(&[&bytes[..], &[0]].concat()), Some(SealError::Damaged));
        // A length that would overflow.
        let mut long = bytes.clone();
        long[80..88].fill(255);
        assert_eq!(refused(&long), Some(SealError::Damaged));
    }

    proptest! {
        #[test]
        fn any_changed_byte_is_recognised(at: proptest::sample::Index, change in 1..=u8::MAX) {
            let mut bytes = written();
            let at = at.index(bytes.len());
            bytes[at] ^= change;
            prop_assert!(open(&bytes, KIND, OWNER).is_err());
        }
    }
}
