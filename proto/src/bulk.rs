//! Bulk messages: packets to trace, samples traced, beams wanted. A fixed head, then arrays of plain-old-data records.

use bytemuck::{Pod, Zeroable};
pub use holo_light::Record;
use holo_section::{BeamId, RayCoords, Sample, SampleKind, Viewpoint};

use crate::{MAX_RAYS_PER_PACKET, ProtoError};

/// Longest run of samples of one beam in a [`Samples`] message.
pub const MAX_RUN: u32 = 1 << 20;

/// A packet to trace: which rays is a function of (section, beam, kind, first, viewpoint) alone, or it names them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Packet {
    /// The server's name for this assignment, given back with the results.
    pub id: u64,
    /// Section number.
    pub section: u16,
    /// Beam in the section.
    pub beam: BeamId,
    /// First sample number.
    pub first: u32,
    /// Rays, 1 to [`MAX_RAYS_PER_PACKET`].
    pub count: u8,
    /// Paths averaged into each sample, at least 1.
    pub paths: u16,
    /// Index into [`Work::viewpoints`], less than 65534; `None`: uniform in the beam.
    pub viewpoint: Option<u16>,
    /// Its rays, `count` of them and then zeros, if they were asked for one by one; it then has no viewpoint.
    pub rays: Option<[RayCoords; MAX_RAYS_PER_PACKET]>,
}

impl Packet {
    /// How its rays are chosen.
    pub fn kind(&self) -> SampleKind {
        match (self.rays, self.viewpoint) {
            (Some(_), _) => SampleKind::SingleRay,
            (None, Some(_)) => SampleKind::ViewpointLimited,
            (None, None) => SampleKind::Uniform,
        }
    }
}

/// Server to worker: packets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Work {
    /// Viewpoints that the packets refer to.
    pub viewpoints: Vec<Viewpoint>,
    /// The packets, in the order wanted.
    pub packets: Vec<Packet>,
}

/// Worker to server: what became of packets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Results {
    /// The packets traced, in the order of their samples.
    pub packets: Vec<Traced>,
    /// Samples of all packets traced, one after the other.
    pub samples: Vec<Sample>,
    /// Names of packets that were not traced because no ray of their beam can meet anything.
    pub unseen: Vec<u64>,
}

/// One packet of a [`Results`]. 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Traced {
    /// The assignment's name.
    pub id: u64,
    /// Samples, as many as were asked for.
    pub count: u32,
    /// Time that one thread took, nanoseconds, saturated.
    pub nanoseconds: u32,
}
const _: () = assert!(size_of::<Traced>() == 16);

/// A beam that a display wants, and how much. 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Wanted {
    /// Beam in the section.
    pub beam: u64,
    /// Share of the picture that it serves, pixels; positive.
    pub weight: f32,
    /// Section number.
    pub section: u16,
    /// Zero.
    pub reserved: u16,
}
const _: () = assert!(size_of::<Wanted>() == 16);

/// Display to server: a view, as the beams that it crosses.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewRequest {
    /// The display's number for the view; larger for later ones. The same number again only changes the viewpoint:
    /// stored samples are not sent twice.
    pub view: u32,
    /// Where the eye is and how near rays must pass (Appendix A).
    pub viewpoint: Viewpoint,
    /// The beams.
    pub beams: Vec<Wanted>,
}

/// A single ray that a display wants. 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct WantedRay {
    /// Beam in the section.
    pub beam: u64,
    /// Section number.
    pub section: u16,
    /// Positions in the beam's cells.
    pub coords: RayCoords,
    /// Zero.
    pub reserved: u16,
}

const _: () = assert!(size_of::<WantedRay>() == 16);

/// Display to server: the rays that its view wants most, most wanted first, in place of those of its last such message that have not
/// been given to a worker yet. They come before the view's beams.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RaysWanted {
    /// The view that they are for; another than the display's last is passed over.
    pub view: u32,
    /// The rays.
    pub rays: Vec<WantedRay>,
}

/// Where samples sent to a display came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Source {
    /// Stored before.
    Stored = 0,
    /// Traced just now.
    Traced = 1,
}

