//! Claims of workers that a beam sees nothing: who made them, and whether others agree.
//!
//! A claim is believed at once, because most are true and tracing is dear. A share of the claims is
//! checked by another worker, which traces rays of the beam. Invariants:
//! - A worker cannot know which of its claims are checked.
//! - The claims of a worker are kept until all their checks are over, even if it has left. So they
//!   can be undone.

use std::{
    collections::BTreeMap,
    hash::{BuildHasher, RandomState},
};

use holo_section::BeamKey;

use crate::{events::ConnectionId, unseen::UnseenBeams};

/// One in this many claims is checked.
const CHECKED: u64 = 32;

/// The first claims of each worker are all checked. Once that many checks were passed, displays
/// hear of its claims.
const FIRST_CHECKED: u64 = 8;

/// Most checks that wait. If there is only one worker, checks cannot be made.
const MAX_CHECKS: usize = 1024;

/// All claims, by worker.
#[derive(Debug, Default)]
pub struct Claims {
    makers: BTreeMap<ConnectionId, Maker>,
    /// Decides which claims are checked.
    secret: RandomState,
}

/// A worker that has made claims.
#[derive(Debug, Default)]
struct Maker {
    claims: UnseenBeams,
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
    pub claimer: ConnectionId,
    /// The worker that has hit something. A third one decides.
    pub hitter: Option<ConnectionId>,
}

impl Claims {
    /// Takes note of a claim. Returns whether it must be checked.
    pub fn add(&mut self, worker: ConnectionId, key: BeamKey) -> bool {
        let waiting: usize = self.makers.values().map(|maker| maker.waiting).sum();
        let maker = self.makers.entry(worker).or_default();
        if !maker.claims.insert(key) {
            return false;
        }
        let is_chosen = maker.claims.count() <= FIRST_CHECKED
            || self.secret.hash_one(key).is_multiple_of(CHECKED);
        let is_checked = is_chosen && waiting < MAX_CHECKS;
        maker.waiting += usize::from(is_checked);
        is_checked
    }

    /// Takes note that a check is over and agreed. Returns the worker's claims if displays may hear
    /// of them from now on.
    pub fn passed(&mut self, worker: ConnectionId) -> Option<&UnseenBeams> {
        let maker = self.makers.get_mut(&worker)?;
        maker.waiting = maker.waiting.saturating_sub(1);
        maker.passed += 1;
        if maker.has_left && maker.waiting == 0 {
            self.makers.remove(&worker);
            return None;
        }
        let maker = self.makers.get(&worker)?;
        (maker.passed == FIRST_CHECKED && !maker.is_doubted).then_some(&maker.claims)
    }

    /// Returns whether displays may hear of this worker's claims: enough of them were checked.
    pub fn is_proven(&self, worker: ConnectionId) -> bool {
        self.makers.get(&worker).is_some_and(|maker| maker.passed >= FIRST_CHECKED)
    }

    /// Doubts a worker, because another one has hit something in a beam that it claimed to be
    /// unseen. Returns its claims, which are no longer believed.
    pub fn doubt(&mut self, worker: ConnectionId) -> UnseenBeams {
        let maker = self.makers.entry(worker).or_default();
        maker.is_doubted = true;
        maker.passed = 0;
        std::mem::take(&mut maker.claims)
    }

    /// Believes a worker again, because a third one agreed with it.
    pub fn believe(&mut self, worker: ConnectionId) {
        if let Some(maker) = self.makers.get_mut(&worker) {
            maker.is_doubted = false;
        }
    }

    /// Returns whether a worker's claims are doubted.
    pub fn is_doubted(&self, worker: ConnectionId) -> bool {
        self.makers.get(&worker).is_some_and(|maker| maker.is_doubted)
    }

    /// Takes note that a worker has left.
    pub fn left(&mut self, worker: ConnectionId) {
        if let Some(maker) = self.makers.get_mut(&worker) {
            maker.has_left = true;
            if maker.waiting == 0 {
                self.makers.remove(&worker);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use holo_section::BeamId;

    use super::*;

    fn key(beam: u64) -> BeamKey {
        BeamKey { section: 0, beam: BeamId(beam) }
    }

    #[test]
    fn the_first_claims_and_a_share_of_the_others_are_checked_and_no_claim_twice() {
        let (mut claims, worker) = (Claims::default(), ConnectionId::next());
        let checked: Vec<bool> = (0..20_000).map(|beam| claims.add(worker, key(beam))).collect();
        assert!(checked[..8].iter().all(|checked| *checked));
        let share = checked.iter().filter(|checked| **checked).count() as f64 / 20_000.0;
        // Six standard deviations.
        assert!((share - 1.0 / 32.0).abs() < 0.008, "{share}");
        assert!((0..20_000).all(|beam| !claims.add(worker, key(beam))), "again");
        let others = Claims::default().add(worker, key(9));
        assert!(others, "each server has a secret of its own");
    }

    #[test]
    fn claims_can_be_undone_until_their_checks_are_over() {
        let (mut claims, worker) = (Claims::default(), ConnectionId::next());
        let checked = (0..1000).filter(|&beam| claims.add(worker, key(beam))).count();
        claims.left(worker);
        for _ in 1..checked {
            claims.passed(worker);
            assert!(!claims.makers.is_empty());
        }
        assert_eq!(claims.doubt(worker).count(), 1000);
        claims.passed(worker);
        assert!(claims.makers.is_empty(), "nothing is kept for ever");
    }

    #[test]
    fn displays_hear_of_claims_once_enough_were_checked() {
        let (mut claims, worker) = (Claims::default(), ConnectionId::next());
        (0..10).for_each(|beam| _ = claims.add(worker, key(beam)));
        for _ in 1..FIRST_CHECKED {
            assert!(claims.passed(worker).is_none() && !claims.is_proven(worker));
        }
        assert_eq!(claims.passed(worker).map(UnseenBeams::count), Some(10));
        assert!(claims.is_proven(worker) && claims.passed(worker).is_none(), "once");
        claims.doubt(worker);
        assert!(!claims.is_proven(worker) && claims.is_doubted(worker));
        claims.believe(worker);
        assert!(!claims.is_doubted(worker));
    }

    #[test]
    fn checks_that_nobody_makes_are_bounded() {
        let mut claims = Claims::default();
        let checked = (0..1000)
            .map(|_| ConnectionId::next())
            .flat_map(|worker| (0..8).map(move |beam| (worker, key(beam))))
            .filter(|&(worker, key)| claims.add(worker, key))
            .count();
        assert_eq!(checked, MAX_CHECKS);
    }
}
