//! Layers: a writer and a reader of shares by the document alone, beside the file's own checks.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use crate::common::{key, options, run, samples};
use holo_beamfile::format::{BLOCK_MAGIC, FIRST_BLOCK};
use holo_beamfile::{BeamFile, DamageKind, Maker};
use holo_section::{BeamKey, NumberRun, Sample};

/// Samples whose shares are known: beam, kind, first, count, paths, maker, generation.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Announced {
    section: u16,
    beam: u64,
    kind: u8,
    first: u32,
    count: u32,
    paths: u16,
    maker: u16,
    generation: u32,
}

/// A layer's shares of consecutive samples: layer, first number, RGBE of each.
pub type Shares = (u16, u32, Vec<[u8; 4]>);

fn entry(of: &Announced, first: u32, count: u32, layer: u16) -> Vec<u8> {
    let mut bytes = of.beam.to_le_bytes().to_vec();
    bytes.extend(of.section.to_le_bytes());
    bytes.extend([of.kind, 0]);
    bytes.extend(first.to_le_bytes());
    bytes.extend(count.to_le_bytes());
    bytes.extend(of.paths.to_le_bytes());
    bytes.extend(of.maker.to_le_bytes());
    bytes.extend(of.generation.to_le_bytes());
    bytes.extend(layer.to_le_bytes());
    bytes.extend([0; 2]);
    bytes
}

/// Appends a block of shares to a closed file, as the document says.
pub fn append_shares(path: &Path, groups: &[(Announced, Vec<Shares>)]) {
    let (mut table, mut payload, mut entries) = (Vec::new(), Vec::new(), 0u32);
    for (announced, shares) in groups {
        table.extend(entry(announced, announced.first, announced.count, 0));
        entries += 1 + shares.len() as u32;
        for (layer, first, colours) in shares {
            table.extend(entry(announced, *first, colours.len() as u32, *layer));
            payload.extend(colours.concat());
        }
    }
    append_block(path, 3, entries, table, payload);
}

/// Appends a block to a closed file. The table lacks the checksums of chunks.
pub fn append_block(path: &Path, kind: u32, entries: u32, mut table: Vec<u8>, payload: Vec<u8>) {
    let mut file = fs::read(path).unwrap();
    for chunk in payload.chunks(4090) {
        table.extend(crc32fast::hash(chunk).to_le_bytes());
    }
    let sequence = blocks(&file).last().map_or(1, |block| block.sequence + 1);
    let mut block = BLOCK_MAGIC.to_vec();
    block.extend_from_slice(&file[16..24]);
    block.extend(sequence.to_le_bytes());
    let words = [kind, entries, table.len() as u32, crc32fast::hash(&table), payload.len() as u32];
    words.iter().for_each(|word| block.extend(word.to_le_bytes()));
    block.resize(60, 0);
    block.extend(crc32fast::hash(&block).to_le_bytes());
    block.extend(table);
    block.resize(block.len().next_multiple_of(16), 0);
    block.extend(payload);
    block.resize(block.len().next_multiple_of(16), 0);
    file.extend(block);
    fs::write(path, file).unwrap();
}

struct Block {
    begin: usize,
    sequence: u64,
    kind: u32,
    entries: usize,
    table: usize,
    payload: usize,
}