/// A run of samples of one beam with consecutive numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// Section number.
    pub section: u16,
    /// Beam in the section.
    pub beam: BeamId,
    /// Kind, part of a sample's name.
    pub kind: SampleKind,
    /// First sample number.
    pub first: u32,
    /// Samples.
    pub count: u32,
    /// Paths averaged into each.
    pub paths: u16,
}

/// Server to display: samples for a view.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples {
    /// The view that they answer.
    pub view: u32,
    /// Stored or traced.
    pub source: Source,
    /// The runs, in the order of their samples.
    pub runs: Vec<Run>,
    /// Samples of all runs, one after the other.
    pub samples: Vec<Sample>,
}

/// Server to display: beams of a view of which no ray meets anything. They show the sky, and nothing is traced in them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unseen {
    /// The view that they belong to.
    pub view: u32,
    /// The beams: section number, beam in the section.
    pub beams: Vec<(u16, BeamId)>,
}

/// Records of indirect light that whoever gets them may not know yet. Merging them twice, or in another order, changes nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Light {
    /// The records, all valid.
    pub records: Vec<Record>,
}

/// A piece of the packed scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlobChunk {
    /// Where it belongs, bytes from the start.
    pub offset: u64,
    /// The bytes.
    pub bytes: Vec<u8>,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Counts {
    first: u32,
    second: u32,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct ResultCounts {
    packets: u32,
    samples: u32,
    unseen: u32,
}
const _: () = assert!(size_of::<ResultCounts>() == 12);

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct RawUnseen {
    beam: u64,
    section: u16,
    reserved: [u8; 6],
}
const _: () = assert!(size_of::<RawUnseen>() == 16);

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct RawViewpoint {
    eye: [f64; 3],
    radius: f64,
}
const _: () = assert!(size_of::<RawViewpoint>() == 32);

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct RawPacket {
    id: u64,
    beam: u64,
    first: u32,
    section: u16,
    viewpoint: u16,
    paths: u16,
    count: u8,
    reserved: [u8; 5],
}
const _: () = assert!(size_of::<RawPacket>() == 32);

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

/// `RawPacket::viewpoint` of a uniform packet.
const NO_VIEWPOINT: u16 = u16::MAX;

/// `RawPacket::viewpoint` of a packet that names its rays.
const NAMED_RAYS: u16 = u16::MAX - 1;

/// Takes records off a payload; what is not there is an error before any memory is taken.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, what: &'static str, bytes: u64) -> Result<&'a [u8], ProtoError> {
        let found = self.0.len() as u64;
        let (head, rest) = usize::try_from(bytes)
            .ok()
            .and_then(|bytes| self.0.split_at_checked(bytes))
            .ok_or(ProtoError::Truncated { what, needed: bytes, found })?;
        self.0 = rest;
        Ok(head)
    }

    fn one<T: Pod>(&mut self, what: &'static str) -> Result<T, ProtoError> {
        Ok(bytemuck::pod_read_unaligned(self.take(what, size_of::<T>() as u64)?))
    }

    fn many<T: Pod>(&mut self, what: &'static str, count: u64) -> Result<Vec<T>, ProtoError> {
        let bytes = count.saturating_mul(size_of::<T>() as u64);
        Ok(bytemuck::pod_collect_to_vec(self.take(what, bytes)?))
    }

    fn end(self) -> Result<(), ProtoError> {
        if self.0.is_empty() { Ok(()) } else { Err(ProtoError::Trailing(self.0.len())) }
    }
}

fn put<T: Pod>(out: &mut Vec<u8>, record: &T) {
    out.extend_from_slice(bytemuck::bytes_of(record));
}

fn parse_viewpoint(raw: RawViewpoint) -> Result<Viewpoint, ProtoError> {
    if !raw.eye.iter().all(|x| x.is_finite()) {
        return Err(ProtoError::Number("an eye"));
    }
    if !(raw.radius.is_finite() && raw.radius >= 0.0) {
        return Err(ProtoError::Number("a viewpoint radius"));
    }
    Ok(Viewpoint { eye: raw.eye, radius: raw.radius })
}

