//! What workers send back: stored once, and passed on to whoever looks at it.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, Result, ensure};
use holo_proto::{
    bulk::{Results, Samples, Source},
    frame::Kind,
};
use holo_section::{BeamKey, Run, Sample};

use super::Coordinator;
use crate::{
    better,
    listen::ConnectionId,
    recall::tell_unseen,
    workers::{Assignment, ResultsError},
};

impl Coordinator {
    /// A worker's results: stored, then sent to every display that looks at their beams.
    pub(super) fn results(&mut self, id: ConnectionId, results: &Results) -> Result<()> {
        let mut outgoing = BTreeMap::new();
        let taken = self
            .take_results(id, results, &mut outgoing)
            .and_then(|()| self.take_unseen(id, &results.unseen));
        // Even if a packet was refused: those before it are stored, so displays get them.
        for (id, message) in outgoing {
            if let Some(display) = self.displays.get(&id) {
                display.outbox.send(Kind::Samples, &message.encode())?;
            }
        }
        self.try_settle();
        taken
    }

    fn take_results(
        &mut self,
        id: ConnectionId,
        results: &Results,
        outgoing: &mut BTreeMap<ConnectionId, Samples>,
    ) -> Result<()> {
        let mut rest = results.samples.as_slice();
        for traced in &results.packets {
            let Some(worker) = self.workers.get_mut(&id) else { return Ok(()) };
            let assignment = worker.finish(traced)?;
            let (samples, after) = rest.split_at(traced.count as usize);
            rest = after;
            let better = self.is_better(&assignment.packet);
            let stored = if better {
                self.store_better(&assignment, samples)
            } else {
                self.store(&assignment, samples)
            };
            match stored {
                Ok(()) => {}
                Err(holo_beamfile::Error::NotWritten { .. }) => {
                    // No memory left for what a full disk does not take: it is traced again when there is room.
                    self.again.push_back(assignment);
                    continue;
                }
                Err(error) => return Err(error.into()),
            }
            self.done(&assignment);
            // Nobody looks at better ones.
            if !better {
                self.forward(&assignment, samples, outgoing);
            }
        }
        Ok(())
    }

    /// Packets that a worker did not trace since their beams see nothing: remembered, and told to whoever looks at them.
    fn take_unseen(&mut self, id: ConnectionId, packets: &[u64]) -> Result<()> {
        let mut outgoing: BTreeMap<ConnectionId, BTreeSet<_>> = BTreeMap::new();
        let taken = packets.iter().try_for_each(|&packet| {
            let key = self.finish_unseen(id, packet)?;
            self.holodeck.unseen_mut().insert(key);
            for (&display, looking) in &self.displays {
                if looking.wishes.as_ref().is_some_and(|wishes| wishes.contains(key)) {
                    // Several packets of one beam may have been under way.
                    outgoing.entry(display).or_default().insert(key);
                }
            }
            Ok(())
        });
        // Even if a packet was refused, as with samples.
        for (id, beams) in outgoing {
            if let Some((display, view)) =
                self.displays.get(&id).and_then(|d| Some((d, d.wishes.as_ref()?.view)))
            {
                tell_unseen(&display.outbox, view, &Vec::from_iter(beams))?;
            }
        }
        taken
    }

    fn finish_unseen(&mut self, id: ConnectionId, packet: u64) -> Result<BeamKey> {
        ensure!(self.holodeck.skip_unseen, ResultsError::NotAsked);
        let worker = self.workers.get_mut(&id).context("it has left")?;
        let assignment = worker.finish_unseen(packet)?;
        self.done(&assignment);
        Ok(assignment.packet.key)
    }

    fn store(
        &mut self,
        assignment: &Assignment,
        samples: &[Sample],
    ) -> Result<(), holo_beamfile::Error> {
        self.holodeck.file.append(assignment.run(), samples)?;
        self.progress.add(samples.len() as u64);
        Ok(())
    }

    /// Better samples take the places of those that are worse. A lost packet that was dealt again may come after others of more
    /// paths. What somebody looks at by now stays as it is: a picture is not made of two samples of one ray, and the file shows
    /// later what is seen at present.
    fn store_better(
        &mut self,
        assignment: &Assignment,
        samples: &[Sample],
    ) -> Result<(), holo_beamfile::Error> {
        let packet = &assignment.packet;
        let key = packet.key;
        if self.is_looked_at(key) {
            return Ok(());
        }
        let file = &self.holodeck.file;
        let numbers = packet.first..packet.first + u32::from(packet.count);
        for range in better::worse(&file.runs(key), packet.paths, &numbers) {
            let part = &samples
                [(range.start - packet.first) as usize..(range.end - packet.first) as usize];
            let run = Run { first: range.start, count: range.len() as u32, ..assignment.run() };
            file.supersede(run, part)?;
            self.progress.add_better(part.len() as u64);
        }
        Ok(())
    }

    fn forward(
        &self,
        assignment: &Assignment,
        samples: &[Sample],
        outgoing: &mut BTreeMap<ConnectionId, Samples>,
    ) {
        let packet = &assignment.packet;
        let key = packet.key;
        for (&id, display) in &self.displays {
            let Some(wishes) = display.wishes.as_ref().filter(|wishes| wishes.contains(key)) else {
                continue;
            };
            let message = outgoing.entry(id).or_insert_with(|| Samples {
                view: wishes.view,
                source: Source::Traced,
                runs: Vec::new(),
                samples: Vec::new(),
            });
            message.runs.push(assignment.run());
            message.samples.extend_from_slice(samples);
        }
    }
}
