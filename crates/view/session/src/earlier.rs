//! Samples of an earlier generation: light of the scene as it was before an edit. They are shown
//! until new samples of their beams come ([`holo_proto::fading`]).
//!
//! Invariant: a sample that is kept here is in the driver, once.

use std::mem::take;

use holo_display::{Age, Light};
use holo_proto::fading::lasting;
use holo_section::{BeamKey, NumberRun, Sample};
use rustc_hash::{FxHashMap, FxHashSet};

/// Most samples that are kept: 320 MiB. Further ones are not shown.
const MOST: u64 = 1 << 25;

/// Part of the samples: so many present ones are worth taking earlier ones out of the driver.
const PART: u64 = 64;

/// Fewer present samples are not.
const LEAST: u64 = 256;

/// The earlier samples that the driver has.
#[derive(Default)]
pub struct Earlier {
    /// Each piece lies in one block of ranks, so that it yields from its front.
    beams: FxHashMap<BeamKey, Vec<RankedSamples>>,
    samples: u64,
    /// Beams of which present samples have come since the last look at them.
    stale: FxHashSet<BeamKey>,
    /// How many came.
    fresh: u64,
    /// Samples that the driver should no longer have, but cannot let go.
    stuck: u64,
}

/// Samples of consecutive ranks.
struct RankedSamples {
    first: u32,
    paths: u16,
    samples: Vec<Sample>,
}

impl Earlier {
    /// Returns whether there are samples of a beam.
    pub fn has(&self, key: BeamKey) -> bool {
        self.beams.contains_key(&key)
    }

    /// Hands samples to the driver, except those that it has and those that no longer count beside
    /// `present` samples of their beam. The first number of `run` is a rank. Returns how many were
    /// new.
    pub fn insert(
        &mut self,
        light: &mut dyn Light,
        run: &NumberRun,
        samples: &[Sample],
        present: u64,
    ) -> u64 {
        let before = self.samples;
        for ranks in lasting(run.first..run.first + run.count, present) {
            let part = &samples[(ranks.start - run.first) as usize..][..ranks.len()];
            let is_room = self.samples + part.len() as u64 <= MOST;
            let known = self.beams.get(&run.key).map_or(&[][..], Vec::as_slice);
            if is_room && !known.iter().any(|piece| piece.has(ranks.start)) {
                light.insert(Age::Earlier, run.key, run.paths, part);
                self.samples += part.len() as u64;
                let piece =
                    RankedSamples { first: ranks.start, paths: run.paths, samples: part.to_vec() };
                self.beams.entry(run.key).or_default().push(piece);
            }
        }
        self.samples - before
    }

    /// Notes that present samples of a beam have come.
    pub fn note(&mut self, key: BeamKey, count: u64) {
        if count > 0 && self.has(key) {
            self.stale.insert(key);
            self.fresh += count;
        }
    }

    /// Returns whether so many present samples have come that the picture would show it.
    pub fn is_due(&self) -> bool {
        self.fresh >= LEAST.max(self.samples / PART)
    }

    /// Takes the samples out of the driver that no longer count. `present` returns how many present
    /// samples of a beam there are.
    pub fn fade(&mut self, light: &mut dyn Light, present: impl Fn(BeamKey) -> u64) {
        self.fresh = 0;
        for key in take(&mut self.stale) {
            let Some(pieces) = self.beams.get_mut(&key) else { continue };
            for piece in &mut *pieces {
                let RankedSamples { first, paths, samples } = piece;
                let ranks = *first..*first + samples.len() as u32;
                let stays = lasting(ranks.clone(), present(key)).next();
                let gone = (stays.map_or(ranks.end, |stays| stays.start) - ranks.start) as usize;
                if gone > 0 && !light.remove_earlier(key, *paths, &samples[..gone]) {
                    self.stuck += gone as u64;
                }
                samples.drain(..gone);
                *first += gone as u32;
                self.samples -= gone as u64;
            }
            pieces.retain(|piece| !piece.samples.is_empty());
            if pieces.is_empty() {
                self.beams.remove(&key);
            }
        }
    }

    /// Returns whether the driver still shows samples that should be gone: any, or only if at least
    /// as many as those that stay.
    pub fn is_stuck(&self, any: bool) -> bool {
        self.stuck > 0 && (any || self.stuck >= self.samples)
    }
}

impl RankedSamples {
    fn has(&self, rank: u32) -> bool {
        rank >= self.first && rank - self.first < self.samples.len() as u32
    }
}
