//! Beams that workers claim to see nothing: believed, checked by other workers, and undone.

use std::collections::BTreeSet;

use anyhow::{Context, Result, ensure};
use holo_proto::{MAX_RAYS_PER_PACKET, bulk::Packet};
use holo_section::{BeamKey, Sample};
use tracing::warn;

use super::Coordinator;
use crate::{
    assignment::{Assignment, Purpose, ResultsError},
    claims::Check,
    events::ConnectionId,
    recall::send_unseen,
    unseen::UnseenBeams,
};

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
        if self.claims.is_proven(id) || self.workers.len() == 1 {
            self.tell_unseen(found)?;
        }
        taken
    }

    /// Ends a packet whose beam sees nothing, as a worker says. Returns the beam if that is new.
    fn finish_unseen(&mut self, id: ConnectionId, packet: u64) -> Result<Option<BeamKey>> {
        ensure!(self.holodeck.skip_unseen, ResultsError::NotAsked);
        let worker = self.workers.get_mut(&id).context("it has left")?;
        let finished = worker.finish_unseen(packet, tokio::time::Instant::now())?;
        let Some(mut assignment) = self.still_open(finished) else { return Ok(None) };
        match assignment.purpose {
            Purpose::Store => {}
            Purpose::Claim(check) => {
                self.checked(id, assignment.key(), check, false)?;
                return Ok(None);
            }
            Purpose::Again(audit) => {
                self.audited(audit, None)?;
                return Ok(None);
            }
        }
        if self.claims.is_doubted(id) && self.workers.len() > 1 {
            assignment.not_for = Some(id);
            self.lose([assignment]);
            return Ok(None);
        }
        self.finish_packet(&assignment);
        let key = assignment.key();
        if self.holodeck.unseen_mut().insert(key) {
            let maker = self.maker(id);
            self.holodeck.makers_mut().change(maker, |made| made.claims += 1);
        }
        if self.claims.add(id, key) {
            self.check(key, Check { claimer: id, hitter: None });
        }
        Ok(Some(key))
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
            purpose: Purpose::Claim(check),
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
        let Check { claimer, hitter } = check;
        let beam = format!("beam {} of section {}", key.beam.0, key.section);
        match (hits, hitter) {
            (false, None) => {
                let proven = self.claims.passed(claimer);
                let claims: Vec<_> = proven.into_iter().flat_map(UnseenBeams::iter).collect();
                self.tell_unseen(claims)?;
            }
            (true, None) => {
                self.undo(claimer);
                self.check(key, Check { claimer, hitter: Some(id) });
            }
            (false, Some(hitter)) => {
                self.claims.believe(claimer);
                self.claims.passed(claimer);
                self.expel(hitter, format!("it hit something in {beam}, and two others nothing"));
            }
            (true, Some(_)) => {
                self.claims.passed(claimer);
                let reason = format!("it says that {beam} sees nothing, and two others hit there");
                self.expel(claimer, reason);
            }
        }
        Ok(())
    }

    /// Believes no claim of a worker any more: the beams are traced.
    pub(super) fn undo(&mut self, claimer: ConnectionId) {
        let claims = self.claims.doubt(claimer);
        if claims.count() == 0 {
            return;
        }
        let name = self.workers.get(&claimer).map_or("a worker that has left", |w| &w.name);
        warn!(peer = name, beams = claims.count(), "claims of unseen beams undone");
        self.progress.say(&format!(
            "{name} says that {} beams see nothing, and is wrong somewhere: all are traced",
            claims.count()
        ));
        let (maker, count) = (self.maker(claimer), claims.count());
        self.holodeck.makers_mut().change(maker, |made| {
            made.claims = made.claims.saturating_sub(count);
        });
        let mut unseen = self.holodeck.unseen_mut();
        claims.iter().for_each(|key| _ = unseen.remove(key));
        drop(unseen);
        for display in self.displays.values_mut() {
            if let Some(wishes) = &mut display.wishes {
                wishes.want_again();
            }
        }
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
