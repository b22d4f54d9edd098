//! What callers give to a [`crate::BeamFile`] and get from it.

use std::fmt;

use holo_section::{Run, Sample};

use crate::format::SAMPLE_BYTES;

/// The next free sample number of each kind in one beam: the highest number stored, plus one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// For [`holo_section::SampleKind::Uniform`].
    pub uniform: u32,
    /// For [`holo_section::SampleKind::ViewpointLimited`].
    pub limited: u32,
    /// For [`holo_section::SampleKind::SingleRay`].
    pub single: u32,
}

/// How to open or create a file.
#[derive(Clone, Debug)]
pub struct Options {
    /// Memory for beams that were read, in bytes; 0 keeps none.
    pub cache_bytes: u64,
    /// Number of beams in each section. Written by `create`; `open` compares it with the file unless it is empty.
    pub layout: Vec<u64>,
}

/// All samples of one beam, in the order (kind, sample number), each number once.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BeamSamples {
    /// The runs that `samples` consists of, in order; their counts add up to its length.
    pub runs: Vec<Run>,
    /// The samples of all runs, one run after the other.
    pub samples: Vec<Sample>,
}

impl BeamSamples {
    /// Each run with its samples.
    pub fn iter(&self) -> impl Iterator<Item = (&Run, &[Sample])> {
        let mut rest = self.samples.as_slice();
        self.runs.iter().map(move |run| {
            let (samples, after) = rest.split_at((run.count as usize).min(rest.len()));
            rest = after;
            (run, samples)
        })
    }
}

/// A part of the file that cannot be used and was left out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// First byte of it in the file.
    pub offset: u64,
    /// Length in bytes.
    pub bytes: u64,
    /// What is there, or should be.
    pub what: DamageKind,
}

/// What a damaged part of the file is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DamageKind {
    /// One copy of the file's header; the other one is used.
    HeaderCopy(u8),
    /// The header of a block, hence the whole block (or several).
    BlockHeader,
    /// The extent table of the block with this sequence number, hence the whole block.
    BlockTable(u64),
    /// Samples of extents.
    Samples,
    /// A part of a blob.
    Blob(String),
    /// A block at the end of the file that was never completed (or, beside a writer, not yet).
    TornTail,
}

impl Damage {
    /// Returns how many samples are left out because of it, at most.
    ///
    /// Exact for [`DamageKind::Samples`]. Of a whole block it is what would fit into its bytes.
    pub fn samples(&self) -> u64 {
        match self.what {
            DamageKind::Samples | DamageKind::BlockHeader | DamageKind::BlockTable(_) => {
                self.bytes / u64::from(SAMPLE_BYTES)
            }
            DamageKind::HeaderCopy(_) | DamageKind::Blob(_) | DamageKind::TornTail => 0,
        }
    }
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Damage { offset, bytes, what } = self;
        match what {
            DamageKind::HeaderCopy(copy) => {
                write!(f, "offset {offset}: copy {copy} of the file header is damaged")
            }
            DamageKind::BlockHeader => {
                write!(f, "offset {offset}: damaged block header, {bytes} bytes left out")
            }
            DamageKind::BlockTable(sequence) => {
                write!(
                    f,
                    "offset {offset}: damaged table of block {sequence}, {bytes} bytes left out"
                )
            }
            DamageKind::Samples => {
                write!(f, "offset {offset}: {} damaged samples are left out", self.samples())
            }
            DamageKind::Blob(name) => {
                write!(f, "offset {offset}: {bytes} damaged bytes of a copy of blob {name}")
            }
            DamageKind::TornTail => {
                write!(
                    f,
                    "offset {offset}: {bytes} bytes of a block that is not complete, left out"
                )
            }
        }
    }
}

/// What opening a file found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OpenReport {
    /// Whole blocks.
    pub blocks: u64,
    /// Extents in them.
    pub extents: u64,
    /// Samples in them, superseded ones included.
    pub samples: u64,
    /// What was damaged and left out, in file order.
    pub damage: Vec<Damage>,
    /// Names of blobs of which not every part is there (interrupted, or in a damaged block).
    pub unfinished_blobs: Vec<String>,
}

/// How full one section is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SectionStats {
    /// Beams that hold a sample.
    pub nonempty_beams: u64,
    /// Samples, each sample number once.
    pub samples: u64,
}

/// Figures of an open file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Stats {
    /// Length of the file.
    pub file_bytes: u64,
    /// Samples, each sample number once; those not yet on disk included.
    pub samples: u64,
    /// The same by section.
    pub sections: Vec<SectionStats>,
    /// Samples that count no more, or never did, since others of their numbers do: ten bytes each that nobody reads.
    pub superseded: u64,
    /// Extents on disk.
    pub extents: u64,
    /// Memory that cached beams take.
    pub cache_bytes: u64,
    /// Reads that found their beam in memory.
    pub cache_hits: u64,
    /// Reads that did not.
    pub cache_misses: u64,
    /// Memory that samples not yet on disk take.
    pub pending_bytes: u64,
    /// Damaged parts found so far, at opening and since.
    pub damage: u64,
    /// Why the last write failed, until one succeeds.
    pub last_error: Option<String>,
}
