//! Beams that workers claim to see nothing: believed, checked by other workers, and undone.

use std::collections::BTreeSet;

use anyhow::{Context, Result, ensure};
use holo_proto::{MAX_RAYS_PER_PACKET, bulk::Packet};
use holo_section::{BeamKey, Sample};
use tracing::warn;

use super::Coordinator;
use crate::{
    assignment::{Assignment, PacketPurpose, ResultsError},
    claims::{Check, Passed},
    events::ConnectionId,
    recall::send_unseen,
    worker_id::WorkerId,
};

/// Most checks that wait before those of another batch begin.
const MAX_CHECKS: usize = 1024;

/// Work of a witness that suffices against any worker, in rays of the usual number of paths.
const ENOUGH_WORK: f64 = 2000.0;

impl Coordinator {
    /// Records beams that a worker found to see nothing, and informs displays that look at them.
    pub(super) fn take_unseen(&mut self, id: ConnectionId, packets: &[u64]) -> Result<()> {
        let mut found = BTreeSet::new();
        let taken = packets.iter().try_for_each(|&packet| {
            found.extend(self.finish_unseen(id, packet)?);
            Ok(())
        });
        // The beams before a refused packet count all the same, as with samples. If there is no
        // other worker, no check will ever confirm this one's claims.
        let worker = self.workers.get(&id).map(|worker| worker.id);
        if worker.is_some_and(|id| self.claims.is_trusted(id)) || self.workers.len() == 1 {
            self.tell_unseen(found)?;
        }
        taken
    }

    /// Ends a packet whose beam sees nothing, as a worker says. Returns the beam if that is new.
    fn finish_unseen(&mut self, id: ConnectionId, packet: u64) -> Result<Option<BeamKey>> {
        ensure!(self.holodeck.skip_unseen, ResultsError::NotAsked);
        let worker = self.workers.get_mut(&id).context("it has left")?;
        let finished = worker.finish_unseen(packet, tokio::time::Instant::now())?;
        let worker = worker.id;
        let Some(mut assignment) = self.still_open(finished) else { return Ok(None) };
        match assignment.purpose {
            PacketPurpose::Store => {}
            PacketPurpose::Claim(check) => {
                self.checked(id, assignment.key(), check, false)?;
                return Ok(None);
            }
            PacketPurpose::Again(audit) => {
                self.audited(audit, None)?;
                return Ok(None);
            }
        }
        if self.claims.is_doubted(worker) && self.workers.len() > 1 {
            assignment.not_for = Some(worker);
            self.lose([assignment]);
            return Ok(None);
        }
        self.finish_packet(&assignment);
        let key = assignment.key();
        if self.holodeck.unseen_mut().insert(key) {
            if !self.holodeck.unproven_mut().insert(worker.maker, key) {
                // There is no room to list it apart, so it is looked at again.
                self.holodeck.unseen_mut().remove(key);
                return Ok(None);
            }
            self.holodeck.makers_mut().change(worker.maker, |made| made.claims += 1);
            self.claims.add(worker, key);
        }
        Ok(Some(key))
    }

    /// Begins to check claims that some worker can check.
    pub(super) fn begin_checks(&mut self) {
        let mut ready = None;
        while self.checks.len() < MAX_CHECKS {
            let ready = ready.get_or_insert_with(|| {
                let ready = self.workers.values().filter(|worker| worker.is_ready());
                ready.map(|worker| worker.id).collect::<Vec<_>>()
            });
            let Some((beams, check)) = self.claims.begin(ready) else { return };
            beams.into_iter().for_each(|key| self.check(key, check));
        }
    }

    /// Returns whether a claim is being checked, or can be. Until that is over, it is unknown
    /// whether anything is left to trace.
    pub(super) fn is_checking(&self) -> bool {
        let is_claim =
            |assignment: &Assignment| matches!(assignment.purpose, PacketPurpose::Claim(_));
        let workers = || self.workers.values().filter(|worker| worker.is_ready());
        let mut waiting = self.checks.values().filter(|assignment| is_claim(assignment));
        waiting.any(|check| workers().any(|worker| check.is_for(worker.id, false)))
            || workers().any(|worker| worker.assignments().any(is_claim))
    }

    /// Has a claim checked by another worker.
    fn check(&mut self, key: BeamKey, check: Check) {
        self.last_packet += 1;
        let (id, count) = (self.last_packet, MAX_RAYS_PER_PACKET as u8);
        let paths = self.holodeck.about.settings.paths_per_sample;
        let packet = Packet { id, key, first: 0, count, paths, viewpoint: None, rays: None };
        let assignment = Assignment {
            packet,
            viewpoint: None,
            display: None,
            purpose: PacketPurpose::Claim(check),
            not_for: None,
        };
        self.lose([assignment]);
    }

