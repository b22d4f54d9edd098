//! Reports on the server's state to displays, people and administrators.

use anyhow::{Result, bail};
use holo_net::Message;
use holo_proto::{
    control::{Control, Status},
    report::{DisplayReport, StatusReport},
};
use tokio::time::Instant;
use tracing::info;

use super::{Coordinator, Fill, NOT_FOR_A_SERVER, STALLED_BYTES, STATUS_EVERY};
use crate::{events::ConnectionId, workers::ConnectedWorker};

impl Coordinator {
    /// Reports the server's state to displays and people every [`STATUS_EVERY`].
    pub(super) fn report(&mut self) {
        let now = Instant::now();
        if now - self.last_status < STATUS_EVERY {
            return;
        }
        self.last_status = now;
        let status = Status {
            samples: self.progress.total(),
            samples_per_second: self.progress.rate(),
            workers: self.workers.len() as u32,
            displays: self.displays.len() as u32,
        };
        for display in self.displays.values() {
            let _ = display.outbox.control(&Control::Status(status));
        }
        let stats = self.holodeck.file.stats();
        self.damage.print_new(&self.holodeck.file);
        self.stalled = stats.last_error.is_some() && stats.pending_bytes > STALLED_BYTES;
        if let Some(paths) = self.fill.as_mut().and_then(Fill::new_level) {
            info!(paths, "enough samples, better ones from now on");
            self.progress.say(&format!(
                "the file has enough samples: they are now traced again, with {paths} paths each"
            ));
        }
        self.progress.show(&status, &self.schedule, &stats);
        self.saver.save(&self.holodeck, self.progress.traced());
    }

    /// Answers an administrator.
    pub(super) fn admins_message(&mut self, id: ConnectionId, message: Message) -> Result<()> {
        let Some(outbox) = self.admins.get(&id).cloned() else { return Ok(()) };
        match message {
            Message::Control(Control::ReportWanted) => {
                Ok(outbox.control(&Control::Report(Box::new(self.present())))?)
            }
            Message::Control(Control::Ping(number)) => Ok(outbox.control(&Control::Pong(number))?),
            _ => bail!(NOT_FOR_A_SERVER),
        }
    }

    /// Returns a report on the server's state.
    fn present(&mut self) -> StatusReport {
        let stats = self.holodeck.file.stats();
        let displays = self.displays.values().map(|display| DisplayReport {
            name: display.name.clone(),
            beams: display.wishes.as_ref().map_or(0, |wishes| wishes.len() as u32),
            is_read_only: display.is_read_only,
            queued_bytes: display.outbox.queued_bytes() as u64,
        });
        StatusReport {
            software: self.holodeck.welcome().software,
            file: self.holodeck.path().display().to_string(),
            file_bytes: stats.file_bytes,
            samples: self.progress.total(),
            traced: self.progress.traced(),
            samples_per_second: self.progress.rate(),
            unseen_beams: self.holodeck.unseen().count(),
            disk_error: stats.last_error.unwrap_or_default(),
            workers: self.workers.values().map(ConnectedWorker::report).collect(),
            displays: displays.collect(),
            faults: self.fault_reports(),
        }
    }
}
