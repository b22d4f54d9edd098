//! Torn tails, flipped bits and hostile lengths.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{
    LAYOUT, Model, assert_same, key, kind, missing, options, remove_index, run, samples,
};
use holo_beamfile::format::{BLOCK_HEADER_BYTES, BLOCK_MAGIC, FIRST_BLOCK, HEADER_COPY_BYTES};
use holo_beamfile::{BeamFile, DamageKind, Error, Maker, Skipped};
use holo_section::NumberRun;

/// A file of a few blocks without an index, each flushed, its model after each block, and where
/// each block ends.
struct Built {
    _folder: tempfile::TempDir,
    path: PathBuf,
    models: Vec<Model>,
    ends: Vec<u64>,
}

fn build(blocks: u32, extents: u32) -> Built {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.holo");
    let file = BeamFile::create(&path, options()).unwrap();
    let mut built =
        Built { _folder: folder, path, models: vec![Model::default()], ends: vec![FIRST_BLOCK] };
    for block in 0..blocks {
        let mut model = built.models.last().unwrap().clone();
        for i in 0..extents {
            let section = (i % 2) as u16;
            let key = key(section, u64::from(i * 7 % 12).min(LAYOUT[usize::from(section)] - 1));
            let run = NumberRun { kind: kind((i % 3) as u8), ..run(key, block * 10_000 + i * 21) };
            let new = samples(&run, 21, block);
            file.append(run, Maker::UNKNOWN, &new).unwrap();
            model.put(&run, &new, false);
        }
        file.flush().unwrap();
        built.models.push(model);
        built.ends.push(file.stats().file_bytes);
    }
    file.close().unwrap();
    remove_index(&built.path, *built.ends.last().unwrap());
    built
}

