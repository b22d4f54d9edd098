//! Reads planned beams from the file.
//!
//! Reads are in file order, and one read takes neighbours together. Each chunk is compared with its
//! checksum before a sample of it is used.

use std::io;
use std::sync::Arc;

use bytemuck::Zeroable;
use holo_section::{NumberRun, Sample};

use crate::directory::DiskBlock;
use crate::format::{CHUNK_SAMPLES, SAMPLE_BYTES};
use crate::plan::{Location, PlannedRun, ReadPlan};
use crate::storage::Storage;
use crate::types::BeamSamples;

/// Longest gap between two pieces of one read, in bytes. Reading it costs less than another seek.
const MAX_GAP: u64 = 64 << 10;
/// Longest read of several pieces, in bytes, so that the first beams come soon.
const MAX_SPAN: u64 = 4 << 20;

/// Chunks that do not match their checksums: (block, chunk).
pub(crate) type BadChunks = Vec<(u32, u32)>;

/// Samples on disk that a plan needs.
struct LoadPiece<'a> {
    /// Index of the plan.
    plan: usize,
    /// Index in the beam's samples where they are stored.
    to: usize,
    /// The block, and its number in the directory.
    id: u32,
    block: &'a Arc<DiskBlock>,
    /// The first one's index in the block's payload, and their number.
    at: u32,
    count: u32,
    /// The bytes of the file that their chunks take: the first, and one past the last.
    begin: u64,
    end: u64,
}

/// Returns the beams in the order of the plans. If chunks that they need are damaged, returns these
/// chunks instead.
pub(crate) fn load(
    storage: &dyn Storage,
    plans: &[ReadPlan],
) -> io::Result<Result<Vec<Arc<BeamSamples>>, BadChunks>> {
    let (mut beams, pieces) = plan_pieces(plans);
    let mut bad = BadChunks::new();
    let mut buffer = Vec::new();
    let mut rest = pieces.as_slice();
    while let Some(first) = rest.first() {
        let (together, end) = read_together(rest);
        let (span, others) = rest.split_at(together);
        rest = others;
        buffer.resize((end - first.begin) as usize, 0);
        storage.read_exact_at(&mut buffer, first.begin)?;
        check(span, &buffer, first.begin, &mut bad);
        if bad.is_empty() {
            copy_samples(span, &buffer, first.begin, &mut beams);
        }
    }
    if !bad.is_empty() {
        return Ok(Err(bad));
    }
    let whole = plans
        .iter()
        .zip(beams)
        .map(|(plan, samples)| Arc::new(BeamSamples { runs: joined_runs(plan), samples }));
    Ok(Ok(whole.collect()))
}

/// Returns the beams with their samples in memory, and the pieces on disk, in the file's order.
fn plan_pieces(plans: &[ReadPlan]) -> (Vec<Vec<Sample>>, Vec<LoadPiece<'_>>) {
    let mut beams: Vec<Vec<Sample>> = Vec::with_capacity(plans.len());
    let mut pieces = Vec::new();
    for (index, plan) in plans.iter().enumerate() {
        let mut samples = vec![Sample::zeroed(); plan.samples() as usize];
        let mut to = 0;
        for PlannedRun { run, location } in &plan.runs {
            let length = run.count as usize;
            match location {
                Location::Copied(from) => samples[to..to + length].copy_from_slice(from),
                Location::Frozen { batch, at } => {
                    samples[to..to + length].copy_from_slice(batch.samples(*at, run.count));
                }
                Location::Disk { id, block, at } => {
                    let (begin, _) = block.chunk_range(at / CHUNK_SAMPLES);
                    let (_, end) = block.chunk_range((at + run.count - 1) / CHUNK_SAMPLES);
                    pieces.push(LoadPiece {
                        plan: index,
                        to,
                        id: *id,
                        block,
                        at: *at,
                        count: run.count,
                        begin,
                        end,
                    });
                }
            }
            to += length;
        }
        beams.push(samples);
    }
    pieces.sort_unstable_by_key(|piece: &LoadPiece| (piece.begin, piece.at));
    (beams, pieces)
}

/// Returns the number of first pieces to read together, and the end of the last one's chunks.
fn read_together(pieces: &[LoadPiece]) -> (usize, u64) {
    let Some(first) = pieces.first() else { return (0, 0) };
    let (mut end, mut together) = (first.end, 1);
    for piece in &pieces[1..] {
        let longer = end.max(piece.end);
        if piece.begin > end + MAX_GAP || longer - first.begin > MAX_SPAN {
            break;
        }
        end = longer;
        together += 1;
    }
    (together, end)
}

/// Copies the samples of pieces from `buffer`, which begins at offset `begin` of the file.
fn copy_samples(pieces: &[LoadPiece], buffer: &[u8], begin: u64, beams: &mut [Vec<Sample>]) {
    for piece in pieces {
        let (payload, _) = piece.block.chunk_range(0);
        let from = (payload + u64::from(piece.at) * u64::from(SAMPLE_BYTES) - begin) as usize;
        let bytes = &buffer[from..from + piece.count as usize * size_of::<Sample>()];
        let to = &mut beams[piece.plan][piece.to..piece.to + piece.count as usize];
        bytemuck::cast_slice_mut::<Sample, u8>(to).copy_from_slice(bytes);
    }
}

/// Compares every chunk of the pieces with its checksum, once. Pieces are in file order.
fn check(span: &[LoadPiece], buffer: &[u8], origin: u64, bad: &mut BadChunks) {
    let mut checked = None;
    for piece in span {
        for chunk in piece.at / CHUNK_SAMPLES..=(piece.at + piece.count - 1) / CHUNK_SAMPLES {
            if checked >= Some((piece.block.offset, chunk)) {
                continue;
            }
            checked = Some((piece.block.offset, chunk));
            let (begin, end) = piece.block.chunk_range(chunk);
            let bytes = &buffer[(begin - origin) as usize..(end - origin) as usize];
            if !piece.block.matches(chunk, bytes) {
                bad.push((piece.id, chunk));
            }
        }
    }
}

/// Returns the runs of a plan. Runs that continue each other are joined.
fn joined_runs(plan: &ReadPlan) -> Vec<NumberRun> {
    let mut runs: Vec<NumberRun> = Vec::with_capacity(plan.runs.len());
    for PlannedRun { run, .. } in &plan.runs {
        match runs.last_mut() {
            Some(last)
                if (last.kind, last.paths) == (run.kind, run.paths)
                    && last.first + last.count == run.first =>
            {
                last.count += run.count;
            }
            _ => runs.push(*run),
        }
    }
    runs
}
