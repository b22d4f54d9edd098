//! Creating and opening a file: header, lock, recovery.
//!
//! Invariant: only a writer cuts anything off, and only a block that was never completed.

use std::collections::hash_map::RandomState;
use std::fs::{File, OpenOptions, TryLockError};
use std::hash::{BuildHasher, Hasher};
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use crate::appender::Appender;
use crate::checksums::bad_chunks;
use crate::error::io_error;
use crate::format::{
    BlockKind, FIRST_BLOCK, FORMAT, FileHeader, HEADER_COPY_BYTES, HeaderCopy, MAX_SECTIONS,
    SAMPLE_BYTES, aligned,
};
use crate::index::Indexed;
use crate::index_range::IndexRange;
use crate::index_read;
use crate::index_write::{IndexWriter, write_pointer};
use crate::scan::{ScanEnd, ScanRange, Tail, scan};
use crate::state::FileState;
use crate::storage::Storage;
use crate::types::{Damage, DamageKind, OpenReport};
use crate::{Error, Result};

/// An opened file, before threads share it.
pub(crate) struct OpenedFile {
    pub header: FileHeader,
    pub state: FileState,
    pub appender: Appender,
    pub report: OpenReport,
    pub index: IndexWriter,
}

/// Opens the file itself and, if `lock` is set, takes the writer's lock.
pub(crate) fn file(path: &Path, options: &OpenOptions, lock: bool) -> Result<File> {
    let file = options.open(path).map_err(io_error(path, "opening"))?;
    if lock {
        file.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => Error::Locked { path: path.to_owned() },
            TryLockError::Error(source) => {
                Error::Io { path: path.to_owned(), doing: "locking", source }
            }
        })?;
    }
    Ok(file)
}

/// Writes both copies of a new file's header.
pub(crate) fn create(storage: &dyn Storage, path: &Path, layout: &[u64]) -> Result<OpenedFile> {
    if !(1..=MAX_SECTIONS).contains(&layout.len()) {
        return Err(Error::SectionCount(layout.len()));
    }
    let header = FileHeader { file_id: random_id(), layout: layout.to_vec() };
    let copies = header.encode().repeat(2);
    storage
        .write_all_at(&copies, 0)
        .and_then(|()| storage.sync_data())
        .map_err(io_error(path, "writing the header of a new holodeck"))?;
    Ok(OpenedFile {
        state: FileState::new(layout.len()),
        header,
        appender: Appender { at: FIRST_BLOCK, sequence: 0 },
        report: OpenReport::default(),
        index: IndexWriter::new(Vec::new(), 0),
    })
}

/// Returns a number that is different for every file, so that a block of another file is never
/// taken for one of this file.
fn random_id() -> u64 {
    let mut hasher = RandomState::new().build_hasher();
    hasher.write_u32(std::process::id());
    hasher.write_u128(
        SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos()),
    );
    hasher.finish()
}

/// Reads the header, the index, and the tables of blocks that the index lacks. If `writable`, it
/// repairs a damaged copy of the header and cuts off a torn tail.
pub(crate) fn open(storage: &dyn Storage, path: &Path, writable: bool) -> Result<OpenedFile> {
    let mut damage = Vec::new();
    let header = read_header(storage, path, &mut damage)?;
    if writable && !damage.is_empty() {
        let good = header.encode();
        let repair = |damage: &Damage| storage.write_all_at(&good, damage.offset);
        damage
            .iter()
            .try_for_each(repair)
            .and_then(|()| storage.sync_data())
            .map_err(io_error(path, "repairing a copy of the header"))?;
    }

    let failed = io_error(path, "reading its index");
    let pointers = index_read::pointers(storage).map_err(&failed)?;
    let mut index = index_read::read(storage, &header, &pointers).map_err(&failed)?;
    if writable
        && pointers[0] != pointers[1]
        && let Some(newest) = index_read::newest(&pointers)
    {
        write_pointer(storage, &newest)
            .map_err(io_error(path, "repairing the place of its index"))?;
    }
    damage.append(&mut index.damage);
    let mut state = FileState::new(header.layout.len());
    let indexed = index.ranges.iter().map(|(range, _)| u64::from(range.blocks)).sum();
    let rest = list_index(storage, path, &header, index.ranges, &mut state, &mut damage)?;
    let end = scan(storage, path, &header, rest, &mut damage, &mut |block, table| {
        state.found(block, table)
    })?;
    let blocks = state.directory.blocks.iter();
    let samples = blocks
        .filter(|block| block.header.kind == BlockKind::Samples)
        .map(|block| u64::from(block.header.payload_bytes / SAMPLE_BYTES))
        .sum();

    // After a power failure the file may have the length of the last block without its bytes.
    if let Some(last) = state.directory.blocks.last() {
        let id = state.directory.blocks.len() as u32 - 1;
        let bad = bad_chunks(storage, last).map_err(io_error(path, "reading the last block"))?;
        state.mark_bad(&bad.into_iter().map(|chunk| (id, chunk)).collect::<Vec<_>>());
    }
    damage.append(&mut state.damage);
    // A damaged index block may be found by its pointer and by the scan.
    damage.sort_by_key(|damage| (damage.offset, damage.bytes));
    damage.dedup();
    let appender = end_of_file(storage, path, writable, &end, &mut damage)?;
    state.damage = damage.clone();
    let report = OpenReport {
        blocks: state.directory.blocks.len() as u64,
        indexed,
        extents: state.directory.extents(),
        samples,
        damage,
        unfinished_blobs: state.blobs.unfinished(),
    };
    let index = IndexWriter::new(index.kept, state.directory.blocks.len());
    Ok(OpenedFile { header, state, appender, report, index })
}

