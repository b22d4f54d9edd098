//! Compares blocks on disk with their checksums.

use std::io;

use crate::block_table::decode_table;
use crate::directory::DiskBlock;
use crate::format::{BLOCK_HEADER_BYTES, BlockHeader, CHUNK_BYTES, FileHeader};
use crate::storage::Storage;
use crate::types::{Damage, DamageKind};

/// Chunks read at a time: about one mebibyte.
const CHUNKS_TOGETHER: usize = 256;

/// Returns whether all chunks of a payload match their checksums.
pub(crate) fn chunks_match(payload: &[u8], crcs: &[u32]) -> bool {
    payload.chunks(CHUNK_BYTES as usize).map(crc32fast::hash).eq(crcs.iter().copied())
}

/// Returns the chunks of the block's payload that do not match their checksums.
pub(crate) fn bad_chunks(storage: &dyn Storage, block: &DiskBlock) -> io::Result<Vec<u32>> {
    let mut bad = Vec::new();
    let mut buffer = Vec::new();
    for (group, crcs) in block.crcs.chunks(CHUNKS_TOGETHER).enumerate() {
        let first = (group * CHUNKS_TOGETHER) as u32;
        let (begin, _) = block.chunk_range(first);
        let (_, end) = block.chunk_range(first + crcs.len() as u32 - 1);
        buffer.resize((end - begin) as usize, 0);
        storage.read_exact_at(&mut buffer, begin)?;
        let found = buffer.chunks(CHUNK_BYTES as usize).map(crc32fast::hash);
        let compared = (first..).zip(crcs.iter().zip(found));
        bad.extend(compared.filter(|(_, (want, have))| *want != have).map(|(chunk, _)| chunk));
    }
    Ok(bad)
}

/// Returns the damage to the block's header or table since they were read.
pub(crate) fn block_damage(
    storage: &dyn Storage,
    file: &FileHeader,
    block: &DiskBlock,
) -> io::Result<Option<Damage>> {
    let bytes = block.header.block_bytes();
    let mut head = [0; BLOCK_HEADER_BYTES];
    storage.read_exact_at(&mut head, block.offset)?;
    if BlockHeader::decode(&head, file.file_id) != Some(block.header) {
        return Ok(Some(Damage { offset: block.offset, bytes, what: DamageKind::BlockHeader }));
    }
    let mut table = vec![0; block.header.table_bytes as usize];
    storage.read_exact_at(&mut table, block.offset + BLOCK_HEADER_BYTES as u64)?;
    let sound = decode_table(&block.header, &table, file).is_some();
    let what = DiskBlock::table_damage(&block.header);
    Ok((!sound).then_some(Damage { offset: block.offset, bytes, what }))
}