impl Work {
    /// The payload of a work frame: counts, viewpoints, packets, rays that packets name.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(8 + self.viewpoints.len() * 32 + self.packets.len() * 32);
        put(&mut out, &Counts { first: self.viewpoints.len() as u32, second: self.packets.len() as u32 });
        for viewpoint in &self.viewpoints {
            put(&mut out, &RawViewpoint { eye: viewpoint.eye, radius: viewpoint.radius });
        }
        for packet in &self.packets {
            put(
                &mut out,
                &RawPacket {
                    id: packet.id,
                    beam: packet.beam.0,
                    first: packet.first,
                    section: packet.section,
                    viewpoint: if packet.rays.is_some() {
                        NAMED_RAYS
                    } else {
                        packet.viewpoint.unwrap_or(NO_VIEWPOINT)
                    },
                    paths: packet.paths,
                    count: packet.count,
                    reserved: [0; 5],
                },
            );
        }
        for (rays, packet) in self.packets.iter().filter_map(|packet| Some((packet.rays.as_ref()?, packet))) {
            out.extend_from_slice(bytemuck::cast_slice(&rays[..usize::from(packet.count).min(MAX_RAYS_PER_PACKET)]));
        }
        out
    }

    /// Parses a work frame. Whether a beam exists is for whoever knows the sections.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts, viewpoints, or numbers.
    pub fn decode(bytes: &[u8]) -> Result<Work, ProtoError> {
        let mut reader = Reader(bytes);
        let counts: Counts = reader.one("work message")?;
        let viewpoints = reader.many::<RawViewpoint>("viewpoint list", u64::from(counts.first))?;
        let packets = reader.many::<RawPacket>("packet list", u64::from(counts.second))?;
        let named = packets.iter().filter(|raw| raw.viewpoint == NAMED_RAYS).map(|raw| u64::from(raw.count)).sum();
        let rays = reader.many::<RayCoords>("ray list", named)?;
        reader.end()?;
        let mut rays = rays.into_iter();
        let viewpoints = viewpoints.into_iter().map(parse_viewpoint).collect::<Result<Vec<_>, _>>()?;
        let packets = packets
            .into_iter()
            .map(|raw| {
                if !(1..=MAX_RAYS_PER_PACKET).contains(&usize::from(raw.count)) {
                    return Err(ProtoError::RayCount(u32::from(raw.count)));
                }
                if raw.paths == 0 {
                    return Err(ProtoError::Number("a packet's number of paths"));
                }
                if raw.first.checked_add(u32::from(raw.count)).is_none() {
                    return Err(ProtoError::Number("a packet's first sample number"));
                }
                let named = (raw.viewpoint == NAMED_RAYS).then(|| {
                    let mut named = [RayCoords::default(); MAX_RAYS_PER_PACKET];
                    named.iter_mut().zip(rays.by_ref().take(usize::from(raw.count))).for_each(|(to, ray)| *to = ray);
                    named
                });
                let viewpoint = (raw.viewpoint != NO_VIEWPOINT && named.is_none()).then_some(raw.viewpoint);
                if let Some(index) = viewpoint.filter(|&index| usize::from(index) >= viewpoints.len()) {
                    return Err(ProtoError::Viewpoint { index, count: viewpoints.len() });
                }
                Ok(Packet {
                    id: raw.id,
                    section: raw.section,
                    beam: BeamId(raw.beam),
                    first: raw.first,
                    count: raw.count,
                    paths: raw.paths,
                    viewpoint,
                    rays: named,
                })
            })
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Work { viewpoints, packets })
    }
}

/// Checks that runs add up to the samples that follow them.
fn expect_total(what: &'static str, said: u64, found: u32) -> Result<(), ProtoError> {
    if said == u64::from(found) {
        return Ok(());
    }
    Err(ProtoError::Truncated { what, needed: said * 10, found: u64::from(found) * 10 })
}

impl Results {
    /// The payload of a results frame: counts of packets, samples and unseen packets, then the lists of each.
    pub fn encode(&self) -> Vec<u8> {
        let bytes = 12 + self.packets.len() * 16 + self.samples.len() * 10 + self.unseen.len() * 8;
        let mut out = Vec::with_capacity(bytes);
        let counts = [self.packets.len(), self.samples.len(), self.unseen.len()].map(|count| count as u32);
        put(&mut out, &ResultCounts { packets: counts[0], samples: counts[1], unseen: counts[2] });
        out.extend_from_slice(bytemuck::cast_slice(&self.packets));
        out.extend_from_slice(bytemuck::cast_slice(&self.samples));
        out.extend_from_slice(bytemuck::cast_slice(&self.unseen));
        out
    }

