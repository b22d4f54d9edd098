//! Sends stored samples to a display, as fast as it takes them. Parts of the file that no view
//! requested are sent here too.
//!
//! A display shows a view while its samples still arrive. Therefore the beams that the view crosses
//! are sent in rounds: first a few samples of every beam, then more. Other beams follow one by one,
//! those of greater weight first.

use std::{
    collections::BTreeMap,
    ops::{ControlFlow, Range},
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result};
use holo_beamfile::{BeamSamples, Caching, Mark};
use holo_net::{Outbox, SCENE_CHUNK_BYTES};
use holo_progress::said_once;
use holo_proto::{
    LEAST_TRACED_WEIGHT, ProtoError,
    bulk::{BlobChunk, MAX_RUN, SampleSource, Unseen, ViewSamples},
    fading,
    frame::FrameKind,
};
use holo_section::{BeamId, BeamKey, NumberRun};
use rustc_hash::FxHashMap;

use crate::holodeck::Holodeck;

/// Samples in one message: large enough that messages cost nothing, small enough that the first is
/// seen soon.
const SAMPLES_PER_MESSAGE: usize = 16_384;

/// Beams in one message: a megabyte.
const UNSEEN_PER_MESSAGE: usize = 65_536;

/// Bytes that may wait for a display before reading pauses.
const QUEUE_BYTES: usize = 8 << 20;

/// Bytes that may wait for somebody before the next piece of a blob is queued: two pieces. Other
/// messages wait for no more than that.
const BLOB_QUEUE_BYTES: usize = 2 * SCENE_CHUNK_BYTES;

/// Time to wait before a full queue is checked again.
const PAUSE: Duration = Duration::from_millis(1);

/// Most beams that are looked up for one part, whatever they hold: some 20 ms.
const BEAMS_PER_PART: u64 = 1 << 18;

/// Beams whose weights differ by a smaller factor are read together, in file order.
const WEIGHT_CLASS: f32 = 4.0;

/// Samples per unit of weight, which is one pixel, that the first round sends of each beam.
const FIRST_ROUND: f32 = 1.0 / 16.0;

/// Each round sends until a beam has this many times as many samples as after the round before.
const NEXT_ROUND: f32 = 2.0;

/// Least number of samples that a round sends of a beam.
const LEAST_OF_BEAM: usize = 8;

/// Most samples that are read before their rounds begin: 48 MB.
const MOST_IN_ROUNDS: usize = 1 << 22;

/// Longest time for which reading delays their rounds.
const ROUNDS_PATIENCE: Duration = Duration::from_millis(50);

/// A view's stored samples, except those that its display has.
pub struct Recall {
    pub holodeck: Arc<Holodeck>,
    pub outbox: Outbox,
    pub view: u32,
    /// The beams of which it lacks samples, and their weights.
    pub keys: Vec<(BeamKey, f32)>,
    /// The beams of which it lacks samples of an earlier generation, and their weights.
    pub earlier: Vec<(BeamKey, f32)>,
    /// The display's newest view: reading for an older one ends.
    pub newest: Arc<AtomicU32>,
}

impl Recall {
    /// Reads and sends on a thread of its own, until the display goes on to another view. At the
    /// end it calls `done` with the view's number, and an error's text if there was one.
    pub fn start(
        self,
        done: impl FnOnce(u32, Result<(), String>) + Send + 'static,
    ) -> std::io::Result<()> {
        thread::Builder::new().name("recall".into()).spawn(move || {
            let result = named_if_cut(&self.holodeck, self.send_all());
            done(self.view, result);
        })?;
        Ok(())
    }

    fn is_wanted(&self) -> bool {
        self.newest.load(Ordering::Acquire) == self.view && !self.outbox.is_closed()
    }

