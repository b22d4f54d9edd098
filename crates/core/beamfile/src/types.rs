//! Types that callers pass to a [`crate::BeamFile`] or receive from it.

use std::fmt;

use holo_section::{NumberRun, Sample};

/// The next free sample number of each kind in one beam: one more than the highest number stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NextNumbers {
    /// For [`Uniform`](holo_section::SampleKind::Uniform).
    pub uniform: u32,
    /// For [`ViewpointLimited`](holo_section::SampleKind::ViewpointLimited).
    pub limited: u32,
    /// For [`SingleRay`](holo_section::SampleKind::SingleRay).
    pub single: u32,
}

/// The maker of samples: a number whose meaning the file's owner stores. 0 if the maker is unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Maker(pub u16);

/// A moment in a file's growth: everything that was on disk then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark(pub(crate) u32);

impl Maker {
    /// An unknown maker.
    pub const UNKNOWN: Maker = Maker(0);
}

/// Options for opening or creating a file.
#[derive(Clone, Debug)]
pub struct Options {
    /// Memory for beams that were read, in bytes; 0 caches none.
    pub cache_bytes: u64,
    /// Number of beams in each section. `create` writes it; `open` compares it with the file,
    /// unless it is empty.
    pub layout: Vec<u64>,
}

/// All samples of one beam, in the order (kind, sample number), each number once.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BeamSamples {
    /// The runs that `samples` consists of, in order. Their counts add up to its length.
    pub runs: Vec<NumberRun>,
    /// The samples of all runs, one run after the other.
    pub samples: Vec<Sample>,
}

impl BeamSamples {
    /// Returns each run with its samples.
    pub fn iter(&self) -> impl Iterator<Item = (&NumberRun, &[Sample])> {
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
    /// Its first byte in the file.
    pub offset: u64,
    /// Its length in bytes.
    pub bytes: u64,
    /// The kind of the damaged part.
    pub what: DamageKind,
}

/// The kinds of damaged parts of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DamageKind {
    /// One copy of the file's header. The other one is used.
    HeaderCopy(u8),
    /// The header of a block, and with it the block, or several.
    BlockHeader,
    /// The table of the block with this sequence number, and with it the block.
    BlockTable(u64),
    /// Samples.
    Samples,
    /// A chunk in one copy of the blob with this name.
    Blob(String),
    /// Shares of samples in layers.
    Shares,
    /// A part of the index. Opening reads the blocks in its place.
    Index,
    /// Bytes of a block of this unknown kind.
    Skipped(u32),
    /// A block at the end of the file that was never completed. If a writer is active, the block
    /// may still be completed.
    TornTail,
}

impl Damage {
    /// Returns the greatest number of samples that are left out because of this damage.
    ///
    /// Exact for [`DamageKind::Samples`]. For a whole block, it is the number that would fit into
    /// its bytes.
    pub fn samples(&self) -> u64 {
        match self.what {
            DamageKind::Samples | DamageKind::BlockHeader | DamageKind::BlockTable(_) => {
                self.bytes / size_of::<Sample>() as u64
            }
            DamageKind::HeaderCopy(_)
            | DamageKind::Blob(_)
            | DamageKind::Shares
            | DamageKind::Index
            | DamageKind::Skipped(_)
            | DamageKind::TornTail => 0,
        }
    }
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Damage { offset, bytes, what } = self;
        write!(f, "offset {offset}: ")?;
        match what {
            DamageKind::HeaderCopy(copy) => {
                write!(f, "copy {copy} of the file's header is damaged")
            }
            DamageKind::BlockHeader => {
                write!(f, "a block header is damaged; {bytes} bytes are left out")
            }
            DamageKind::BlockTable(sequence) => {
                write!(f, "the table of block {sequence} is damaged; {bytes} bytes are left out")
            }
            DamageKind::Samples => write!(f, "{} damaged samples are left out", self.samples()),
            DamageKind::Blob(name) => {
                write!(f, "{bytes} bytes in a copy of blob `{name}` are damaged")
            }
            DamageKind::Shares => {
                write!(f, "{bytes} bytes with shares of layers are damaged and left out")
            }
            DamageKind::Index => {
                write!(
                    f,
                    "{bytes} bytes of the index are damaged; opening reads the blocks instead"
                )
            }
            DamageKind::Skipped(kind) => {
                write!(f, "{bytes} bytes in a block of the unknown kind {kind} are damaged")
            }
            DamageKind::TornTail => {
                write!(f, "a block was never completed; {bytes} bytes are left out")
            }
        }
    }
}

/// Blocks of one kind that this program does not know. A later version wrote them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Skipped {
    /// The kind.
    pub kind: u32,
    /// Number of blocks.
    pub blocks: u64,
    /// Their length in bytes.
    pub bytes: u64,
}

/// The report on opening a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OpenReport {
    /// Complete blocks.
    pub blocks: u64,
    /// Those of them that the index described, and that were not read one by one.
    pub indexed: u64,
    /// Extents in them.
    pub extents: u64,
    /// Samples in them, including superseded ones.
    pub samples: u64,
    /// Damaged parts, in file order.
    pub damage: Vec<Damage>,
    /// Names of blobs that lack a part, because writing was interrupted or a block is damaged.
    pub unfinished_blobs: Vec<String>,
}

/// Fill level of one section.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SectionStats {
    /// Beams that hold a sample.
    pub nonempty_beams: u64,
    /// Samples; each sample number counts once.
    pub samples: u64,
}

/// Figures of an open file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Stats {
    /// Length of the file, bytes.
    pub file_bytes: u64,
    /// Samples, also those not yet on disk; each sample number counts once.
    pub samples: u64,
    /// The same by section.
    pub sections: Vec<SectionStats>,
    /// Samples of earlier generations that
    /// [`BeamFile::read_earlier`](crate::BeamFile::read_earlier) reads.
    pub earlier: u64,
    /// Samples that no read returns, because another sample of the same number counts. Each takes
    /// ten bytes of the file.
    pub superseded: u64,
    /// Extents on disk.
    pub extents: u64,
    /// Memory that cached beams take, bytes.
    pub cache_bytes: u64,
    /// Reads that found their beam in the cache.
    pub cache_hits: u64,
    /// Reads that did not find their beam in the cache.
    pub cache_misses: u64,
    /// Memory that samples not yet on disk take, bytes.
    pub pending_bytes: u64,
    /// Number of damaged parts found so far, at opening and since.
    pub damage: u64,
    /// The reason why the last write failed; `None` once a write succeeds.
    pub last_error: Option<String>,
}
