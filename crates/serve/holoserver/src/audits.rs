//! Packets that a second worker traces again, and whether the two return the same.
//!
//! Both trace the same rays, so they must hit the same surfaces. Their radiances may be noisy. For
//! each ray, the difference of the two radiances is divided by their sum. The quotient lies between
//! -1 and 1. If both workers are right, its expectation is 0, whatever the noise. So the mean over
//! many rays shows a worker whose light is too bright or too dim.
//!
//! Invariants:
//! - A worker cannot know which of its packets are traced again.
//! - A worker is found broken only if two others differ from it, and most that were compared with
//!   it do. A machine that comes back again and again is one other.
//! - Comparisons outlive connections. A worker that comes back has those that it had.

use std::{
    collections::{BTreeMap, HashMap},
    fmt,
    hash::{BuildHasher, RandomState},
};

use holo_beamfile::Maker;
use holo_section::Sample;

use crate::worker_id::WorkerId;

/// One in this many packets is traced again: 1.6 % of the work.
const AUDITED: u64 = 64;

/// One in this many packets of a worker that was hardly compared is traced again.
const AUDITED_FIRST: u64 = 8;

/// Workers that trace a worker's packets again. Each worker also checks as many others, so it takes
/// part in four comparisons. Two broken machines next to it do not make it look broken.
const CHECKERS: usize = 2;

/// Packets that wait for one checker, at most.
const MAX_WAITING: usize = 64;

/// Most pairs of workers that are remembered. The pair with the fewest rays gives way.
const MAX_PAIRS: usize = 1 << 14;

/// Rays that two workers have both traced before they are compared.
const ENOUGH_RAYS: u64 = 500;

/// The largest share of rays that may hit something else. Processors round differently, which moves
/// a ray in some ten thousand past an edge.
const MOST_MOVED: f64 = 0.02;

/// The largest mean difference of radiances, as a share of their sum, beyond noise.
const MOST_DIFFERENCE: f64 = 0.05;

/// Standard errors of the mean difference that count as noise.
const NOISE: f64 = 5.0;

/// A packet that is traced again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Audit {
    /// Who traced it first.
    pub first: WorkerId,
    /// Who traces it again.
    pub checker: WorkerId,
    number: u64,
}

/// A difference between a worker's samples and those of others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SampleDifference {
    /// The share of its rays that hit something else.
    Moved(f64),
    /// Its radiance in one channel, as a multiple of others'.
    Light(&'static str, f64),
}

impl fmt::Display for SampleDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SampleDifference::Moved(share) => {
                write!(f, "{:.1} % of its rays hit something else than others'", 100.0 * share)
            }
            SampleDifference::Light(channel, factor) => {
                write!(f, "its {channel} light is {factor:.2} times that of others")
            }
        }
    }
}

/// What a comparison shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AuditVerdict {
    /// This worker is broken.
    Broken(WorkerId, SampleDifference),
    /// Two workers differ, and it is unknown which one is wrong. The difference is stated for the
    /// first.
    Undecided(WorkerId, WorkerId, SampleDifference),
}

/// All comparisons.
#[derive(Debug, Default)]
pub struct Audits {
    /// Decides which packets are traced again.
    secret: RandomState,
    last: u64,
    /// The samples of those who traced packets first, by the audit's number.
    waiting: HashMap<u64, (Audit, Vec<Sample>)>,
    /// By the two workers, the smaller number first.
    pairs: BTreeMap<(WorkerId, WorkerId), Tally>,
    /// Rays of each worker that were compared.
    compared: BTreeMap<WorkerId, u64>,
}