    /// Takes the samples of a check. They are not stored.
    pub(super) fn check_traced(
        &mut self,
        id: ConnectionId,
        key: BeamKey,
        check: Check,
        samples: &[Sample],
    ) -> Result<()> {
        let hits = samples.iter().any(|sample| sample.distance(1.0).is_finite());
        self.checked(id, key, check, hits)
    }

    /// Takes the outcome of a check: whether a worker `id` has hit something in the beam.
    fn checked(&mut self, id: ConnectionId, key: BeamKey, check: Check, hits: bool) -> Result<()> {
        let Check { claimer, hitter, .. } = check;
        let Some(worker) = self.workers.get(&id).map(|worker| worker.id) else { return Ok(()) };
        let beam = format!("beam {} of section {}", key.beam.0, key.section);
        match (hits, hitter) {
            (false, None) => {
                let Passed { proven, told } = self.claims.passed(claimer);
                if proven.count() > 0 {
                    self.holodeck.unproven_mut().remove(claimer.maker, &proven);
                }
                self.tell_unseen(told.iter())?;
            }
            (true, None) => {
                let (claims, hits) = (self.name_of(claimer), self.name_of(worker));
                if self.undo(claimer) > 0 && claimer.maker != worker.maker {
                    let reason =
                        format!("{claims} says that {beam} sees nothing, {hits} hits there");
                    self.doubt(&claims, &hits, &reason);
                }
                if claimer == WorkerId::earlier(worker.maker) {
                    // The machine has refuted itself, so nobody need decide.
                    self.claims.decided(claimer, true);
                    return Ok(());
                }
                self.check(key, Check { claimer, hitter: Some(worker), is_strict: false });
            }
            (false, Some(hitter)) => {
                self.claims.decided(claimer, true);
                if !self.may_accuse(hitter, [claimer, worker]) {
                    return Ok(());
                }
                let reason = format!("it hit something in {beam}, and two others nothing");
                self.found_broken(hitter, &reason);
            }
            (true, Some(hitter)) => {
                if !self.may_accuse(claimer, [hitter, worker]) {
                    // Until others decide, the claimer stays in doubt.
                    self.check(key, Check { claimer, hitter: None, is_strict: false });
                    return Ok(());
                }
                self.claims.decided(claimer, false);
                let reason = format!("it says that {beam} sees nothing, and two others hit there");
                self.found_broken(claimer, &reason);
            }
        }
        Ok(())
    }

    /// Returns whether two workers have returned enough for a third to be dropped on their word.
    ///
    /// Whoever may join can join under many names, so names alone must not outvote a worker that
    /// has returned much.
    fn may_accuse(&self, accused: WorkerId, witnesses: [WorkerId; 2]) -> bool {
        let returned = |id| self.workers.values().find(|w| w.id == id).map(|w| w.work_returned());
        let wanted = returned(accused).unwrap_or(ENOUGH_WORK).min(ENOUGH_WORK);
        witnesses.into_iter().all(|id| returned(id).is_some_and(|work| work >= wanted))
    }

    /// Believes no claim of a worker any more: the beams are traced. Returns how many there were.
    pub(super) fn undo(&mut self, claimer: WorkerId) -> u64 {
        let claims = self.claims.doubt(claimer);
        let count = claims.count();
        if count == 0 {
            return 0;
        }
        let name = self.name_of(claimer);
        warn!(peer = name, beams = count, "claims of unseen beams undone");
        self.progress.say(&format!(
            "{count} beams that see nothing, as {name} says, are traced: others doubt it"
        ));
        self.holodeck.makers_mut().change(claimer.maker, |made| {
            made.claims = made.claims.saturating_sub(count);
        });
        self.holodeck.unseen_mut().subtract(&claims);
        self.holodeck.unproven_mut().remove(claimer.maker, &claims);
        // The fill may have passed over these beams, or have ended because of them.
        let stored = self.holodeck.file.stats().samples;
        if let Some(fill) = &mut self.fill {
            fill.begin_again(stored, &self.holodeck.unseen());
        }
        for display in self.displays.values_mut() {
            if let Some(wishes) = &mut display.wishes {
                wishes.want_again();
            }
        }
        count
    }

    /// Informs displays which of these beams of their views see nothing.
    fn tell_unseen(&self, beams: impl IntoIterator<Item = BeamKey>) -> Result<()> {
        let beams: Vec<BeamKey> = beams.into_iter().collect();
        for display in self.displays.values() {
            let Some(wishes) = &display.wishes else { continue };
            let seen: Vec<_> =
                beams.iter().copied().filter(|&beam| wishes.contains(beam)).collect();
            if !seen.is_empty() {
                send_unseen(&display.outbox, wishes.view, &seen)?;
            }
        }
        Ok(())
    }
}
