//! Which sample numbers of each beam have been given out.

use std::collections::HashMap;

use holo_beamfile::BeamFile;
use holo_section::{BeamKey, SampleKind};

/// Gives out sample numbers so that none is traced twice: from the file's counts on, upwards.
#[derive(Default)]
pub struct Allotment {
    next: HashMap<(BeamKey, SampleKind), u32>,
    returned: HashMap<(BeamKey, SampleKind), Vec<(u32, u8)>>,
}

impl Allotment {
    /// Returns up to `count` fresh numbers of a beam: the first, and how many. `None` at the very
    /// end of the numbers.
    pub fn take(
        &mut self,
        file: &BeamFile,
        key: BeamKey,
        kind: SampleKind,
        count: u8,
    ) -> Option<(u32, u8)> {
        if let Some(ranges) = self.returned.get_mut(&(key, kind)) {
            let range = ranges.pop();
            if ranges.is_empty() {
                self.returned.remove(&(key, kind));
            }
            if range.is_some() {
                return range;
            }
        }
        let next = self.next.entry((key, kind)).or_insert_with(|| stored(file, key, kind));
        let first = *next;
        *next = first.checked_add(u32::from(count))?;
        Some((first, count))
    }

    /// Takes back numbers that will not be traced. They are the beam's next.
    pub fn give_back(&mut self, key: BeamKey, kind: SampleKind, first: u32, count: u8) {
        self.returned.entry((key, kind)).or_default().push((first, count));
    }

    /// Returns how many numbers have been given out: stored, or under way.
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