impl Audits {
    /// Decides whether a packet is traced again, and which worker does it. `others` are the workers
    /// that could, in the order of their numbers.
    pub fn begin(
        &mut self,
        packet: u64,
        first: WorkerId,
        samples: &[Sample],
        others: impl Fn() -> Vec<WorkerId>,
    ) -> Option<Audit> {
        let compared = self.compared.get(&first).copied().unwrap_or(0);
        let is_new = compared < CHECKERS as u64 * ENOUGH_RAYS;
        let one_in = if is_new { AUDITED_FIRST } else { AUDITED };
        if !self.secret.hash_one(packet).is_multiple_of(one_in) {
            return None;
        }
        // The next ones in a ring, so that the same two workers meet often.
        let mut ring: Vec<WorkerId> = others().into_iter().filter(|id| *id != first).collect();
        let after = ring.partition_point(|id| *id < first);
        ring.rotate_left(after);
        ring.truncate(CHECKERS);
        let waits =
            |id: WorkerId| self.waiting.values().filter(|(audit, _)| audit.checker == id).count();
        // The one with the fewest comparisons with `first` so far.
        let checker = ring.into_iter().min_by_key(|&id| {
            self.pairs.get(&pair(first, id)).map_or(0, |tally| tally.rays) + 21 * waits(id) as u64
        })?;
        if waits(checker) >= MAX_WAITING {
            return None;
        }
        self.last += 1;
        let audit = Audit { first, checker, number: self.last };
        self.waiting.insert(audit.number, (audit, samples.to_vec()));
        Some(audit)
    }

    /// Takes the samples of whoever traced a packet again; `None` if it says that the beam sees
    /// nothing. `noise` is the engine's own error, relative.
    pub fn finish(
        &mut self,
        audit: Audit,
        again: Option<&[Sample]>,
        noise: f64,
    ) -> Option<AuditVerdict> {
        let (_, before) = self.waiting.remove(&audit.number)?;
        let key = pair(audit.first, audit.checker);
        self.make_room(key);
        *self.compared.entry(audit.first).or_default() += before.len() as u64;
        let tally = self.pairs.entry(key).or_default();
        // Counted from the first of the pair.
        let sign = if key.0 == audit.first { 1.0 } else { -1.0 };
        match again {
            Some(again) => {
                before.iter().zip(again).for_each(|(a, b)| tally.compare(a, b, sign));
            }
            None => before.iter().for_each(|sample| tally.moved(hits(sample))),
        }
        let difference = tally.difference(noise)?;
        let broken = [key.0, key.1].into_iter().find_map(|worker| self.broken(worker, noise));
        Some(broken.unwrap_or(AuditVerdict::Undecided(key.0, key.1, difference)))
    }

    /// Returns how a worker differs from others, if most that were compared with it say so. All
    /// workers of another machine have one vote.
    fn broken(&self, worker: WorkerId, noise: f64) -> Option<AuditVerdict> {
        let mut votes: BTreeMap<WorkerId, Option<SampleDifference>> = BTreeMap::new();
        for ((first, second), tally) in &self.pairs {
            let other = if *first == worker { *second } else { *first };
            if (*first != worker && *second != worker) || tally.rays < ENOUGH_RAYS {
                continue;
            }
            let difference = tally.difference(noise).map(|difference| match *first == worker {
                true => difference,
                false => difference.of_the_other(),
            });
            let is_apart = other.maker != worker.maker && other.maker != Maker::UNKNOWN;
            let voter = if is_apart { WorkerId { seat: 0, ..other } } else { other };
            let vote = votes.entry(voter).or_default();
            *vote = vote.or(difference);
        }
        let differ: Vec<SampleDifference> = votes.values().copied().flatten().collect();
        let is_broken = differ.len() >= 2 && 2 * differ.len() > votes.len();
        is_broken.then(|| AuditVerdict::Broken(worker, differ[0]))
    }

    /// Makes room for a pair that is not known yet.
    fn make_room(&mut self, key: (WorkerId, WorkerId)) {
        if self.pairs.len() < MAX_PAIRS || self.pairs.contains_key(&key) {
            return;
        }
        let fewest = self.pairs.iter().min_by_key(|(_, tally)| tally.rays);
        if let Some(key) = fewest.map(|(&key, _)| key) {
            self.pairs.remove(&key);
            // A worker whose pairs are forgotten is new again.
            self.compared.retain(|id, _| *id != key.0 && *id != key.1);
        }
    }

    /// Takes note that a worker has left: it checks no packets. Its own are still checked, so that
    /// nobody evades that by leaving.
    pub fn left(&mut self, worker: WorkerId) {
        self.waiting.retain(|_, (audit, _)| audit.checker != worker);
    }

