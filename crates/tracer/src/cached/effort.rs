//! Limits the work on records.
//!
//! Invariant: the rays of records never exceed the number that samples have allowed by more than
//! the records that are being made. A record counts from its beginning, so that few are made at
//! once. No clock decides: work is counted in rays and samples.

use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

use super::settings::{FIRST_SHARE, RAY_COST, SERVED_WORTH, UNLIMITED, WINDOW};

/// Fraction bits of [`Effort::allowed`].
const FRACTION: u32 = 8;

/// Rays that a record counts for while it is being made, as its number is not known yet. Without
/// them, all threads would begin records at a program's first moment, and the first samples would
/// wait for them.
const EXPECTED_RAYS: u64 = 4096;

/// The effort of one tracer, shared by its threads.
#[derive(Debug)]
pub(super) struct Effort {
    /// Most rays of records for each sample that lacks a record, or [`UNLIMITED`].
    most: AtomicU32,
    /// True if the limit may be lower than `most`, according to the use of records.
    is_measured: AtomicBool,
    /// Samples that found records, of the latest [`WINDOW`] or more.
    served: AtomicU64,
    /// Samples that did not.
    lacking: AtomicU64,
    /// Rays of records that samples have allowed so far, with [`FRACTION`] bits.
    allowed: AtomicU64,
    /// Rays of records that have been traced, and [`EXPECTED_RAYS`] for each record that is being
    /// made.
    traced: AtomicU64,
}

impl Effort {
    pub fn unlimited() -> Effort {
        Effort {
            most: AtomicU32::new(UNLIMITED),
            is_measured: AtomicBool::default(),
            served: AtomicU64::default(),
            lacking: AtomicU64::default(),
            allowed: AtomicU64::default(),
            traced: AtomicU64::default(),
        }
    }

    pub fn set(&self, most: u32, is_measured: bool) {
        self.most.store(most, Ordering::Relaxed);
        self.is_measured.store(is_measured, Ordering::Relaxed);
    }

    /// Counts rays of records.
    pub fn add_rays(&self, rays: u32) {
        self.traced.fetch_add(rays.into(), Ordering::Relaxed);
    }

    /// Counts a sample that found records.
    #[inline]
    pub fn add_served(&self) {
        if self.most.load(Ordering::Relaxed) != UNLIMITED {
            self.served.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Counts a sample that lacks a record. `Some` if it may make one: a value to keep until the
    /// record is made.
    pub fn begin_record(&self) -> Option<Begun<'_>> {
        let most = self.most.load(Ordering::Relaxed);
        if most == UNLIMITED {
            return Some(Begun { effort: self, rays: 0 });
        }
        let lacking = self.lacking.fetch_add(1, Ordering::Relaxed) + 1;
        let served = self.served.load(Ordering::Relaxed);
        if served + lacking >= WINDOW {
            // Other threads may count meanwhile. Counts that are lost in between are small compared
            // with the window.
            self.served.store(served / 2, Ordering::Relaxed);
            self.lacking.store(lacking / 2, Ordering::Relaxed);
        }
        let rays = match self.is_measured.load(Ordering::Relaxed) {
            true => rays_per_lacking(served, lacking).min(f64::from(most)),
            false => f64::from(most),
        };
        let more = (rays * f64::from(1 << FRACTION)) as u64;
        let allowed = self.allowed.fetch_add(more, Ordering::Relaxed) + more;
        // Without effort there is never a record, not even the first.
        if self.traced.load(Ordering::Relaxed) << FRACTION >= allowed {
            return None;
        }
        let rays = EXPECTED_RAYS;
        let before = self.traced.fetch_add(rays, Ordering::Relaxed);
        let begun = Begun { effort: self, rays };
        // Another thread may have begun one since.
        (before << FRACTION < allowed).then_some(begun)
    }
}

/// A record that is being made.
#[derive(Debug)]
pub(super) struct Begun<'a> {
    effort: &'a Effort,
    /// Rays that it counts for until then.
    rays: u64,
}

impl Drop for Begun<'_> {
    fn drop(&mut self) {
        self.effort.traced.fetch_sub(self.rays, Ordering::Relaxed);
    }
}