    /// Parses a results frame: every packet traced has 1 to 21 samples and all are there.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts.
    pub fn decode(bytes: &[u8]) -> Result<Results, ProtoError> {
        let mut reader = Reader(bytes);
        let counts: ResultCounts = reader.one("results message")?;
        let packets = reader.many::<Traced>("traced packet list", u64::from(counts.packets))?;
        let samples = reader.many::<Sample>("sample list", u64::from(counts.samples))?;
        let unseen = reader.many::<u64>("unseen packet list", u64::from(counts.unseen))?;
        reader.end()?;
        if let Some(bad) = packets.iter().find(|packet| !(1..=MAX_RAYS_PER_PACKET as u32).contains(&packet.count)) {
            return Err(ProtoError::RayCount(bad.count));
        }
        let said = packets.iter().map(|packet| u64::from(packet.count)).sum();
        expect_total("sample list", said, counts.samples)?;
        Ok(Results { packets, samples, unseen })
    }
}

impl ViewRequest {
    /// The payload of a view frame: view number and beam count, viewpoint, beams.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(40 + self.beams.len() * 16);
        put(&mut out, &Counts { first: self.view, second: self.beams.len() as u32 });
        put(&mut out, &RawViewpoint { eye: self.viewpoint.eye, radius: self.viewpoint.radius });
        out.extend_from_slice(bytemuck::cast_slice(&self.beams));
        out
    }

    /// Parses a view frame. Whether a beam exists is for whoever knows the sections.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts or numbers.
    pub fn decode(bytes: &[u8]) -> Result<ViewRequest, ProtoError> {
        let mut reader = Reader(bytes);
        let counts: Counts = reader.one("view message")?;
        let viewpoint = parse_viewpoint(reader.one("viewpoint")?)?;
        let beams = reader.many::<Wanted>("beam list", u64::from(counts.second))?;
        reader.end()?;
        if !beams.iter().all(|wanted| wanted.weight.is_finite() && wanted.weight > 0.0) {
            return Err(ProtoError::Number("a beam's weight"));
        }
        Ok(ViewRequest { view: counts.first, viewpoint, beams })
    }
}

impl RaysWanted {
    /// The payload of a frame of wanted rays: view, count, rays.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(8 + self.rays.len() * 16);
        put(&mut out, &Counts { first: self.view, second: self.rays.len() as u32 });
        out.extend_from_slice(bytemuck::cast_slice(&self.rays));
        out
    }

    /// Parses a frame of wanted rays. Whether a beam exists is for whoever knows the sections.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts.
    pub fn decode(bytes: &[u8]) -> Result<RaysWanted, ProtoError> {
        let mut reader = Reader(bytes);
        let counts: Counts = reader.one("message of wanted rays")?;
        let rays = reader.many::<WantedRay>("ray list", u64::from(counts.second))?;
        reader.end()?;
        Ok(RaysWanted { view: counts.first, rays })
    }
}

