//! Live rays: those of a view that no section covers. They are traced and shown, but not stored.
//!
//! Invariants:
//! - The server keeps at most [`MAX_LIVE_RAYS_HELD`] live rays for one display.
//! - If a display wants both live rays and beams, each gets a share of the work.

use std::collections::VecDeque;

use holo_proto::{
    MAX_RAYS_PER_PACKET,
    bulk::{LiveRay, MAX_LIVE_RAYS_HELD},
};

use crate::events::ConnectionId;

/// Least share of a display's work for its live rays, and for its beams. A few pixels at the edge
/// of a view must not wait for ever.
const LEAST_SHARE: f64 = 1.0 / 16.0;

/// Largest number of rays that one side may be ahead of its share, or behind it. A side that wanted
/// nothing for a while does not get everything afterwards.
const MOST_AHEAD: f64 = 10.0 * MAX_RAYS_PER_PACKET as f64;

/// Live rays that a worker has, with all that another worker would need.
#[derive(Clone, Debug)]
pub struct LiveAssignment {
    /// The server's number for them.
    pub id: u64,
    /// The display that asked.
    pub display: ConnectionId,
    /// The view that they are for, as the display numbers it.
    pub view: u32,
    /// Paths averaged into each ray.
    pub paths: u16,
    /// The rays.
    pub rays: Vec<LiveRay>,
}

/// A display's live rays that no worker has yet, and whether they or the beams come next.
#[derive(Debug, Default)]
pub struct LiveQueue {
    view: u32,
    rays: VecDeque<LiveRay>,
    /// The number of pixels that they are for.
    pixels: u32,
    /// The number of live rays above their share.
    ahead: f64,
}

impl LiveQueue {
    /// Adds rays for so many pixels of a view, and forgets those of another view. Returns false,
    /// and adds none, if they are too many.
    pub fn add(&mut self, view: u32, pixels: u32, rays: &[LiveRay]) -> bool {
        if self.view != view {
            self.rays.clear();
            self.view = view;
        }
        let fits = self.rays.len() + rays.len() <= MAX_LIVE_RAYS_HELD;
        if fits {
            self.pixels = pixels;
            self.rays.extend(rays);
        }
        fits
    }

    /// Takes back rays that a worker has not traced. They are next. If the display has filled the
    /// queue since, some of them are dropped.
    pub fn put_back(&mut self, rays: &[LiveRay]) {
        let room = MAX_LIVE_RAYS_HELD - self.rays.len();
        rays.iter().take(room).rev().for_each(|ray| self.rays.push_front(*ray));
    }

    /// Returns the number of their view.
    pub fn view(&self) -> u32 {
        self.view
    }

    /// Returns whether there are no rays.
    pub fn is_empty(&self) -> bool {
        self.rays.is_empty()
    }

    /// Forgets all rays, because the view is over.
    pub fn clear(&mut self) {
        self.rays.clear();
    }

    /// Returns whether live rays come before the beams now.
    pub fn is_next(&self) -> bool {
        !self.is_empty() && self.ahead <= 0.0
    }

    /// Returns the next rays, up to a packet. The display's beams serve `other_pixels` at the same
    /// time.
    pub fn next(&mut self, other_pixels: f64) -> Vec<LiveRay> {
        let count = self.rays.len().min(MAX_RAYS_PER_PACKET);
        self.ahead = (self.ahead + count as f64 * (1.0 - self.share(other_pixels))).min(MOST_AHEAD);
        self.rays.drain(..count).collect()
    }

    /// Takes note that beams, which serve `other_pixels`, got so many rays.
    pub fn passed_over(&mut self, rays: f64, other_pixels: f64) {
        if !self.is_empty() {
            self.ahead = (self.ahead - rays * self.share(other_pixels)).max(-MOST_AHEAD);
        }
    }

