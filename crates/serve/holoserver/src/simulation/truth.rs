//! The samples of simulated workers: a function of the ray alone, so that a sample in a wrong place
//! is noticed.

use std::collections::BTreeMap;

use holo_beamfile::BeamFile;
use holo_proto::bulk::Packet;
use holo_section::{BeamId, BeamKey, RayCoords, Sample, SampleKind};

use super::random::mix;

/// Samples by beam, kind and number.
pub type Samples = BTreeMap<(BeamKey, u8, u32), Sample>;

/// A beam of the only section.
pub fn beam(number: u64) -> BeamKey {
    BeamKey { section: 0, beam: BeamId(number) }
}

/// Returns whether a beam sees nothing.
pub fn is_unseen(key: BeamKey) -> bool {
    mix(key.beam.0).is_multiple_of(8)
}

/// Returns the sample of a ray that has this number, or these positions.
pub fn sample(key: BeamKey, kind: SampleKind, number: u32, named: Option<RayCoords>) -> Sample {
    let drawn = mix(key.beam.0 << 34 | u64::from(number) << 2 | kind as u64);
    let coords = named.unwrap_or(RayCoords((drawn as u32).to_le_bytes()));
    let seen = mix(key.beam.0 << 32 | u64::from(u32::from_le_bytes(coords.0)));
    let [red, green, blue, low, high, ..] = seen.to_le_bytes();
    let distance = u16::from_le_bytes([low, high]) % 2048;
    Sample::from_codes(coords, [red | 128, green, blue, 128], distance)
}

/// Returns the samples of a packet.
pub fn traced(packet: &Packet) -> Vec<Sample> {
    (0..u32::from(packet.count))
        .map(|at| {
            let named = packet.rays.map(|rays| rays[at as usize]);
            sample(packet.key, packet.kind(), packet.first + at, named)
        })
        .collect()
}

/// Returns all samples of a file, after checking each.
///
/// # Panics
/// If a sample does not match its ray, or its beam sees nothing.
pub fn stored(file: &BeamFile) -> Samples {
    let mut keys = Vec::new();
    file.for_each_beam(&mut |key, _| keys.push(key));
    let mut all = Samples::new();
    for key in keys {
        assert!(!is_unseen(key), "{key:?}");
        for (run, samples) in file.read(key).unwrap().iter() {
            for (number, found) in (run.first..).zip(samples) {
                let named = (run.kind == SampleKind::SingleRay).then_some(found.coords);
                assert_eq!(*found, sample(key, run.kind, number, named), "{key:?}, {number}");
                let twice = all.insert((key, run.kind as u8, number), *found);
                assert!(twice.is_none(), "{key:?} has {number} twice");
            }
        }
    }
    all
}