impl Samples {
    /// The payload of a samples frame: view and source, counts of runs and samples, runs, samples.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(16 + self.runs.len() * 24 + self.samples.len() * 10);
        put(&mut out, &Counts { first: self.view, second: self.source as u32 });
        put(&mut out, &Counts { first: self.runs.len() as u32, second: self.samples.len() as u32 });
        for run in &self.runs {
            put(
                &mut out,
                &RawRun {
                    beam: run.beam.0,
                    first: run.first,
                    count: run.count,
                    section: run.section,
                    paths: run.paths,
                    kind: run.kind as u8,
                    reserved: [0; 3],
                },
            );
        }
        out.extend_from_slice(bytemuck::cast_slice(&self.samples));
        out
    }

    /// Parses a samples frame. Whether a beam exists is for whoever knows the sections.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts, kinds or numbers.
    pub fn decode(bytes: &[u8]) -> Result<Samples, ProtoError> {
        let mut reader = Reader(bytes);
        let head: Counts = reader.one("samples message")?;
        let counts: Counts = reader.one("samples message")?;
        let raw = reader.many::<RawRun>("run list", u64::from(counts.first))?;
        let samples = reader.many::<Sample>("sample list", u64::from(counts.second))?;
        reader.end()?;
        let source = match head.second {
            0 => Source::Stored,
            1 => Source::Traced,
            _ => return Err(ProtoError::Number("the source of samples")),
        };
        let runs = raw.into_iter().map(parse_run).collect::<Result<Vec<_>, _>>()?;
        let said = runs.iter().map(|run| u64::from(run.count)).sum();
        expect_total("sample list", said, counts.second)?;
        Ok(Samples { view: head.first, source, runs, samples })
    }

    /// Each run with its samples.
    pub fn iter(&self) -> impl Iterator<Item = (&Run, &[Sample])> {
        let mut rest = self.samples.as_slice();
        self.runs.iter().map(move |run| {
            let (samples, after) = rest.split_at(rest.len().min(run.count as usize));
            rest = after;
            (run, samples)
        })
    }
}

fn parse_run(raw: RawRun) -> Result<Run, ProtoError> {
    let kind = match raw.kind {
        0 => SampleKind::Uniform,
        1 => SampleKind::ViewpointLimited,
        2 => SampleKind::SingleRay,
        other => return Err(ProtoError::SampleKind(other)),
    };
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
    Ok(Run { section: raw.section, beam: BeamId(raw.beam), kind, first: raw.first, count: raw.count, paths: raw.paths })
}

impl Unseen {
    /// The payload of an unseen frame: view number and beam count, beams.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(8 + self.beams.len() * 16);
        put(&mut out, &Counts { first: self.view, second: self.beams.len() as u32 });
        for &(section, beam) in &self.beams {
            put(&mut out, &RawUnseen { beam: beam.0, section, reserved: [0; 6] });
        }
        out
    }

    /// Parses an unseen frame. Whether a beam exists is for whoever knows the sections.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts.
    pub fn decode(bytes: &[u8]) -> Result<Unseen, ProtoError> {
        let mut reader = Reader(bytes);
        let counts: Counts = reader.one("unseen message")?;
        let beams = reader.many::<RawUnseen>("unseen beam list", u64::from(counts.second))?;
        reader.end()?;
        let beams = beams.into_iter().map(|raw| (raw.section, BeamId(raw.beam))).collect();
        Ok(Unseen { view: counts.first, beams })
    }
}

impl Light {
    /// The payload of a light frame: count and length of the records, records.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(8 + size_of_val(self.records.as_slice()));
        put(&mut out, &Counts { first: self.records.len() as u32, second: size_of::<Record>() as u32 });
        out.extend_from_slice(bytemuck::cast_slice(&self.records));
        out
    }

    /// Parses a light frame.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts; [`ProtoError::Number`] for a record that no tracer makes.
    pub fn decode(bytes: &[u8]) -> Result<Light, ProtoError> {
        let mut reader = Reader(bytes);
        let head: Counts = reader.one("light message")?;
        if head.second != size_of::<Record>() as u32 {
            return Err(ProtoError::Number("the length of a light record"));
        }
        let records = reader.many::<Record>("light record list", u64::from(head.first))?;
        reader.end()?;
        if !records.iter().all(Record::is_valid) {
            return Err(ProtoError::Number("a record of indirect light"));
        }
        Ok(Light { records })
    }
}

impl BlobChunk {
    /// The payload of a chunk frame: offset `u64`, bytes.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = self.offset.to_le_bytes().to_vec();
        out.extend_from_slice(&self.bytes);
        out
    }

    /// Parses a chunk frame.
    ///
    /// # Errors
    /// [`ProtoError::Truncated`] if there is no offset.
    pub fn decode(bytes: &[u8]) -> Result<BlobChunk, ProtoError> {
        let (offset, bytes) = bytes.split_first_chunk::<8>().ok_or(ProtoError::Truncated {
            what: "blob chunk",
            needed: 8,
            found: bytes.len() as u64,
        })?;
        Ok(BlobChunk { offset: u64::from_le_bytes(*offset), bytes: bytes.to_vec() })
    }
}
