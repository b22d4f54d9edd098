//! Single rays that a driver has requested: what each is for, and how many to request next.
//!
//! Invariant: the tags of at most twice [`MOST`] rays are kept, however many are never answered.

use holo_section::{BeamKey, RayCoords};
use rustc_hash::FxHashMap;

/// Rays after which the older half of the tags is dropped: more than a picture of two million
/// pixels requests in half a second.
const MOST: usize = 1 << 17;

/// Pixels of the picture for each ray of the largest and of the smallest request.
const PIXELS_PER_RAY: [usize; 2] = [16, 1024];

/// Least rays of a request, unless the picture has fewer pixels than 16 times that.
const LEAST: usize = 64;

/// A request has this many rays for each ray that was answered since the last one, so that workers
/// are never without rays. More would only make the choice among them random.
const AHEAD: f64 = 1.5;

/// Share of the number of answers that an interval without any leaves. Answers come in bursts.
const REMEMBERED: f64 = 0.75;

/// The tags of requested rays that have not arrived, and the rate of answers.
#[derive(Debug)]
pub(crate) struct AwaitedRays<T> {
    newer: FxHashMap<(BeamKey, RayCoords), T>,
    older: FxHashMap<(BeamKey, RayCoords), T>,
    /// Answers since the last request.
    answers: usize,
    /// Answers between two requests, as a running maximum.
    rate: f64,
}

impl<T> Default for AwaitedRays<T> {
    fn default() -> Self {
        let (newer, older) = (FxHashMap::default(), FxHashMap::default());
        Self { newer, older, answers: 0, rate: 0.0 }
    }
}

impl<T> AwaitedRays<T> {
    /// Returns how many rays to request now, for a picture of so many pixels.
    pub fn wanted(&mut self, pixels: usize) -> usize {
        self.rate = (self.answers as f64).max(REMEMBERED * self.rate);
        self.answers = 0;
        let [most, least] = PIXELS_PER_RAY.map(|each| (pixels / each).max(1));
        ((AHEAD * self.rate) as usize).clamp(least.max(LEAST).min(most), most)
    }

    /// Remembers what a requested ray is for.
    pub fn insert(&mut self, key: BeamKey, coords: RayCoords, tag: T) {
        if self.newer.len() >= MOST {
            self.older = std::mem::take(&mut self.newer);
        }
        self.newer.insert((key, coords), tag);
    }

    /// Returns what an arrived ray is for, once. `None` if it was not requested, or long ago.
    pub fn remove(&mut self, key: BeamKey, coords: RayCoords) -> Option<T> {
        let ray = (key, coords);
        let tag = self.newer.remove(&ray).or_else(|| self.older.remove(&ray));
        self.answers += usize::from(tag.is_some());
        tag
    }

    /// Forgets all rays, because their tags no longer mean anything.
    pub fn clear(&mut self) {
        self.newer.clear();
        self.older.clear();
    }
}

#[cfg(test)]
mod tests {
    use holo_section::BeamId;

    use super::*;

    fn ray(number: usize) -> (BeamKey, RayCoords) {
        let coords = RayCoords((number as u32).to_le_bytes());
        (BeamKey { section: 0, beam: BeamId(number as u64 / 7) }, coords)
    }

    #[test]
    fn each_tag_is_returned_once_and_only_the_newest_are_kept() {
        let mut awaited = AwaitedRays::default();
        for number in 0..3 * MOST {
            let (key, coords) = ray(number);
            awaited.insert(key, coords, number);
        }
        let mut remove = |number| {
            let (key, coords) = ray(number);
            awaited.remove(key, coords)
        };
        assert_eq!(remove(0), None, "it was dropped");
        for number in [MOST, 2 * MOST, 3 * MOST - 1] {
            assert_eq!((remove(number), remove(number)), (Some(number), None));
        }
        awaited.clear();
        let (key, coords) = ray(MOST + 1);
        assert_eq!(awaited.remove(key, coords), None);
    }

    #[test]
    fn requests_follow_the_rate_of_answers_between_two_limits() {
        let mut awaited = AwaitedRays::default();
        let pixels = 1 << 20;
        assert_eq!(awaited.wanted(pixels), pixels / 1024, "nothing is known");
        let mut answered = |count: usize| {
            for number in 0..count {
                let (key, coords) = ray(number);
                awaited.insert(key, coords, ());
                awaited.remove(key, coords);
            }
            awaited.wanted(pixels)
        };
        assert_eq!(answered(10_000), 15_000);
        assert_eq!(answered(0), 11_250, "answers come in bursts");
        assert_eq!(answered(60_000), pixels / 16);
        assert_eq!((0..30).map(|_| answered(0)).last(), Some(pixels / 1024));
    }
}
