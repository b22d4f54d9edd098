//! The index: files open from it as from their blocks, and nothing depends on it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::fs;
use std::io;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use crate::common::{
    LAYOUT, Model, assert_same, contents, key, kind, missing, options, remove_index, run, samples,
};
use holo_beamfile::format::{
    BLOCK_HEADER_BYTES, FIRST_BLOCK, HEADER_COPY_BYTES, POINTER_BYTES, POINTER_OFFSET,
};
use holo_beamfile::{BeamFile, Damage, DamageKind, Maker, Storage};
use holo_section::NumberRun;

/// What a disk was told to do.
#[derive(Clone)]
enum Operation {
    Write(u64, Vec<u8>),
    Cut(u64),
}

/// A disk in memory that records what it does, and counts reads.
#[derive(Clone, Default)]
struct Memory {
    bytes: Arc<Mutex<Vec<u8>>>,
    operations: Arc<Mutex<Vec<Operation>>>,
    reads: Arc<AtomicU64>,
}

impl Memory {
    fn of(bytes: Vec<u8>) -> Memory {
        Memory { bytes: Arc::new(Mutex::new(bytes)), ..Memory::default() }
    }

    fn apply(bytes: &mut Vec<u8>, operation: &Operation) {
        match operation {
            Operation::Write(offset, new) => {
                let end = *offset as usize + new.len();
                bytes.resize(bytes.len().max(end), 0);
                bytes[*offset as usize..end].copy_from_slice(new);
            }
            Operation::Cut(length) => bytes.resize(*length as usize, 0),
        }
    }

    fn run(&self, operation: Operation) {
        Self::apply(&mut self.bytes.lock().unwrap(), &operation);
        self.operations.lock().unwrap().push(operation);
    }

    fn open(&self) -> BeamFile {
        BeamFile::open_on(Box::new(self.clone()), "memory", options()).unwrap()
    }
}

impl Storage for Memory {
    fn read_exact_at(&self, bytes: &mut [u8], offset: u64) -> io::Result<()> {
        self.reads.fetch_add(1, Ordering::SeqCst);
        let disk = self.bytes.lock().unwrap();
        let found = disk.get(offset as usize..).and_then(|rest| rest.get(..bytes.len()));
        bytes.copy_from_slice(found.ok_or(io::ErrorKind::UnexpectedEof)?);
        Ok(())
    }

    fn write_all_at(&self, bytes: &[u8], offset: u64) -> io::Result<()> {
        self.run(Operation::Write(offset, bytes.to_vec()));
        Ok(())
    }

    fn sync_data(&self) -> io::Result<()> {
        Ok(())
    }

    fn length(&self) -> io::Result<u64> {
        Ok(self.bytes.lock().unwrap().len() as u64)
    }

    fn set_len(&self, bytes: u64) -> io::Result<()> {
        self.run(Operation::Cut(bytes));
        Ok(())
    }
}

/// A small random generator.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit
    }
}

/// Appends one block of random runs.
fn put_block(file: &BeamFile, model: &mut Model, random: &mut Random, tag: u32) {
    for _ in 0..=random.below(6) {
        let section = random.below(2) as u16;
        let run = NumberRun {
            kind: kind(random.below(3) as u8),
            paths: 1 + random.below(2) as u16,
            ..run(key(section, random.below(12)), random.below(90) as u32)
        };
        let new = samples(&run, 1 + random.below(40) as u32, tag);
        let maker = Maker(random.below(3) as u16);
        if random.below(4) == 0 {
            file.supersede(run, maker, &new).unwrap();
            model.put(&run, &new, true);
        } else {
            file.append(run, maker, &new).unwrap();
            model.put(&run, &new, false);
        }
    }
    file.flush().unwrap();
}

/// Checks that two open files say the same in every way.
fn assert_equal(one: &BeamFile, other: &BeamFile) {
    assert!(contents(one).0 == contents(other).0);
    let (a, b) = (one.stats(), other.stats());
    assert_eq!(
        (a.samples, a.earlier, a.superseded, a.extents, a.sections),
        (b.samples, b.earlier, b.superseded, b.extents, b.sections)
    );
    assert_eq!(one.generation(), other.generation());
    assert_eq!(one.last_maker(), other.last_maker());
    assert_eq!(one.blob_names(), other.blob_names());
    assert_eq!(one.report().unfinished_blobs, other.report().unfinished_blobs);
    for name in one.blob_names() {
        assert_eq!(one.blob(&name).unwrap(), other.blob(&name).unwrap());
    }
    for (section, &beams) in (0..).zip(&LAYOUT) {
        for key in (0..beams).map(|beam| key(section, beam)) {
            assert_eq!(one.counts(key), other.counts(key));
            assert_eq!(one.count(key), other.count(key));
            assert_eq!(one.makers(key), other.makers(key));
            assert_eq!(one.count_earlier(key), other.count_earlier(key));
            let earlier = |file: &BeamFile| {
                let mut read = Vec::new();
                file.read_earlier(&[key], &mut |_, samples| {
                    read.push(samples);
                    ControlFlow::Continue(())
                })
                .unwrap();
                read
            };
            assert_eq!(earlier(one), earlier(other));
        }
    }
}

