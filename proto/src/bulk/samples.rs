//! The answer to a view, server to display: samples, and unseen beams.

use bytemuck::{Pod, Zeroable};
use holo_section::{BeamId, BeamKey, NumberRun, Sample, SampleKind};

use super::{Head, RecordReader, expect_total, put};
use crate::ProtoError;

/// Most samples of a run in a [`ViewSamples`] message.
pub const MAX_RUN: u32 = 1 << 20;

/// The source of samples for a display.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum SampleSource {
    /// The file.
    Stored = 0,
    /// A worker, moments ago.
    Traced = 1,
    /// The file, as a part without a view.
    Part = 2,
    /// The file: samples of an earlier generation, as far as they still count
    /// ([`crate::fading`]). Their numbers are ranks in their beam, and their view is any.
    Earlier = 3,
}

/// Server to display: samples for a view.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewSamples {
    /// The view of the samples. For [`SampleSource::Part`], any number.
    pub view: u32,
    /// The source of the samples.
    pub source: SampleSource,
    /// The runs, in the order of their samples.
    pub runs: Vec<NumberRun>,
    /// Samples of all runs, one after the other.
    pub samples: Vec<Sample>,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct RawRun {
    beam: u64,
    first: u32,
    count: u32,
    section: u16,
    paths: u16,
    kind: u8,
    reserved: [u8; 3],
}
const _: () = assert!(size_of::<RawRun>() == 24);

impl ViewSamples {
    /// Returns the payload: view and source, numbers of runs and samples, runs, samples.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(16 + self.runs.len() * 24 + self.samples.len() * 10);
        put(&mut out, &Head { first: self.view, second: self.source as u32 });
        put(&mut out, &Head { first: self.runs.len() as u32, second: self.samples.len() as u32 });
        for run in &self.runs {
            put(
                &mut out,
                &RawRun {
                    beam: run.key.beam.0,
                    first: run.first,
                    count: run.count,
                    section: run.key.section,
                    paths: run.paths,
                    kind: run.kind as u8,
                    reserved: [0; 3],
                },
            );
        }
        out.extend_from_slice(bytemuck::cast_slice(&self.samples));
        out
    }

    /// Parses a payload. It does not check whether the beams exist.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts, kinds or numbers.
    pub fn decode(bytes: &[u8]) -> Result<ViewSamples, ProtoError> {
        let mut reader = RecordReader(bytes);
        let head: Head = reader.one("samples message")?;
        let counts: Head = reader.one("samples message")?;
        let raw = reader.many::<RawRun>("run list", u64::from(counts.first))?;
        let samples = reader.many::<Sample>("sample list", u64::from(counts.second))?;
        reader.end()?;
        let source = match head.second {
            0 => SampleSource::Stored,
            1 => SampleSource::Traced,
            2 => SampleSource::Part,
            3 => SampleSource::Earlier,
            _ => return Err(ProtoError::Number("the source of samples")),
        };
        let runs = raw.into_iter().map(parse_run).collect::<Result<Vec<_>, _>>()?;
        let said = runs.iter().map(|run| u64::from(run.count)).sum();
        expect_total("sample list", said, &samples)?;
        Ok(ViewSamples { view: head.first, source, runs, samples })
    }

    /// Returns each run with its samples.
    pub fn iter(&self) -> impl Iterator<Item = (&NumberRun, &[Sample])> {
        let mut rest = self.samples.as_slice();
        self.runs.iter().map(move |run| {
            let (samples, after) = rest.split_at(rest.len().min(run.count as usize));
            rest = after;
            (run, samples)
        })
    }
}

fn parse_run(raw: RawRun) -> Result<NumberRun, ProtoError> {
    let kind = SampleKind::from_code(raw.kind).ok_or(ProtoError::SampleKind(raw.kind))?;
    if raw.count == 0 || raw.count > MAX_RUN {
        return Err(ProtoError::TooMany {
            what: "samples in a run",
            found: u64::from(raw.count),
            limit: u64::from(MAX_RUN),
        });
    }
    if raw.paths == 0 {
        return Err(ProtoError::Number("a run's number of paths"));
    }
    if raw.first.checked_add(raw.count).is_none() {
        return Err(ProtoError::Number("a run's first sample number"));
    }
    Ok(NumberRun {
        key: BeamKey { section: raw.section, beam: BeamId(raw.beam) },
        kind,
        first: raw.first,
        count: raw.count,
        paths: raw.paths,
    })
}

/// Server to display: unseen beams of a view. None of their rays hits anything, so they show the
/// sky, and nothing is traced in them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unseen {
    /// The view that they belong to.
    pub view: u32,
    /// The beams.
    pub beams: Vec<BeamKey>,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct RawUnseen {
    beam: u64,
    section: u16,
    reserved: [u8; 6],
}
const _: () = assert!(size_of::<RawUnseen>() == 16);

impl Unseen {
    /// Returns the payload: view, number of beams, beams.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(8 + self.beams.len() * 16);
        put(&mut out, &Head { first: self.view, second: self.beams.len() as u32 });
        for &BeamKey { section, beam } in &self.beams {
            put(&mut out, &RawUnseen { beam: beam.0, section, reserved: [0; 6] });
        }
        out
    }

    /// Parses a payload. It does not check whether the beams exist.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts.
    pub fn decode(bytes: &[u8]) -> Result<Unseen, ProtoError> {
        let mut reader = RecordReader(bytes);
        let counts: Head = reader.one("unseen message")?;
        let beams = reader.many::<RawUnseen>("unseen beam list", u64::from(counts.second))?;
        reader.end()?;
        let beams = beams
            .into_iter()
            .map(|raw| BeamKey { section: raw.section, beam: BeamId(raw.beam) })
            .collect();
        Ok(Unseen { view: counts.first, beams })
    }
}