    fn send_all(&self) -> Result<()> {
        self.holodeck.refresh().context("looking for what another process has added")?;
        self.send_unseen()?;
        let is_wanted = || self.is_wanted();
        let is_crossed = |&(_, weight): &(BeamKey, f32)| weight >= LEAST_TRACED_WEIGHT;
        let (crossed, others): (Vec<_>, Vec<_>) = self.keys.iter().copied().partition(is_crossed);
        let sender =
            |source| Sender::new(&self.holodeck, &self.outbox, (self.view, source), &is_wanted);
        let mut stored = sender(SampleSource::Stored);
        stored.send_in_rounds(&crossed)?;
        stored.send_by_weight(&others)?;
        stored.finish()?;
        let mut earlier = sender(SampleSource::Earlier);
        earlier.send_by_weight(&self.earlier)?;
        earlier.finish()
    }

    /// Sends which of the view's beams see nothing. The coordinator sends those found later.
    fn send_unseen(&self) -> Result<()> {
        let beams: Vec<_> = {
            let unseen = self.holodeck.unseen();
            let keys = self.keys.iter().map(|&(key, _)| key);
            keys.filter(|&key| unseen.contains(key)).collect()
        };
        Ok(send_unseen(&self.outbox, self.view, &beams)?)
    }
}

/// A part of the file that no view requested.
pub struct FilePart {
    pub holodeck: Arc<Holodeck>,
    pub outbox: Outbox,
    pub section: u16,
    /// The number of its first beam.
    pub first: u64,
    /// About how many samples it has.
    pub samples: u32,
    /// Samples that were stored later are left out.
    pub until: Option<Mark>,
}

impl FilePart {
    /// Reads and sends on a thread of its own. At the end it calls `done` with the number of the
    /// next beam, or with an error's text.
    pub fn start(
        self,
        done: impl FnOnce(Result<Option<u64>, String>) + Send + 'static,
    ) -> std::io::Result<()> {
        thread::Builder::new().name("part".into()).spawn(move || {
            done(named_if_cut(&self.holodeck, self.send()));
        })?;
        Ok(())
    }

    /// Returns the number of the next beam.
    fn send(&self) -> Result<Option<u64>> {
        let beams = self.holodeck.sections[usize::from(self.section)].beam_count();
        let end = beams.min(self.first.saturating_add(BEAMS_PER_PART));
        let file = &self.holodeck.file;
        let (mut keys, mut earlier) = (Vec::new(), Vec::new());
        let mut samples = 0;
        let mut next = self.first;
        while next < end && samples < u64::from(self.samples) {
            let key = BeamKey { section: self.section, beam: BeamId(next) };
            let stored = file.count(key);
            if stored > 0 {
                keys.push(key);
                samples += stored;
            }
            let lasting = lasting(file.count_earlier(key), stored);
            if lasting > 0 {
                earlier.push(key);
                samples += lasting;
            }
            next += 1;
        }
        let is_wanted = || !self.outbox.is_closed();
        for (source, keys) in [(SampleSource::Part, keys), (SampleSource::Earlier, earlier)] {
            let mut sender = Sender::new(&self.holodeck, &self.outbox, (0, source), &is_wanted);
            sender.until = self.until;
            sender.send_beams(&keys)?;
            sender.finish()?;
        }
        Ok((next < beams).then_some(next))
    }
}

/// Returns how many of a beam's earlier samples still count beside so many present ones.
pub fn lasting(earlier: u64, present: u64) -> u64 {
    // A beam has at most 2³² samples of a kind.
    let ranks = 0..u32::try_from(earlier).unwrap_or(u32::MAX);
    if present >= u64::from(fading::ENOUGH) {
        return 0;
    }
    fading::lasting(ranks, present).map(|ranks| ranks.len() as u64).sum()
}

/// Returns an error as a text. If the file was cut off, the file reports that from now on, also if
/// nothing but its checksums showed it.
fn named_if_cut<T>(holodeck: &Holodeck, result: Result<T>) -> Result<T, String> {
    let checked = holodeck.file.check_length();
    result
        .and_then(|done| checked.map(|()| done).map_err(Into::into))
        .map_err(|error| said_once(error.as_ref()))
}

