//! Packets that a second worker traces again: who is found broken is dropped and named.

use anyhow::Result;
use holo_beamfile::Maker;
use holo_proto::{control::Engine, report::FaultReport};
use holo_section::Sample;
use tracing::warn;

use super::Coordinator;
use crate::{
    assignment::{Assignment, Purpose},
    audits::{Audit, Verdict},
    events::ConnectionId,
};

/// Most faults that are kept for reports: the oldest ones.
const MAX_FAULTS: usize = 64;

/// Relative error of the light of two workers of the engine `gather` that many rays share. Around
/// two corners, single runs were up to 20 % off after four paths a pixel.
const CELLS_NOISE: f64 = 0.2;

impl Coordinator {
    /// Begins to check a traced packet now and then: another worker traces it again.
    pub(super) fn audit(&mut self, id: ConnectionId, traced: &Assignment, samples: &[Sample]) {
        let workers = &self.workers;
        let ready = || workers.iter().filter(|(_, w)| w.is_ready()).map(|(&id, _)| id).collect();
        let Some(audit) = self.audits.begin(traced.packet.id, id, samples, ready) else { return };
        self.last_packet += 1;
        let mut again = Assignment { display: None, purpose: Purpose::Again(audit), ..*traced };
        again.packet.id = self.last_packet;
        self.lose([again]);
    }

    /// Takes what another worker returned for the same packet.
    pub(super) fn audited(&mut self, audit: Audit, samples: Option<&[Sample]>) -> Result<()> {
        let settings = &self.holodeck.about.settings;
        // Two workers of this engine estimate indirect light by different records.
        let noise = match settings.engine {
            Engine::Path => 0.0,
            Engine::Cached => f64::from(settings.accuracy),
            // Their cells have an error that neighbouring rays share.
            Engine::Gather => CELLS_NOISE,
        };
        match self.audits.finish(audit, samples, noise) {
            None => {}
            Some(Verdict::Broken(id, difference)) => {
                let reason = difference.to_string();
                // A worker compared with a broken one is no longer in doubt.
                self.faults.retain(|fault| fault.is_dropped);
                self.fault(id, reason.clone(), true);
                self.undo(id);
                self.expel(id, format!("it seems to be broken: {reason}"));
            }
            Some(Verdict::Undecided(first, second, difference)) => {
                let is_known = self.faults.iter().any(|fault| !fault.is_dropped);
                if is_known || self.workers.len() > 2 {
                    // A third one will show which of the two is wrong.
                    return Ok(());
                }
                let name = |id| self.workers.get(&id).map_or("", |worker| worker.name.as_str());
                let reason = format!(
                    "compared with {}, {difference}; a third worker would show which is broken",
                    name(second)
                );
                self.progress.say(&format!("{}: {reason}", name(first)));
                self.fault(first, reason, false);
            }
        }
        Ok(())
    }

    /// Keeps a fault for reports.
    fn fault(&mut self, id: ConnectionId, reason: String, is_dropped: bool) {
        let Some(worker) = self.workers.get(&id) else { return };
        let (name, maker) = (worker.name.clone(), worker.maker);
        warn!(peer = name, maker = maker.0, reason, dropped = is_dropped, "broken or in doubt");
        let makers = self.holodeck.makers();
        let token = makers.get(maker).and_then(|made| made.token.clone()).unwrap_or_default();
        if self.faults.len() < MAX_FAULTS {
            let maker = maker.0;
            self.faults.push(FaultReport { name, maker, token, reason, is_dropped });
        }
    }

    /// Returns why a machine may not work here, if it was found broken. It may work again once the
    /// server was started again.
    pub(super) fn fault_of(&self, maker: Maker) -> Option<String> {
        let is_it = |fault: &&FaultReport| fault.is_dropped && fault.maker == maker.0;
        let fault = self.faults.iter().find(is_it).filter(|_| maker != Maker::UNKNOWN)?;
        Some(format!("its machine seems to be broken: {}", fault.reason))
    }
}
