//! Samples that were appended and are not yet on disk: what will become one block.
//!
//! Invariant: an active batch only grows; once frozen it never changes, so readers share it without a lock.

use holo_section::{BeamKey, Sample};

use crate::directory::NONE;
use crate::format::{BlockKind, Class, Entry, push_chunk_crcs};
use crate::hash::BeamMap;

/// One append.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    pub key: BeamKey,
    pub class: Class,
    pub first: u32,
    pub count: u32,
    /// Its first sample in the batch.
    pub at: u32,
    next: u32,
}

/// A block's table and payload, ready to be written.
pub(crate) struct Body {
    pub kind: BlockKind,
    pub entries: u32,
    pub table: Vec<u8>,
    pub payload: Vec<u8>,
}

#[derive(Debug, Default)]
pub(crate) struct Batch {
    pub id: u64,
    pieces: Vec<Piece>,
    samples: Vec<Sample>,
    /// First and last piece of each beam.
    beams: BeamMap<(u32, u32)>,
}

impl Batch {
    pub fn with_id(self, id: u64) -> Self {
        Self { id, ..self }
    }

    /// An empty batch in the memory of one that is no longer needed: fresh memory costs more than what is put into it.
    pub fn emptied(mut self) -> Self {
        self.pieces.clear();
        self.samples.clear();
        self.beams.clear();
        self
    }

    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Memory that it takes, about.
    pub fn bytes(&self) -> u64 {
        (self.samples.len() * size_of::<Sample>() + self.pieces.len() * 2 * size_of::<Piece>())
            as u64
    }

    /// The caller bounds a batch by its bytes, so that numbers fit in 32 bits by far.
    pub fn push(&mut self, key: BeamKey, class: Class, first: u32, samples: &[Sample]) {
        let new = self.pieces.len() as u32;
        let at = self.samples.len() as u32;
        self.samples.extend_from_slice(samples);
        self.pieces.push(Piece { key, class, first, count: samples.len() as u32, at, next: NONE });
        let (_, last) = self.beams.entry(key).or_insert((new, new));
        if *last != new {
            self.pieces[*last as usize].next = new;
            *last = new;
        }
    }

    /// A beam's pieces, oldest first.
    pub fn pieces_of(&self, key: BeamKey) -> impl Iterator<Item = &Piece> {
        let mut at = self.beams.get(&key).map_or(NONE, |&(first, _)| first);
        std::iter::from_fn(move || {
            let piece = self.pieces.get(at as usize)?;
            at = piece.next;
            Some(piece)
        })
    }

    pub fn samples(&self, at: u32, count: u32) -> &[Sample] {
        &self.samples[at as usize..(at + count) as usize]
    }

    /// The extents in the order of (beam, kind, time), appends that continue each other joined, and the bytes to write.
    pub fn body(&self) -> (Vec<Entry>, Body) {
        let mut order: Vec<_> =
            self.pieces.iter().enumerate().map(|(i, p)| (p.key, p.class.kind, i)).collect();
        order.sort_unstable();

        let mut entries: Vec<Entry> = Vec::with_capacity(order.len());
        let mut payload = Vec::with_capacity(self.samples.len() * size_of::<Sample>());
        for (key, _, i) in order {
            let piece = &self.pieces[i];
            let class = piece.class;
            payload.extend_from_slice(bytemuck::cast_slice(self.samples(piece.at, piece.count)));
            match entries.last_mut() {
                Some(e) if e.key == key && e.class == class && e.first + e.count == piece.first => {
                    e.count += piece.count
                }
                _ => entries.push(Entry { key, class, first: piece.first, count: piece.count }),
            }
        }
        let mut table = Vec::with_capacity(entries.len() * 32 + payload.len() / 1000 + 4);
        entries.iter().for_each(|entry| entry.encode(&mut table));
        push_chunk_crcs(&payload, &mut table);
        let body = Body { kind: BlockKind::Samples, entries: entries.len() as u32, table, payload };
        (entries, body)
    }
}