/// Sends samples of beams, many in one message.
struct Sender<'a> {
    holodeck: &'a Holodeck,
    outbox: &'a Outbox,
    message: ViewSamples,
    /// Most paths that are stated for a sample. Displays weigh samples by their paths, but equal
    /// weights make better pictures: docs/notes/weights.md.
    usual_paths: u16,
    /// Returns whether the display still wants these samples.
    is_wanted: &'a dyn Fn() -> bool,
    /// Samples of the present generation that were stored later are left out of parts.
    until: Option<Mark>,
}

impl<'a> Sender<'a> {
    fn new(
        holodeck: &'a Holodeck,
        outbox: &'a Outbox,
        (view, source): (u32, SampleSource),
        is_wanted: &'a dyn Fn() -> bool,
    ) -> Sender<'a> {
        let message = ViewSamples { view, source, runs: Vec::new(), samples: Vec::new() };
        let usual_paths = holodeck.about.settings.paths_per_sample;
        Sender { holodeck, outbox, message, usual_paths, is_wanted, until: None }
    }

    /// Sends samples of some beams: all of the present generation, those in memory first, or those
    /// of an earlier generation that still count. The last ones wait for more.
    fn send_beams(&mut self, keys: &[BeamKey]) -> Result<()> {
        let file = &self.holodeck.file;
        let (source, until) = (self.message.source, self.until);
        let mut sent = Ok(());
        let mut send = |key: BeamKey, beam: Arc<BeamSamples>| {
            sent = match source {
                SampleSource::Earlier => self.add_earlier(&beam, file.count(key)),
                _ => self.add(&beam, 0..beam.samples.len()),
            };
            if sent.is_err() || !(self.is_wanted)() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        match source {
            SampleSource::Earlier => file.read_earlier(keys, &mut send)?,
            // A display requests each part once. Beams of views must not leave the cache for it.
            SampleSource::Part => match until {
                Some(mark) => file.read_until(keys, mark, &mut send)?,
                None => file.read_many(keys, Caching::Bypass, &mut send)?,
            },
            SampleSource::Stored | SampleSource::Traced => {
                file.read_many(keys, Caching::Fill, &mut send)?
            }
        }
        sent
    }

    /// Sends samples of beams, given with their weights. Those of greater weight come first.
    fn send_by_weight(&mut self, beams: &[(BeamKey, f32)]) -> Result<()> {
        let mut classes = by_weight(beams).take_while(|_| (self.is_wanted)());
        classes.try_for_each(|keys| self.send_beams(&keys))
    }

    /// Sends samples of the beams of a view, given with their weights, in rounds. Reading that
    /// takes long, or very many samples, are divided among several sequences of rounds.
    fn send_in_rounds(&mut self, beams: &[(BeamKey, f32)]) -> Result<()> {
        let weights: FxHashMap<BeamKey, f32> = beams.iter().copied().collect();
        let file = &self.holodeck.file;
        let (mut read, mut samples, mut since) = (Vec::new(), 0, Instant::now());
        for keys in by_weight(beams) {
            if !(self.is_wanted)() {
                return Ok(());
            }
            let mut sent = Ok(());
            let mut take = |key: BeamKey, beam: Arc<BeamSamples>| {
                samples += beam.samples.len();
                read.push((weights[&key], beam));
                if samples >= MOST_IN_ROUNDS || since.elapsed() >= ROUNDS_PATIENCE {
                    sent = self.send_rounds(std::mem::take(&mut read));
                    (samples, since) = (0, Instant::now());
                }
                match sent.is_ok() && (self.is_wanted)() {
                    true => ControlFlow::Continue(()),
                    false => ControlFlow::Break(()),
                }
            };
            file.read_many(&keys, Caching::Fill, &mut take)?;
            sent?;
        }
        self.send_rounds(read)
    }

    /// Sends all samples of beams, given with their weights, in rounds.
    fn send_rounds(&mut self, beams: Vec<(f32, Arc<BeamSamples>)>) -> Result<()> {
        let pieces = rounds(beams.iter().map(|(weight, beam)| (*weight, beam.samples.len())));
        for (beam, part) in pieces {
            if !(self.is_wanted)() {
                break;
            }
            self.add(&beams[beam].1, part)?;
        }
        Ok(())
    }

    fn add_earlier(&mut self, beam: &BeamSamples, present: u64) -> Result<()> {
        let mut rank = 0u32;
        for (run, samples) in beam.iter() {
            let paths = run.paths.min(self.usual_paths);
            let (first, end) = (rank, rank.saturating_add(samples.len() as u32));
            rank = end;
            for ranks in fading::lasting(first..end, present) {
                let part = &samples[(ranks.start - first) as usize..(ranks.end - first) as usize];
                let count = ranks.len() as u32;
                self.message.runs.push(NumberRun { first: ranks.start, count, paths, ..*run });
                self.message.samples.extend_from_slice(part);
                if self.message.samples.len() >= SAMPLES_PER_MESSAGE {
                    self.send()?;
                }
            }
        }
        Ok(())
    }

    /// Sends the samples in `part` of the beam's samples.
    fn add(&mut self, beam: &BeamSamples, part: Range<usize>) -> Result<()> {
        let mut begin = 0;
        for (run, samples) in beam.iter() {
            let end = begin + samples.len();
            let (from, to) = (part.start.clamp(begin, end), part.end.clamp(begin, end));
            let mut first = run.first + (from - begin) as u32;
            for part in samples[from - begin..to - begin].chunks(MAX_RUN as usize) {
                let count = part.len() as u32;
                let paths = run.paths.min(self.usual_paths);
                self.message.runs.push(NumberRun { first, count, paths, ..*run });
                self.message.samples.extend_from_slice(part);
                first += count;
                if self.message.samples.len() >= SAMPLES_PER_MESSAGE {
                    self.send()?;
                }
            }
            begin = end;
        }
        Ok(())
    }

    /// Sends what waits.
    fn send(&mut self) -> Result<()> {
        while self.outbox.queued_bytes() > QUEUE_BYTES && (self.is_wanted)() {
            thread::sleep(PAUSE);
        }
        self.outbox.send(FrameKind::Samples, &self.message.encode())?;
        self.message.runs.clear();
        self.message.samples.clear();
        Ok(())
    }

    /// Sends the last message.
    fn finish(mut self) -> Result<()> {
        if self.message.samples.is_empty() { Ok(()) } else { self.send() }
    }
}

