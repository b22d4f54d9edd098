//! Named byte strings in the file, such as the packed scene.
//!
//! A blob that cannot be made again is stored twice. If a chunk of one copy is damaged, it is read
//! from the other.
//!
//! Invariant: replacing a blob is atomic. Reads return the old bytes until the first copy of the
//! new ones is complete.

use crate::batch::BlockBytes;
use crate::blob_list::PartBlock;
use crate::block_table::BlockTable;
use crate::directory::DiskBlock;
use crate::file::BeamFile;
use crate::format::{
    BLOB_PART_BYTES, BlobPart, BlockKind, CHUNK_BYTES, MAX_BLOB_BYTES, MAX_BLOB_NAME,
    push_chunk_crcs,
};
use crate::{Error, Result};

impl BeamFile {
    /// Stores two copies of named bytes, in place of a blob of the same name. When this returns,
    /// both copies are on disk.
    ///
    /// Use it for bytes that cannot be made again.
    ///
    /// # Errors
    /// If the name or the bytes are too long, or the file is read-only or cannot be written. The
    /// blob then has either the old bytes or the new ones.
    pub fn put_blob(&self, name: &str, bytes: &[u8]) -> Result<()> {
        self.put_blob_once(name, bytes)?;
        self.put_blob_once(name, bytes)
    }

    /// Stores bytes like [`BeamFile::put_blob`], but in one copy. Use it for bytes that can be made
    /// again.
    ///
    /// # Errors
    /// The errors of [`BeamFile::put_blob`].
    pub fn put_blob_once(&self, name: &str, bytes: &[u8]) -> Result<()> {
        self.writable()?;
        if !(1..=MAX_BLOB_NAME).contains(&name.len()) {
            return Err(Error::BlobName(name.len()));
        }
        let total = bytes.len() as u64;
        if total > MAX_BLOB_BYTES {
            return Err(Error::BlobSize { name: name.into(), bytes: total });
        }
        let _one_at_a_time = self.blob_writing.lock();
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
        let body = BlockBytes { kind: BlockKind::Blob, entries: 1, table, payload: bytes.to_vec() };
        let block = self.shared.write_block(&body, "writing a blob")?;
        let block = DiskBlock { blob: Some(part.name.as_str().into()), ..block };
        self.shared.state().found(block, BlockTable::Blob(part))
    }

    /// Returns the bytes stored under a name, if any.
    ///
    /// If a chunk of the newest copy is damaged, it is read from another copy. The damage is then
    /// listed by [`BeamFile::damage`], and a writer stores the blob once more.
    ///
    /// # Errors
    /// [`Error::BlobDamaged`] if a chunk is damaged in every copy; [`Error::Io`] if the disk cannot
    /// be read.
    pub fn blob(&self, name: &str) -> Result<Option<Vec<u8>>> {
        let copies = self.shared.state().blobs.copies(name);
        let Some(newest) = copies.last() else { return Ok(None) };
        // All parts are in the file, so `total` is at most the file's length.
        let mut bytes = vec![0; newest.total as usize];
        let mut damaged = Vec::new();
        let mut rest = bytes.as_mut_slice();
        let mut read = Ok(());
        for (at, part) in newest.parts.iter().enumerate() {
            let length = rest.len().min(part.block.header.payload_bytes as usize);
            let (into, others) = rest.split_at_mut(length);
            rest = others;
            let copies: Vec<_> = copies.iter().rev().map(|copy| &copy.parts[at]).collect();
            read = read.and(self.read_part(name, &copies, into, &mut damaged));
        }
        if !damaged.is_empty() {
            self.shared.state().mark_bad(&damaged);
        }
        read?;
        if !damaged.is_empty() && !self.shared.read_only {
            // If the disk refuses the copy, the next writer of samples receives the error.
            let _ = self.put_blob_once(name, &bytes);
        }
        Ok(Some(bytes))
    }

    /// Reads one part of a blob, each chunk from the newest intact copy of the chunk.
    ///
    /// `copies` has the newest copy first. Adds damaged chunks to `damaged`, as (block, chunk).
    fn read_part(
        &self,
        name: &str,
        copies: &[&PartBlock],
        into: &mut [u8],
        damaged: &mut Vec<(u32, u32)>,
    ) -> Result<()> {
        let Some(newest) = copies.first() else { return Ok(()) };
        let whole = self.shared.storage.read_exact_at(into, newest.block.chunk_range(0).0).is_ok();
        (0..).zip(into.chunks_mut(CHUNK_BYTES as usize)).try_for_each(|(chunk, bytes)| {
            if whole && newest.block.matches(chunk, bytes) {
                return Ok(());
            }
            self.read_chunk(name, copies, chunk, bytes, damaged)
        })
    }

    fn read_chunk(
        &self,
        name: &str,
        copies: &[&PartBlock],
        chunk: u32,
        into: &mut [u8],
        damaged: &mut Vec<(u32, u32)>,
    ) -> Result<()> {
        let mut failed = Ok(());
        for copy in copies {
            let (offset, _) = copy.block.chunk_range(chunk);
            failed = match self.shared.storage.read_exact_at(into, offset) {
                Ok(()) if copy.block.matches(chunk, into) => return Ok(()),
                Ok(()) => Err(Error::BlobDamaged {
                    path: self.shared.path.clone(),
                    name: name.into(),
                    offset,
                }),
                Err(error) => Err(self.shared.io("reading a blob", error)),
            };
            damaged.push((copy.id, chunk));
        }
        failed
    }

    /// Returns the names of the blobs in the file, sorted.
    pub fn blob_names(&self) -> Vec<String> {
        self.shared.state().blobs.names()
    }
}
