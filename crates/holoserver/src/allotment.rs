//! Which sample numbers of each beam have been given out.

use std::collections::HashMap;

use holo_beamfile::BeamFile;
pub use holo_beamfile::BeamKey;
use holo_section::SampleKind;

/// Hands out sample numbers so that none is traced twice: from the file's counts on, and from there upwards.
#[derive(Default)]
pub struct Allotment {
    next: HashMap<(BeamKey, SampleKind), u32>,
}

impl Allotment {
    /// The first of `count` fresh numbers of a beam; fewer than `count` may be left at the very end of the numbers.
    pub fn take(&mut self, file: &BeamFile, key: BeamKey, kind: SampleKind, count: u8) -> Option<u32> {
        let next = self.next.entry((key, kind)).or_insert_with(|| stored(file, key, kind));
        let first = *next;
        *next = first.checked_add(u32::from(count))?;
        Some(first)
    }

    /// Numbers given out so far, stored or under way.
    pub fn taken(&self, file: &BeamFile, key: BeamKey, kind: SampleKind) -> u32 {
        self.next.get(&(key, kind)).copied().unwrap_or_else(|| stored(file, key, kind))
    }
}

fn stored(file: &BeamFile, key: BeamKey, kind: SampleKind) -> u32 {
    let counts = file.counts(key);
    match kind {
        SampleKind::Uniform => counts.uniform,
        SampleKind::ViewpointLimited => counts.limited,
        SampleKind::SingleRay => counts.single,
    }
}
