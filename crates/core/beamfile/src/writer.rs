//! The writer: the thread that brings samples to the end of the file.
//!
//! Invariant: samples leave the memory only when the disk has them. After a failed write the same
//! samples are tried again.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::Result;
use crate::batch::WriteBatch;
use crate::directory::DiskBlock;
use crate::format::Entry;
use crate::index_write::{CLOSING_RANGES, IndexWriter};
use crate::shared::OpenFile;
use crate::state::FileState;
use parking_lot::MutexGuard;

/// Longest wait of samples before they are written. Even on a slow disk, the write then ends within
/// the promised second.
const WRITE_INTERVAL: Duration = Duration::from_millis(400);
const _: () = assert!(WRITE_INTERVAL.as_millis() <= 500, "samples must be on disk within a second");
/// Pause after a failed write.
const RETRY_INTERVAL: Duration = Duration::from_millis(500);

/// Extents listed under one lock, which takes well below a millisecond.
const EXTENTS_TOGETHER: usize = 1024;

/// Wakes threads that wait for the writer when it ends, even by a panic.
struct Gone<'a>(&'a OpenFile);

impl Drop for Gone<'_> {
    fn drop(&mut self) {
        self.0.state().writer_gone = true;
        self.0.progress.notify_all();
    }
}

/// Runs the writer's thread. It ends when it must stop and nothing is left to write, or when
/// writing fails for good.
pub(crate) fn run(shared: &Arc<OpenFile>, mut index: IndexWriter) {
    let _gone = Gone(shared);
    let mut failed_at: Option<Instant> = None;
    while let Some(batch) = next_batch(shared, failed_at) {
        // It does not change while samples wait.
        let (generation, keeps_order) = {
            let state = shared.state();
            (state.directory.generation, state.keeps_order)
        };
        let (entries, body) = batch.body(generation, keeps_order);
        let written = shared.write_block(&body, "writing samples");
        let result = written.and_then(|block| list(shared, block, &entries));
        let mut state = shared.state();
        match result {
            Ok(()) => {
                let done = state.batch_written();
                drop(state);
                drop(batch);
                let spare = done.and_then(Arc::into_inner).map(WriteBatch::emptied);
                state = shared.state();
                state.spare = spare;
                state.last_error = None;
                failed_at = None;
            }
            Err(error) => {
                state.last_error = Some(error.to_string());
                state.failures += 1;
                failed_at = Some(Instant::now());
                if state.stop || state.lost.is_some() {
                    return;
                }
            }
        }
        drop(state);
        shared.progress.notify_all();
        if failed_at.is_none() && index.is_due(shared) {
            // Without an index opening takes longer, and a full disk is named with the next
            // samples.
            let _ = index.write(shared);
        }
    }
    close_index(shared, &mut index);
}

/// Writes the index of a file that is closed.
fn close_index(shared: &OpenFile, index: &mut IndexWriter) {
    if shared.state().lost.is_some() || !index.is_due_at_close(shared) {
        return;
    }
    for _ in 0..CLOSING_RANGES {
        if !index.write(shared).is_ok_and(|more| more) {
            return;
        }
    }
}

/// Lists a block's extents in small groups, so that appends and reads wait only briefly.
fn list(shared: &OpenFile, block: DiskBlock, entries: &[Entry]) -> Result<()> {
    let id = shared.state().directory.add_block(Arc::new(block))?;
    let mut at = 0;
    for some in entries.chunks(EXTENTS_TOGETHER) {
        let mut state = shared.state();
        for entry in some {
            state.directory.add_extent(id, at, entry)?;
            at += entry.count;
        }
    }
    Ok(())
}

/// Waits for a batch to write; `None` when the writer must stop.
fn next_batch(shared: &OpenFile, failed_at: Option<Instant>) -> Option<Arc<WriteBatch>> {
    let mut state: MutexGuard<FileState> = shared.state();
    loop {
        if state.stop {
            state.freeze();
        }
        let now = Instant::now();
        let retry = failed_at
            .map(|at| at + RETRY_INTERVAL)
            .filter(|&at| at > now && !state.hurry && !state.stop);
        let due = state.active_since.map(|since| since + WRITE_INTERVAL);
        if due.is_some_and(|due| due <= now) && state.frozen.is_empty() {
            state.freeze();
        }
        if retry.is_none() {
            if let Some(batch) = state.frozen.front() {
                let batch = Arc::clone(batch);
                state.hurry = false;
                return Some(batch);
            }
            state.hurry = false;
        }
        if state.stop && state.frozen.is_empty() {
            return None;
        }
        let until = retry.or(due);
        match until {
            Some(at) => _ = shared.wake.wait_until(&mut state, at),
            None => shared.wake.wait(&mut state),
        }
    }
}