impl Block {
    fn payload_at(&self) -> usize {
        self.begin + (64 + self.table).next_multiple_of(16)
    }
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

fn blocks(file: &[u8]) -> Vec<Block> {
    let mut at = FIRST_BLOCK as usize;
    let mut blocks = Vec::new();
    while at < file.len() {
        let block = Block {
            begin: at,
            sequence: u64::from_le_bytes(file[at + 16..at + 24].try_into().unwrap()),
            kind: word(file, at + 24),
            entries: word(file, at + 28) as usize,
            table: word(file, at + 32) as usize,
            payload: word(file, at + 40) as usize,
        };
        at = (block.payload_at() + block.payload).next_multiple_of(16);
        blocks.push(block);
    }
    blocks
}

/// What a reader knows of the shares of a sample: RGBE by layer. Layers that are absent are black.
pub type Known = BTreeMap<u16, [u8; 4]>;

/// A reader by the document: the shares of the samples of a run that count, by number.
pub fn read_shares(
    file: &[u8],
    run: &NumberRun,
    maker: Maker,
    generation: u32,
) -> BTreeMap<u32, Known> {
    let mut known: BTreeMap<u32, Known> = BTreeMap::new();
    for block in blocks(file).iter().filter(|block| block.kind == 3) {
        let mut at = block.payload_at();
        let mut open: Vec<u32> = Vec::new();
        for number in 0..block.entries {
            let entry = &file[block.begin + 64 + 32 * number..][..32];
            let layer = u16::from_le_bytes([entry[28], entry[29]]);
            let count = word(entry, 16) as usize;
            let mut is_same = entry[..8] == run.key.beam.0.to_le_bytes();
            is_same &= entry[8..10] == run.key.section.to_le_bytes() && entry[10] == run.kind as u8;
            is_same &= entry[20..22] == run.paths.to_le_bytes();
            is_same &= entry[22..24] == maker.0.to_le_bytes() && word(entry, 24) == generation;
            let numbers = word(entry, 12)..word(entry, 12) + count as u32;
            if layer == 0 {
                open = numbers.filter(|n| is_same && !known.contains_key(n)).collect();
                open.iter().for_each(|&n| _ = known.insert(n, Known::new()));
                continue;
            }
            for n in numbers {
                if open.contains(&n) {
                    let share = file[at..at + 4].try_into().unwrap();
                    known.get_mut(&n).unwrap().insert(layer, share);
                }
                at += 4;
            }
        }
    }
    known
}

pub fn announced(run: &NumberRun, count: u32, maker: u16) -> Announced {
    Announced {
        section: run.key.section,
        beam: run.key.beam.0,
        kind: run.kind as u8,
        first: run.first,
        count,
        paths: run.paths,
        maker,
        generation: 0,
    }
}

fn colour(layer: u16, number: u32) -> [u8; 4] {
    [layer as u8 | 1, number as u8, (layer >> 8) as u8, 128]
}

/// The shares of `count` samples in some layers. Every third sample is black.
pub fn shares(layers: impl Iterator<Item = u16>, first: u32, count: u32) -> Vec<Shares> {
    let runs = |layer: u16| {
        let begins = (first..first + count).step_by(3);
        begins.map(move |begin| {
            let numbers = begin..(begin + 2).min(first + count);
            (layer, begin, numbers.map(|n| colour(layer, n)).collect())
        })
    };
    layers.flat_map(runs).collect()
}

/// A file with samples of two beams and makers.
fn file(path: &Path) -> (NumberRun, NumberRun) {
    let (one, other) = (run(key(0, 3), 0), NumberRun { paths: 4, ..run(key(1, 2), 50) });
    let file = BeamFile::create(path, options()).unwrap();
    file.append(one, Maker(1), &samples(&one, 21, 0)).unwrap();
    file.append(other, Maker(2), &samples(&other, 30, 0)).unwrap();
    file.close().unwrap();
    (one, other)
}

fn samples_of(file: &BeamFile, key: BeamKey) -> Vec<Sample> {
    file.read(key).unwrap().samples.clone()
}

#[test]
fn shares_of_many_layers_are_stored_counted_and_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.holo");
    let (one, other) = file(&path);
    append_shares(&path, &[(announced(&one, 21, 1), shares(1..=300, 0, 21))]);
    append_shares(
        &path,
        &[
            (announced(&other, 10, 2), shares([7, u16::MAX].into_iter(), 50, 10)),
            // The lamps of all layers are behind a wall.
            (Announced { first: 60, ..announced(&other, 20, 2) }, vec![]),
        ],
    );
    let reader = BeamFile::open_read_only(&path, 0).unwrap();
    assert!(reader.report().damage.is_empty() && reader.verify().unwrap().is_empty());
    assert_eq!(reader.layers().len(), 301);
    assert_eq!(reader.layers()[0], (1, 14));
    assert_eq!(reader.layers()[6], (7, 14 + 7));
    assert_eq!(reader.layers()[300], (u16::MAX, 7));
    assert_eq!(samples_of(&reader, one.key), samples(&one, 21, 0));
    assert_eq!(samples_of(&reader, other.key), samples(&other, 30, 0));

    // The file goes on, and its index describes the shares, too.
    let writer = BeamFile::open(&path, options()).unwrap();
    let more = run(key(0, 9), 0);
    writer.append(more, Maker(1), &samples(&more, 5, 0)).unwrap();
    writer.close().unwrap();
    let again = BeamFile::open_read_only(&path, 0).unwrap();
    assert!(again.report().indexed > 4, "{:?}", again.report());
    assert_eq!(again.layers(), reader.layers());
    assert!(again.verify().unwrap().is_empty());