    /// Forgets the comparisons with all workers of a machine that was found broken.
    pub fn forget(&mut self, maker: Maker) {
        self.pairs.retain(|(a, b), _| a.maker != maker && b.maker != maker);
        self.compared.retain(|id, _| id.maker != maker);
    }
}

impl SampleDifference {
    /// Returns the difference as a sentence about two workers that accuses neither.
    pub fn between(&self, first: &str, second: &str) -> String {
        match self {
            SampleDifference::Moved(share) => {
                format!("{:.1} % of the same rays hit something else", 100.0 * share)
            }
            SampleDifference::Light(channel, factor) => {
                format!("the {channel} light of {first} is {factor:.2} times that of {second}")
            }
        }
    }

    /// Returns the same difference from the view of the other worker.
    fn of_the_other(self) -> SampleDifference {
        match self {
            SampleDifference::Moved(share) => SampleDifference::Moved(share),
            SampleDifference::Light(channel, factor) => {
                SampleDifference::Light(channel, 1.0 / factor)
            }
        }
    }
}

fn pair(a: WorkerId, b: WorkerId) -> (WorkerId, WorkerId) {
    (a.min(b), a.max(b))
}

fn hits(sample: &Sample) -> bool {
    sample.distance(1.0).is_finite()
}

/// The comparison of two workers over the rays that both have traced.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    rays: u64,
    /// Rays of different positions or distances.
    moved: u64,
    /// Differences of radiances divided by their sums, by channel: their sum, and that of their
    /// squares.
    sum: [f64; 3],
    squares: [f64; 3],
}

impl Tally {
    fn compare(&mut self, a: &Sample, b: &Sample, sign: f64) {
        // Rounding may move a distance to the next code.
        let is_near = a.distance_code().abs_diff(b.distance_code()) <= 1 && hits(a) == hits(b);
        self.moved(a.coords != b.coords || !is_near);
        for ((sum, squares), (a, b)) in
            self.sum.iter_mut().zip(&mut self.squares).zip(a.rgb().into_iter().zip(b.rgb()))
        {
            let (a, b) = (f64::from(a), f64::from(b));
            if a + b > 0.0 {
                let difference = sign * (a - b) / (a + b);
                *sum += difference;
                *squares += difference * difference;
            }
        }
    }

    fn moved(&mut self, is_moved: bool) {
        self.rays += 1;
        self.moved += u64::from(is_moved);
    }

    /// Returns how the first worker's samples differ from the second's, if they do.
    fn difference(&self, noise: f64) -> Option<SampleDifference> {
        if self.rays < ENOUGH_RAYS {
            return None;
        }
        let rays = self.rays as f64;
        let moved = self.moved as f64 / rays;
        if moved > MOST_MOVED {
            return Some(SampleDifference::Moved(moved));
        }
        let channels = ["red", "green", "blue"].into_iter().zip(self.sum.iter().zip(self.squares));
        channels.into_iter().find_map(|(channel, (sum, squares))| {
            let mean = sum / rays;
            let error = ((squares / rays - mean * mean).max(0.0) / rays).sqrt();
            let is_different = mean.abs() > MOST_DIFFERENCE + noise + NOISE * error;
            let factor = (1.0 + mean) / (1.0 - mean).max(1e-6);
            is_different.then_some(SampleDifference::Light(channel, factor))
        })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU16, Ordering};

    use holo_section::RayCoords;

    use super::*;

    /// A worker of a test: how it changes a ray's light, and every so many rays a distance.
    #[derive(Clone, Copy)]
    struct Machine {
        gain: f32,
        moves: u64,
    }

    /// Returns a worker of a machine of its own.
    fn next() -> WorkerId {
        static NEXT: AtomicU16 = AtomicU16::new(1);
        WorkerId { maker: Maker(NEXT.fetch_add(1, Ordering::Relaxed)), seat: 0 }
    }

    const SOUND: Machine = Machine { gain: 1.0, moves: u64::MAX };

