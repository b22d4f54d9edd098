//! Files that another program deletes, moves or cuts off while they are written.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::fs::{self, File};
use std::path::Path;

use crate::common::{key, options, run, samples};
use holo_beamfile::{BeamFile, Error, FileLoss, Maker};

type Harm = fn(&Path);

fn delete(path: &Path) {
    fs::remove_file(path).unwrap();
}

fn move_away(path: &Path) {
    fs::rename(path, path.with_extension("elsewhere")).unwrap();
}

fn replace(path: &Path) {
    let other = path.with_extension("other");
    fs::copy(path, &other).unwrap();
    fs::rename(other, path).unwrap();
}

fn cut_off(path: &Path) {
    File::options().write(true).open(path).unwrap().set_len(100).unwrap();
}

/// A file with some samples on disk, then harmed.
fn harmed(folder: &Path, harm: Harm) -> BeamFile {
    let path = folder.join("test.holo");
    let file = BeamFile::create(&path, options()).unwrap();
    let run = run(key(0, 0), 0);
    file.append(run, Maker::UNKNOWN, &samples(&run, 21, 0)).unwrap();
    file.flush().unwrap();
    assert!(file.lost().is_none());
    harm(&path);
    file
}

fn is_lost(error: &Error, harm: Harm) -> bool {
    let Error::Lost { path, how } = error else { return false };
    let cut = matches!(how, FileLoss::Shortened { bytes: 100, written } if *written > 32_768);
    let right =
        if std::ptr::fn_addr_eq(harm, cut_off as Harm) { cut } else { *how == FileLoss::NotAtPath };
    right && path.ends_with("test.holo")
}

#[test]
fn samples_added_after_the_loss_are_an_error_and_not_silently_gone() {
    for harm in [delete, move_away, replace, cut_off] as [Harm; 4] {
        let folder = tempfile::tempdir().unwrap();
        let file = harmed(folder.path(), harm);
        let later = run(key(0, 1), 0);
        file.append(later, Maker::UNKNOWN, &samples(&later, 21, 0)).unwrap();
        assert!(is_lost(&file.flush().unwrap_err(), harm));
        assert!(is_lost(&file.lost().unwrap(), harm));
        // The writer has stopped, and accepts no samples that could not be written.
        assert!(is_lost(
            &file.append(later, Maker::UNKNOWN, &samples(&later, 21, 0)).unwrap_err(),
            harm
        ));
        assert!(is_lost(&file.close().unwrap_err(), harm));
    }
}

#[test]
fn a_loss_is_noticed_by_a_flush_with_nothing_to_write_and_by_a_blob() {
    for harm in [delete, move_away, replace, cut_off] as [Harm; 4] {
        let folder = tempfile::tempdir().unwrap();
        let file = harmed(folder.path(), harm);
        assert!(is_lost(&file.flush().unwrap_err(), harm));
        drop(file);
        let folder = tempfile::tempdir().unwrap();
        let file = harmed(folder.path(), harm);
        assert!(is_lost(&file.put_blob("scene", &[1; 100]).unwrap_err(), harm));
        assert!(is_lost(&file.close().unwrap_err(), harm));
    }
}