/// A copy of a file with other bytes.
fn variant(folder: &Path, bytes: &[u8]) -> PathBuf {
    let path = folder.join("variant.holo");
    let _ = fs::remove_file(&path);
    fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn a_tail_torn_at_any_byte_is_named_and_left_out_and_the_file_goes_on_after_it() {
    let built = build(3, 3);
    let bytes = fs::read(&built.path).unwrap();
    let (begin, end) = (built.ends[2], built.ends[3]);
    assert_eq!(bytes.len() as u64, end);
    let folder = tempfile::tempdir().unwrap();
    for cut in begin..end {
        let path = variant(folder.path(), &bytes[..cut as usize]);
        let reader = BeamFile::open_read_only(&path, 0).unwrap();
        assert_same(&reader, &built.models[2]);
        let torn: Vec<_> =
            reader.report().damage.iter().map(|d| (d.offset, d.bytes, d.what.clone())).collect();
        let expected = [(begin, cut - begin, DamageKind::TornTail)];
        assert_eq!(torn, &expected[..usize::from(cut > begin)]);

        let writer = BeamFile::open(&path, options()).unwrap();
        assert_eq!(writer.report(), reader.report());
        let mut model = built.models[2].clone();
        let run = run(key(0, 1), 5000);
        let new = samples(&run, 30, 99);
        writer.append(run, Maker::UNKNOWN, &new).unwrap();
        model.put(&run, &new, false);
        // Closing writes, too. A flush for every cut would make the test as slow as the disk.
        writer.close().unwrap();
        reader.refresh().unwrap();
        assert_same(&reader, &model);
        let again = BeamFile::open_read_only(&path, 0).unwrap();
        assert!(again.report().damage.is_empty(), "cut off at {cut}: {:?}", again.report());
        assert_same(&again, &model);
    }
}

#[test]
fn a_block_whose_header_was_not_yet_written_is_a_torn_tail() {
    let built = build(2, 5);
    let mut bytes = fs::read(&built.path).unwrap();
    let begin = built.ends[1] as usize;
    bytes[begin..begin + BLOCK_HEADER_BYTES].fill(0);
    fs::write(&built.path, &bytes).unwrap();
    let file = BeamFile::open(&built.path, options()).unwrap();
    assert_eq!(file.report().damage[0].what, DamageKind::TornTail);
    assert_same(&file, &built.models[1]);
    assert_eq!(file.stats().file_bytes, built.ends[1], "cut off");
}

#[test]
fn a_flipped_bit_is_reported_and_loses_only_its_own_part() {
    let built = build(5, 60);
    let whole = built.models.last().unwrap();
    let bytes = fs::read(&built.path).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut random = 0x1234_5678_9abc_def0u64;
    let (mut harmless, mut lossy) = (0, 0);
    for trial in 0..1000 {
        random =
            random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        // One in ten in the header's pages, the others in blocks.
        let range = if trial % 10 == 0 { 0..FIRST_BLOCK } else { FIRST_BLOCK..bytes.len() as u64 };
        let at = range.start + (random >> 20) % (range.end - range.start);
        let mut flipped = bytes.clone();
        flipped[at as usize] ^= 1 << (random >> 60 & 7);
        let path = variant(folder.path(), &flipped);

        let file = BeamFile::open_read_only(&path, 1 << 20).unwrap();
        let lost = missing(&file, whole);
        let damage = file.verify().unwrap();
        let named = damage.iter().any(|d| (d.offset..d.offset + d.bytes).contains(&at));
        if damage.is_empty() {
            harmless += 1;
            assert!(lost.is_empty());
            let padding = if at < FIRST_BLOCK {
                at as usize % HEADER_COPY_BYTES >= 48
            } else {
                bytes[at as usize] == 0
            };
            assert!(padding, "byte {at} is no padding, and its damage was not noticed");
        } else {
            assert!(named, "byte {at} damaged, but {damage:?} named");
            let block = built.ends.iter().rposition(|&end| end <= at);
            let in_block = block.map(|b| (b as u32 * 10_000, b as u32 * 10_000 + 60 * 21));
            for &(_, _, number) in &lost {
                let (from, to) = in_block.expect("a damaged file header loses nothing");
                assert!(
                    (from..to).contains(&number),
                    "sample {number} lost by damage at {at} in block {block:?}"
                );
            }
            if matches!(damage[0].what, DamageKind::Samples) {
                assert!((1..=409).contains(&lost.len()), "one chunk: {} samples lost", lost.len());
            }
            lossy += usize::from(!lost.is_empty());
        }
    }
    assert!(harmless > 50 && lossy > 700, "{harmless} {lossy}: the trials reach both");
}

#[test]
fn after_damage_in_every_block_header_the_writer_goes_on_and_destroys_nothing() {
    let built = build(3, 10);
    let mut bytes = fs::read(&built.path).unwrap();
    for &begin in &built.ends[1..3] {
        bytes[begin as usize + 20] ^= 1;
    }
    fs::write(&built.path, &bytes).unwrap();
    let file = BeamFile::open(&built.path, options()).unwrap();
    assert_same(&file, &built.models[1]);
    let run = run(key(1, 2), 9000);
    let new = samples(&run, 50, 5);
    file.append(run, Maker::UNKNOWN, &new).unwrap();
    file.close().unwrap();
    let mut model = built.models[1].clone();
    model.put(&run, &new, false);
    let file = BeamFile::open_read_only(&built.path, 0).unwrap();
    assert_same(&file, &model);
    assert_eq!(file.report().damage.len(), 1, "one stretch without a block");
    let blocks = FIRST_BLOCK as usize..bytes.len();
    let now = &fs::read(&built.path).unwrap()[blocks.clone()];
    assert!(*now == bytes[blocks], "what is damaged may be wanted by a rescuer");
}

#[test]
fn a_damaged_copy_of_the_header_is_repaired_by_the_writer_and_two_are_an_error() {
    let built = build(1, 3);
    let good = fs::read(&built.path).unwrap();
    let mut bytes = good.clone();
    bytes[33] ^= 4;
    fs::write(&built.path, &bytes).unwrap();
    let file = BeamFile::open(&built.path, options()).unwrap();
    assert_eq!(file.report().damage[0].what, DamageKind::HeaderCopy(0));
    drop(file);
    assert_eq!(fs::read(&built.path).unwrap(), good);

    bytes[HEADER_COPY_BYTES + 33] ^= 4;
    fs::write(&built.path, &bytes).unwrap();
    assert!(matches!(BeamFile::open(&built.path, options()), Err(Error::NoHeader { .. })));
    fs::write(&built.path, b"").unwrap();
    assert!(matches!(
        BeamFile::open_read_only(&built.path, 0),
        Err(Error::NoHeader { bytes: 0, .. })
    ));
}

#[test]
fn damage_in_a_better_sample_uncovers_the_one_that_it_superseded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.holo");
    let file = BeamFile::create(&path, options()).unwrap();
    let rough = run(key(0, 0), 0);
    let better = NumberRun { paths: 64, ..rough };
    file.append(rough, Maker::UNKNOWN, &samples(&rough, 30, 1)).unwrap();
    file.flush().unwrap();
    file.supersede(better, Maker::UNKNOWN, &samples(&better, 30, 2)).unwrap();
    file.close().unwrap();
    let mut bytes = fs::read(&path).unwrap();
    let last = samples(&better, 30, 2);
    let needle: &[u8] = bytemuck::cast_slice(&last);
    let at = bytes.windows(needle.len()).position(|w| w == needle).unwrap();
    bytes[at + 150] ^= 8;
    fs::write(&path, &bytes).unwrap();
    let file = BeamFile::open_read_only(&path, 0).unwrap();
    let read = file.read(rough.key).unwrap();
    assert_eq!(read.samples, samples(&rough, 30, 1));
    assert_eq!(file.damage().len(), 1);
}

