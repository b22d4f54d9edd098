//! Workers' results: stored once, and passed on to the displays that look at them.

use std::collections::BTreeMap;

use anyhow::Result;
use holo_beamfile::{Error as FileError, Maker};
use holo_proto::{
    bulk::{Results, SampleSource, ViewSamples},
    frame::FrameKind,
};
use holo_section::{NumberRun, Sample, SampleKind};
use tokio::time::Instant;

use super::{Coordinator, display::is_looked_at};
use crate::{
    assignment::{Assignment, PacketPurpose, PacketState, ResultsError},
    better,
    events::ConnectionId,
};

impl Coordinator {
    /// Stores a worker's results and sends them to every display that looks at their beams.
    pub(super) fn results(&mut self, id: ConnectionId, results: &Results) -> Result<()> {
        let mut outgoing = BTreeMap::new();
        let taken = self
            .take_results(id, results, &mut outgoing)
            .and_then(|()| self.take_unseen(id, &results.unseen));
        // Even if a packet was refused: those before it are stored, so displays get them.
        for (id, message) in outgoing {
            if let Some(display) = self.displays.get(&id) {
                display.outbox.send(FrameKind::Samples, &message.encode())?;
            }
        }
        self.try_settle();
        taken
    }

    fn take_results(
        &mut self,
        id: ConnectionId,
        results: &Results,
        outgoing: &mut BTreeMap<ConnectionId, ViewSamples>,
    ) -> Result<()> {
        let usual = self.holodeck.about.settings.paths_per_sample;
        let now = Instant::now();
        let mut rest = results.samples.as_slice();
        for traced in &results.packets {
            let Some(worker) = self.workers.get_mut(&id) else { return Ok(()) };
            let maker = worker.stored_as;
            let (samples, after) = rest.split_at(traced.count as usize);
            rest = after;
            let finished = worker.finish(traced, now)?;
            let Some(assignment) = self.still_open(finished) else { continue };
            if assignment.packet.count as usize != samples.len() {
                let asked = assignment.packet.count;
                self.lose([assignment]);
                return Err(ResultsError::Count { found: traced.count, asked }.into());
            }
            if !assignment.is_answered_by(samples) {
                self.lose([assignment]);
                return Err(ResultsError::OtherRays.into());
            }
            let plausible = &self.holodeck.plausible;
            if let Err(error) = plausible.samples(assignment.key(), samples) {
                self.lose([assignment]);
                return Err(error.into());
            }
            match assignment.purpose {
                PacketPurpose::Store => {}
                PacketPurpose::Claim(check) => {
                    self.check_traced(id, assignment.key(), check, samples)?;
                    continue;
                }
                PacketPurpose::Again(audit) => {
                    self.audited(audit, Some(samples))?;
                    continue;
                }
            }
            let is_better = assignment.packet.paths > usual;
            let stored = match is_better {
                true => self.store_better(&assignment, maker, samples),
                false => self.store(&assignment, maker, samples),
            };
            match stored {
                Ok(()) => {}
                Err(FileError::NotWritten { .. }) => {
                    // A full disk, and no memory left. It is traced again when there is room.
                    self.lose([assignment]);
                    continue;
                }
                Err(error) => return Err(error.into()),
            }
            self.finish_packet(&assignment);
            self.audit(id, &assignment, samples);
            // No display looks at the beams of better samples.
            if !is_better {
                self.forward(&assignment, samples, outgoing);
            }
        }
        Ok(())
    }

    /// Returns the packet whose results have come. `None` if they are too late: another worker has
    /// or had the packet, or no display wants it any more.
    pub(super) fn still_open(&mut self, finished: PacketState<Assignment>) -> Option<Assignment> {
        match finished {
            PacketState::InTime(assignment) => Some(assignment),
            PacketState::Late(renamed) => {
                let renamed = renamed?;
                self.lost.remove(&renamed).or_else(|| self.checks.remove(&renamed))
            }
        }
    }

    /// Takes note that a packet's results have come, whatever they are.
    pub(super) fn finish_packet(&mut self, assignment: &Assignment) {
        if let Some(fill) = self.fill.as_mut().filter(|_| assignment.display.is_none()) {
            fill.finish_packet();
        }
    }

    fn store(
        &mut self,
        assignment: &Assignment,
        maker: Maker,
        samples: &[Sample],
    ) -> Result<(), FileError> {
        self.holodeck.file.append(assignment.run(), maker, samples)?;
        self.progress.add(samples.len() as u64);
        Ok(())
    }

    /// Puts better samples in the places of those that are worse.
    ///
    /// A packet that was lost and dealt again may come after others of more paths. If a display
    /// looks at the beam by now, nothing is replaced, so that the file later shows what the display
    /// shows now.
    fn store_better(
        &mut self,
        assignment: &Assignment,
        maker: Maker,
        samples: &[Sample],
    ) -> Result<(), FileError> {
        let (packet, key) = (&assignment.packet, assignment.key());
        if is_looked_at(&self.displays, key) {
            return Ok(());
        }
        let file = &self.holodeck.file;
        let numbers = packet.first..packet.first + u32::from(packet.count);
        for range in better::worse(
            &file.runs_within(key, SampleKind::Uniform, &numbers),
            packet.paths,
            &numbers,
        ) {
            let part = &samples
                [(range.start - packet.first) as usize..(range.end - packet.first) as usize];
            let run =
                NumberRun { first: range.start, count: range.len() as u32, ..assignment.run() };
            file.supersede(run, maker, part)?;
            self.progress.add_better(part.len() as u64);
        }
        Ok(())
    }

    /// Adds samples to the messages for displays that look at their beam.
    fn forward(
        &self,
        assignment: &Assignment,
        samples: &[Sample],
        outgoing: &mut BTreeMap<ConnectionId, ViewSamples>,
    ) {
        let key = assignment.key();
        for (&id, display) in &self.displays {
            let Some(wishes) = display.wishes.as_ref().filter(|wishes| wishes.contains(key)) else {
                continue;
            };
            let message = outgoing.entry(id).or_insert_with(|| ViewSamples {
                view: wishes.view,
                source: SampleSource::Traced,
                runs: Vec::new(),
                samples: Vec::new(),
            });
            message.runs.push(assignment.run());
            message.samples.extend_from_slice(samples);
        }
    }
}
