//! Copies the shares of layers to another file.
//!
//! Invariant: the shares of a sample are copied together or not at all. A share that is missing
//! would be taken for black.

use std::collections::HashSet;
use std::io;
use std::sync::Arc;

use crate::Result;
use crate::batch::BlockBytes;
use crate::block_table::{BlockTable, decode_table};
use crate::directory::DiskBlock;
use crate::file::BeamFile;
use crate::format::{BLOCK_HEADER_BYTES, BlockKind, CHUNK_BYTES, Class, Entry, push_chunk_crcs};
use crate::shared::OpenFile;
use crate::shares::ShareRun;
use crate::types::Maker;

impl BeamFile {
    /// Appends the shares of layers on this file's disk to another file. When this returns, they
    /// are on its disk.
    ///
    /// `rename` gives the maker and the generation that samples of a maker and a generation have in
    /// the other file; `None` leaves their shares out. So are shares in damaged chunks, and those
    /// of samples whose shares the other file has. Returns the number of copied shares.
    ///
    /// # Errors
    /// If this file cannot be read, or the other one cannot be written.
    pub fn copy_shares(
        &self,
        to: &BeamFile,
        rename: &dyn Fn(Maker, u32) -> Option<(Maker, u32)>,
    ) -> Result<u64> {
        to.writable()?;
        let failed = |error| self.shared.io("reading shares of layers", error);
        let blocks = share_blocks(&self.shared);
        if blocks.is_empty() {
            return Ok(0);
        }
        let mut known = HashSet::new();
        for block in share_blocks(&to.shared) {
            let runs = runs(&to.shared, &block);
            let runs = runs.map_err(|error| to.shared.io("reading shares of layers", error))?;
            known.extend(runs.iter().filter(|run| run.layer == 0).map(|run| run.entry));
        }
        let mut copied = 0;
        for block in blocks {
            let runs = runs(&self.shared, &block).map_err(failed)?;
            let mut payload = vec![0; block.header.payload_bytes as usize];
            let read = self.shared.storage.read_exact_at(&mut payload, block.chunk_range(0).0);
            read.map_err(failed)?;
            let chunks = (0..).zip(payload.chunks(CHUNK_BYTES as usize));
            let intact: Vec<bool> = chunks.map(|(at, bytes)| block.matches(at, bytes)).collect();
            let mut kept = Kept::default();
            let mut rest = payload.as_slice();
            for group in runs.chunk_by(|_, next| next.layer > 0) {
                let bytes: usize = group.iter().map(ShareRun::payload_bytes).sum();
                let from = payload.len() - rest.len();
                let (shares, others) = rest.split_at(bytes.min(rest.len()));
                rest = others;
                let its_chunks =
                    from / CHUNK_BYTES as usize..(from + bytes).div_ceil(CHUNK_BYTES as usize);
                let is_intact = intact.get(its_chunks).is_some_and(|all| all.iter().all(|ok| *ok));
                if is_intact {
                    copied += kept.add(group, shares, to, rename, &mut known);
                }
            }
            kept.write(to)?;
        }
        Ok(copied)
    }
}

/// A block of shares that is being put together.
#[derive(Default)]
struct Kept {
    runs: Vec<ShareRun>,
    payload: Vec<u8>,
}

impl Kept {
    /// Adds the shares of one run of samples, if they belong into the other file and are not yet
    /// there. Returns their number.
    fn add(
        &mut self,
        group: &[ShareRun],
        shares: &[u8],
        to: &BeamFile,
        rename: &dyn Fn(Maker, u32) -> Option<(Maker, u32)>,
        known: &mut HashSet<Entry>,
    ) -> u64 {
        let Some(samples) = group.first().map(|run| run.entry) else { return 0 };
        let Some((maker, generation)) = rename(samples.class.maker, samples.generation) else {
            return 0;
        };
        let renamed =
            |entry: Entry| Entry { class: Class { maker, ..entry.class }, generation, ..entry };
        if !to.shared.header.has(samples.key) || !known.insert(renamed(samples)) {
            return 0;
        }
        let run = |run: &ShareRun| ShareRun { entry: renamed(run.entry), ..*run };
        self.runs.extend(group.iter().map(run));
        self.payload.extend_from_slice(shares);
        group.iter().skip(1).map(|run| u64::from(run.entry.count)).sum()
    }

    fn write(self, to: &BeamFile) -> Result<()> {
        if self.runs.is_empty() {
            return Ok(());
        }
        let mut table = Vec::new();
        self.runs.iter().for_each(|run| run.entry.encode(run.layer, &mut table));
        push_chunk_crcs(&self.payload, &mut table);
        let entries = self.runs.len() as u32;
        let body = BlockBytes { kind: BlockKind::Shares, entries, table, payload: self.payload };
        let block = to.shared.write_block(&body, "writing shares of layers")?;
        to.shared.state().found(block, BlockTable::Shares(self.runs))
    }
}

/// Returns the listed blocks of shares.
fn share_blocks(shared: &OpenFile) -> Vec<Arc<DiskBlock>> {
    let state = shared.state();
    let blocks = state.directory.blocks.iter();
    blocks.filter(|block| block.header.kind == BlockKind::Shares).cloned().collect()
}

/// Returns the runs of a block of shares; none if its table was damaged since it was listed.
fn runs(shared: &OpenFile, block: &DiskBlock) -> io::Result<Vec<ShareRun>> {
    let mut table = vec![0; block.header.table_bytes as usize];
    shared.storage.read_exact_at(&mut table, block.offset + BLOCK_HEADER_BYTES as u64)?;
    Ok(match decode_table(&block.header, &table, &shared.header) {
        Some((BlockTable::Shares(runs), _)) => runs,
        _ => Vec::new(),
    })
}
