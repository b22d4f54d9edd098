//! Samples that were appended and are not yet on disk. They will become one block.
//!
//! Invariant: an active batch only grows. Once frozen it never changes, so readers share it without
//! a lock.

use holo_section::{BeamKey, Sample};

use crate::directory::NONE;
use crate::format::{BlockKind, Class, Entry, push_chunk_crcs};
use crate::hash::BeamMap;

/// Samples that were appended together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Append {
    pub key: BeamKey,
    pub class: Class,
    /// Number of the first sample.
    pub first: u32,
    /// Number of samples.
    pub count: u32,
    /// Index of the first sample among the batch's samples.
    pub at: u32,
    /// The beam's next append in the batch.
    next: u32,
}

/// A block's table and payload, ready to be written.
pub(crate) struct BlockBytes {
    pub kind: BlockKind,
    /// Entries in the table; 1 for a part of a blob.
    pub entries: u32,
    pub table: Vec<u8>,
    pub payload: Vec<u8>,
}

#[derive(Debug, Default)]
pub(crate) struct WriteBatch {
    /// Number of the batch, rising with every batch of the open file.
    pub id: u64,
    appends: Vec<Append>,
    samples: Vec<Sample>,
    /// First and last append of each beam.
    beams: BeamMap<(u32, u32)>,
}

impl WriteBatch {
    pub fn with_id(self, id: u64) -> Self {
        Self { id, ..self }
    }

    /// Returns an empty batch in the memory of one that is no longer needed. Fresh memory costs
    /// more time than the samples that go into it.
    pub fn emptied(mut self) -> Self {
        self.appends.clear();
        self.samples.clear();
        self.beams.clear();
        self
    }

    pub fn is_empty(&self) -> bool {
        self.appends.is_empty()
    }

    /// Returns the approximate memory of the batch, in bytes.
    pub fn bytes(&self) -> u64 {
        (self.samples.len() * size_of::<Sample>() + self.appends.len() * 2 * size_of::<Append>())
            as u64
    }

    /// Adds samples. The caller bounds the batch by its bytes, so positions fit in 32 bits.
    pub fn push(&mut self, key: BeamKey, class: Class, first: u32, samples: &[Sample]) {
        let new = self.appends.len() as u32;
        let at = self.samples.len() as u32;
        self.samples.extend_from_slice(samples);
        let count = samples.len() as u32;
        self.appends.push(Append { key, class, first, count, at, next: NONE });
        let (_, last) = self.beams.entry(key).or_insert((new, new));
        if *last != new {
            self.appends[*last as usize].next = new;
            *last = new;
        }
    }

    /// Returns a beam's appends, oldest first.
    pub fn appends_of(&self, key: BeamKey) -> impl Iterator<Item = &Append> {
        let mut at = self.beams.get(&key).map_or(NONE, |&(first, _)| first);
        std::iter::from_fn(move || {
            let append = self.appends.get(at as usize)?;
            at = append.next;
            Some(append)
        })
    }

    pub fn samples(&self, at: u32, count: u32) -> &[Sample] {
        &self.samples[at as usize..(at + count) as usize]
    }

    /// Returns the batch's extents and its block's body, as samples of a generation.
    ///
    /// Extents are in the order (beam, kind, time). Appends that continue each other are joined. If
    /// the caller's order is kept, beams are in the order of their first appends.
    pub fn body(&self, generation: u32, keeps_order: bool) -> (Vec<Entry>, BlockBytes) {
        let place = |key| if keeps_order { self.beams.get(&key).map(|beam| beam.0) } else { None };
        let appends = self.appends.iter().enumerate();
        let mut order: Vec<_> =
            appends.map(|(i, a)| (place(a.key), a.key, a.class.kind, i)).collect();
        order.sort_unstable();
        let mut entries: Vec<Entry> = Vec::with_capacity(order.len());
        let mut payload = Vec::with_capacity(self.samples.len() * size_of::<Sample>());
        for (_, key, _, i) in order {
            let Append { class, first, count, at, .. } = self.appends[i];
            payload.extend_from_slice(bytemuck::cast_slice(self.samples(at, count)));
            match entries.last_mut() {
                Some(e) if e.key == key && e.class == class && e.first + e.count == first => {
                    e.count += count;
                }
                _ => entries.push(Entry { key, class, first, count, generation }),
            }
        }
        let mut table = Vec::with_capacity(entries.len() * 32 + payload.len() / 1000 + 4);
        entries.iter().for_each(|entry| entry.encode(0, &mut table));
        push_chunk_crcs(&payload, &mut table);
        let body =
            BlockBytes { kind: BlockKind::Samples, entries: entries.len() as u32, table, payload };
        (entries, body)
    }
}
