//! Layers: the shares that groups of lamps, or parts of the sky, have in samples.
//!
//! Layer 0 is all light, and its values are the samples themselves. A block of shares has further
//! layers of samples that are stored elsewhere in the file. A share is four bytes of RGBE. It
//! repeats neither the ray nor the distance.
//!
//! A sample that has shares is named by its section, beam, kind, number, generation, paths and
//! maker. So shares stay true in a copy of the file, and after a merge.

use crate::format::{BlockHeader, Entry, SHARE_BYTES};

/// Samples whose shares in all layers are known, or a run of shares of such samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ShareRun {
    /// The samples. `supersedes` is false.
    pub entry: Entry,
    /// 0: the shares of these samples are known, and black unless a following run of this block
    /// has them. Otherwise the layer of the shares.
    pub layer: u16,
}

impl ShareRun {
    /// Returns the runs of a block's table; `None` unless they are in order and every run of shares
    /// lies within the samples announced before it.
    pub fn list(entries: Vec<(Entry, u16)>, block: &BlockHeader) -> Option<Vec<ShareRun>> {
        let mut announced: Option<Entry> = None;
        let mut last = (0, 0);
        let mut shares = 0;
        let mut runs = Vec::with_capacity(entries.len());
        for (entry, layer) in entries {
            let end = u64::from(entry.first) + u64::from(entry.count);
            if layer == 0 {
                announced = Some(entry);
                last = (0, 0);
            } else {
                let base = announced?;
                let within = entry.first >= base.first
                    && end <= u64::from(base.first) + u64::from(base.count);
                let same = Entry { first: base.first, count: base.count, ..entry } == base;
                if !within || !same || (layer, u64::from(entry.first)) < last {
                    return None;
                }
                last = (layer, end);
                shares += u64::from(entry.count);
            }
            if entry.class.supersedes {
                return None;
            }
            runs.push(ShareRun { entry, layer });
        }
        (shares * u64::from(SHARE_BYTES) == u64::from(block.payload_bytes)).then_some(runs)
    }

    /// Returns the bytes of payload that belong to the run.
    pub fn payload_bytes(&self) -> usize {
        if self.layer == 0 { 0 } else { self.entry.count as usize * SHARE_BYTES as usize }
    }
}