/// Returns the rays of records that a sample without a record allows. So many samples were served
/// by records, and so many lacked one.
///
/// Records may take half as large a share of the time as the share of samples that they serve, but
/// at least [`FIRST_SHARE`]. Large surfaces need few records, and much is served soon. In clutter a
/// record serves few samples, and paths lower the error faster.
///
/// Let records serve the share s, leave half of the variance to a sample that they serve, and take
/// the share x of the time. The error is then (1 - s/2) / (1 - x) of that of paths alone. So beyond
/// s/2, records lose, however long the fill takes.
fn rays_per_lacking(served: u64, lacking: u64) -> f64 {
    let share = served as f64 / (served + lacking) as f64;
    let time = (SERVED_WORTH * share).max(FIRST_SHARE);
    // This is the ratio of rays to samples whose times have the ratio `time` : `1 - time`, divided
    // among the samples that lack records.
    time / (1.0 - time) / RAY_COST / (1.0 - share)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Simulates samples that allow records of 300 rays, each of which serves the share `serves` of
    /// the remaining samples. Returns the share of work in records, and of samples served.
    fn simulate(samples: u64, serves: f64) -> (f64, f64) {
        let effort = Effort::unlimited();
        effort.set(16, true);
        let (mut unserved, mut found, mut rays) = (1.0_f64, 0, 0);
        for i in 0..samples {
            // A low-discrepancy coin.
            if (i as f64 * 0.618_034).fract() >= unserved {
                effort.add_served();
                found += 1;
            } else if let Some(_begun) = effort.begin_record() {
                effort.add_rays(300);
                rays += 300;
                unserved *= 1.0 - serves;
            }
        }
        let work = rays as f64 * RAY_COST;
        (work / (work + samples as f64), found as f64 / samples as f64)
    }

    #[test]
    fn records_that_serve_much_are_made_soon() {
        // A record takes the work of 120 samples. With a share of 30 % of the work, the share of
        // unserved samples falls to 1/e within 14,000 samples.
        let (work, served) = simulate(200_000, 0.02);
        assert!(served > 0.8 && work < FIRST_SHARE, "{work} {served}");
    }

    #[test]
    fn records_that_serve_little_take_little_work() {
        let (work, served) = simulate(100_000, 1e-5);
        assert!(work < 1.05 * FIRST_SHARE && served < 0.02, "{work} {served}");
    }

    #[test]
    fn use_decides_between() {
        let shares: Vec<(f64, f64)> =
            [3e-5, 3e-4, 3e-3].map(|serves| simulate(300_000, serves)).to_vec();
        assert!(shares.is_sorted_by(|a, b| a.1 < b.1), "{shares:?}");
        for (work, served) in shares {
            assert!(work < (SERVED_WORTH * served).max(FIRST_SHARE) + 0.05, "{work} {served}");
        }
    }

    #[test]
    fn records_without_end_take_half_the_share_of_time_that_they_serve() {
        let effort = Effort::unlimited();
        effort.set(16, true);
        let (samples, serve, rays) = (300_000_u32, 0.8, 300);
        let mut made = 0;
        for i in 0..samples {
            // Clutter: each record serves a place of its own, so the share served never grows.
            if (f64::from(i) * 0.618_034).fract() < serve {
                effort.add_served();
            } else if let Some(_begun) = effort.begin_record() {
                effort.add_rays(rays);
                made += 1;
            }
        }
        let work = f64::from(made * rays) * RAY_COST;
        let time = work / (work + f64::from(samples));
        assert!((time - 0.4).abs() < 0.02, "{time}");
    }

    #[test]
    fn an_effort_that_is_not_measured_is_kept() {
        let effort = Effort::unlimited();
        assert!(effort.begin_record().is_some());
        effort.set(2, false);
        let made = (0..3000).filter(|_| {
            let begun = effort.begin_record();
            if begun.is_some() {
                effort.add_rays(300);
            }
            begun.is_some()
        });
        assert_eq!(made.count(), 20);
        effort.set(0, false);
        effort.add_rays(10_000);
        assert!((0..1000).all(|_| effort.begin_record().is_none()));
    }

    #[test]
    fn a_record_that_is_being_made_counts() {
        let effort = Effort::unlimited();
        let unlimited = effort.begin_record();
        effort.set(2, false);
        let first = effort.begin_record();
        assert!(first.is_some());
        assert!((0..1000).all(|_| effort.begin_record().is_none()));
        // Rays are counted as they are traced, even if the limit changed meanwhile.
        effort.add_rays(300);
        drop((first, unlimited));
        assert!(effort.begin_record().is_some());
    }
}