/// Returns the pieces in which the samples of beams are sent, as indices of beams and ranges of
/// their samples. Beams are given as their weights and numbers of samples.
fn rounds(
    beams: impl Iterator<Item = (f32, usize)>,
) -> impl Iterator<Item = (usize, Range<usize>)> {
    // Beams that are not sent yet: index, weight, number of samples, and how many are sent.
    let mut rest: Vec<(usize, f32, usize, usize)> =
        beams.enumerate().map(|(index, (weight, count))| (index, weight, count, 0)).collect();
    let mut density = FIRST_ROUND;
    std::iter::from_fn(move || {
        rest.retain(|&(.., count, sent)| sent < count);
        let mut pieces = Vec::new();
        for (index, weight, count, sent) in &mut rest {
            // Conversions of floats saturate.
            let end = ((*weight * density) as usize).max(LEAST_OF_BEAM).min(*count);
            if end > *sent {
                pieces.push((*index, *sent..end));
                *sent = end;
            }
        }
        density *= NEXT_ROUND;
        (!rest.is_empty()).then_some(pieces)
    })
    .flatten()
}

/// Returns beams in classes of about equal weight, the heaviest first. Each class keeps their
/// order.
fn by_weight(beams: &[(BeamKey, f32)]) -> impl Iterator<Item = Vec<BeamKey>> {
    let mut classes = BTreeMap::<i32, Vec<BeamKey>>::new();
    for &(key, weight) in beams {
        // Conversions of floats saturate, so a weight of 0 belongs to the last class.
        let class = weight.log(WEIGHT_CLASS).floor() as i32;
        classes.entry(class).or_default().push(key);
    }
    classes.into_values().rev()
}

