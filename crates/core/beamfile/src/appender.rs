//! The end of the file, and how a block is written there.
//!
//! Invariants: a block's header is written after its body. After a failed write the file is cut off
//! where the block began.

use crate::batch::BlockBytes;
use crate::directory::DiskBlock;
use crate::format::{BLOCK_HEADER_BYTES, BlockHeader, CHUNK_BYTES, aligned};
use crate::storage::Storage;

/// The end of the file.
pub(crate) struct Appender {
    /// Where the next block begins.
    pub at: u64,
    /// Sequence number of the last block.
    pub sequence: u64,
}

impl Appender {
    /// Appends one block. It is on the disk itself when this returns.
    pub fn write(
        &mut self,
        storage: &dyn Storage,
        file_id: u64,
        body: &BlockBytes,
    ) -> std::io::Result<DiskBlock> {
        let header = BlockHeader {
            file_id,
            sequence: self.sequence + 1,
            kind: body.kind,
            entries: body.entries,
            table_bytes: body.table.len() as u32,
            table_crc: crc32fast::hash(&body.table),
            payload_bytes: body.payload.len() as u32,
        };
        let mut rest = Vec::with_capacity(header.block_bytes() as usize - BLOCK_HEADER_BYTES);
        rest.extend_from_slice(&body.table);
        rest.resize(header.payload_offset() as usize - BLOCK_HEADER_BYTES, 0);
        let crcs_at = body.table.len() - 4 * body.payload.len().div_ceil(CHUNK_BYTES as usize);
        let crcs = body.table[crcs_at..]
            .chunks_exact(4)
            .map(|crc| u32::from_le_bytes([crc[0], crc[1], crc[2], crc[3]]));
        let block = DiskBlock { header, offset: self.at, crcs: crcs.collect(), blob: None };
        rest.extend_from_slice(&body.payload);
        rest.resize(header.block_bytes() as usize - BLOCK_HEADER_BYTES, 0);

        let written = storage
            .write_all_at(&rest, self.at + BLOCK_HEADER_BYTES as u64)
            .and_then(|()| storage.write_all_at(&header.encode(), self.at))
            .and_then(|()| storage.sync_data());
        if let Err(error) = written {
            // If this fails, too, the next attempt overwrites the bytes, or opening finds them
            // incomplete.
            let _ = storage.set_len(self.at);
            return Err(error);
        }
        debug_assert_eq!(self.at, aligned(self.at));
        self.at += header.block_bytes();
        self.sequence += 1;
        Ok(block)
    }
}