    /// A generator of random numbers.
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 40) as f32 / (1 << 24) as f32
        }
    }

    impl Machine {
        /// Returns its samples of a packet: distances by the packet, light of one noisy path.
        fn trace(self, packet: u64, random: &mut Random) -> Vec<Sample> {
            let sample = |ray: u64| {
                // Most paths find little light, and some much.
                let light = self.gain * random.next().powi(-1).min(500.0);
                let moved = u16::from((packet * 21 + ray).is_multiple_of(self.moves)) * 300;
                let distance = (packet * 7 + ray * 131) as u16 % 2000 + moved;
                let rgb = [light, light * 0.5, light * 0.1];
                let rgbe = holo_section::rgbe::encode(rgb, (random.next() * 4e9) as u32);
                Sample::from_codes(RayCoords::default(), rgbe, distance)
            };
            (0..21).map(sample).collect()
        }
    }

    /// Has workers trace so many packets each. Returns them, and the first verdict.
    fn session(machines: &[Machine], packets: u64) -> (Vec<WorkerId>, Vec<AuditVerdict>) {
        let ids: Vec<WorkerId> = machines.iter().map(|_| next()).collect();
        let verdicts = session_of(&ids, machines, packets);
        (ids, verdicts)
    }

    /// As [`session`], with these workers.
    fn session_of(ids: &[WorkerId], machines: &[Machine], packets: u64) -> Vec<AuditVerdict> {
        let (mut audits, mut random, mut verdicts) = (Audits::default(), Random(7), Vec::new());
        for packet in 0..packets * machines.len() as u64 {
            let at = (packet % machines.len() as u64) as usize;
            let samples = machines[at].trace(packet, &mut random);
            let Some(audit) = audits.begin(packet, ids[at], &samples, || ids.to_vec()) else {
                continue;
            };
            assert!(audit.first == ids[at] && audit.checker != ids[at]);
            let checker = ids.iter().position(|id| *id == audit.checker).unwrap();
            let again = machines[checker].trace(packet, &mut random);
            verdicts.extend(audits.finish(audit, Some(&again), 0.0));
        }
        verdicts
    }

    #[test]
    fn two_workers_of_a_lying_machine_do_not_make_a_sound_one_look_broken() {
        let (sound, liar) = (next(), next());
        let ids = [sound, liar, WorkerId { seat: 1, ..liar }];
        let lies = Machine { gain: 4.0, ..SOUND };
        let verdicts = session_of(&ids, &[SOUND, lies, lies], 20_000);
        assert!(!verdicts.is_empty());
        let is_broken = |verdict: &AuditVerdict| matches!(verdict, AuditVerdict::Broken(..));
        assert!(!verdicts.iter().any(is_broken), "{:?}", verdicts.iter().find(|v| is_broken(v)));
    }

    #[test]
    fn sound_workers_are_never_told_apart_however_noisy_their_light_is() {
        for workers in 1..6 {
            let (_, verdicts) = session(&vec![SOUND; workers], 20_000);
            assert!(verdicts.is_empty(), "{workers}: {verdicts:?}");
        }
    }

    #[test]
    fn a_machine_whose_light_is_dim_or_whose_rays_miss_is_found_among_three_and_among_nine() {
        let dim = Machine { gain: 0.5, ..SOUND };
        let astray = Machine { moves: 15, ..SOUND };
        for workers in [3, 9] {
            for (broken, moves) in [(dim, false), (astray, true)] {
                let mut machines = vec![SOUND; workers];
                machines[1] = broken;
                let (ids, verdicts) = session(&machines, 20_000);
                let found = verdicts.iter().find_map(|verdict| match verdict {
                    AuditVerdict::Broken(id, difference) => Some((*id, *difference)),
                    AuditVerdict::Undecided(..) => None,
                });
                let (id, difference) = found.expect("somebody is broken");
                assert_eq!(id, ids[1]);
                match difference {
                    SampleDifference::Moved(share) => assert!(moves && share < 0.2, "{share}"),
                    SampleDifference::Light(_, factor) => {
                        assert!(!moves && factor < 0.8, "{factor}")
                    }
                }
            }
        }
    }

    #[test]
    fn of_two_workers_that_differ_neither_is_called_broken() {
        let (ids, verdicts) = session(&[SOUND, Machine { gain: 3.0, ..SOUND }], 20_000);
        assert!(!verdicts.is_empty());
        for verdict in verdicts {
            let AuditVerdict::Undecided(a, b, SampleDifference::Light("red", factor)) = verdict
            else {
                panic!("{verdict:?}");
            };
            assert!((a, b) == (ids[0], ids[1]) && factor < 0.7, "{factor}");
        }
    }

    #[test]
    fn an_error_that_the_engine_allows_is_none() {
        let (first, second) = (next(), next());
        let (mut audits, mut random) = (Audits::default(), Random(1));
        let bright = Machine { gain: 1.4, ..SOUND };
        let mut verdicts = [0; 2];
        for packet in 0..40_000 {
            let samples = SOUND.trace(packet, &mut random);
            if let Some(audit) = audits.begin(packet, first, &samples, || vec![second]) {
                let again = bright.trace(packet, &mut random);
                let noise = if packet < 20_000 { 0.25 } else { 0.0 };
                let verdict = audits.finish(audit, Some(&again), noise);
                verdicts[usize::from(packet >= 20_000)] += usize::from(verdict.is_some());
            }
        }
        assert!(verdicts[0] == 0 && verdicts[1] > 0, "{verdicts:?}");
    }

    #[test]
    fn rays_that_hit_where_another_says_that_there_is_nothing_are_moved() {
        let (first, second) = (next(), next());
        let (mut audits, mut random, mut verdicts) = (Audits::default(), Random(1), 0);
        for packet in 0..5000 {
            let samples = SOUND.trace(packet, &mut random);
            if let Some(audit) = audits.begin(packet, first, &samples, || vec![second]) {
                verdicts += usize::from(audits.finish(audit, None, 0.0).is_some());
            }
        }
        assert!(verdicts > 0);
    }

    #[test]
    fn a_worker_that_comes_back_has_the_comparisons_that_it_had() {
        let ids = [next(), next(), next()];
        let (mut audits, mut random, mut found) = (Audits::default(), Random(1), None);
        let dim = Machine { gain: 0.5, ..SOUND };
        for packet in 0..60_000 {
            let at = (packet % 3) as usize;
            let machine = |at: usize| if at == 1 { dim } else { SOUND };
            let samples = machine(at).trace(packet, &mut random);
            let Some(audit) = audits.begin(packet, ids[at], &samples, || ids.to_vec()) else {
                continue;
            };
            let checker = ids.iter().position(|id| *id == audit.checker).unwrap();
            let again = machine(checker).trace(packet, &mut random);
            if let Some(AuditVerdict::Broken(id, _)) = audits.finish(audit, Some(&again), 0.0) {
                found = Some(id);
                break;
            }
            // It goes after each comparison: with less than a verdict takes.
            audits.left(ids[1]);
        }
        assert_eq!(found, Some(ids[1]));
        audits.forget(ids[1].maker);
        assert!(audits.pairs.keys().all(|(a, b)| *a != ids[1] && *b != ids[1]));
    }

    #[test]
    fn memory_is_bounded_if_nobody_checks_and_whoever_comes() {
        let ids: Vec<WorkerId> = (0..3).map(|_| next()).collect();
        let samples = SOUND.trace(0, &mut Random(1));
        let mut audits = Audits::default();
        for packet in 0..100_000 {
            audits.begin(packet, ids[0], &samples, || ids.clone());
        }
        assert_eq!(audits.waiting.len(), 2 * MAX_WAITING);
        audits.left(ids[1]);
        assert_eq!(audits.waiting.len(), MAX_WAITING);
        audits.left(ids[0]);
        assert_eq!(audits.waiting.len(), MAX_WAITING, "its own are still checked");
        audits.left(ids[2]);
        assert!(audits.waiting.is_empty() && audits.pairs.is_empty());
        for seat in 0..MAX_PAIRS as u16 + 100 {
            audits.make_room(pair(ids[0], WorkerId { seat, ..ids[1] }));
            audits.pairs.entry(pair(ids[0], WorkerId { seat, ..ids[1] })).or_default();
        }
        assert_eq!(audits.pairs.len(), MAX_PAIRS);
    }
}
