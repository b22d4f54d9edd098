//! Blobs with a damaged copy.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::options;
use holo_beamfile::format::FIRST_BLOCK;
use holo_beamfile::{BeamFile, DamageKind, Error};

const NAME: &str = "holodeck";

/// Two and a half chunks of bytes, none of them zero.
fn content() -> Vec<u8> {
    (0..10_000).map(|i: u32| (i % 255 + 1) as u8).collect()
}

/// A file that holds nothing but a blob, and its bytes.
fn with_blob(folder: &Path) -> (PathBuf, Vec<u8>) {
    let path = folder.join("test.holo");
    let file = BeamFile::create(&path, options()).unwrap();
    file.put_blob(NAME, &content()).unwrap();
    file.close().unwrap();
    let bytes = fs::read(&path).unwrap();
    (path, bytes)
}

/// Where in a file's bytes the content stands: once in each copy.
fn copies(bytes: &[u8]) -> Vec<usize> {
    let content = content();
    let begins = bytes.windows(8).enumerate().filter(|(_, window)| *window == &content[..8]);
    begins.map(|(at, _)| at).filter(|&at| bytes[at..].starts_with(&content)).collect()
}

#[test]
fn a_flipped_bit_anywhere_costs_no_blob_and_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (path, good) = with_blob(folder.path());
    assert_eq!(copies(&good).len(), 2);
    for at in (FIRST_BLOCK as usize..good.len()).step_by(41) {
        let mut bytes = good.clone();
        bytes[at] ^= 1 << (at % 8);
        fs::write(&path, &bytes).unwrap();
        let file = BeamFile::open_read_only(&path, 0).unwrap();
        assert_eq!(file.blob(NAME).unwrap(), Some(content()), "byte {at}");
        let damage = file.verify().unwrap();
        let named = damage.iter().any(|d| (d.offset..d.offset + d.bytes).contains(&(at as u64)));
        assert!(named || good[at] == 0, "byte {at}: {damage:?}");
    }
}

#[test]
fn each_chunk_is_read_from_the_copy_in_which_it_is_intact() {
    let folder = tempfile::tempdir().unwrap();
    let (path, mut bytes) = with_blob(folder.path());
    let copies = copies(&bytes);
    bytes[copies[0] + 1] ^= 1;
    bytes[copies[1] + 9_000] ^= 1;
    fs::write(&path, &bytes).unwrap();
    let file = BeamFile::open_read_only(&path, 0).unwrap();
    assert_eq!(file.blob(NAME).unwrap(), Some(content()));
    // Only what was tried and found damaged is listed: the newest copy comes first.
    let damage = file.damage();
    assert_eq!(damage.len(), 1, "{damage:?}");
    assert_eq!(damage[0].what, DamageKind::Blob(NAME.into()));
    assert!(damage[0].to_string().contains("blob `holodeck`"), "{}", damage[0]);

    bytes[copies[0] + 9_500] ^= 1;
    fs::write(&path, &bytes).unwrap();
    let file = BeamFile::open_read_only(&path, 0).unwrap();
    let error = file.blob(NAME).unwrap_err();
    assert!(matches!(error, Error::BlobDamaged { .. }));
    let message = error.to_string();
    assert!(message.contains("test.holo") && message.contains("blob `holodeck`"), "{message}");
}

#[test]
fn a_writer_that_finds_a_damaged_copy_stores_the_blob_again() {
    let folder = tempfile::tempdir().unwrap();
    let (path, mut bytes) = with_blob(folder.path());
    let first_two = copies(&bytes);
    bytes[first_two[1] + 1] ^= 1;
    fs::write(&path, &bytes).unwrap();
    let file = BeamFile::open(&path, options()).unwrap();
    assert_eq!(file.blob(NAME).unwrap(), Some(content()));
    file.close().unwrap();

    let mut bytes = fs::read(&path).unwrap();
    bytes[first_two[0] + 1] ^= 1;
    fs::write(&path, &bytes).unwrap();
    let file = BeamFile::open(&path, options()).unwrap();
    assert_eq!(file.blob(NAME).unwrap(), Some(content()), "the third copy");
    let length = file.stats().file_bytes;
    file.close().unwrap();
    assert_eq!(fs::metadata(&path).unwrap().len(), length, "the newest copy is intact");
}

#[test]
fn older_bytes_are_no_copy_of_newer_ones() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = with_blob(folder.path());
    let file = BeamFile::open(&path, options()).unwrap();
    let mut newer = content();
    newer[5_000] = 0;
    file.put_blob_once(NAME, &newer).unwrap();
    let at = file.stats().file_bytes as usize - 8;
    file.close().unwrap();
    let mut bytes = fs::read(&path).unwrap();
    bytes[at] ^= 1;
    fs::write(&path, &bytes).unwrap();
    let file = BeamFile::open_read_only(&path, 0).unwrap();
    assert!(matches!(file.blob(NAME), Err(Error::BlobDamaged { .. })), "stored once");
}
