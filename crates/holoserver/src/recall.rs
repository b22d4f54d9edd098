//! Sending a view's stored samples to its display: in file order, as fast as the display takes them.

use std::{
    ops::ControlFlow,
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
    thread,
    time::Duration,
};

use anyhow::{Context, Result};
use holo_net::{Outbox, SCENE_CHUNK_BYTES};
use holo_proto::{
    ProtoError,
    bulk::{BlobChunk, MAX_RUN, Samples, Source, Unseen},
    frame::Kind,
};
use holo_section::{BeamKey, Run};

use crate::holodeck::Holodeck;

/// Samples in one message: large enough that messages cost nothing, small enough that the first is seen soon.
const SAMPLES_PER_MESSAGE: usize = 16_384;

/// Beams in one message: a megabyte.
const UNSEEN_PER_MESSAGE: usize = 65_536;

/// Bytes that wait for a display at the most before reading pauses.
const QUEUE_BYTES: usize = 8 << 20;

/// How long to wait before a full queue is looked at again.
const PAUSE: Duration = Duration::from_millis(1);

/// A display's stored samples for one view.
pub struct Recall {
    pub holodeck: Arc<Holodeck>,
    pub outbox: Outbox,
    pub view: u32,
    pub keys: Vec<BeamKey>,
    /// The display's newest view: reading for an older one ends.
    pub newest: Arc<AtomicU32>,
}

impl Recall {
    /// Reads and sends on a thread of its own, then calls `done` with the view's number, or an error's text. A view
    /// that is no longer the newest ends without either.
    pub fn start(
        self,
        done: impl FnOnce(u32, Result<(), String>) + Send + 'static,
    ) -> std::io::Result<()> {
        thread::Builder::new().name("recall".into()).spawn(move || {
            let result = self.send_all().map_err(|error| format!("{error:#}"));
            if self.is_wanted() {
                done(self.view, result);
            }
        })?;
        Ok(())
    }

    fn is_wanted(&self) -> bool {
        self.newest.load(Ordering::Acquire) == self.view && !self.outbox.is_closed()
    }

    fn send_all(&self) -> Result<()> {
        self.holodeck.refresh().context("looking for what another process has added")?;
        self.send_unseen()?;
        let mut message = self.empty();
        // A display weighs samples by their paths, and so much that pictures get worse while a level is in progress: what one pixel
        // sees differs from ray to ray, too, which more paths in some of them do not change. With a quarter of 4 M samples at 16 paths
        // and the rest at 4 (Cornell, `path`), `quadtree` errs by 0.019 so and by 0.010 with equal weights, which only gain.
        let usual = self.holodeck.about.settings.paths_per_sample;
        let mut broken = Ok(());
        self.holodeck.file.read_many(&self.keys, &mut |_, beam| {
            for (run, samples) in beam.iter() {
                let mut first = run.first;
                for part in samples.chunks(MAX_RUN as usize) {
                    let count = part.len() as u32;
                    let paths = run.paths.min(usual);
                    message.runs.push(Run { first, count, paths, ..*run });
                    message.samples.extend_from_slice(part);
                    first += count;
                    if message.samples.len() >= SAMPLES_PER_MESSAGE {
                        broken = self.send(&std::mem::replace(&mut message, self.empty()));
                    }
                }
            }
            if broken.is_err() || !self.is_wanted() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        })?;
        broken?;
        self.send(&message)
    }

    /// Those found from now on the coordinator tells of.
    fn send_unseen(&self) -> Result<()> {
        let beams: Vec<_> = {
            let unseen = self.holodeck.unseen();
            self.keys.iter().copied().filter(|&key| unseen.contains(key)).collect()
        };
        Ok(tell_unseen(&self.outbox, self.view, &beams)?)
    }

    fn empty(&self) -> Samples {
        Samples { view: self.view, source: Source::Stored, runs: Vec::new(), samples: Vec::new() }
    }

    fn send(&self, message: &Samples) -> Result<()> {
        if message.samples.is_empty() {
            return Ok(());
        }
        while self.outbox.queued_bytes() > QUEUE_BYTES && self.is_wanted() {
            thread::sleep(PAUSE);
        }
        Ok(self.outbox.send(Kind::Samples, &message.encode())?)
    }
}

/// Tells a display which of its view's beams see nothing.
pub fn tell_unseen(outbox: &Outbox, view: u32, beams: &[BeamKey]) -> Result<(), ProtoError> {
    beams.chunks(UNSEEN_PER_MESSAGE).try_for_each(|part| {
        outbox.send(Kind::Unseen, &Unseen { view, beams: part.to_vec() }.encode())
    })
}

/// Sends the packed scene in pieces, on a thread of its own.
pub fn send_scene(holodeck: Arc<Holodeck>, outbox: Outbox) -> std::io::Result<()> {
    send_blob(outbox, move || holodeck.packed_scene().ok())
}

/// Sends the stand-ins in the same way.
pub fn send_stand_ins(holodeck: Arc<Holodeck>, outbox: Outbox) -> std::io::Result<()> {
    send_blob(outbox, move || holodeck.stand_ins().ok().flatten())
}

fn send_blob(
    outbox: Outbox,
    read: impl FnOnce() -> Option<Arc<[u8]>> + Send + 'static,
) -> std::io::Result<()> {
    thread::Builder::new().name("scene".into()).spawn(move || {
        let Some(packed) = read() else { return };
        let mut offset = 0;
        for piece in packed.chunks(SCENE_CHUNK_BYTES) {
            while outbox.queued_bytes() > QUEUE_BYTES && !outbox.is_closed() {
                thread::sleep(PAUSE);
            }
            let chunk = BlobChunk { offset, bytes: piece.to_vec() };
            if outbox.send(Kind::BlobChunk, &chunk.encode()).is_err() {
                return;
            }
            offset += piece.len() as u64;
        }
    })?;
    Ok(())
}