#[test]
fn a_file_opens_from_its_index_as_from_its_blocks_and_counts_on_in_the_same_way() {
    let mut random = Random(1);
    for round in 0..40 {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("test.holo");
        let mut file = BeamFile::create(&path, options()).unwrap();
        let mut model = Model::default();
        let mut end = FIRST_BLOCK;
        for tag in 0..=random.below(14) as u32 {
            match random.below(8) {
                0 => {
                    file.put_blob("a blob", &vec![tag as u8; random.below(9000) as usize]).unwrap()
                }
                1 => file.begin_generation(file.generation() + random.below(2) as u32).unwrap(),
                2 => {
                    file.close().unwrap();
                    file = BeamFile::open(&path, options()).unwrap();
                    assert!(file.report().damage.is_empty(), "{:?}", file.report());
                }
                _ => put_block(&file, &mut model, &mut random, tag),
            }
            end = file.stats().file_bytes;
        }
        file.close().unwrap();
        let plain = folder.path().join("plain.holo");
        fs::copy(&path, &plain).unwrap();
        remove_index(&plain, end);
        let indexed = BeamFile::open_read_only(&path, 0).unwrap();
        let scanned = BeamFile::open_read_only(&plain, 0).unwrap();
        assert_eq!(scanned.report().indexed, 0);
        assert!(indexed.report().indexed + 1 >= scanned.report().blocks, "round {round}");
        assert_equal(&indexed, &scanned);
        assert!(indexed.verify().unwrap().is_empty());
        drop((indexed, scanned));

        // Both go on.
        let (one, other) =
            (BeamFile::open(&path, options()).unwrap(), BeamFile::open(&plain, options()).unwrap());
        for file in [&one, &other] {
            put_block(file, &mut Model::default(), &mut Random(round), 99);
        }
        assert_equal(&one, &other);
    }
}

#[test]
fn opening_many_blocks_reads_few_places_also_while_the_file_grows() {
    let disk = Memory::default();
    let file = BeamFile::create_on(Box::new(disk.clone()), "memory", options()).unwrap();
    let (mut model, mut random) = (Model::default(), Random(2));
    let reads_of_opening = |disk: &Memory| {
        disk.reads.store(0, Ordering::SeqCst);
        let file = disk.open();
        let reads = disk.reads.load(Ordering::SeqCst);
        (file, reads)
    };
    for tag in 0..700 {
        put_block(&file, &mut model, &mut random, tag);
    }
    // A copy of the disk as it is while the writer goes on.
    let snapshot = Memory::of(disk.bytes.lock().unwrap().clone());
    let (growing, reads) = reads_of_opening(&snapshot);
    assert!(growing.report().indexed >= 600, "{:?}", growing.report());
    assert!(reads < 230, "{reads} reads: only what follows the index is read block by block");
    assert_same(&growing, &model);
    drop(growing);
    for tag in 700..3000 {
        put_block(&file, &mut model, &mut random, tag);
    }
    file.close().unwrap();
    let (file, reads) = reads_of_opening(&disk);
    assert!(file.report().blocks >= 3000);
    assert!(reads < 20, "{reads} reads");
    assert_same(&file, &model);
    file.close().unwrap();

    // A file that is continued often does not collect ranges.
    for tag in 0..300 {
        let file = disk.open();
        put_block(&file, &mut model, &mut random, tag);
        file.close().unwrap();
    }
    let (file, reads) = reads_of_opening(&disk);
    assert!(reads < 40, "{reads} reads");
    assert_same(&file, &model);
}

