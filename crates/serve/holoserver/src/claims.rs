//! Claims of workers that a beam sees nothing: who made them, and whether others agree.
//!
//! A claim is believed at once, because most are true and tracing is dear. It is *proven* later.
//! Claims are checked in batches: other workers trace rays of some beams of a batch. If none of
//! these rays hits anything, the whole batch is proven. Invariants:
//! - A worker cannot know which of its claims are checked: they are drawn after it made them.
//! - Only workers of another machine prove a claim. Any other worker may refute it.
//! - The claims of a worker stay listed until they are proven, even if it has left. So they can be
//!   undone. Those that it proved while it is connected can be undone, too.
//! - Claims that a file lists as unproven are open again when a server starts.

use std::{
    collections::BTreeMap,
    hash::{BuildHasher, RandomState},
};

use holo_beamfile::Maker;
use holo_section::BeamKey;

use crate::{unproven::UnprovenClaims, unseen::UnseenBeams, worker_id::WorkerId};

/// One in this many claims of a batch is checked.
const CHECKED: u64 = 32;

/// Fewest checks of a batch that has so many claims. Once so many checks of a worker's claims were
/// passed, displays hear of its claims at once.
const LEAST_CHECKED: u64 = 8;

/// Most checks of a batch. If one claim in 200 is wrong, this many checks miss it once in 170
/// times.
const MOST_CHECKED: u64 = 1024;

/// All claims, by worker.
#[derive(Debug, Default)]
pub struct UnseenClaims {
    claimers: BTreeMap<WorkerId, Claimer>,
    /// Decides which claims are checked.
    secret: RandomState,
    batches: u64,
}

/// A worker that has made claims.
#[derive(Debug, Default)]
struct Claimer {
    /// Claims that no check covers yet.
    open: UnseenBeams,
    /// Claims that only workers of the same machine have checked.
    vouched: UnseenBeams,
    /// Claims that are being checked.
    batch: UnseenBeams,
    /// Claims that are proven.
    proven: UnseenBeams,
    /// True if only workers of other machines check the batch.
    is_strict: bool,
    /// Checks that are not over.
    waiting: usize,
    /// Checks that agreed.
    passed: u64,
    is_doubted: bool,
    has_left: bool,
}

/// A check of a claim: another worker traces rays of the beam.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Check {
    /// The worker that says that the beam sees nothing.
    pub claimer: WorkerId,
    /// The worker that has hit something. A third one decides.
    pub hitter: Option<WorkerId>,
    /// True if a worker of another machine than the claimer's must make the check.
    pub is_strict: bool,
}

impl Check {
    /// Returns whether a worker may make this check.
    pub fn is_for(&self, worker: WorkerId) -> bool {
        let is_other = worker != self.claimer && Some(worker) != self.hitter;
        is_other && !(self.is_strict && worker.maker == self.claimer.maker)
    }
}

/// What a passed check leads to.
#[derive(Debug, Default)]
pub struct Passed {
    /// Claims that are proven from now on.
    pub proven: UnseenBeams,
    /// Claims that displays may hear of from now on.
    pub told: UnseenBeams,
}

impl UnseenClaims {
    /// Returns the claims that a file lists as unproven.
    pub fn restore(unproven: &UnprovenClaims) -> UnseenClaims {
        let claimer = |claims: &UnseenBeams| Claimer {
            open: claims.clone(),
            has_left: true,
            ..Claimer::default()
        };
        let claimers = unproven.iter();
        UnseenClaims {
            claimers: claimers
                .map(|(maker, claims)| (WorkerId::earlier(maker), claimer(claims)))
                .collect(),
            ..UnseenClaims::default()
        }
    }

    /// Takes note of a claim.
    pub fn add(&mut self, worker: WorkerId, key: BeamKey) {
        let claimer = self.claimers.entry(worker).or_default();
        claimer.has_left = false;
        let sets = [&claimer.vouched, &claimer.batch, &claimer.proven];
        if !sets.iter().any(|set| set.contains(key)) {
            claimer.open.insert(key);
        }
    }

    /// Begins to check a batch of claims that one of these workers can check, if there is one.
    /// Returns the beams, and who may trace them.
    pub fn begin(&mut self, ready: &[WorkerId]) -> Option<(Vec<BeamKey>, Check)> {
        for (&worker, claimer) in &mut self.claimers {
            if claimer.is_doubted || claimer.waiting > 0 {
                continue;
            }
            let is_strict = ready.iter().any(|id| id.maker != worker.maker);
            let open = claimer.open.count();
            let can_vouch = open > 0 && ready.iter().any(|id| *id != worker);
            if !(is_strict && open + claimer.vouched.count() > 0 || can_vouch) {
                continue;
            }
            claimer.batch = std::mem::take(&mut claimer.open);
            if is_strict {
                claimer.batch.add(&std::mem::take(&mut claimer.vouched));
            }
            claimer.is_strict = is_strict;
            self.batches += 1;
            let drawn = draw(&claimer.batch, |at, key| {
                self.secret.hash_one((self.batches, at, key.section, key.beam.0))
            });
            claimer.waiting = drawn.len();
            return Some((drawn, Check { claimer: worker, hitter: None, is_strict }));
        }
        None
    }

