//! Packets that a second worker traces again, and what becomes of workers that return wrong
//! results.

use anyhow::{Error, Result};
use holo_beamfile::Maker;
use holo_proto::{
    control::Engine,
    report::{FaultReport, MAX_FAULTS},
};
use holo_section::Sample;
use tracing::warn;

use super::Coordinator;
use crate::{
    assignment::{Assignment, PacketPurpose, ResultsError},
    audits::{Audit, AuditVerdict},
    events::ConnectionId,
    plausible::Implausible,
    worker_id::WorkerId,
};

/// Most machines whose impossible results are remembered: as many as a file has numbers for.
const MAX_REMEMBERED: usize = 4096;

/// Most pairs of workers in doubt that are listed.
const MAX_IN_DOUBT: usize = 64;

/// Relative error of the light of two workers of the engine `gather` that many rays share. Around
/// two corners, single runs were up to 20 % off after four paths a pixel.
const CELLS_NOISE: f64 = 0.2;

impl Coordinator {
    /// Begins to check a traced packet now and then: another worker traces it again.
    pub(super) fn audit(&mut self, id: ConnectionId, traced: &Assignment, samples: &[Sample]) {
        let workers = &self.workers;
        let Some(first) = workers.get(&id).map(|worker| worker.id) else { return };
        let ready = || {
            let mut ready: Vec<WorkerId> =
                workers.values().filter(|w| w.is_ready()).map(|worker| worker.id).collect();
            ready.sort_unstable();
            ready
        };
        let Some(audit) = self.audits.begin(traced.packet.id, first, samples, ready) else {
            return;
        };
        self.last_packet += 1;
        let mut again =
            Assignment { display: None, purpose: PacketPurpose::Again(audit), ..*traced };
        again.packet.id = self.last_packet;
        self.lose([again]);
    }

    /// Takes what another worker returned for the same packet.
    pub(super) fn audited(&mut self, audit: Audit, samples: Option<&[Sample]>) -> Result<()> {
        let settings = &self.holodeck.about.settings;
        let noise = match settings.engine {
            Engine::Path | Engine::Captured => 0.0,
            // Their cells have an error that neighbouring rays share.
            Engine::Gather => CELLS_NOISE,
        };
        match self.audits.finish(audit, samples, noise) {
            None => {}
            Some(AuditVerdict::Broken(worker, difference)) => {
                self.found_broken(worker, &difference.to_string());
            }
            // If there is a third one, it will show which of the two is wrong.
            Some(AuditVerdict::Undecided(first, second, difference))
                if self.in_doubt.is_empty() && self.workers.len() <= 2 =>
            {
                let (first, second) = (self.name_of(first), self.name_of(second));
                let reason = difference.between(&first, &second);
                self.doubt(&first, &second, &reason);
            }
            Some(AuditVerdict::Undecided(..)) => {}
        }
        Ok(())
    }

    /// Drops a worker whose results two others contradict. Its machine is refused from now on, also
    /// by later servers of this file.
    pub(super) fn found_broken(&mut self, worker: WorkerId, reason: &str) {
        warn!(peer = self.name_of(worker), maker = worker.maker.0, reason, "broken");
        // Workers compared with a broken one are no longer in doubt.
        self.in_doubt.clear();
        self.holodeck.makers_mut().accuse(worker.maker, reason);
        for claimer in self.claims.claimers_of(worker.maker) {
            self.undo(claimer);
        }
        if let Some(id) = self.connection_of(worker) {
            self.expel(id, format!("it seems to be broken: {reason}"));
        }
        self.audits.forget(worker.maker);
    }

    /// Remembers that a worker returned results that are impossible, if the error says so. This
    /// server refuses its machine from now on.
    pub(super) fn accuse(&mut self, id: ConnectionId, error: &Error) {
        let is_result = error.is::<ResultsError>() || error.is::<Implausible>();
        let Some(worker) = self.workers.get(&id).filter(|_| is_result) else { return };
        let (name, maker) = (worker.name.clone(), worker.id.maker);
        let reason = error.to_string();
        warn!(peer = name, maker = maker.0, reason, "impossible results");
        if self.faults.len() < MAX_REMEMBERED {
            let token = self.token_of(maker);
            let fault = FaultReport { name, maker: maker.0, token, reason, is_dropped: true };
            self.faults.entry(maker).or_insert(fault);
        }
    }

    /// Lists two workers that differ. Neither is accused.
    pub(super) fn doubt(&mut self, first: &str, second: &str, reason: &str) {
        let reason = format!("{reason}; a third worker would show which of the two is wrong");
        let name = format!("{first} and {second}");
        warn!(peers = name, reason, "they differ");
        self.progress.say(&format!("{name} differ: {reason}"));
        if self.in_doubt.len() < MAX_IN_DOUBT {
            let (maker, token) = (Maker::UNKNOWN.0, String::new());
            self.in_doubt.push(FaultReport { name, maker, token, reason, is_dropped: false });
        }
    }

    fn token_of(&self, maker: Maker) -> String {
        let makers = self.holodeck.makers();
        makers.get(maker).and_then(|made| made.token.clone()).unwrap_or_default()
    }

    /// Returns the faults for a report: machines that are refused, then workers in doubt.
    pub(super) fn fault_reports(&self) -> Vec<FaultReport> {
        let makers = self.holodeck.makers();
        let broken = makers.iter().filter_map(|made| {
            let (name, token) = (made.name.clone(), made.token.clone().unwrap_or_default());
            let reason = made.fault.clone()?;
            Some(FaultReport { name, maker: made.id, token, reason, is_dropped: true })
        });
        let is_broken = |maker| makers.get(maker).is_some_and(|made| made.fault.is_some());
        let impossible = self.faults.iter().filter(|(maker, _)| !is_broken(**maker));
        let impossible = impossible.map(|(_, fault)| fault.clone());
        broken.chain(impossible).chain(self.in_doubt.iter().cloned()).take(MAX_FAULTS).collect()
    }

    /// Returns why a machine may not work here, if it returned wrong results.
    pub(super) fn fault_of(&self, maker: Maker) -> Option<String> {
        if maker == Maker::UNKNOWN {
            return None;
        }
        let makers = self.holodeck.makers();
        let broken = makers.get(maker).and_then(|made| made.fault.as_deref());
        let reason =
            broken.or_else(|| self.faults.get(&maker).map(|fault| fault.reason.as_str()))?;
        Some(format!("its machine seems to be broken: {reason}"))
    }
}