#[test]
fn a_process_that_dies_at_any_write_loses_nothing_that_was_flushed() {
    let disk = Memory::default();
    let mut file = BeamFile::create_on(Box::new(disk.clone()), "memory", options()).unwrap();
    let (mut model, mut random) = (Model::default(), Random(3));
    // What was flushed once so many operations were done.
    let mut flushed = vec![(disk.operations.lock().unwrap().len(), model.clone())];
    for tag in 0..30 {
        if tag % 4 == 3 {
            file.close().unwrap();
            file = disk.open();
        }
        put_block(&file, &mut model, &mut random, tag);
        flushed.push((disk.operations.lock().unwrap().len(), model.clone()));
    }
    file.close().unwrap();
    let operations = disk.operations.lock().unwrap().clone();
    let mut bytes = Vec::new();
    let mut pointers = 0;
    for (done, operation) in operations.iter().enumerate() {
        let pieces: Vec<Operation> = match operation {
            Operation::Cut(_) => vec![],
            Operation::Write(offset, new) => {
                let is_pointer = new.len() == POINTER_BYTES && *offset < FIRST_BLOCK;
                pointers += usize::from(is_pointer);
                let step = if is_pointer { 1 } else { 1 + new.len() / 7 };
                let lengths = (0..new.len()).step_by(step);
                lengths.map(|length| Operation::Write(*offset, new[..length].to_vec())).collect()
            }
        };
        let Some((_, model)) = flushed.iter().rev().find(|(count, _)| *count <= done) else {
            Memory::apply(&mut bytes, operation);
            continue;
        };
        for torn in pieces {
            let mut bytes = bytes.clone();
            Memory::apply(&mut bytes, &torn);
            let file = Memory::of(bytes).open();
            assert!(missing_of(&file, model).is_empty(), "after {done} operations");
            // A header of which only a part is written cannot be told from a damaged one.
            let end = file.stats().file_bytes;
            let is_expected = |damage: &Damage| match damage.what {
                DamageKind::TornTail | DamageKind::Index => true,
                _ => damage.offset + damage.bytes == end,
            };
            let damage = &file.report().damage;
            assert!(damage.iter().all(is_expected), "{damage:?}");
        }
        Memory::apply(&mut bytes, operation);
    }
    assert!(pointers >= 14, "{pointers}: the index was written several times");
}

/// Returns what a file lacks of a model. The file may have more.
fn missing_of(file: &BeamFile, model: &Model) -> Vec<(u8, u32)> {
    let found = contents(file);
    let lacks = |key, number: &(u8, u32)| {
        found
            .0
            .get(key)
            .is_none_or(|beam: &std::collections::BTreeMap<_, _>| !beam.contains_key(number))
    };
    let all = model.0.iter().flat_map(|(key, beam)| beam.keys().map(move |n| (key, n)));
    all.filter(|(key, number)| lacks(key, number)).map(|(_, number)| *number).collect()
}

/// A file with an index, its model, and where the index begins.
fn indexed(path: &Path) -> (Model, usize) {
    let file = BeamFile::create(path, options()).unwrap();
    let (mut model, mut random) = (Model::default(), Random(4));
    for tag in 0..12 {
        put_block(&file, &mut model, &mut random, tag);
    }
    file.put_blob("a blob", &[5; 6000]).unwrap();
    let end = file.stats().file_bytes as usize;
    file.close().unwrap();
    (model, end)
}

#[test]
fn a_damaged_index_is_named_and_costs_nothing_but_a_scan() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.holo");
    let (model, end) = indexed(&path);
    let good = fs::read(&path).unwrap();
    let used = good.iter().rposition(|&byte| byte != 0).unwrap();
    let pointer = POINTER_OFFSET..POINTER_OFFSET + 20;
    for at in (end..=used).chain(pointer) {
        let mut bytes = good.clone();
        bytes[at] ^= 1 << (at % 8);
        fs::write(&path, &bytes).unwrap();
        let file = BeamFile::open_read_only(&path, 0).unwrap();
        assert_same(&file, &model);
        assert_eq!(file.blob("a blob").unwrap(), Some(vec![5; 6000]));
        let is_named = |file: &BeamFile| {
            let damage = file.verify().unwrap();
            damage.iter().any(|d| (d.offset..d.offset + d.bytes).contains(&(at as u64)))
        };
        assert!(is_named(&file) || good[at] == 0, "byte {at}");
    }
    // A writer goes on, and its index is whole again.
    let mut bytes = good.clone();
    bytes[end + BLOCK_HEADER_BYTES + 80] ^= 1;
    for copy in 0..2 {
        bytes[copy * HEADER_COPY_BYTES + POINTER_OFFSET + 3] ^= 1;
    }
    fs::write(&path, &bytes).unwrap();
    let file = BeamFile::open(&path, options()).unwrap();
    let mut model = model;
    put_block(&file, &mut model, &mut Random(5), 77);
    file.close().unwrap();
    let file = BeamFile::open_read_only(&path, 0).unwrap();
    assert!(file.report().indexed >= 14, "{:?}", file.report());
    assert_same(&file, &model);
}