    fn share(&self, other_pixels: f64) -> f64 {
        let own = f64::from(self.pixels);
        (own / (own + other_pixels).max(1.0)).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(number: u64) -> LiveRay {
        LiveRay { origin: [0.0; 3], direction: [1.0, 0.0, 0.0], number }
    }

    fn numbers(rays: &[LiveRay]) -> Vec<u64> {
        rays.iter().map(|ray| ray.number).collect()
    }

    /// Compares with a plain list: rays come once and in order, after lost ones, and never too
    /// many.
    #[test]
    fn every_ray_comes_once_in_order_and_lost_ones_come_first() {
        let mut queue = LiveQueue::default();
        let (mut model, mut under_way): (Vec<u64>, Vec<Vec<LiveRay>>) = Default::default();
        let (mut state, mut asked) = (7_u64, 0);
        for _ in 0..20_000 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let held = model.len() + under_way.iter().map(Vec::len).sum::<usize>();
            match state >> 61 {
                0 | 1 => {
                    let count = (state >> 40) as usize % 3000;
                    let rays: Vec<LiveRay> = (asked..asked + count as u64).map(ray).collect();
                    // A display keeps to the limit of unanswered rays.
                    if held + count <= MAX_LIVE_RAYS_HELD {
                        assert!(queue.add(1, 10, &rays));
                        model.extend(numbers(&rays));
                        asked += count as u64;
                    } else if model.len() + count > MAX_LIVE_RAYS_HELD {
                        assert!(!queue.add(1, 10, &rays), "more than may be kept");
                    }
                }
                2 if !under_way.is_empty() => {
                    // A worker dies.
                    let lost = under_way.swap_remove((state >> 30) as usize % under_way.len());
                    queue.put_back(&lost);
                    model.splice(0..0, numbers(&lost));
                }
                3 if !under_way.is_empty() => {
                    under_way.swap_remove((state >> 30) as usize % under_way.len());
                }
                _ => {
                    let rays = queue.next(10.0);
                    assert_eq!(rays.len(), model.len().min(MAX_RAYS_PER_PACKET));
                    assert_eq!(numbers(&rays), model.drain(..rays.len()).collect::<Vec<_>>());
                    if !rays.is_empty() {
                        under_way.push(rays);
                    }
                }
            }
            assert_eq!(queue.is_empty(), model.is_empty());
        }
        assert!(asked > MAX_LIVE_RAYS_HELD as u64, "the limit was met");
        assert!(
            queue.add(2, 10, &[ray(1), ray(2)]) && numbers(&queue.next(10.0)) == [1, 2],
            "rays of another view"
        );
        assert!(queue.add(2, 10, &[ray(3)]));
        queue.clear();
        assert!(queue.is_empty() && !queue.is_next() && queue.next(10.0).is_empty());
    }

    /// Returns the live rays and the rays of beams among a thousand packets, while both are wanted.
    /// A beam's packet has `size` rays.
    fn given(queue: &mut LiveQueue, other_pixels: f64, size: usize) -> [usize; 2] {
        let mut given = [0, 0];
        for _ in 0..1000 {
            assert!(queue.add(1, 600, &[ray(0); 21]));
            if queue.is_next() {
                given[0] += queue.next(other_pixels).len();
            } else {
                queue.passed_over(size as f64, other_pixels);
                given[1] += size;
            }
        }
        given
    }

    #[test]
    fn live_rays_and_beams_share_the_work_by_their_pixels_and_neither_starves() {
        for (other_pixels, size, share) in [
            (600.0, 21, 0.5),
            (600.0, 1, 0.5),
            (1800.0, 21, 0.25),
            (200.0, 7, 0.75),
            (1e9, 21, 1.0 / 16.0),
            (0.0, 21, 15.0 / 16.0),
        ] {
            let mut queue = LiveQueue::default();
            let [live, beams] = given(&mut queue, other_pixels, size).map(|rays| rays as f64);
            // One packet of either side more or less.
            assert!(
                (live - share * (live + beams)).abs() <= 21.0,
                "{other_pixels} {size}: {live} {beams}"
            );
        }
    }

    #[test]
    fn what_was_not_wanted_for_long_is_not_made_up_for() {
        // For a long time only live rays, then both.
        let mut queue = LiveQueue::default();
        for _ in 0..10_000 {
            assert!(queue.add(1, 600, &[ray(0); 21]));
            queue.next(600.0);
        }
        let [live, beams] = given(&mut queue, 600.0, 21);
        assert!(beams - live <= 2 * (MOST_AHEAD as usize) + 42, "{live} {beams}");
        // For a long time only beams, then both.
        let mut queue = LiveQueue::default();
        (0..10_000).for_each(|_| queue.passed_over(21.0, 600.0));
        let [live, beams] = given(&mut queue, 600.0, 21);
        assert!(live - beams <= 42, "{live} {beams}");
    }
}
