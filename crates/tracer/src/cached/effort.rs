//! Limits the work on records: to a given number of rays for each sample that lacks a record, or to
//! the number that makes the error of samples fall fastest.
//!
//! Invariant: the rays of records never exceed the number that samples have allowed by more than
//! the records that are being made. A record counts from its beginning, so that few are made at
//! once. No clock decides: work is counted in rays and samples.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use super::settings::{DECAYS, MEASURED, RAY_COST, SERVED_WORTH, UNLIMITED, WINDOW};

/// Fraction bits of [`Effort::allowed`].
const FRACTION: u32 = 8;

/// Rays that a record counts for while it is being made, as its number is not known yet. Without
/// them, all threads would begin records at a program's first moment, and the first samples would
/// wait for them.
const EXPECTED_RAYS: u64 = 4096;

/// The effort of one tracer, shared by its threads.
#[derive(Debug)]
pub(super) struct Effort {
    /// Rays of records for each sample that lacks a record, [`MEASURED`] or [`UNLIMITED`].
    limit: AtomicU32,
    /// Samples that found records, of the latest [`WINDOW`] or more.
    served: AtomicU64,
    /// Samples that did not.
    lacking: AtomicU64,
    /// The moment for which [`Effort::decay`] was measured last.
    measured: Mutex<Measured>,
    /// Rays of all records at which it is measured again.
    next_measured: AtomicU64,
    /// The exponent d if the share of samples that lack a record falls like rays^-d, as the bits of
    /// an `f64`. 1 until it is measured.
    decay: AtomicU64,
    /// Rays of records that samples have allowed so far, with [`FRACTION`] bits.
    allowed: AtomicU64,
    /// Rays of records that have been traced, and [`EXPECTED_RAYS`] for each record that is being
    /// made.
    traced: AtomicU64,
}

/// What records had cost and achieved at one moment.
#[derive(Clone, Copy, Debug, Default)]
struct Measured {
    /// Rays of all records, also of those that other processes made. 0 if nothing was measured yet.
    rays: u64,
    /// Share of the samples that lacked a record.
    lacking: f64,
}

impl Effort {
    pub fn unlimited() -> Effort {
        Effort {
            limit: AtomicU32::new(UNLIMITED),
            served: AtomicU64::default(),
            lacking: AtomicU64::default(),
            measured: Mutex::default(),
            next_measured: AtomicU64::new(1),
            decay: AtomicU64::new(1.0_f64.to_bits()),
            allowed: AtomicU64::default(),
            traced: AtomicU64::default(),
        }
    }

    pub fn set(&self, limit: u32) {
        self.limit.store(limit, Ordering::Relaxed);
    }

    /// Counts rays of records.
    pub fn add_rays(&self, rays: u32) {
        self.traced.fetch_add(rays.into(), Ordering::Relaxed);
    }