/// A block header with right checksums and the given words from offset 24 on.
fn hostile_header(file: &[u8], words: [u32; 5]) -> Vec<u8> {
    let mut header = BLOCK_MAGIC.to_vec();
    header.extend_from_slice(&file[16..24]);
    header.extend_from_slice(&1000u64.to_le_bytes());
    words.iter().for_each(|word| header.extend_from_slice(&word.to_le_bytes()));
    header.resize(60, 0);
    let crc = crc32fast::hash(&header);
    header.extend_from_slice(&crc.to_le_bytes());
    header
}

#[test]
fn hostile_lengths_take_no_memory_and_cost_no_sample() {
    let built = build(1, 5);
    let good = fs::read(&built.path).unwrap();
    let table = |words: &[u32]| words.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
    // Beam, section and kind, first, count, paths, zeros; then the payload's one checksum.
    let entry = |beam: u32, section: u32, first: u32, count: u32| {
        table(&[beam, 0, section, first, count, 1, 0, 0])
    };
    let payload = [0u8; 10];
    let mut cases: Vec<(&str, [u32; 3], Vec<u8>, u32)> = vec![
        ("table longer than any", [1, 1, u32::MAX], vec![], 10),
        ("payload longer than any", [1, 1, 36], entry(0, 0, 0, 1), u32::MAX),
        ("more entries than the table", [1, u32::MAX, 36], entry(0, 0, 0, 1), 10),
        ("more samples than the payload", [1, 1, 36], entry(0, 0, 0, u32::MAX), 10),
        ("numbers beyond 32 bits", [1, 1, 36], entry(0, 0, u32::MAX, 1), 10),
        ("a beam that is not there", [1, 1, 36], entry(40, 0, 0, 1), 10),
        ("a section that is not there", [1, 1, 36], entry(0, 2, 0, 1), 10),
        ("no samples", [1, 1, 36], entry(0, 0, 0, 0), 0),
        ("a kind that is not there", [1, 1, 36], entry(0, 3 << 16, 0, 1), 10),
        ("a blob without a name", [2, 1, 36], table(&[0; 8]), 10),
        ("a blob longer than any", [2, 1, 40], table(&[0, 0, 0, 2, 0, 0, 1, 0]), 10),
        ("samples of a layer", [1, 1, 36], table(&[0, 0, 0, 0, 1, 1, 0, 1]), 10),
        (
            "shares of samples that are not announced",
            [3, 1, 36],
            table(&[0, 0, 0, 0, 1, 1, 0, 1]),
            4,
        ),
        ("announced samples with shares", [3, 1, 36], entry(0, 0, 0, 1), 4),
        ("an index of nothing", [4, 0, 4], vec![], 4),
        ("an index of the header", [4, 1, 52], table(&[0; 12]), 4),
    ];
    cases.push((
        "good, to show that the others differ from it",
        [1, 1, 36],
        entry(0, 0, 77_000, 1),
        10,
    ));
    for (what, [kind, entries, table_bytes], mut table, payload_bytes) in cases {
        let used = &payload[..payload.len().min(payload_bytes as usize)];
        table.extend_from_slice(&crc32fast::hash(used).to_le_bytes());
        let header = hostile_header(
            &good,
            [kind, entries, table_bytes, crc32fast::hash(&table), payload_bytes],
        );
        let mut bytes = [good.clone(), header, table].concat();
        bytes.resize(bytes.len().next_multiple_of(16), 0);
        bytes.extend_from_slice(&payload);
        bytes.resize(bytes.len().next_multiple_of(16), 0);
        let folder = tempfile::tempdir().unwrap();
        let path = variant(folder.path(), &bytes);
        let file = BeamFile::open_read_only(&path, 1 << 20).unwrap();
        let accepted = what.starts_with("good");
        assert_eq!(file.report().damage.is_empty(), accepted, "{what}: {:?}", file.report());
        assert_eq!(file.counts(key(0, 0)).uniform == 77_001, accepted, "{what}");
        assert_eq!(missing_only(&file, &built), 0, "{what}");
    }
}

