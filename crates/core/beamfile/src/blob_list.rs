//! The blobs of a file, by name, and the blocks that hold their parts.
//!
//! Invariants:
//! - A copy is listed only when all its parts are on disk.
//! - Copies of one blob have the same parts and the same checksums.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use crate::directory::DiskBlock;
use crate::format::BlobPart;

/// A block that holds a part of a blob, and its number in the directory.
#[derive(Clone, Debug)]
pub(crate) struct PartBlock {
    pub id: u32,
    pub block: Arc<DiskBlock>,
}

/// The blocks of one copy of a blob, in order.
#[derive(Clone, Debug)]
pub(crate) struct BlobCopy {
    pub total: u64,
    pub parts: Vec<PartBlock>,
}

impl BlobCopy {
    fn is_copy_of(&self, other: &BlobCopy) -> bool {
        let same = |(one, two): (&PartBlock, &PartBlock)| {
            one.block.header.payload_bytes == two.block.header.payload_bytes
                && one.block.crcs == two.block.crcs
        };
        self.total == other.total
            && self.parts.len() == other.parts.len()
            && self.parts.iter().zip(&other.parts).all(same)
    }
}

/// A copy that still lacks some parts.
#[derive(Debug)]
struct UnfinishedCopy {
    name: String,
    have: u64,
    copy: BlobCopy,
}

/// The blobs of a file.
#[derive(Debug, Default)]
pub(crate) struct BlobList {
    /// The whole copies of each blob's newest bytes, oldest first.
    whole: BTreeMap<String, Vec<BlobCopy>>,
    /// By blob id.
    unfinished: HashMap<u64, UnfinishedCopy>,
    /// Blobs that lack a part.
    broken: BTreeSet<String>,
}

impl BlobList {
    /// Takes the next part of a copy, in file order. Its block has number `id` in the directory.
    pub fn add(&mut self, part: BlobPart, id: u32, block: Arc<DiskBlock>) {
        if part.offset == 0 {
            let copy = BlobCopy { total: part.total, parts: Vec::new() };
            let begun = UnfinishedCopy { name: part.name.clone(), have: 0, copy };
            self.unfinished.insert(part.blob_id, begun);
        }
        let bytes = u64::from(block.header.payload_bytes);
        let fits = |begun: &UnfinishedCopy| {
            let grows = bytes > 0 || begun.copy.total == 0;
            let continues = begun.have == part.offset && begun.copy.total == part.total;
            grows && continues && begun.name == part.name
        };
        let Some(mut begun) = self.unfinished.remove(&part.blob_id).filter(fits) else {
            self.broken.insert(part.name);
            return;
        };
        begun.copy.parts.push(PartBlock { id, block });
        begun.have += bytes;
        if begun.have == begun.copy.total {
            self.finish(begun);
        } else if begun.have < begun.copy.total {
            self.unfinished.insert(part.blob_id, begun);
        } else {
            self.broken.insert(begun.name);
        }
    }

    fn finish(&mut self, UnfinishedCopy { name, copy, .. }: UnfinishedCopy) {
        self.broken.remove(&name);
        let copies = self.whole.entry(name).or_default();
        copies.retain(|older| copy.is_copy_of(older));
        copies.push(copy);
    }

    /// Gives up a copy whose writing failed.
    pub fn abandon(&mut self, blob_id: u64) {
        self.unfinished.remove(&blob_id);
    }

    /// Returns the names of blobs that were begun and are not whole.
    pub fn unfinished(&self) -> Vec<String> {
        let begun = self.unfinished.values().map(|begun| begun.name.clone());
        begun.chain(self.broken.iter().cloned()).collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// Returns the whole copies of a blob, oldest first.
    pub fn copies(&self, name: &str) -> Vec<BlobCopy> {
        self.whole.get(name).cloned().unwrap_or_default()
    }

    /// Returns the names of the blobs that have a whole copy, sorted.
    pub fn names(&self) -> Vec<String> {
        self.whole.keys().cloned().collect()
    }
}
