//! The bytes of every message, compared with the files in `golden/`. A change of any of them must
//! raise the protocol's version.
#![allow(clippy::unwrap_used)]

use std::{collections::BTreeSet, fs, path::PathBuf};

use holo_proto::{
    PROTOCOL_VERSION, ProtoError,
    bulk::*,
    control::*,
    frame::{self, FrameHeader, FrameKind, HEADER_BYTES},
    hello::{Answer, Hello, Role},
    proof::{Challenge, MachineProof, Proof},
    report::{DisplayReport, FaultReport, StatusReport, WorkerReport},
};
use holo_section::{
    BeamId, BeamKey, NumberRun, RayCoords, Sample, SampleKind, SectionSpec, ViewClass, Viewpoint,
};

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("golden")
}

/// Returns the frame in a file: hexadecimal bytes, with comments from `#` to the end of the line.
fn golden(name: &str) -> Vec<u8> {
    let text = fs::read_to_string(folder().join(name).with_extension("hex")).unwrap();
    let digits =
        text.lines().flat_map(|line| line.split('#').next().unwrap_or("").split_whitespace());
    digits.map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

#[derive(Clone, Debug, PartialEq)]
enum Any {
    Hello(Hello),
    Answer(Answer),
    Control(Control),
    Work(WorkPackets),
    Results(Results),
    View(ViewRequest),
    Samples(ViewSamples),
    BlobChunk(BlobChunk),
    Unseen(Unseen),
    Cells(CellBatch),
    Rays(RaysWanted),
    LiveWanted(LiveWanted),
    LiveWork(LiveWork),
    LiveResults(LiveResults),
    LiveSamples(LiveSamples),
    Challenge(Challenge),
    Proof(Proof),
    MachineProof(MachineProof),
}

impl Any {
    fn frame(&self) -> Vec<u8> {
        let (kind, payload) = match self {
            Any::Hello(message) => (FrameKind::Hello, message.encode()),
            Any::Answer(message) => (FrameKind::Answer, message.encode()),
            Any::Control(message) => (FrameKind::Control, message.encode().unwrap()),
            Any::Work(message) => (FrameKind::Work, message.encode()),
            Any::Results(message) => (FrameKind::Results, message.encode()),
            Any::View(message) => (FrameKind::View, message.encode()),
            Any::Samples(message) => (FrameKind::Samples, message.encode()),
            Any::BlobChunk(message) => (FrameKind::BlobChunk, message.encode()),
            Any::Unseen(message) => (FrameKind::Unseen, message.encode()),
            Any::Cells(message) => (FrameKind::Cells, message.encode()),
            Any::Rays(message) => (FrameKind::Rays, message.encode()),
            Any::LiveWanted(message) => (FrameKind::LiveWanted, message.encode()),
            Any::LiveWork(message) => (FrameKind::LiveWork, message.encode()),
            Any::LiveResults(message) => (FrameKind::LiveResults, message.encode()),
            Any::LiveSamples(message) => (FrameKind::LiveSamples, message.encode()),
            Any::Challenge(message) => (FrameKind::Challenge, message.encode()),
            Any::Proof(message) => (FrameKind::Proof, message.encode()),
            Any::MachineProof(message) => (FrameKind::MachineProof, message.encode()),
        };
        frame::encode(kind, &payload).unwrap()
    }

    fn decode(frame: &[u8]) -> Result<Any, ProtoError> {
        let (header, payload) = frame.split_first_chunk::<HEADER_BYTES>().unwrap();
        let header = FrameHeader::parse(*header)?;
        assert_eq!(header.length as usize, payload.len(), "the length is the payload's");
        Ok(match header.kind {
            FrameKind::Hello => Any::Hello(Hello::decode(payload)?),
            FrameKind::Answer => Any::Answer(Answer::decode(payload)?),
            FrameKind::Control => Any::Control(Control::decode(payload)?),
            FrameKind::Work => Any::Work(WorkPackets::decode(payload)?),
            FrameKind::Results => Any::Results(Results::decode(payload)?),
            FrameKind::View => Any::View(ViewRequest::decode(payload)?),
            FrameKind::Samples => Any::Samples(ViewSamples::decode(payload)?),
            FrameKind::BlobChunk => Any::BlobChunk(BlobChunk::decode(payload)?),
            FrameKind::Unseen => Any::Unseen(Unseen::decode(payload)?),
            FrameKind::Cells => Any::Cells(CellBatch::decode(payload)?),
            FrameKind::Rays => Any::Rays(RaysWanted::decode(payload)?),
            FrameKind::LiveWanted => Any::LiveWanted(LiveWanted::decode(payload)?),
            FrameKind::LiveWork => Any::LiveWork(LiveWork::decode(payload)?),
            FrameKind::LiveResults => Any::LiveResults(LiveResults::decode(payload)?),
            FrameKind::LiveSamples => Any::LiveSamples(LiveSamples::decode(payload)?),
            FrameKind::Challenge => Any::Challenge(Challenge::decode(payload)?),
            FrameKind::Proof => Any::Proof(Proof::decode(payload)?),
            FrameKind::MachineProof => Any::MachineProof(MachineProof::decode(payload)?),
        })
    }
}

fn cell() -> WireCell {
    WireCell {
        point: [1.5, -2.0, 0.25],
        normal: [0.0, 0.0, 1.0],
        material: 7,
        bounces: u32::MAX,
        level: 2,
        maker: 513,
        count: 4,
        light: [3.0, 2.0, 1.0],
        albedo: [2.0, 1.0, 0.5],
    }
}

fn live_rays() -> [LiveRay; 3] {
    [
        LiveRay { origin: [1.0, -2.5, 1e6], direction: [0.6, 0.0, -0.8], number: 1 },
        LiveRay {
            origin: [0.0, 0.0, 0.5],
            direction: [0.0, -1.0, 0.0],
            number: 0x1122_3344_5566_7788,
        },
        LiveRay { origin: [-1.5, 3.0, 0.25], direction: [1.0, 0.0, 0.0], number: 1 << 63 },
    ]
}

fn live_hits() -> [LiveHit; 3] {
    [
        LiveHit { radiance: [1.5, 0.25, 0.0], distance: 2.5 },
        LiveHit { radiance: [0.0; 3], distance: f32::INFINITY },
        LiveHit { radiance: [1e30, 8.0, 1.0], distance: 0.0 },
    ]
}

fn live() -> [(&'static str, Any); 4] {
    let ([a, b, c], hits) = (live_rays(), live_hits());
    let packets = vec![
        LivePacket { id: 1, paths: 16, rays: vec![a, b] },
        LivePacket { id: 1 << 63, paths: 1, rays: vec![c] },
    ];
    let traced = vec![
        TracedPacket { id: 1, count: 2, nanoseconds: 1000 },
        TracedPacket { id: 1 << 63, count: 1, nanoseconds: u32::MAX },
    ];
    let samples =
        [a, b].iter().zip(hits).map(|(ray, hit)| LiveResult { number: ray.number, hit }).collect();
    [
        ("live-wanted", Any::LiveWanted(LiveWanted { view: 7, pixels: 1000, rays: vec![a, b] })),
        ("live-work", Any::LiveWork(LiveWork { packets })),
        ("live-results", Any::LiveResults(LiveResults { packets: traced, hits: hits.to_vec() })),
        ("live-samples", Any::LiveSamples(LiveSamples { view: 7, samples })),
    ]
}

fn hello(role: Role, name: &str) -> Any {
    Any::Hello(Hello { version: PROTOCOL_VERSION, role, name: name.into() })
}

fn room() -> SectionSpec {
    SectionSpec {
        origin: [1.0, -2.0, 0.5],
        axes: [[4.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.25, 0.0, 2.5]],
        grid: [8, 6, 5],
        class: ViewClass::Interior,
        obstructions: true,
    }
}

fn cube() -> SectionSpec {
    SectionSpec {
        origin: [0.0; 3],
        axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        grid: [1, 2, 64],
        class: ViewClass::Exterior,
        obstructions: false,
    }
}

fn welcome() -> Any {
    Any::Control(Control::Welcome(Box::new(Welcome {
        software: "holoserver 0.1.0".into(),
        sections: vec![room(), cube()],
        settings: RenderSettings {
            engine: Engine::Gather,
            bounces: Some(3),
            paths_per_sample: 16,
            seed: 0x0123_4567_89ab_cdef,
            virtual_distance: true,
        },
        scene: SceneInfo { hash: std::array::from_fn(|i| i as u8), bytes: 1_234_567 },
        up: [0.0, 0.0, 1.0],
        views: vec![("front".into(), "-vp 1 2 3 -vh 60".into()), (String::new(), String::new())],
        samples: 20_000_000_000,
        tracing: true,
        sky: [0.25, 0.5, 1.0],
        sky_varies: true,
        skip_unseen: true,
        unit: 0.001,
    })))
}

fn welcome_shown() -> Any {
    Any::Control(Control::Welcome(Box::new(Welcome {
        software: String::new(),
        sections: vec![cube()],
        settings: RenderSettings {
            engine: Engine::Path,
            bounces: None,
            paths_per_sample: 1,
            seed: 0,
            virtual_distance: false,
        },
        scene: SceneInfo { hash: [0xff; 32], bytes: 88 },
        up: [0.0, 1.0, 0.0],
        views: Vec::new(),
        samples: 0,
        tracing: false,
        sky: [0.0; 3],
        sky_varies: false,
        skip_unseen: false,
        unit: 1.0,
    })))
}

fn report() -> Any {
    Any::Control(Control::Report(Box::new(StatusReport {
        software: "holoserver 9".into(),
        file: "a.holo".into(),
        file_bytes: 4096,
        samples: 400,
        traced: 300,
        samples_per_second: 1.5,
        unseen_beams: 7,
        disk_error: "full".into(),
        workers: vec![WorkerReport {
            name: "w".into(),
            maker: 258,
            threads: 2,
            rays_per_second: 0.5,
            rays: 300,
            packets: 5,
            late_packets: 1,
            latency: 0.25,
            queued_bytes: 32,
        }],
        displays: vec![DisplayReport {
            name: "d".into(),
            beams: 9,
            is_read_only: true,
            queued_bytes: 16,
        }],
        faults: vec![FaultReport {
            name: "x".into(),
            maker: 3,
            token: "t".into(),
            reason: "no".into(),
            is_dropped: true,
        }],
    })))
}

fn key(section: u16, beam: u64) -> BeamKey {
    BeamKey { section, beam: BeamId(beam) }
}

fn work() -> Any {
    let (viewpoint, rays) = (None, None);
    let packet = Packet {
        id: 1,
        key: key(0, 0x01_0203_0405),
        first: 0,
        count: 21,
        paths: 1,
        viewpoint,
        rays,
    };
    Any::Work(WorkPackets {
        viewpoints: vec![
            Viewpoint { eye: [1.0, 2.0, 3.0], radius: 0.01 },
            Viewpoint { eye: [-1.5, 0.0, 1e6], radius: 0.0 },
        ],
        packets: vec![
            packet,
            Packet {
                id: 2,
                key: key(3, 6),
                first: 21,
                count: 1,
                paths: 16,
                viewpoint: Some(0),
                rays,
            },
            Packet {
                id: 1 << 63,
                key: key(1023, 7),
                first: 0xffff_fff0,
                count: 15,
                paths: u16::MAX,
                viewpoint: Some(1),
                rays,
            },
        ],
    })
}

fn work_named() -> Any {
    let named = |known: &[[u8; 4]]| {
        let mut rays = [RayCoords::default(); 21];
        rays.iter_mut().zip(known).for_each(|(to, ray)| *to = RayCoords(*ray));
        Some(rays)
    };
    let packet =
        Packet { id: 1, key: key(2, 6), first: 7, count: 2, paths: 1, viewpoint: None, rays: None };
    Any::Work(WorkPackets {
        viewpoints: Vec::new(),
        packets: vec![
            Packet { rays: named(&[[1, 2, 3, 4], [5, 6, 7, 8]]), ..packet },
            Packet { id: 2, ..packet },
            Packet { id: 3, count: 1, rays: named(&[[255, 0, 254, 9]]), ..packet },
        ],
    })
}

fn samples() -> Vec<Sample> {
    vec![
        Sample::from_codes(RayCoords([1, 2, 3, 4]), [128, 64, 32, 129], 0x0506),
        Sample::from_codes(RayCoords([0, 255, 127, 128]), [0; 4], 65535),
        Sample::from_codes(RayCoords([9; 4]), [10, 20, 30, 140], 2047),
    ]
}

fn stored() -> Any {
    let uniform = NumberRun {
        key: key(0, 0x01_0203_0405),
        kind: SampleKind::Uniform,
        first: 40,
        count: 2,
        paths: 16,
    };
    let single =
        NumberRun { key: key(1023, 9), kind: SampleKind::SingleRay, first: 0, count: 1, paths: 1 };
    Any::Samples(ViewSamples {
        view: 7,
        source: SampleSource::Stored,
        runs: vec![uniform, single],
        samples: samples(),
    })
}

fn traced() -> Any {
    let kind = SampleKind::ViewpointLimited;
    let run = NumberRun { key: key(3, 6), kind, first: 21, count: 3, paths: u16::MAX };
    Any::Samples(ViewSamples {
        view: 8,
        source: SampleSource::Traced,
        runs: vec![run],
        samples: samples(),
    })
}

fn earlier() -> Any {
    let kind = SampleKind::Uniform;
    let run = NumberRun { key: key(0, 5), kind, first: 70, count: 2, paths: 1 };
    let samples = samples().into_iter().take(2).collect();
    Any::Samples(ViewSamples { view: 8, source: SampleSource::Earlier, runs: vec![run], samples })
}

fn cases() -> Vec<(&'static str, Any)> {
    let number = 0x1122_3344_5566_7788;
    let mut cases = vec![
        ("hello-worker", hello(Role::Worker, "rtworker 42")),
        ("hello-admin", hello(Role::Admin, "holodeck status")),
        ("control-report-wanted", Any::Control(Control::ReportWanted)),
        ("control-report", report()),
        ("challenge", Any::Challenge(Challenge(std::array::from_fn(|i| i as u8)))),
        ("proof", Any::Proof(Proof { token: *b"a token!", mac: [0xab; 32] })),
        (
            "machine-proof",
            Any::MachineProof(MachineProof { key: [0xcd; 32], signature: [0xef; 64] }),
        ),
        ("hello-display", hello(Role::Display, "holoview – 7")),
        ("answer-accepted", Any::Answer(Answer::Accepted)),
        ("answer-refused", Any::Answer(Answer::Refused("full".into()))),
        ("control-welcome", welcome()),
        ("control-welcome-shown", welcome_shown()),
        (
            "control-status",
            Any::Control(Control::Status(Status {
                samples: 123_456,
                samples_per_second: 1500.5,
                workers: 2,
                displays: 1,
            })),
        ),
        ("control-stored-sent", Any::Control(Control::StoredSent { view: 7 })),
        ("control-settled", Any::Control(Control::Settled { view: 7 })),
        ("control-bye", Any::Control(Control::Bye(Farewell::SessionOver))),
        (
            "control-dropped",
            Any::Control(Control::Bye(Farewell::Dropped { reason: "late".into() })),
        ),
        ("control-starts-again", Any::Control(Control::Bye(Farewell::StartsAgain))),
        ("control-ping", Any::Control(Control::Ping(number))),
        ("control-pong", Any::Control(Control::Pong(number))),
        ("control-scene-wanted", Any::Control(Control::SceneWanted)),
        ("control-ready", Any::Control(Control::Ready { threads: 258 })),
        ("control-failed", Any::Control(Control::Failed { reason: "no memory".into() })),
        ("control-settle", Any::Control(Control::Settle { view: 7 })),
        ("control-cells-wanted", Any::Control(Control::CellsWanted)),
        (
            "control-stand-ins",
            Any::Control(Control::StandIns(SceneInfo { hash: [0xAB; 32], bytes: 258 })),
        ),
        ("control-stand-ins-wanted", Any::Control(Control::StandInsWanted)),
        (
            "control-keep-view",
            Any::Control(Control::KeepView { name: "ab".into(), options: "-vtv".into() }),
        ),
        ("control-views", Any::Control(Control::Views(vec![("ab".into(), "-vtv".into())]))),
        ("control-refused", Any::Control(Control::Refused { reason: "no".into() })),
        (
            "control-part-wanted",
            Any::Control(Control::PartWanted {
                section: 258,
                first: number,
                samples: 65536,
                as_settled: true,
            }),
        ),
        ("control-part-sent", Any::Control(Control::PartSent { section: 258, next: Some(number) })),
        ("control-cells-used", Any::Control(Control::CellsUsed { maker: 258 })),
        ("control-part-last", Any::Control(Control::PartSent { section: 258, next: None })),
        ("work", work()),
        ("work-named", work_named()),
        ("work-empty", Any::Work(WorkPackets::default())),
        (
            "results",
            Any::Results(Results {
                packets: vec![
                    TracedPacket { id: 1, count: 2, nanoseconds: 1000 },
                    TracedPacket { id: 1 << 63, count: 1, nanoseconds: u32::MAX },
                ],
                samples: samples(),
                unseen: vec![2, 0x0102_0304_0506_0708],
            }),
        ),
        (
            "view",
            Any::View(ViewRequest {
                view: 7,
                viewpoint: Viewpoint { eye: [0.5, -0.25, 1.75], radius: 0.001 },
                beams: vec![
                    RequestedBeam {
                        key: key(0, 0x01_0203_0405),
                        weight: 12.5,
                        held: 42,
                        has_earlier: false,
                    },
                    RequestedBeam { key: key(1023, 9), weight: 0.125, held: 9, has_earlier: true },
                ],
            }),
        ),
        ("samples-stored", stored()),
        ("samples-traced", traced()),
        ("samples-earlier", earlier()),
        (
            "unseen",
            Any::Unseen(Unseen { view: 7, beams: vec![key(0, 0x01_0203_0405), key(1023, 9)] }),
        ),
        ("cells", Any::Cells(CellBatch { cells: vec![cell()] })),
        (
            "rays",
            Any::Rays(RaysWanted {
                view: 7,
                rays: vec![
                    WantedRay { key: key(0, 0x01_0203_0405), coords: RayCoords([1, 2, 3, 4]) },
                    WantedRay { key: key(1023, 9), coords: RayCoords([0, 255, 127, 128]) },
                ],
            }),
        ),
        ("blob-chunk", Any::BlobChunk(BlobChunk { offset: 1 << 32, bytes: b"holoscn\n".to_vec() })),
    ];
    cases.extend(live());
    cases
}

#[test]
fn every_message_has_exactly_the_bytes_of_its_file() {
    for (name, message) in cases() {
        assert_eq!(message.frame(), golden(name), "{name}: encoded");
        assert_eq!(Any::decode(&golden(name)), Ok(message), "{name}: decoded");
    }
}

#[test]
fn a_compressed_piece_is_a_block_of_lz4_of_the_first_bytes_of_all_words_then_the_second() {
    // Of each of the first three: a literal, and a match of 7 bytes at distance 1. Then 10
    // literals.
    let block = [
        [0x13, 1, 1, 0, 0x13, 2, 1, 0, 0x13, 3, 1, 0].as_slice(),
        &[0xa0, 4, 4, 4, 4, 4, 4, 4, 4, 9, 8],
    ];
    let head = [7, 0, 0, 0, 0, 0, 0, 0, 34, 0, 0, 0];
    let payload = [&head, block[0], block[1]].concat();
    let bytes = [[1, 2, 3, 4].repeat(8), vec![9, 8]].concat();
    let piece = BlobChunk { offset: 7, bytes };
    assert_eq!(BlobChunk::decode(&payload), Ok(piece.clone()));
    assert!(piece.encode_compressed().len() <= payload.len());
    for length in 12..payload.len() {
        assert_eq!(BlobChunk::decode(&payload[..length]), Err(ProtoError::Compressed), "{length}");
    }
}

#[test]
fn every_file_is_of_a_message_and_begins_with_a_comment() {
    let names: BTreeSet<_> = cases().into_iter().map(|(name, _)| format!("{name}.hex")).collect();
    let files: BTreeSet<_> = fs::read_dir(folder())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    assert_eq!(names, files);
    for file in files {
        assert!(fs::read_to_string(folder().join(&file)).unwrap().starts_with("# "), "{file}");
    }
}

#[test]
fn every_kind_and_every_control_message_has_a_file() {
    let kinds: BTreeSet<u8> = cases().iter().map(|(_, message)| message.frame()[4]).collect();
    let known: BTreeSet<u8> =
        (0..=u8::MAX).filter(|&byte| FrameKind::from_byte(byte).is_some()).collect();
    assert_eq!(kinds, known);
    // A message's first four bytes are its variant number. The next number after the last has no
    // message.
    let controls: BTreeSet<u8> = cases()
        .iter()
        .map(|(_, message)| message.frame())
        .filter(|f| f[4] == 3)
        .map(|f| f[8])
        .collect();
    assert_eq!(controls, (0..=21).collect());
    let mut next = vec![0; 64];
    next[0] = 22;
    let error = Control::decode(&next).unwrap_err().to_string();
    assert!(error.contains("22"), "{error}");
}

#[test]
fn a_message_cut_anywhere_or_with_a_byte_more_is_refused() {
    for (name, message) in cases() {
        let payload = &golden(name)[HEADER_BYTES..];
        let kind = FrameKind::from_byte(golden(name)[4]).unwrap();
        let decode = |payload: &[u8]| Any::decode(&frame::encode(kind, payload)?);
        // Hellos and answers may grow in later versions.
        let may_grow = matches!(message, Any::Hello(_) | Any::Answer(_));
        for length in 0..payload.len() {
            assert!(
                decode(&payload[..length]).is_err(),
                "{name}: {length} of {} bytes",
                payload.len()
            );
        }
        let longer = decode(&[payload, &[0]].concat());
        assert_eq!(longer.is_ok(), may_grow, "{name}: {longer:?}");
    }
}
