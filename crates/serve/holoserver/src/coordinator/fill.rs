//! The next packet when no display wants anything: batch order, first for samples, then for paths.

use std::{collections::VecDeque, ops::Range};

use holo_beamfile::BeamFile;
use holo_proto::MAX_RAYS_PER_PACKET;
use holo_section::{BeamKey, SampleKind};

use crate::{
    allotment::Allotment,
    batch::{BatchOrder, BatchTarget},
    better,
    shard::Share,
    unseen::UnseenBeams,
};

/// Beams that one search looks at, if none wants a ray: the coordinator has others to serve.
const MAX_LOOKS: usize = 20_000;

/// Filling in batch order, and where it is.
pub struct Fill {
    order: BatchOrder,
    share: Share,
    /// A beam in turn, and the samples that it is to have.
    in_turn: Option<(BeamKey, u64)>,
    /// Sample numbers to trace again with more paths.
    better: VecDeque<BetterRange>,
    /// Packets that workers have, or that lost workers had.
    under_way: usize,
    exhausted: bool,
    /// The number of paths that was last reported to people.
    announced: Option<u16>,
}

/// Samples of one beam to trace again.
struct BetterRange {
    key: BeamKey,
    numbers: Range<u32>,
    paths: u16,
}

/// A packet to give out.
#[derive(Debug)]
pub struct FillPacket {
    /// Its beam.
    pub key: BeamKey,
    /// Its first sample number.
    pub first: u32,
    /// Its samples.
    pub count: u8,
    /// Paths of each, if more than usual.
    pub paths: Option<u16>,
}

/// The state that a search reads.
pub struct FillState<'a> {
    /// What is stored.
    pub file: &'a BeamFile,
    /// Beams that see nothing.
    pub unseen: &'a UnseenBeams,
    /// Sample numbers given out.
    pub allotment: &'a mut Allotment,
    /// Returns whether a display may show samples of a beam.
    pub is_looked_at: &'a dyn Fn(BeamKey) -> bool,
}

impl Fill {
    /// Returns filling of a share that begins at the order's beginning.
    pub fn new(order: BatchOrder, share: Share) -> Fill {
        Fill {
            order,
            share,
            in_turn: None,
            better: VecDeque::new(),
            under_way: 0,
            exhausted: false,
            announced: None,
        }
    }

    /// Returns the next packet; `None` if nothing is wanted at present, or this search found
    /// nothing.
    pub fn next(&mut self, known: &mut FillState) -> Option<FillPacket> {
        for _ in 0..MAX_LOOKS {
            if let Some(packet) = self.next_better(known).or_else(|| self.next_fresh(known)) {
                self.under_way += 1;
                return Some(packet);
            }
            // The file does not include samples under way, so this waits for them, once for each
            // level.
            let waits = self.order.waits_for_results() && self.under_way > 0;
            if self.exhausted || waits {
                return None;
            }
            self.turn(known);
        }
        None
    }

    /// Goes on to the order's next beam.
    fn turn(&mut self, known: &FillState) {
        match self.order.next(known.unseen) {
            None => self.exhausted = true,
            Some((key, _)) if known.unseen.contains(key) || !self.share.has(key) => {}
            Some((key, BatchTarget::Samples(wanted))) => self.in_turn = Some((key, wanted)),
            // A beam that a display looks at is left as it is until the next level.
            Some((key, BatchTarget::Paths(_))) if (known.is_looked_at)(key) => {}
            Some((key, BatchTarget::Paths(paths))) => {
                let worse = better::worse(&known.file.runs(key), paths, &(0..u32::MAX));
                self.better =
                    worse.into_iter().map(|numbers| BetterRange { key, numbers, paths }).collect();
            }
        }
    }

    /// Returns the next packet of new samples for the beam in turn.
    fn next_fresh(&mut self, known: &mut FillState) -> Option<FillPacket> {
        let (key, wanted) = self.in_turn.take().filter(|(key, _)| !known.unseen.contains(*key))?;
        let have = known.allotment.taken(known.file, key);
        let count = wanted.saturating_sub(have).min(MAX_RAYS_PER_PACKET as u64) as u8;
        if count == 0 {
            return None;
        }
        let (first, count) = known.allotment.take(known.file, key, SampleKind::Uniform, count)?;
        self.in_turn = Some((key, wanted));
        Some(FillPacket { key, first, count, paths: None })
    }

    /// Returns the next packet of samples to trace again.
    fn next_better(&mut self, known: &FillState) -> Option<FillPacket> {
        let mut range = self.better.pop_front()?;
        if (known.is_looked_at)(range.key) {
            // A display looks at the beam by now, so it is left as it is until the next level.
            self.better.clear();
            return None;
        }
        let (key, first, paths) = (range.key, range.numbers.start, range.paths);
        let count = better::rays_per_packet(paths).min(range.numbers.end - first) as u8;
        range.numbers.start += u32::from(count);
        if !range.numbers.is_empty() {
            self.better.push_front(range);
        }
        Some(FillPacket { key, first, count, paths: Some(paths) })
    }

    /// Begins the order anew for a file of so many samples: beams that were passed over are not
    /// unseen after all.
    pub fn begin_again(&mut self, stored: u64, unseen: &UnseenBeams) {
        self.order = self.order.again(self.share.all_shards(stored), unseen);
        self.in_turn = None;
        self.better.clear();
        self.exhausted = false;
    }

    /// Takes note that a packet's results have come, whatever they are.
    pub fn finish_packet(&mut self) {
        self.under_way = self.under_way.saturating_sub(1);
    }

    /// Returns whether every beam has all it may get.
    pub fn is_exhausted(&self) -> bool {
        self.exhausted
    }

    /// Returns the paths that samples get from now on, once for each level.
    pub fn new_level(&mut self) -> Option<u16> {
        let paths = self.order.better_paths();
        let is_new = paths != self.announced;
        self.announced = paths;
        paths.filter(|_| is_new)
    }
}
