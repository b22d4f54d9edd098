//! Limits the work on records: to a given number of rays for each sample that lacks a record, or to
//! the number that makes the error of samples fall fastest. In the second case, it also determines
//! the [grade](holo_light::Record::grade) of records. Without grades, a fill of ten minutes would
//! show the error of its records, however many samples it had.
//!
//! Invariant: the rays of records never exceed the number that samples have allowed by more than
//! the records that are being made. A record counts from its beginning, so that few are made at
//! once. No clock decides: work is counted in rays and samples.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use holo_light::{MAX_GRADE, Store};

use super::settings::{
    COVERED, DECAYS, GRADE_COST, MEASURED, RAY_COST, REFINING, SERVED_WORTH, UNLIMITED, WINDOW,
};

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
    /// Samples that are no longer in these two counts.
    earlier: AtomicU64,
    /// Grade of the records that are made.
    grade: AtomicU32,
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
            earlier: AtomicU64::default(),
            grade: AtomicU32::default(),
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

    /// Returns the grade of records that samples need, and that new ones get. Nobody who waits has
    /// time for more than 0.
    #[inline]
    pub fn grade(&self, store: &Store) -> u32 {
        match self.limit.load(Ordering::Relaxed) {
            MEASURED => self.grade.load(Ordering::Relaxed).max(store.grade()),
            _ => 0,
        }
    }

    /// Counts a sample that found records.
    #[inline]
    pub fn add_served(&self, store: &Store) {
        if self.limit.load(Ordering::Relaxed) != UNLIMITED {
            let served = self.served.fetch_add(1, Ordering::Relaxed) + 1;
            if served >= WINDOW {
                self.end_window(served, self.lacking.load(Ordering::Relaxed), store);
            }
        }
    }

    /// Counts a sample that lacks a record. `Some` if it may make one: a value to keep until the
    /// record is made.
    pub fn begin_record(&self, store: &Store) -> Option<Begun<'_>> {
        let limit = self.limit.load(Ordering::Relaxed);
        if limit == UNLIMITED {
            return Some(Begun { effort: self, rays: 0 });
        }
        let lacking = self.lacking.fetch_add(1, Ordering::Relaxed) + 1;
        let served = self.served.load(Ordering::Relaxed);
        if served + lacking >= WINDOW {
            self.end_window(served, lacking, store);
        }
        let rays = match limit {
            MEASURED if self.grade(store) > 0 => REFINING / RAY_COST,
            MEASURED => {
                let share = lacking as f64 / (served + lacking) as f64;
                let all_rays = store.rays();
                if served + lacking >= WINDOW / 2
                    && all_rays >= self.next_measured.load(Ordering::Relaxed)
                {
                    self.measure_decay(share, all_rays);
                }
                rays_per_lacking(share, f64::from_bits(self.decay.load(Ordering::Relaxed)))
            }
            rays => f64::from(rays),
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

    /// Halves the counts, and begins the next grade once that is due.
    #[cold]
    fn end_window(&self, served: u64, lacking: u64, store: &Store) {
        // Other threads may count meanwhile. Counts that are lost in between are small compared
        // with the window.
        self.served.store(served / 2, Ordering::Relaxed);
        self.lacking.store(lacking / 2, Ordering::Relaxed);
        let counted = (served + lacking) / 2;
        let earlier = self.earlier.fetch_add(counted, Ordering::Relaxed) + counted;
        let grade = self.grade(store);
        let is_covered = (lacking as f64) < COVERED * (served + lacking) as f64;
        // At most, all rays so far were for this grade.
        let cost = RAY_COST * GRADE_COST * store.rays() as f64;
        if grade < MAX_GRADE && is_covered && cost < REFINING * earlier as f64 {
            self.grade.store(grade + 1, Ordering::Relaxed);
            self.served.store(0, Ordering::Relaxed);
            self.lacking.store(0, Ordering::Relaxed);
        }
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
    use bytemuck::Zeroable;
    use holo_light::Record;

    /// Rays of a record.
    const RAYS: u32 = 300;

    /// Returns an empty store.
    fn store() -> Store {
        Store::new(0.01)
    }

    /// Adds a record that serves nothing but counts.
    fn add_record(effort: &Effort, store: &Store, grade: u32) {
        let rays = RAYS << (3 * grade);
        effort.add_rays(rays);
        assert!(store.receive(Record {
            point: [store.len() as f32, 0.0, 0.0],
            normal: [0.0, 0.0, 1.0],
            radius: 0.1,
            rays,
            flags: grade << 8,
            id: store.len() as u64,
            ..Record::zeroed()
        }));
    }

    /// Simulates samples that allow records, of which record `n` (from 0) serves the share
    /// `serves(n)` of the samples that lacked one. Returns the share of work in records, and of
    /// samples served.
    fn simulate(samples: u32, serves: impl Fn(u32) -> f64) -> (f64, f64) {
        let (effort, store) = (Effort::unlimited(), store());
        effort.set(MEASURED);
        let (mut unserved, mut found, mut made) = (1.0_f64, 0, 0);
        for i in 0..samples {
            // A low-discrepancy coin.
            if (f64::from(i) * 0.618_034).fract() >= unserved {
                effort.add_served(&store);
                found += 1;
            } else if let Some(_begun) = effort.begin_record(&store) {
                add_record(&effort, &store, 0);
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
        let (effort, store) = (Effort::unlimited(), store());
        effort.set(MEASURED);
        (0..1000).for_each(|_| add_record(&Effort::unlimited(), &store, 0));
        for i in 0..3_000_000 {
            let share = 0.5 * (1000.0 / store.len() as f64).sqrt();
            if (f64::from(i) * 0.618_034).fract() >= share {
                effort.add_served(&store);
            } else if let Some(_begun) = effort.begin_record(&store) {
                add_record(&effort, &store, 0);
            }
        }
        assert!(store.len() > 2000);
        let decay = f64::from_bits(effort.decay.load(Ordering::Relaxed));
        assert!((decay - 0.5).abs() < 0.05, "{decay}");
    }

    #[test]
    fn covered_surfaces_are_refined_in_a_small_share_of_time() {
        // 100 records of each grade cover everything.
        let (effort, store) = (Effort::unlimited(), store());
        effort.set(MEASURED);
        let mut made = [0; MAX_GRADE as usize + 1];
        let mut refined = vec![];
        for i in 0..120_000_000_u32 {
            let grade = effort.grade(&store);
            let share = 1.0 - f64::from(made[grade as usize]) / 100.0;
            if (f64::from(i) * 0.618_034).fract() >= share {
                effort.add_served(&store);
            } else if let Some(_begun) = effort.begin_record(&store) {
                if made[grade as usize] == 0 && grade > 0 {
                    refined.push(f64::from(i) / store.rays() as f64);
                }
                add_record(&effort, &store, grade);
                made[grade as usize] += 1;
            }
        }
        assert!(made.iter().all(|&made| f64::from(made) >= 100.0 * (1.0 - COVERED)), "{made:?}");
        let least = RAY_COST * GRADE_COST / REFINING;
        assert!(refined.iter().all(|&samples| samples > least), "{refined:?}");
        let work = RAY_COST * store.rays() as f64;
        assert!(work < REFINING * 120e6, "{work}");
    }

    #[test]
    fn nobody_who_waits_refines_and_clutter_is_not_refined() {
        for (limit, served) in [(2, 100), (MEASURED, 90)] {
            let (effort, store) = (Effort::unlimited(), store());
            effort.set(limit);
            (0..10).for_each(|_| add_record(&effort, &store, 0));
            for i in 0..1_000_000 {
                if i % 100 < served {
                    effort.add_served(&store);
                } else {
                    let _ = effort.begin_record(&store);
                }
            }
            assert_eq!(effort.grade(&store), 0);
        }
        // A fill that goes on makes records as exact as those that are there.
        let (effort, store) = (Effort::unlimited(), store());
        add_record(&effort, &store, 2);
        assert_eq!(effort.grade(&store), 0);
        effort.set(MEASURED);
        assert_eq!(effort.grade(&store), 2);
    }

    #[test]
    fn an_effort_that_is_not_measured_is_kept() {
        let (effort, store) = (Effort::unlimited(), store());
        assert!(effort.begin_record(&store).is_some());
        effort.set(2);
        let made = (0..3000).filter(|_| {
            let begun = effort.begin_record(&store);
            if begun.is_some() {
                effort.add_rays(300);
            }
            begun.is_some()
        });
        assert_eq!(made.count(), 20);
        effort.set(0);
        effort.add_rays(10_000);
        assert!((0..1000).all(|_| effort.begin_record(&store).is_none()));
    }

    #[test]
    fn a_record_that_is_being_made_counts() {
        let (effort, store) = (Effort::unlimited(), store());
        let unlimited = effort.begin_record(&store);
        effort.set(2);
        let first = effort.begin_record(&store);
        assert!(first.is_some());
        assert!((0..1000).all(|_| effort.begin_record(&store).is_none()));
        // Rays are counted as they are traced, even if the limit changed meanwhile.
        effort.add_rays(300);
        drop((first, unlimited));
        assert!(effort.begin_record(&store).is_some());
    }
}