    let bytes = fs::read(&path).unwrap();
    let known = read_shares(&bytes, &one, Maker(1), 0);
    assert_eq!(known.len(), 21);
    for (&number, layers) in &known {
        assert_eq!(layers.len(), if number % 3 == 2 { 0 } else { 300 });
        assert!(layers.iter().all(|(&layer, &share)| share == colour(layer, number)));
    }
    let known = read_shares(&bytes, &other, Maker(2), 0);
    assert_eq!(known.len(), 30);
    assert!(known.range(60..).all(|(_, layers)| layers.is_empty()), "known to be black");
    // The same numbers, but samples of another maker or of more paths: nothing is known.
    assert!(read_shares(&bytes, &other, Maker(1), 0).is_empty());
    assert!(read_shares(&bytes, &NumberRun { paths: 1, ..other }, Maker(2), 0).is_empty());
}

#[test]
fn damaged_shares_are_named_and_cost_no_sample() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.holo");
    let (one, other) = file(&path);
    append_shares(&path, &[(announced(&one, 21, 1), shares(1..=200, 0, 21))]);
    let good = fs::read(&path).unwrap();
    let block = blocks(&good).pop().unwrap();
    for at in (block.begin..block.payload_at() + block.payload).step_by(23) {
        let mut bytes = good.clone();
        bytes[at] ^= 1;
        fs::write(&path, &bytes).unwrap();
        let file = BeamFile::open_read_only(&path, 0).unwrap();
        let damage = file.verify().unwrap();
        let named = damage.iter().find(|d| (d.offset..d.offset + d.bytes).contains(&(at as u64)));
        let named = named.unwrap_or_else(|| panic!("byte {at}: {damage:?}"));
        if at >= block.payload_at() {
            assert_eq!((&named.what, named.samples()), (&DamageKind::Shares, 0));
        }
        assert_eq!(samples_of(&file, one.key).len(), 21);
        assert_eq!(samples_of(&file, other.key).len(), 30);
    }
}

#[test]
fn shares_go_into_another_file_once_with_new_names_and_never_in_part() {
    let folder = tempfile::tempdir().unwrap();
    let (path, merged) = (folder.path().join("test.holo"), folder.path().join("merged.holo"));
    let (one, other) = file(&path);
    append_shares(
        &path,
        &[
            (announced(&one, 21, 1), shares(1..=200, 0, 21)),
            (announced(&other, 30, 2), shares(1..=200, 50, 30)),
        ],
    );
    let from = BeamFile::open_read_only(&path, 0).unwrap();
    let to = BeamFile::create(&merged, options()).unwrap();
    let rename = |maker: Maker, generation| {
        (maker == Maker(1)).then_some((Maker(maker.0 + 10), generation + 5))
    };
    assert_eq!(from.copy_shares(&to, &rename).unwrap(), 200 * 14);
    assert_eq!(from.copy_shares(&to, &rename).unwrap(), 0, "they are there");
    assert_eq!(
        from.copy_shares(&to, &|maker, generation| Some((maker, generation))).unwrap(),
        200 * 34
    );
    to.close().unwrap();
    let to = BeamFile::open_read_only(&merged, 0).unwrap();
    assert!(to.verify().unwrap().is_empty());
    assert_eq!(to.layers()[0], (1, 14 + 34));
    let bytes = fs::read(&merged).unwrap();
    let known = read_shares(&bytes, &one, Maker(11), 5);
    assert_eq!(known, read_shares(&fs::read(&path).unwrap(), &one, Maker(1), 0));

    // The first chunk has shares of the first run of samples alone.
    let mut bytes = fs::read(&path).unwrap();
    let block = blocks(&bytes).pop().unwrap();
    bytes[block.payload_at()] ^= 1;
    fs::write(&path, &bytes).unwrap();
    let from = BeamFile::open_read_only(&path, 0).unwrap();
    let third = folder.path().join("third.holo");
    let to = BeamFile::create(&third, options()).unwrap();
    assert_eq!(
        from.copy_shares(&to, &|maker, generation| Some((maker, generation))).unwrap(),
        200 * 20
    );
    to.close().unwrap();
    let bytes = fs::read(&third).unwrap();
    assert!(read_shares(&bytes, &one, Maker(1), 0).is_empty());
    assert_eq!(read_shares(&bytes, &other, Maker(2), 0).len(), 30);
}
