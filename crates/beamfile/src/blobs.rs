//! Named byte strings in the file, such as the packed scene.
//!
//! Invariant: a blob is listed only when all its parts are on disk, so replacing one is atomic: until the last part of
//! the new one is there, the old one is read.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use crate::batch::Body;
use crate::directory::Block;
use crate::file::{BeamFile, locked};
use crate::format::{
    BLOB_PART_BYTES, BlobPart, BlockKind, CHUNK_BYTES, MAX_BLOB_BYTES, MAX_BLOB_NAME, Table,
    push_chunk_crcs,
};
use crate::{Error, Result};

/// The blocks of one blob, in order.
#[derive(Clone, Debug, Default)]
pub(crate) struct BlobParts {
    pub total: u64,
    pub parts: Vec<Arc<Block>>,
}

#[derive(Debug)]
struct Partial {
    name: String,
    have: u64,
    blob: BlobParts,
}

#[derive(Debug, Default)]
pub(crate) struct Blobs {
    pub whole: BTreeMap<String, BlobParts>,
    partial: HashMap<u64, Partial>,
    /// Blobs of which a part is missing.
    broken: BTreeSet<String>,
}

impl Blobs {
    /// Takes the next part of a blob in file order.
    pub fn add(&mut self, part: BlobPart, block: Arc<Block>) {
        if part.offset == 0 {
            let blob = BlobParts { total: part.total, parts: Vec::new() };
            self.partial.insert(part.blob_id, Partial { name: part.name.clone(), have: 0, blob });
        }
        let bytes = u64::from(block.header.payload_bytes);
        let fits = |p: &Partial| {
            let grows = bytes > 0 || p.blob.total == 0;
            grows && p.name == part.name && p.have == part.offset && p.blob.total == part.total
        };
        let Some(mut partial) = self.partial.remove(&part.blob_id).filter(fits) else {
            self.broken.insert(part.name);
            return;
        };
        partial.blob.parts.push(block);
        partial.have += bytes;
        if partial.have == partial.blob.total {
            self.broken.remove(&partial.name);
            self.whole.insert(partial.name, partial.blob);
        } else if partial.have < partial.blob.total {
            self.partial.insert(part.blob_id, partial);
        } else {
            self.broken.insert(partial.name);
        }
    }

    /// Gives up a blob whose writing failed.
    pub fn abandon(&mut self, blob_id: u64) {
        self.partial.remove(&blob_id);
    }

    /// Names of blobs that were begun and are not whole.
    pub fn unfinished(&self) -> Vec<String> {
        let begun = self.partial.values().map(|partial| partial.name.clone());
        begun.chain(self.broken.iter().cloned()).collect::<BTreeSet<_>>().into_iter().collect()
    }
}

impl BeamFile {
    /// Stores named bytes; a blob of the same name is replaced once the new one is wholly on disk, which it is when this
    /// returns.
    ///
    /// # Errors
    /// If the name or the bytes are too long, the file is read-only, or cannot be written; the old blob is there then.
    pub fn put_blob(&self, name: &str, bytes: &[u8]) -> Result<()> {
        self.writable()?;
        if !(1..=MAX_BLOB_NAME).contains(&name.len()) {
            return Err(Error::BlobName(name.len()));
        }
        let total = bytes.len() as u64;
        if total > MAX_BLOB_BYTES {
            return Err(Error::BlobSize { name: name.into(), bytes: total });
        }
        let _one_at_a_time = locked(&self.blob_writing);
        let blob_id = self.shared.appender().sequence + 1;
        let mut offset = 0;
        loop {
            let end = bytes.len().min(offset + BLOB_PART_BYTES);
            let part = BlobPart { blob_id, total, offset: offset as u64, name: name.into() };
            if let Err(error) = self.put_blob_part(part, &bytes[offset..end]) {
                self.shared.state().blobs.abandon(blob_id);
                return Err(error);
            }
            offset = end;
            if offset == bytes.len() {
                return Ok(());
            }
        }
    }

    fn put_blob_part(&self, part: BlobPart, bytes: &[u8]) -> Result<()> {
        let mut table = Vec::new();
        part.encode(&mut table);
        push_chunk_crcs(bytes, &mut table);
        let body = Body { kind: BlockKind::Blob, entries: 1, table, payload: bytes.to_vec() };
        let written =
            self.shared.appender().write(&*self.shared.storage, self.shared.header.file_id, &body);
        let block = written.map_err(|error| self.shared.io("writing a blob", error))?;
        let block = Block { blob: Some(part.name.as_str().into()), ..block };
        self.shared.state().found(block, Table::Blob(part))
    }

    /// The bytes stored under a name, if any.
    ///
    /// # Errors
    /// If they are damaged ([`Error::BlobDamaged`]) or the disk cannot be read.
    pub fn blob(&self, name: &str) -> Result<Option<Vec<u8>>> {
        let Some(blob) = self.shared.state().blobs.whole.get(name).cloned() else {
            return Ok(None);
        };
        // The parts are in the file, so that `total` is no more than the file holds.
        let mut bytes = vec![0; blob.total as usize];
        let mut rest = bytes.as_mut_slice();
        for block in &blob.parts {
            let (begin, _) = block.chunk_range(0);
            let length = rest.len().min(block.header.payload_bytes as usize);
            let (part, others) = rest.split_at_mut(length);
            self.shared
                .storage
                .read_exact_at(part, begin)
                .map_err(|e| self.shared.io("reading a blob", e))?;
            for ((chunk, bytes), &crc) in
                (0..).zip(part.chunks(CHUNK_BYTES as usize)).zip(&*block.crcs)
            {
                if crc32fast::hash(bytes) != crc {
                    let (offset, _) = block.chunk_range(chunk);
                    return Err(Error::BlobDamaged {
                        path: self.shared.path.clone(),
                        name: name.into(),
                        offset,
                    });
                }
            }
            rest = others;
        }
        Ok(Some(bytes))
    }

    /// Names of the blobs in the file, sorted.
    pub fn blob_names(&self) -> Vec<String> {
        self.shared.state().blobs.whole.keys().cloned().collect()
    }
}
