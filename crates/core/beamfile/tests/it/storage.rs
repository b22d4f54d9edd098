//! Disks that are full, slow, or fail to sync.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::fs::File;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::common::{Model, assert_same, key, options, run, samples};
use holo_beamfile::{BeamFile, DiskStorage, Error, Maker, Storage};
use holo_section::Sample;

/// A disk with limited room, which fails to sync on request.
struct SmallDisk {
    disk: DiskStorage,
    room: Arc<AtomicU64>,
    no_sync: Arc<AtomicBool>,
}

impl Storage for SmallDisk {
    fn read_exact_at(&self, bytes: &mut [u8], offset: u64) -> io::Result<()> {
        self.disk.read_exact_at(bytes, offset)
    }

    fn write_all_at(&self, bytes: &[u8], offset: u64) -> io::Result<()> {
        let room = self.room.load(Ordering::SeqCst).saturating_sub(offset).min(bytes.len() as u64)
            as usize;
        self.disk.write_all_at(&bytes[..room], offset)?;
        if room < bytes.len() { Err(io::Error::from(io::ErrorKind::StorageFull)) } else { Ok(()) }
    }

    fn sync_data(&self) -> io::Result<()> {
        if self.no_sync.load(Ordering::SeqCst) { Err(io::Error::other("no sync")) } else { Ok(()) }
    }

    fn length(&self) -> io::Result<u64> {
        self.disk.length()
    }

    fn set_len(&self, bytes: u64) -> io::Result<()> {
        self.disk.set_len(bytes)
    }
}

struct Bench {
    folder: tempfile::TempDir,
    room: Arc<AtomicU64>,
    no_sync: Arc<AtomicBool>,
}

fn small_disk(room: u64) -> (BeamFile, Bench) {
    let folder = tempfile::tempdir().unwrap();
    let bench = Bench { folder, room: Arc::new(AtomicU64::new(room)), no_sync: Arc::default() };
    let path = bench.folder.path().join("test.holo");
    let file = File::options().read(true).write(true).create_new(true).open(&path).unwrap();
    let disk = SmallDisk {
        disk: DiskStorage::new(file, &path),
        room: bench.room.clone(),
        no_sync: bench.no_sync.clone(),
    };
    (BeamFile::create_on(Box::new(disk), &path, options()).unwrap(), bench)
}

#[test]
fn a_full_disk_is_reported_and_samples_wait_in_memory_until_there_is_room() {
    for room in (32_768..34_500).step_by(61) {
        let (file, bench) = small_disk(32_768);
        let path = bench.folder.path().join("test.holo");
        let mut model = Model::default();
        let put = |model: &mut Model, first| {
            let run = run(key(1, 3), first);
            let new = samples(&run, 120, first);
            file.append(run, Maker::UNKNOWN, &new).unwrap();
            model.put(&run, &new, false);
        };
        bench.room.store(room, Ordering::SeqCst);
        put(&mut model, 0);
        if file.flush().is_ok() {
            assert!(room >= 34_000, "{room} bytes cannot hold 1200 bytes of samples");
            continue;
        }
        let reason = file.stats().last_error.expect("the reason");
        assert!(reason.contains("no storage space"), "{reason}");
        assert!(file.stats().pending_bytes > 1200);
        put(&mut model, 500);
        assert_same(&file, &model);
        assert!(matches!(file.put_blob("scene", &[1; 2000]), Err(Error::Io { .. })));
        let reader = BeamFile::open_read_only(&path, 0).unwrap();
        assert_eq!(reader.stats().samples, 0, "no partial block is taken for a block");

        bench.room.store(u64::MAX, Ordering::SeqCst);
        file.flush().unwrap();
        assert_eq!(file.stats().last_error, None);
        assert_eq!(file.stats().pending_bytes, 0);
        file.put_blob("scene", &[1; 2000]).unwrap();
        assert_same(&file, &model);
        file.close().unwrap();
        reader.refresh().unwrap();
        assert_same(&reader, &model);
        let file = BeamFile::open(&path, options()).unwrap();
        assert!(file.report().damage.is_empty() && file.verify().unwrap().is_empty());
        assert_same(&file, &model);
        assert_eq!(file.blob("scene").unwrap(), Some(vec![1; 2000]));
    }
}

#[test]
fn a_failed_sync_is_a_failed_write() {
    let (file, bench) = small_disk(u64::MAX);
    let run = run(key(0, 0), 0);
    bench.no_sync.store(true, Ordering::SeqCst);
    file.append(run, Maker::UNKNOWN, &samples(&run, 21, 0)).unwrap();
    assert!(matches!(file.flush(), Err(Error::NotWritten { pending, .. }) if pending > 0));
    bench.no_sync.store(false, Ordering::SeqCst);
    file.flush().unwrap();
    assert_eq!(file.stats().extents, 1, "written again, not twice");
}

#[test]
fn a_failed_replacement_of_a_blob_leaves_the_old_bytes_or_the_new_ones() {
    let (file, bench) = small_disk(u64::MAX);
    let (old, new) = (vec![3; (16 << 20) + 5000], vec![4; 20 << 20]);
    file.put_blob("scene", &old).unwrap();
    // Room for one part of the first copy, then for the first copy and one part of the second.
    for (room, expected) in [(17, &old), (37, &new)] {
        bench.room.store(file.stats().file_bytes + (room << 20), Ordering::SeqCst);
        file.put_blob("scene", &new).unwrap_err();
        assert!(file.blob("scene").unwrap().as_ref() == Some(expected), "{room} MiB");
    }
    bench.room.store(u64::MAX, Ordering::SeqCst);
    let path = bench.folder.path().join("test.holo");
    file.close().unwrap();
    let file = BeamFile::open(&path, options()).unwrap();
    assert_eq!(file.report().unfinished_blobs, ["scene"]);
    assert!(file.blob("scene").unwrap() == Some(new));
}

#[test]
fn samples_waiting_for_a_full_disk_are_bounded_and_further_appends_are_refused() {
    let (file, bench) = small_disk(32_768);
    let many = vec![<Sample as bytemuck::Zeroable>::zeroed(); 1 << 20];
    let mut taken = 0u32;
    let refused = loop {
        match file.append(run(key(0, 0), taken), Maker::UNKNOWN, &many) {
            Ok(()) => taken += many.len() as u32,
            Err(error) => break error,
        }
        assert!(taken < 60 << 20, "nothing bounds what is pending");
    };
    assert!(matches!(refused, Error::NotWritten { .. }), "{refused}");
    assert!(file.stats().pending_bytes < (256 << 20) + (11 << 20));
    bench.room.store(u64::MAX, Ordering::SeqCst);
    file.flush().unwrap();
    assert_eq!(file.count(key(0, 0)), u64::from(taken));
}
