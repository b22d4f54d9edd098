//! Decoders that get arbitrary bytes: they return an error or a message, and never panic.
#![allow(clippy::unwrap_used)]

use crate::common;
use holo_proto::{
    MAX_RAYS_PER_PACKET, PROTOCOL_VERSION, ProtoError,
    bulk::*,
    control::{Control, Farewell},
    frame::{self, FrameHeader, FrameKind, HEADER_BYTES},
    hello::{Answer, Hello, MAGIC, MAX_TEXT_BYTES, Role},
};
use proptest::{collection::vec, prelude::*};

/// Decodes bytes as every kind of message. A message that is accepted must survive encoding and
/// decoding.
fn decode_all(bytes: &[u8]) {
    // Where nothing forbids NaN, as in a status's rate, the test compares bytes, not values.
    if let Ok(message) = Control::decode(bytes) {
        let again = message.encode().unwrap();
        assert_eq!(Control::decode(&again).unwrap().encode().unwrap(), again);
    }
    if let Ok(message) = WorkPackets::decode(bytes) {
        assert!(
            message
                .packets
                .iter()
                .all(|p| (1..=MAX_RAYS_PER_PACKET).contains(&usize::from(p.count)))
        );
        assert!(
            message
                .packets
                .iter()
                .all(|p| p.viewpoint.is_none_or(|v| usize::from(v) < message.viewpoints.len()))
        );
        assert_eq!(WorkPackets::decode(&message.encode()), Ok(message));
    }
    if let Ok(message) = Results::decode(bytes) {
        assert_eq!(
            message.packets.iter().map(|p| p.count as usize).sum::<usize>(),
            message.samples.len()
        );
        assert_eq!(message.encode(), bytes);
    }
    if let Ok(message) = ViewRequest::decode(bytes) {
        assert_eq!(ViewRequest::decode(&message.encode()), Ok(message));
    }
    if let Ok(message) = ViewSamples::decode(bytes) {
        assert_eq!(
            message
                .iter()
                .map(|(run, samples)| usize::from(run.count as usize == samples.len()))
                .sum::<usize>(),
            message.runs.len()
        );
        assert_eq!(ViewSamples::decode(&message.encode()), Ok(message));
    }
    if let Ok(message) = Unseen::decode(bytes) {
        assert_eq!(Unseen::decode(&message.encode()), Ok(message));
    }
    if let Ok(message) = CellBatch::decode(bytes) {
        assert!(message.cells.iter().all(WireCell::is_valid));
        assert_eq!(message.encode(), bytes);
    }
    if let Ok(message) = LiveWanted::decode(bytes) {
        assert!(message.rays.len() <= MAX_LIVE_RAYS && message.rays.iter().all(is_ray));
        assert_eq!(LiveWanted::decode(&message.encode()), Ok(message));
    }
    if let Ok(message) = LiveWork::decode(bytes) {
        assert!(
            message
                .packets
                .iter()
                .all(|p| (1..=MAX_RAYS_PER_PACKET).contains(&p.rays.len()) && p.paths > 0)
        );
        assert!(message.packets.iter().flat_map(|packet| &packet.rays).all(is_ray));
        assert_eq!(LiveWork::decode(&message.encode()), Ok(message));
    }
    if let Ok(message) = LiveResults::decode(bytes) {
        assert_eq!(
            message.packets.iter().map(|p| p.count as usize).sum::<usize>(),
            message.hits.len()
        );
        assert!(message.hits.iter().all(is_hit));
        assert_eq!(message.encode(), bytes);
    }
    if let Ok(message) = LiveSamples::decode(bytes) {
        assert!(message.samples.iter().all(|sample| is_hit(&sample.hit)));
        assert_eq!(message.encode(), bytes);
    }
    if let Ok(message) = BlobChunk::decode(bytes) {
        assert_eq!(BlobChunk::decode(&message.encode_compressed()), Ok(message));
    }
    if let Ok(message) = Hello::decode(bytes) {
        assert_eq!(Hello::decode(&message.encode()), Ok(message));
    }
    if let Ok(message) = Answer::decode(bytes) {
        assert_eq!(Answer::decode(&message.encode()), Ok(message));
    }
}