#[test]
fn damage_of_a_block_that_the_index_describes_is_found_by_verify_and_loses_no_sample() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.holo");
    let (model, _) = indexed(&path);
    let mut bytes = fs::read(&path).unwrap();
    // In the header and in the table of the first block.
    for at in [20, 70] {
        bytes[FIRST_BLOCK as usize + at] ^= 1;
        fs::write(&path, &bytes).unwrap();
        let file = BeamFile::open_read_only(&path, 0).unwrap();
        assert_same(&file, &model);
        let damage = file.verify().unwrap();
        assert_eq!(damage.len(), 1, "{damage:?}");
        assert_eq!(damage[0].offset, FIRST_BLOCK);
        bytes[FIRST_BLOCK as usize + at] ^= 1;
    }
}

#[test]
fn an_index_cut_off_is_missed_by_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.holo");
    let (model, end) = indexed(&path);
    let good = fs::read(&path).unwrap();
    for cut in (end..good.len()).step_by(7) {
        fs::write(&path, &good[..cut]).unwrap();
        let file = BeamFile::open_read_only(&path, 0).unwrap();
        assert_same(&file, &model);
        assert_eq!(file.report().indexed, 0);
        let torn = file.report().damage.iter().all(|d| d.what == DamageKind::TornTail);
        assert!(torn, "{:?}", file.report());
    }
    // Another block takes the place of the index, and the pointers still name the place.
    fs::write(&path, &good[..end]).unwrap();
    let file = BeamFile::open(&path, options()).unwrap();
    let mut model = model;
    put_block(&file, &mut model, &mut Random(6), 50);
    fs::copy(&path, folder.path().join("killed.holo")).unwrap();
    file.close().unwrap();
    for name in ["killed.holo", "test.holo"] {
        let file = BeamFile::open_read_only(folder.path().join(name), 0).unwrap();
        assert!(file.report().damage.is_empty(), "{:?}", file.report());
        assert_same(&file, &model);
    }
}

#[test]
fn blocks_that_an_older_program_appends_after_the_index_are_read_and_indexed_later() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.holo");
    let (mut model, _) = indexed(&path);
    let before = fs::read(&path).unwrap();
    let file = BeamFile::open(&path, options()).unwrap();
    for tag in 20..25 {
        put_block(&file, &mut model, &mut Random(tag.into()), tag);
    }
    let end = file.stats().file_bytes as usize;
    file.close().unwrap();
    // An older program neither writes an index nor changes the pointers.
    let mut bytes = fs::read(&path).unwrap();
    bytes.truncate(end);
    bytes[..FIRST_BLOCK as usize].copy_from_slice(&before[..FIRST_BLOCK as usize]);
    fs::write(&path, &bytes).unwrap();
    let file = BeamFile::open(&path, options()).unwrap();
    assert!(file.report().damage.is_empty(), "{:?}", file.report());
    assert_eq!((file.report().indexed, file.report().blocks), (14, 20));
    assert_same(&file, &model);
    put_block(&file, &mut model, &mut Random(30), 30);
    file.close().unwrap();
    let file = BeamFile::open_read_only(&path, 0).unwrap();
    assert_eq!((file.report().indexed, file.report().blocks), (21, 22));
    assert_same(&file, &model);
}

#[test]
fn one_damaged_range_of_several_is_read_block_by_block_and_then_indexed_anew() {
    let disk = Memory::default();
    let mut file = BeamFile::create_on(Box::new(disk.clone()), "memory", options()).unwrap();
    let (mut model, mut random) = (Model::default(), Random(8));
    let mut indexes = Vec::new();
    // Each session has fewer blocks than the one before, so that the ranges stay apart.
    for blocks in [20, 9, 4] {
        for tag in 0..blocks {
            put_block(&file, &mut model, &mut random, tag);
        }
        indexes.push(file.stats().file_bytes as usize);
        file.close().unwrap();
        file = disk.open();
    }
    file.close().unwrap();
    for (at, offset) in indexes.iter().enumerate() {
        let mut bytes = disk.bytes.lock().unwrap().clone();
        // The first byte of the payload: the table has a range for each session, and one checksum.
        let table = 48 * (at + 1) + 4;
        bytes[(offset + BLOCK_HEADER_BYTES + table).next_multiple_of(16) + 1] ^= 1;
        let copy = Memory::of(bytes);
        let file = copy.open();
        assert_same(&file, &model);
        let damage = &file.report().damage;
        assert!(damage.iter().all(|damage| damage.what == DamageKind::Index), "{damage:?}");
        assert_eq!(damage[0].offset, *offset as u64);
        assert!(file.report().indexed >= 4 && file.report().indexed < 35);
        let mut model = model.clone();
        put_block(&file, &mut model, &mut Random(9), 99);
        file.close().unwrap();
        let file = copy.open();
        assert!(file.report().indexed >= 34, "{:?}", file.report());
        assert_same(&file, &model);
        assert!(missing(&file, &model).is_empty());
    }
}