    /// Takes note that a check is over and agreed.
    pub fn passed(&mut self, worker: WorkerId) -> Passed {
        let mut outcome = Passed::default();
        let Some(claimer) = self.claimers.get_mut(&worker) else { return outcome };
        claimer.passed += 1;
        if claimer.passed == LEAST_CHECKED && !claimer.is_doubted {
            for set in [&claimer.open, &claimer.vouched, &claimer.batch] {
                outcome.told.add(set);
            }
        }
        claimer.waiting = claimer.waiting.saturating_sub(1);
        if claimer.waiting == 0 {
            let batch = std::mem::take(&mut claimer.batch);
            outcome.told.add(&batch);
            if claimer.is_strict {
                claimer.proven.add(&batch);
                outcome.proven = batch;
            } else {
                claimer.vouched.add(&batch);
            }
        }
        self.tidy(worker);
        outcome
    }

    /// Returns whether displays may hear of this worker's claims: enough of them were checked.
    pub fn is_trusted(&self, worker: WorkerId) -> bool {
        self.claimers.get(&worker).is_some_and(|claimer| claimer.passed >= LEAST_CHECKED)
    }

    /// Doubts a worker, because another one has hit something in a beam that it claimed to be
    /// unseen. Returns its claims, which are no longer believed.
    pub fn doubt(&mut self, worker: WorkerId) -> UnseenBeams {
        let claimer = self.claimers.entry(worker).or_default();
        claimer.is_doubted = true;
        claimer.passed = 0;
        let mut claims = std::mem::take(&mut claimer.open);
        for set in [&mut claimer.vouched, &mut claimer.batch, &mut claimer.proven] {
            claims.add(&std::mem::take(set));
        }
        claims
    }

    /// Takes note that a third worker has decided about a claim: `is_right` if it agreed with the
    /// claimer.
    pub fn decided(&mut self, worker: WorkerId, is_right: bool) {
        if let Some(claimer) = self.claimers.get_mut(&worker) {
            claimer.is_doubted &= !is_right;
            claimer.waiting = claimer.waiting.saturating_sub(1);
        }
        self.tidy(worker);
    }

    /// Returns whether a worker's claims are doubted.
    pub fn is_doubted(&self, worker: WorkerId) -> bool {
        self.claimers.get(&worker).is_some_and(|claimer| claimer.is_doubted)
    }

    /// Returns the workers that have made claims and belong to a machine.
    pub fn claimers_of(&self, maker: Maker) -> Vec<WorkerId> {
        self.claimers.keys().copied().filter(|worker| worker.maker == maker).collect()
    }

    /// Takes note that a worker has left.
    pub fn left(&mut self, worker: WorkerId) {
        if let Some(claimer) = self.claimers.get_mut(&worker) {
            claimer.has_left = true;
        }
        self.tidy(worker);
    }

    /// Forgets a worker that has left, once it has no claims that are not proven.
    fn tidy(&mut self, worker: WorkerId) {
        let is_over = |claimer: &Claimer| {
            let sets = [&claimer.open, &claimer.vouched, &claimer.batch];
            claimer.has_left && claimer.waiting == 0 && sets.iter().all(|set| set.count() == 0)
        };
        if self.claimers.get(&worker).is_some_and(is_over) {
            self.claimers.remove(&worker);
        }
    }
}

/// Draws the beams of a batch that are checked, all with the same chance. `random` returns a random
/// number for the n-th beam.
fn draw(batch: &UnseenBeams, random: impl Fn(u64, BeamKey) -> u64) -> Vec<BeamKey> {
    let count = batch.count();
    let checks = (count / CHECKED).clamp(LEAST_CHECKED.min(count), MOST_CHECKED);
    let mut drawn = Vec::new();
    for (at, key) in (0..).zip(batch.iter()) {
        if at < checks {
            drawn.push(key);
            continue;
        }
        // Each beam replaces one that was drawn, with the chance that it belongs to the result.
        let place = random(at, key) % (at + 1);
        if let Some(place) = drawn.get_mut(place as usize) {
            *place = key;
        }
    }
    drawn
}

#[cfg(test)]
mod tests {
    use holo_section::BeamId;

    use super::*;

    const A: WorkerId = WorkerId { maker: Maker(1), seat: 0 };
    /// Another worker of the same machine.
    const A2: WorkerId = WorkerId { maker: Maker(1), seat: 1 };
    const B: WorkerId = WorkerId { maker: Maker(2), seat: 0 };