fn is_ray(ray: &LiveRay) -> bool {
    let length: f64 = ray.direction.iter().map(|x| x * x).sum::<f64>().sqrt();
    ray.origin.iter().all(|x| x.is_finite()) && (length - 1.0).abs() < 1e-6
}

fn is_hit(hit: &LiveHit) -> bool {
    hit.radiance.iter().all(|x| x.is_finite() && *x >= 0.0)
        && !hit.distance.is_nan()
        && hit.distance >= 0.0
}

fn any_payload() -> impl Strategy<Value = Vec<u8>> {
    let hello = "\\PC{0,40}".prop_map(|name| Hello::new(Role::Worker, name).encode());
    prop_oneof![
        common::control().prop_map(|message| message.encode().unwrap()),
        common::work().prop_map(|message| message.encode()),
        common::results().prop_map(|message| message.encode()),
        common::view().prop_map(|message| message.encode()),
        common::samples().prop_map(|message| message.encode()),
        common::unseen().prop_map(|message| message.encode()),
        common::live_wanted().prop_map(|message| message.encode()),
        common::live_work().prop_map(|message| message.encode()),
        common::live_results().prop_map(|message| message.encode()),
        common::live_samples().prop_map(|message| message.encode()),
        common::chunk().prop_map(|message| message.encode_compressed()),
        hello,
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        // `scripts/fuzz` asks for more.
        cases: ProptestConfig::default().cases.max(2000),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn every_message_survives_encoding_and_decoding(
        control in common::control(), work in common::work(), results in common::results(),
        view in common::view(), samples in common::samples(), unseen in common::unseen(),
        chunk in common::chunk(), cells in common::cells(),
        live in (
            common::live_wanted(), common::live_work(),
            common::live_results(), common::live_samples(),
        ),
    ) {
        prop_assert_eq!(LiveWanted::decode(&live.0.encode()), Ok(live.0));
        prop_assert_eq!(LiveWork::decode(&live.1.encode()), Ok(live.1));
        prop_assert_eq!(LiveResults::decode(&live.2.encode()), Ok(live.2));
        prop_assert_eq!(LiveSamples::decode(&live.3.encode()), Ok(live.3));
        prop_assert_eq!(Control::decode(&control.encode().unwrap()), Ok(control));
        prop_assert_eq!(WorkPackets::decode(&work.encode()), Ok(work));
        prop_assert_eq!(Results::decode(&results.encode()), Ok(results));
        prop_assert_eq!(ViewRequest::decode(&view.encode()), Ok(view));
        prop_assert_eq!(ViewSamples::decode(&samples.encode()), Ok(samples));
        prop_assert_eq!(Unseen::decode(&unseen.encode()), Ok(unseen));
        prop_assert_eq!(CellBatch::decode(&cells.encode()), Ok(cells));
        prop_assert_eq!(BlobChunk::decode(&chunk.encode()), Ok(chunk.clone()));
        prop_assert_eq!(BlobChunk::decode(&chunk.encode_compressed()), Ok(chunk));
    }

    #[test]
    fn random_bytes_are_a_message_or_an_error(bytes in vec(any::<u8>(), 0..300)) {
        decode_all(&bytes);
        // With a small first number, more inputs get past the first count, or to a control variant.
        if let [first, .., _, _, _, _] = bytes.as_slice() {
            let rest = &bytes[4..];
            decode_all(&[&[first % 16, 0, 0, 0], rest].concat());
        }
    }

    #[test]
    fn messages_cut_or_with_flipped_bits_are_messages_or_errors(
        bytes in any_payload(),
        cut in any::<prop::sample::Index>(),
        flips in vec(any::<prop::sample::Index>(), 0..4),
    ) {
        prop_assume!(!bytes.is_empty());
        decode_all(&bytes[..cut.index(bytes.len())]);
        let mut flipped = bytes;
        for flip in flips {
            let bit = flip.index(flipped.len() * 8);
            flipped[bit / 8] ^= 1 << (bit % 8);
        }
        decode_all(&flipped);
    }

    #[test]
    fn a_header_is_accepted_only_with_a_known_kind_a_length_within_its_limit_and_zeros(
        bytes in any::<[u8; 8]>(), kind in 0..17u8, small in any::<bool>(),
    ) {
        let mut bytes = bytes;
        bytes[4] = kind;
        if small {
            bytes[3] = 0;
            bytes[5..].fill(0);
        }
        let length = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        match FrameHeader::parse(bytes) {
            Ok(header) => {
                prop_assert_eq!((header.kind as u8, header.length), (kind, length));
                prop_assert!(u64::from(length) <= header.kind.max_bytes());
                prop_assert_eq!(header.to_bytes(), bytes);
            }
            Err(ProtoError::Kind(found)) => {
                prop_assert!(found == kind && (kind == 10 || !(1..=19).contains(&kind)));
            }
            Err(ProtoError::TooLong { kind, limit, .. }) => {
                prop_assert!(u64::from(length) > limit && limit == kind.max_bytes());
            }
            Err(ProtoError::Trailing(_)) => prop_assert!(bytes[5..] != [0; 3]),
            Err(other) => prop_assert!(false, "{other}"),
        }
    }

    #[test]
    fn a_hello_of_any_version_decodes_with_any_bytes_after_its_text(
        version in any::<u16>(), name in "\\PC{0,100}", more in vec(any::<u8>(), 0..200),
    ) {
        let hello = Hello { version, role: Role::Display, name: name.clone() };
        let decoded = Hello::decode(&[hello.encode(), more].concat()).unwrap();
        prop_assert_eq!(&decoded, &hello);
        match decoded.check_version() {
            Ok(()) => prop_assert_eq!(version, PROTOCOL_VERSION),
            Err(error) => {
                let expected = ProtoError::Version { ours: PROTOCOL_VERSION, theirs: version };
                prop_assert_eq!(&error, &expected);
                prop_assert!(error.to_string().contains(&version.to_string()));
            }
        }
    }
}

#[test]
fn each_kind_of_frame_has_its_limit_at_both_ends() {
    for kind in (1..=19).filter_map(FrameKind::from_byte) {
        let limit = kind.max_bytes();
        let header = FrameHeader { kind, length: limit as u32 };
        assert_eq!(FrameHeader::parse(header.to_bytes()), Ok(header));
        let longer = FrameHeader { length: limit as u32 + 1, ..header };
        let refused = ProtoError::TooLong { kind, length: limit + 1, limit };
        assert_eq!(FrameHeader::parse(longer.to_bytes()), Err(refused));
        let payload = vec![0; limit as usize + 1];
        assert!(frame::encode(kind, &payload).is_err());
        assert_eq!(
            frame::encode(kind, &payload[1..]).unwrap().len(),
            HEADER_BYTES + limit as usize
        );
    }
}

#[test]
fn a_refusal_of_any_version_is_read_and_an_acceptance_only_of_this_one() {
    let mut refused = Answer::Refused("no".into()).encode();
    refused[8..10].copy_from_slice(&(PROTOCOL_VERSION + 1).to_le_bytes());
    assert_eq!(Answer::decode(&refused), Ok(Answer::Refused("no".into())));
    let mut accepted = Answer::Accepted.encode();
    assert_eq!(Answer::decode(&accepted), Ok(Answer::Accepted));
    accepted[10] = 2;
    assert_eq!(
        Answer::decode(&accepted),
        Err(ProtoError::NotHolodeck),
        "no such answer in this version"
    );
    accepted[8..10].copy_from_slice(&(PROTOCOL_VERSION + 1).to_le_bytes());
    assert_eq!(
        Answer::decode(&accepted),
        Err(ProtoError::Version { ours: PROTOCOL_VERSION, theirs: PROTOCOL_VERSION + 1 })
    );
}

#[test]
fn bytes_that_are_no_hello_and_hellos_of_unknown_roles_give_different_errors() {
    let good = Hello::new(Role::Worker, "w").encode();
    let with = |at: usize, byte: u8| {
        let mut bytes = good.clone();
        bytes[at] = byte;
        Hello::decode(&bytes)
    };
    assert_eq!(with(0, b'X'), Err(ProtoError::NotHolodeck));
    assert_eq!(with(11, 1), Err(ProtoError::NotHolodeck));
    assert_eq!(with(10, 4), Err(ProtoError::Role(4)));
    assert_eq!(Hello::decode(&MAGIC), Err(ProtoError::NotHolodeck));
    let huge =
        ProtoError::TooMany { what: "text bytes", found: 0xff01, limit: MAX_TEXT_BYTES as u64 };
    assert_eq!(with(13, 0xff), Err(huge));
}

#[test]
fn long_texts_are_cut_between_characters_and_control_characters_become_spaces() {
    let name: String = "é".repeat(400);
    let Ok(hello) = Hello::decode(&Hello::new(Role::Worker, &name).encode()) else {
        panic!("refused")
    };
    assert_eq!(hello.name, "é".repeat(256));
    let odd = format!("x{name}");
    let Ok(hello) = Hello::decode(&Hello::new(Role::Worker, &odd).encode()) else {
        panic!("refused")
    };
    assert_eq!(hello.name, format!("x{}", "é".repeat(255)));

    let evil = "a\x1b[2Jb\r\nc\u{9b}d";
    let plain = "a [2Jb  c d";
    assert_eq!(Hello::decode(&Hello::new(Role::Worker, evil).encode()).unwrap().name, plain);
    assert_eq!(
        Answer::decode(&Answer::Refused(evil.into()).encode()),
        Ok(Answer::Refused(plain.into()))
    );
    let bye = |reason: &str| Control::Bye(Farewell::Dropped { reason: reason.into() });
    assert_eq!(Control::decode(&bye(evil).encode().unwrap()), Ok(bye(plain)));
    let mut bytes = Hello::new(Role::Worker, "abc").encode();
    bytes[15] = 0xff;
    assert_eq!(Hello::decode(&bytes).unwrap().name, "a\u{fffd}c", "not UTF-8");
}

#[test]
fn a_control_message_that_is_too_long_to_send_is_an_error() {
    let reason = |bytes: usize| Control::Failed { reason: "x".repeat(bytes) };
    let limit = frame::MAX_CONTROL_BYTES;
    assert_eq!(reason(limit as usize - 12).encode().unwrap().len() as u64, limit);
    let refused = ProtoError::TooLong { kind: FrameKind::Control, length: limit + 1, limit };
    assert_eq!(reason(limit as usize - 11).encode(), Err(refused));
}

#[test]
fn wrong_numbers_in_bulk_messages_are_named() {
    let counts = |first: u32, second: u32| [first.to_le_bytes(), second.to_le_bytes()].concat();
    // One uniform packet: id, beam, first, section, viewpoint, paths, count.
    let packet = |first: u32, viewpoint: u16, paths: u16, count: u8| {
        let mut bytes = counts(0, 1);
        bytes.extend([0; 16]);
        bytes.extend(first.to_le_bytes());
        bytes.extend([0, 0]);
        bytes.extend(viewpoint.to_le_bytes());
        bytes.extend(paths.to_le_bytes());
        bytes.extend([count, 0, 0, 0, 0, 0]);
        WorkPackets::decode(&bytes)
    };
    assert!(packet(0, 0xffff, 1, 21).is_ok());
    assert_eq!(packet(0, 0xffff, 1, 0), Err(ProtoError::RayCount(0)));
    assert_eq!(packet(0, 0xffff, 1, 22), Err(ProtoError::RayCount(22)));
    assert!(matches!(packet(0, 0xffff, 0, 1), Err(ProtoError::Number(_))));
    assert!(packet(u32::MAX - 21, 0xffff, 1, 21).is_ok());
    assert!(matches!(packet(u32::MAX - 20, 0xffff, 1, 21), Err(ProtoError::Number(_))));
    assert_eq!(packet(0, 0, 1, 1), Err(ProtoError::Viewpoint { index: 0, count: 0 }));

    let view = |eye: f64, radius: f64, weight: f32| {
        let mut bytes = counts(1, 1);
        bytes.extend([0.0, eye, 0.0, radius].map(f64::to_le_bytes).concat());
        bytes.extend([0; 8]);
        bytes.extend(weight.to_le_bytes());
        bytes.extend([0; 4]);
        ViewRequest::decode(&bytes)
    };
    assert!(view(1.0, 0.0, 1.0).is_ok());
    for (eye, radius, weight) in [
        (f64::NAN, 0.0, 1.0),
        (f64::INFINITY, 0.0, 1.0),
        (0.0, -1.0, 1.0),
        (0.0, f64::NAN, 1.0),
        (0.0, 0.0, 0.0),
        (0.0, 0.0, -1.0),
        (0.0, 0.0, f32::INFINITY),
        (0.0, 0.0, f32::NAN),
    ] {
        assert!(
            matches!(view(eye, radius, weight), Err(ProtoError::Number(_))),
            "{eye} {radius} {weight}"
        );
    }

    // One run: beam, first, count, section, paths, kind.
    let samples = |source: u32, first: u32, count: u32, paths: u16, kind: u8| {
        let mut bytes = [counts(7, source), counts(1, count)].concat();
        bytes.extend([0; 8]);
        bytes.extend([first.to_le_bytes(), count.to_le_bytes()].concat());
        bytes.extend([0, 0]);
        bytes.extend(paths.to_le_bytes());
        bytes.extend([kind, 0, 0, 0]);
        bytes.extend(std::iter::repeat_n(0, 10 * count as usize));
        ViewSamples::decode(&bytes)
    };
    assert!(samples(1, u32::MAX - 2, 2, 1, 2).is_ok());
    assert!(samples(0, 0, MAX_RUN, 1, 0).is_ok());
    assert!(matches!(samples(0, 0, MAX_RUN + 1, 1, 0), Err(ProtoError::TooMany { .. })));
    assert!(matches!(samples(0, 0, 0, 1, 0), Err(ProtoError::TooMany { found: 0, .. })));
    assert!(samples(3, u32::MAX - 2, 2, 1, 0).is_ok());
    assert!(matches!(samples(4, 0, 1, 1, 0), Err(ProtoError::Number(_))));
    assert!(matches!(samples(1, u32::MAX - 1, 2, 1, 0), Err(ProtoError::Number(_))));
    assert!(matches!(samples(1, 0, 1, 0, 0), Err(ProtoError::Number(_))));
    assert_eq!(samples(1, 0, 1, 1, 3), Err(ProtoError::SampleKind(3)));

    // Packets with more samples, or fewer, than follow.
    let results = |counts_of: [u32; 2]| {
        let mut bytes = [counts(2, 3), vec![0; 4]].concat();
        for count in counts_of {
            bytes.extend([0; 8]);
            bytes.extend([count.to_le_bytes(), [0; 4]].concat());
        }
        bytes.extend([0; 30]);
        Results::decode(&bytes)
    };
    assert!(results([1, 2]).is_ok());
    assert!(matches!(results([1, 1]), Err(ProtoError::Truncated { needed: 20, found: 30, .. })));
    assert!(matches!(results([3, 1]), Err(ProtoError::Truncated { needed: 40, found: 30, .. })));
    assert_eq!(results([0, 3]), Err(ProtoError::RayCount(0)));
    assert_eq!(results([22, 3]), Err(ProtoError::RayCount(22)));
}

#[test]
fn impossible_live_rays_and_impossible_results_are_refused() {
    let ray = |origin: f64, direction: [f64; 3]| LiveRay {
        origin: [0.0, origin, 0.0],
        direction,
        number: 5,
    };
    let good = ray(1.0, [0.6, 0.0, 0.8]);
    let wanted = |ray: LiveRay, count: usize| {
        LiveWanted::decode(&LiveWanted { view: 1, pixels: 9, rays: vec![ray; count] }.encode())
    };
    let work = |ray: LiveRay, count: usize, paths: u16| {
        LiveWork::decode(
            &LiveWork { packets: vec![LivePacket { id: 1, paths, rays: vec![ray; count] }] }
                .encode(),
        )
    };
    assert!(wanted(good, MAX_LIVE_RAYS).is_ok() && work(good, 21, 1).is_ok());
    let (found, limit) = (MAX_LIVE_RAYS as u64 + 1, MAX_LIVE_RAYS as u64);
    assert_eq!(
        wanted(good, MAX_LIVE_RAYS + 1),
        Err(ProtoError::TooMany { what: "live rays", found, limit })
    );
    assert_eq!(work(good, 22, 1), Err(ProtoError::RayCount(22)));
    assert_eq!(work(good, 0, 1), Err(ProtoError::RayCount(0)));
    assert!(matches!(work(good, 1, 0), Err(ProtoError::Number(_))));
    for bad in [
        ray(f64::NAN, good.direction),
        ray(f64::INFINITY, good.direction),
        ray(0.0, [0.0; 3]),
        ray(0.0, [1.0, 0.01, 0.0]),
        ray(0.0, [1.0, f64::NAN, 0.0]),
        ray(0.0, [f64::INFINITY, 0.0, 0.0]),
    ] {
        assert!(matches!(wanted(bad, 2), Err(ProtoError::Number(_))), "{bad:?}");
        assert!(matches!(work(bad, 2, 1), Err(ProtoError::Number(_))), "{bad:?}");
    }
    // A packet with more rays than follow.
    let mut bytes =
        LiveWork { packets: vec![LivePacket { id: 1, paths: 1, rays: vec![good; 2] }] }.encode();
    bytes[16] = 3;
    assert!(matches!(
        LiveWork::decode(&bytes),
        Err(ProtoError::Truncated { needed: 168, found: 112, .. })
    ));

    let hit = |radiance: f32, distance: f32| LiveHit { radiance: [1.0, radiance, 0.0], distance };
    let results = |hit: LiveHit| {
        let packets = vec![TracedPacket { id: 1, count: 1, nanoseconds: 1 }];
        LiveResults::decode(&LiveResults { packets, hits: vec![hit] }.encode())
    };
    let samples = |hit: LiveHit| {
        LiveSamples::decode(
            &LiveSamples { view: 1, samples: vec![LiveResult { number: 1, hit }] }.encode(),
        )
    };
    assert!(results(hit(0.0, f32::INFINITY)).is_ok() && samples(hit(0.0, 0.0)).is_ok());
    for (radiance, distance) in
        [(-1.0, 1.0), (f32::NAN, 1.0), (f32::INFINITY, 1.0), (1.0, f32::NAN), (1.0, -1.0)]
    {
        assert!(
            matches!(results(hit(radiance, distance)), Err(ProtoError::Number(_))),
            "{radiance} {distance}"
        );
        assert!(
            matches!(samples(hit(radiance, distance)), Err(ProtoError::Number(_))),
            "{radiance} {distance}"
        );
    }
}

#[test]
fn a_welcome_with_impossible_numbers_is_refused() {
    let hex = include_str!("../../golden/control-welcome.hex");
    let digits = hex.lines().filter(|line| !line.starts_with('#')).flat_map(str::split_whitespace);
    let bytes: Vec<u8> =
        digits.map(|byte| u8::from_str_radix(byte, 16).unwrap()).skip(HEADER_BYTES).collect();
    let with = |change: &dyn Fn(&mut holo_proto::control::Welcome)| {
        let Ok(Control::Welcome(mut welcome)) = Control::decode(&bytes) else {
            panic!("no welcome")
        };
        change(&mut welcome);
        Control::decode(&Control::Welcome(welcome).encode().unwrap())
    };
    assert!(with(&|_| {}).is_ok());
    assert!(with(&|w| w.sections = vec![w.sections[0].clone(); 1024]).is_ok());
    let many = ProtoError::TooMany { what: "sections", found: 1025, limit: 1024 };
    assert_eq!(with(&|w| w.sections = vec![w.sections[0].clone(); 1025]), Err(many));
    assert!(matches!(with(&|w| w.sections.clear()), Err(ProtoError::Number(_))));
    assert!(matches!(with(&|w| w.up = [0.0; 3]), Err(ProtoError::Number(_))));
    assert!(matches!(with(&|w| w.up[1] = f64::NAN), Err(ProtoError::Number(_))));
    for bad in [0.0, -1.0, f64::INFINITY, f64::NAN] {
        assert!(matches!(with(&|w| w.unit = bad), Err(ProtoError::Number(_))), "{bad}");
    }
    assert!(matches!(with(&|w| w.settings.paths_per_sample = 0), Err(ProtoError::Number(_))));
    for bad in [-1.0, f32::NAN, f32::INFINITY] {
        assert!(matches!(with(&|w| w.sky[2] = bad), Err(ProtoError::Number(_))));
    }
}
