//! The index of a holodeck file: any range and any payload, in a file whose header, block and place
//! of the index are right.
#![no_main]

use std::sync::LazyLock;

use holo_beamfile::{
    BeamFile, Options,
    format::{
        BLOCK_HEADER_BYTES, BLOCK_MAGIC, CHUNK_BYTES, FIRST_BLOCK, HEADER_COPY_BYTES,
        POINTER_OFFSET,
    },
};
use holo_fuzz::Memory;
use libfuzzer_sys::fuzz_target;

/// Bytes of a range in the table of an index block.
const RANGE_BYTES: usize = 48;

/// The header of a file with two sections.
static HEADER: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let path = folder.path().join("a.holo");
    let options = Options { cache_bytes: 0, layout: vec![100, 7] };
    drop(BeamFile::create(&path, options).expect("a file can be made"));
    std::fs::read(&path).expect("a file can be read")
});

fuzz_target!(|bytes: &[u8]| {
    let Some((range, payload)) = bytes.split_first_chunk::<RANGE_BYTES>() else { return };
    // The blocks of the range, which no reader of the index looks at, end where it says.
    let end = u64::from_le_bytes([
        range[8], range[9], range[10], range[11], range[12], range[13], range[14], range[15],
    ]);
    let end = end.clamp(FIRST_BLOCK, 1 << 20).next_multiple_of(16) as usize;
    let mut file = HEADER.clone();
    file.resize(end, 1);

    let mut table = range.to_vec();
    table[24..36].fill(0);
    table.resize(RANGE_BYTES + 4 * payload.len().div_ceil(CHUNK_BYTES as usize), 0);
    let mut block = BLOCK_MAGIC.to_vec();
    block.extend_from_slice(&HEADER[16..24]);
    block.extend_from_slice(&(u64::MAX - 1).to_le_bytes());
    for word in [4, 1, table.len() as u32, 0, payload.len() as u32] {
        block.extend_from_slice(&word.to_le_bytes());
    }
    block.resize(BLOCK_HEADER_BYTES, 0);
    block.extend_from_slice(&table);
    block.resize(block.len().next_multiple_of(16), 0);
    block.extend_from_slice(payload);
    block.resize(block.len().next_multiple_of(16), 0);
    for copy in 0..2 {
        let at = copy * HEADER_COPY_BYTES + POINTER_OFFSET;
        file[at..at + 8].copy_from_slice(&(end as u64).to_le_bytes());
        file[at + 8..at + 16].copy_from_slice(&(u64::MAX - 1).to_le_bytes());
        file[at + 16..at + 20].copy_from_slice(&(block.len() as u32).to_le_bytes());
    }
    file.extend_from_slice(&block);

    let options = Options { cache_bytes: 0, layout: Vec::new() };
    let disk = Box::new(Memory(file.into()));
    let Ok(file) = BeamFile::open_on(disk, "fuzzed", options) else { return };
    let mut beams = Vec::new();
    file.for_each_beam(&mut |key, _| beams.push(key));
    for key in beams {
        let _ = file.read(key);
    }
    for name in file.blob_names() {
        let _ = file.blob(&name);
    }
    let _ = file.verify();
    let _ = file.close();
});