    fn key(beam: u64) -> BeamKey {
        BeamKey { section: 0, beam: BeamId(beam) }
    }

    /// Returns claims of so many beams by one worker.
    fn claims_of(worker: WorkerId, beams: u64) -> UnseenClaims {
        let mut claims = UnseenClaims::default();
        (0..beams).for_each(|beam| claims.add(worker, key(beam)));
        claims
    }

    /// Has all checks of a batch pass. Returns what the last of them led to.
    fn pass(claims: &mut UnseenClaims, worker: WorkerId, checks: usize) -> Passed {
        (1..checks).for_each(|_| assert_eq!(claims.passed(worker).proven.count(), 0));
        claims.passed(worker)
    }

    #[test]
    fn a_share_of_the_claims_is_checked_and_all_have_the_same_chance() {
        for (beams, expected) in [(1, 1), (8, 8), (20, 8), (640, 20), (200_000, 1024)] {
            let drawn = claims_of(A, beams).begin(&[B]).unwrap().0;
            assert_eq!(drawn.len(), expected);
            assert!(drawn.iter().all(|key| key.beam.0 < beams));
        }
        let mut counts = [0; 20];
        for _ in 0..4000 {
            let (drawn, _) = claims_of(A, 20).begin(&[B]).unwrap();
            drawn.iter().for_each(|key| counts[key.beam.0 as usize] += 1);
        }
        // 8 of 20 in 4000 batches: 1600 each, with a standard deviation of 31.
        assert!(counts.iter().all(|count| (1400..1800).contains(count)), "{counts:?}");
    }

    #[test]
    fn only_another_machine_proves_claims_and_the_same_one_is_asked_once() {
        let mut claims = claims_of(A, 100);
        assert!(claims.begin(&[A]).is_none(), "not the claimer itself");
        let (drawn, check) = claims.begin(&[A, A2]).unwrap();
        assert!(!check.is_for(A) && check.is_for(A2) && check.is_for(B));
        assert_eq!(pass(&mut claims, A, drawn.len()).proven.count(), 0);
        assert!(claims.begin(&[A, A2]).is_none(), "it has agreed already");
        claims.add(A, key(500));
        let (drawn, check) = claims.begin(&[A, B]).unwrap();
        assert!(!check.is_for(A2) && check.is_for(B));
        assert!(claims.begin(&[A, B]).is_none(), "one batch at a time");
        let proven = pass(&mut claims, A, drawn.len()).proven;
        assert!(proven.count() == 101 && proven.contains(key(500)));
        claims.add(A, key(7));
        assert!(claims.begin(&[B]).is_none(), "a proven claim is not checked again");
    }

    #[test]
    fn claims_of_an_earlier_server_are_open_to_everyone() {
        let mut set = UnseenBeams::default();
        (0..50).for_each(|beam| _ = set.insert(key(beam)));
        let mut claims = UnseenClaims::restore(&UnprovenClaims::of(A.maker, set));
        let earlier = WorkerId::earlier(A.maker);
        let (drawn, check) = claims.begin(&[A]).unwrap();
        assert!(check.claimer == earlier && check.is_for(A), "it may refute itself");
        assert_eq!(pass(&mut claims, earlier, drawn.len()).proven.count(), 0, "but not agree");
        assert!(claims.begin(&[A]).is_none());
        let (drawn, _) = claims.begin(&[A, B]).unwrap();
        assert_eq!(pass(&mut claims, earlier, drawn.len()).proven.count(), 50);
        assert!(claims.claimers.is_empty(), "nothing is kept for ever");
    }

    #[test]
    fn claims_can_be_undone_until_they_are_proven_and_while_the_worker_is_there() {
        let mut claims = claims_of(A, 1000);
        let (drawn, _) = claims.begin(&[B]).unwrap();
        claims.left(A);
        claims.add(A, key(2000));
        pass(&mut claims, A, drawn.len());
        assert_eq!(claims.doubt(A).count(), 1001, "it is back, and there");
        assert!(claims.is_doubted(A) && claims.begin(&[B]).is_none());
        claims.left(A);
        assert!(claims.claimers.is_empty());
    }

    #[test]
    fn displays_hear_of_claims_once_enough_were_checked() {
        let mut claims = claims_of(A, 1000);
        let (drawn, check) = claims.begin(&[B]).unwrap();
        claims.add(A, key(1000));
        assert_eq!((drawn.len(), check.claimer), (31, A));
        for _ in 1..LEAST_CHECKED {
            assert_eq!(claims.passed(A).told.count(), 0);
            assert!(!claims.is_trusted(A));
        }
        assert_eq!(claims.passed(A).told.count(), 1001);
        assert!(claims.is_trusted(A));
        claims.doubt(A);
        assert!(!claims.is_trusted(A) && claims.is_doubted(A));
        claims.decided(A, true);
        assert!(!claims.is_doubted(A));
    }
}