/// Informs a display which of its view's beams see nothing.
pub fn send_unseen(outbox: &Outbox, view: u32, beams: &[BeamKey]) -> Result<(), ProtoError> {
    beams.chunks(UNSEEN_PER_MESSAGE).try_for_each(|part| {
        outbox.send(FrameKind::Unseen, &Unseen { view, beams: part.to_vec() }.encode())
    })
}

/// A blob that peers may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Blob {
    /// The packed scene.
    Scene,
    /// The stand-ins for the scene.
    StandIns,
}

impl Blob {
    fn read(self, holodeck: &Holodeck) -> Result<Arc<[u8]>> {
        match self {
            Blob::Scene => holodeck.packed_scene(),
            Blob::StandIns => {
                holodeck.stand_ins()?.context("the file holds no stand-ins for the scene")
            }
        }
    }
}

/// Sends a blob in pieces, on a thread of its own, which calls `done` at its end. If the blob
/// cannot be read, sends a message that it is absent.
pub fn send_blob(
    holodeck: Arc<Holodeck>,
    outbox: Outbox,
    blob: Blob,
    done: impl FnOnce() + Send + 'static,
) -> std::io::Result<()> {
    thread::Builder::new().name("blob".into()).spawn(move || {
        send_pieces(blob.read(&holodeck), &outbox);
        done();
    })?;
    Ok(())
}

fn send_pieces(read: Result<Arc<[u8]>>, outbox: &Outbox) {
    let bytes = match read {
        Ok(bytes) if !bytes.is_empty() => bytes,
        read => {
            if let Err(error) = read {
                // This is printed even with `quiet`, because displays will not show what was
                // requested.
                eprintln!("{}", said_once(error.as_ref()));
            }
            let _ = outbox.send(FrameKind::BlobChunk, &holo_net::absent().encode());
            return;
        }
    };
    let mut offset = 0;
    for piece in bytes.chunks(SCENE_CHUNK_BYTES) {
        while outbox.queued_bytes() > BLOB_QUEUE_BYTES && !outbox.is_closed() {
            thread::sleep(PAUSE);
        }
        let chunk = BlobChunk { offset, bytes: piece.to_vec() };
        if outbox.send(FrameKind::BlobChunk, &chunk.encode_compressed()).is_err() {
            return;
        }
        offset += piece.len() as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_send_every_sample_once_and_equal_numbers_per_pixel() {
        let beams = [(100.0, 3000), (400.0, 3000), (0.01, 100), (50.0, 0), (f32::MAX, 17)];
        let mut sent = [0; 5];
        let pieces: Vec<_> = rounds(beams.into_iter()).collect();
        for (at, (beam, part)) in pieces.iter().enumerate() {
            assert!(part.start == sent[*beam] && part.end > part.start, "{part:?} of beam {beam}");
            sent[*beam] = part.end;
            if at > 4 && sent[..2].iter().all(|&sent| sent < 3000) {
                let ratio = sent[1] as f32 / sent[0] as f32;
                assert!((1.9..8.1).contains(&ratio), "{sent:?}");
            }
        }
        assert_eq!(sent, beams.map(|(_, count)| count));
        let first: Vec<_> = pieces[..4].to_vec();
        assert_eq!(first, [(0, 0..8), (1, 0..25), (2, 0..8), (4, 0..17)]);
        // A beam that hardly any pixel crosses comes last.
        assert_eq!(pieces.last(), Some(&(2, 81..100)));
    }

    #[test]
    fn heavier_beams_come_first_and_like_ones_together() {
        let weights = [1e-6, 300.0, 0.0, 1e-6, 270.0, 1.0, 2.0, 1e-6, f32::MAX, f32::MIN_POSITIVE];
        let key = |number| BeamKey { section: 0, beam: BeamId(number) };
        let beams: Vec<_> = (0..).map(key).zip(weights).collect();
        let classes: Vec<Vec<u64>> = by_weight(&beams)
            .map(|class| class.into_iter().map(|key| key.beam.0).collect())
            .collect();
        let expected: [&[u64]; 6] = [&[8], &[1, 4], &[5, 6], &[0, 3, 7], &[9], &[2]];
        assert_eq!(classes, expected);
    }
}