#[test]
fn blocks_of_unknown_kinds_are_named_and_skipped_and_their_damage_is_damage() {
    let built = build(2, 5);
    let good = fs::read(&built.path).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for kind in [0, 5, 9, u32::MAX] {
        let payload = [7u8; 5000];
        let mut table = b"whatever".to_vec();
        for chunk in payload.chunks(4090) {
            table.extend_from_slice(&crc32fast::hash(chunk).to_le_bytes());
        }
        let words = [kind, 77, table.len() as u32, crc32fast::hash(&table), payload.len() as u32];
        let mut bytes = [good.clone(), hostile_header(&good, words), table].concat();
        bytes.extend_from_slice(&payload);
        bytes.resize(bytes.len().next_multiple_of(16), 0);
        let length = (bytes.len() - good.len()) as u64;
        let path = variant(folder.path(), &bytes);

        let reader = BeamFile::open_read_only(&path, 0).unwrap();
        assert!(reader.verify().unwrap().is_empty(), "{:?}", reader.damage());
        assert_eq!(reader.skipped(), [Skipped { kind, blocks: 1, bytes: length }]);
        let writer = BeamFile::open(&path, options()).unwrap();
        let run = run(key(0, 1), 5000);
        let new = samples(&run, 30, 99);
        writer.append(run, Maker::UNKNOWN, &new).unwrap();
        writer.close().unwrap();
        let mut model = built.models[2].clone();
        model.put(&run, &new, false);
        let reader = BeamFile::open_read_only(&path, 0).unwrap();
        assert!(reader.report().indexed > 0);
        assert_same(&reader, &model);
        assert_eq!(reader.skipped(), [Skipped { kind, blocks: 1, bytes: length }]);
        let now = &fs::read(&path).unwrap()[good.len()..bytes.len()];
        assert!(*now == bytes[good.len()..], "the block is left alone");

        // Bytes 0 to 63 are the header, 64 to 79 the table, and the payload follows.
        for at in (0..80).chain((80..5080).step_by(101)) {
            let mut flipped = bytes.clone();
            flipped[good.len() + at] ^= 1 << (at % 8);
            let path = variant(folder.path(), &flipped);
            let file = BeamFile::open_read_only(&path, 0).unwrap();
            let damage = file.verify().unwrap();
            let at = (good.len() + at) as u64;
            let named = damage.iter().any(|d| (d.offset..d.offset + d.bytes).contains(&at));
            assert!(named, "byte {at} of a block of kind {kind}: {damage:?}");
            assert!(missing(&file, &built.models[2]).is_empty());
        }
    }
}

fn missing_only(file: &BeamFile, built: &Built) -> usize {
    let mut model = built.models.last().unwrap().clone();
    let extra = run(key(0, 0), 77_000);
    let zero = [bytemuck::Zeroable::zeroed()];
    model.put(&extra, &zero, false);
    missing(file, &model).iter().filter(|&&(_, _, number)| number != 77_000).count()
}