/// Lists what the index describes, and reads the blocks between its ranges one by one. Returns the
/// rest of the file.
fn list_index(
    storage: &dyn Storage,
    path: &Path,
    header: &FileHeader,
    ranges: Vec<(IndexRange, Indexed)>,
    state: &mut FileState,
    damage: &mut Vec<Damage>,
) -> Result<ScanRange> {
    let mut all = Vec::with_capacity(ranges.len());
    let mut rest = ScanRange::WHOLE;
    for (range, indexed) in ranges {
        if range.begin > rest.from {
            let between = ScanRange { to: range.begin, ..rest };
            let mut found = Vec::new();
            let end = scan(storage, path, header, between, damage, &mut |block, table| {
                found.push((block, table));
                Ok(())
            })?;
            if let Tail::Torn(lost) | Tail::Damaged(lost) = end.tail {
                damage.push(Damage { what: DamageKind::BlockHeader, ..lost });
            }
            all.push(Indexed::of_blocks(found));
        }
        rest = ScanRange { from: range.end, sequence: range.sequence, ..rest };
        all.push(indexed);
    }
    state.list_ranges(all)?;
    Ok(rest)
}

fn end_of_file(
    storage: &dyn Storage,
    path: &Path,
    writable: bool,
    end: &ScanEnd,
    damage: &mut Vec<Damage>,
) -> Result<Appender> {
    let mut at = end.resume;
    match &end.tail {
        Tail::Clean => {}
        Tail::Torn(torn) => {
            damage.push(torn.clone());
            if writable {
                storage
                    .set_len(torn.offset)
                    .map_err(io_error(path, "cutting off an incomplete block"))?;
            }
        }
        Tail::Damaged(lost) => {
            damage.push(lost.clone());
            if writable {
                at = aligned(end.length);
            }
        }
    }
    Ok(Appender { at, sequence: end.sequence })
}

/// Returns the header from a copy that is intact. Adds damaged copies to `damage`.
pub(crate) fn read_header(
    storage: &dyn Storage,
    path: &Path,
    damage: &mut Vec<Damage>,
) -> Result<FileHeader> {
    let length = storage.length().map_err(io_error(path, "reading its length"))?;
    let mut intact = None;
    let mut other_format = None;
    for copy in 0..2u8 {
        let offset = u64::from(copy) * HEADER_COPY_BYTES as u64;
        let bytes = length.saturating_sub(offset).min(HEADER_COPY_BYTES as u64);
        let mut buffer = vec![0; bytes as usize];
        storage.read_exact_at(&mut buffer, offset).map_err(io_error(path, "reading its header"))?;
        match FileHeader::decode(&buffer) {
            HeaderCopy::Intact(header) => intact = intact.or(Some(header)),
            HeaderCopy::OtherFormat(found) => other_format = Some(found),
            HeaderCopy::Damaged => {
                damage.push(Damage {
                    offset,
                    bytes: HEADER_COPY_BYTES as u64,
                    what: DamageKind::HeaderCopy(copy),
                });
            }
        }
    }
    match (intact, other_format) {
        (Some(header), _) => Ok(header),
        (None, Some(found)) => Err(Error::Version { path: path.to_owned(), found, known: FORMAT }),
        (None, None) => Err(Error::NoHeader { path: path.to_owned(), bytes: length }),
    }
}