    /// Counts a sample that found records.
    #[inline]
    pub fn add_served(&self) {
        if self.limit.load(Ordering::Relaxed) != UNLIMITED {
            self.served.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Counts a sample that lacks a record, while all records that there are have `all_rays` rays.
    /// `Some` if it may make one: a value to keep until the record is made.
    pub fn begin_record(&self, all_rays: u64) -> Option<Begun<'_>> {
        let limit = self.limit.load(Ordering::Relaxed);
        if limit == UNLIMITED {
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
        let rays = if limit == MEASURED {
            let share = lacking as f64 / (served + lacking) as f64;
            if served + lacking >= WINDOW / 2
                && all_rays >= self.next_measured.load(Ordering::Relaxed)
            {
                self.measure_decay(share, all_rays);
            }
            rays_per_lacking(share, f64::from_bits(self.decay.load(Ordering::Relaxed)))
        } else {
            f64::from(limit)
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

    /// Measures [`decay`](Self::decay) again, as is done whenever the rays of all records have
    /// doubled.
    fn measure_decay(&self, lacking: f64, rays: u64) {
        // Another thread may be measuring, or may just have done it.
        if let Ok(mut last) = self.measured.try_lock()
            && rays >= 2 * last.rays
        {
            if last.rays > 0 {
                let more = rays as f64 / last.rays as f64;
                let decay = (last.lacking / lacking).ln() / more.ln();
                let [least, most] = DECAYS;
                self.decay.store(decay.clamp(least, most).to_bits(), Ordering::Relaxed);
            }
            *last = Measured { rays, lacking };
            self.next_measured.store(2 * rays, Ordering::Relaxed);
        }
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

/// Returns the rays of records that each sample without a record allows, from the share of samples
/// that lack a record, and from the [decay](Effort::decay) of that share.
///
/// Let u be the share, d its decay, and w the part of a sample's variance that a record removes
/// ([`SERVED_WORTH`]). N samples and r rays take the time N + c r ([`RAY_COST`] is c), and the
/// error is (1 - w (1 - u)) / N. For a given time, it is least if
/// c r / N = w d u / (1 - w (1 - u)). The r rays are divided among the N u samples that lack a
/// record.
///
/// So a room of large surfaces has its records soon. In clutter, further records serve few samples,
/// and paths lower the error faster.
fn rays_per_lacking(lacking: f64, decay: f64) -> f64 {
    SERVED_WORTH * decay / (1.0 - SERVED_WORTH * (1.0 - lacking)) / RAY_COST
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rays of a record.
    const RAYS: u32 = 300;

    /// Simulates samples that allow records, of which record `n` (from 0) serves the share
    /// `serves(n)` of the samples that lacked one. Returns the share of work in records, and of
    /// samples served.
    fn simulate(samples: u32, serves: impl Fn(u32) -> f64) -> (f64, f64) {
        let effort = Effort::unlimited();
        effort.set(MEASURED);
        let (mut unserved, mut found, mut made) = (1.0_f64, 0, 0);
        for i in 0..samples {
            // A low-discrepancy coin.
            if (f64::from(i) * 0.618_034).fract() >= unserved {
                effort.add_served();
                found += 1;
            } else if let Some(_begun) = effort.begin_record(u64::from(made * RAYS)) {
                effort.add_rays(RAYS);
                unserved *= 1.0 - serves(made);
                made += 1;
            }
        }
        let work = f64::from(made * RAYS) * RAY_COST;
        (work / (work + f64::from(samples)), f64::from(found) / f64::from(samples))
    }

    /// Returns the error over that of paths alone, for the same work.
    fn error((work, served): (f64, f64)) -> f64 {
        (1.0 - SERVED_WORTH * served) / (1.0 - work)
    }

    #[test]
    fn records_that_serve_much_are_made_soon() {
        // A record takes the work of 120 samples.
        let (work, served) = simulate(200_000, |_| 0.02);
        assert!(served > 0.8 && work < 0.1, "{work} {served}");
    }

    #[test]
    fn records_that_serve_nothing_take_ever_less_work() {
        let [(early, _), (late, _)] =
            [100_000, 3_000_000].map(|samples| simulate(samples, |_| 0.0));
        assert!(early < 0.25 && late < 0.06, "{early} {late}");
    }

    #[test]
    fn records_in_endless_clutter_take_little_work() {
        // 60 % of the samples find a record soon. Each further record serves a place of its own.
        let (work, served) = simulate(3_000_000, |made| if made < 100 { 0.009 } else { 0.0 });
        assert!(served > 0.55 && work < 0.05, "{work} {served}");
    }

    /// Returns the error of the best number of records, all made before the first sample.
    fn least_error(samples: u32, serves: impl Fn(u32) -> f64) -> f64 {
        let (mut unserved, mut least) = (1.0, 1.0_f64);
        let most = (f64::from(samples) / (f64::from(RAYS) * RAY_COST)) as u32;
        for made in 0..most {
            let work = f64::from(made * RAYS) * RAY_COST / f64::from(samples);
            least = least.min(error((work, 1.0 - unserved)));
            unserved *= 1.0 - serves(made);
        }
        least
    }

    #[test]
    fn the_error_is_near_the_least_whatever_records_serve() {
        // Constant allowances of 0.1, 0.3, 1 and 3 rays are each more than a quarter above the
        // least error for the first or the third of these.
        let serving: [&dyn Fn(u32) -> f64; 6] = [
            &|_| 0.0,
            &|_| 3e-4,
            &|_| 3e-3,
            &|_| 0.02,
            &|made| 0.1 / f64::from(made + 1),
            &|made| 0.3 / f64::from(made + 1),
        ];
        for serves in serving {
            let samples = 1_000_000;
            let (found, least) = (error(simulate(samples, serves)), least_error(samples, serves));
            assert!(found < 1.25 * least, "{found} {least}");
        }
    }

    #[test]
    fn decay_is_measured_over_the_records_of_everyone() {
        // The share that lacks a record falls like the root of rays. 1000 records are there before.
        let effort = Effort::unlimited();
        effort.set(MEASURED);
        let mut all_rays = 1000 * u64::from(RAYS);
        let first = all_rays as f64;
        for i in 0..3_000_000 {
            if (f64::from(i) * 0.618_034).fract() >= 0.5 * (first / all_rays as f64).sqrt() {
                effort.add_served();
            } else if let Some(_begun) = effort.begin_record(all_rays) {
                effort.add_rays(RAYS);
                all_rays += u64::from(RAYS);
            }
        }
        assert!(all_rays as f64 > 2.0 * first);
        let decay = f64::from_bits(effort.decay.load(Ordering::Relaxed));
        assert!((decay - 0.5).abs() < 0.05, "{decay}");
    }

    #[test]
    fn an_effort_that_is_not_measured_is_kept() {
        let effort = Effort::unlimited();
        assert!(effort.begin_record(0).is_some());
        effort.set(2);
        let made = (0..3000).filter(|_| {
            let begun = effort.begin_record(0);
            if begun.is_some() {
                effort.add_rays(300);
            }
            begun.is_some()
        });
        assert_eq!(made.count(), 20);
        effort.set(0);
        effort.add_rays(10_000);
        assert!((0..1000).all(|_| effort.begin_record(0).is_none()));
    }

    #[test]
    fn a_record_that_is_being_made_counts() {
        let effort = Effort::unlimited();
        let unlimited = effort.begin_record(0);
        effort.set(2);
        let first = effort.begin_record(0);
        assert!(first.is_some());
        assert!((0..1000).all(|_| effort.begin_record(0).is_none()));
        // Rays are counted as they are traced, even if the limit changed meanwhile.
        effort.add_rays(300);
        drop((first, unlimited));
        assert!(effort.begin_record(0).is_some());
    }
}
