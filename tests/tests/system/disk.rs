//! Effects of other programs and broken disks on a holodeck's file.

use std::{
    collections::HashMap,
    fs::{self, File},
    path::Path,
};

use holo_beamfile::BeamFile;
use holo_tests::{Place, stored, wait_until};
use rustix::process::{Pid, Resource, Rlimit, Signal, getrlimit, prlimit};

use crate::interrupted::{count, filling};

const VIEW: [&str; 4] = ["--view", "front", "--size", "64x64"];

/// Flips a bit in each of these bytes of a file.
fn flip(path: &Path, places: &[usize]) {
    let mut bytes = fs::read(path).unwrap();
    places.iter().for_each(|&at| bytes[at] ^= 1);
    fs::write(path, bytes).unwrap();
}

/// Returns all places where these bytes begin in a file.
fn occurrences(path: &Path, wanted: &[u8]) -> Vec<usize> {
    let bytes = fs::read(path).unwrap();
    (0..bytes.len()).filter(|&at| bytes[at..].starts_with(wanted)).collect()
}

/// Where the first sample of every beam lies in a file.
fn first_samples(path: &Path) -> Vec<usize> {
    let bytes = fs::read(path).unwrap();
    let places: HashMap<&[u8], usize> =
        bytes.windows(10).enumerate().map(|(at, ten)| (ten, at)).collect();
    let file = BeamFile::open_read_only(path, 0).unwrap();
    let mut keys = Vec::new();
    file.for_each_beam(&mut |key, _| keys.push(key));
    let first = |key| {
        let sample = file.read(key).unwrap().samples[0];
        [&sample.coords.0[..], &sample.rgbe, &sample.distance_code().to_le_bytes()].concat()
    };
    keys.into_iter().map(|key| places[&first(key)[..]]).collect()
}

#[test]
fn a_fill_whose_file_is_deleted_or_cut_off_fails_and_says_so() {
    let place = Place::new();
    let path = place.path("a.holo");
    let (process, _) = filling(&place);
    fs::remove_file(&path).unwrap();
    process.wait().failed(1, &["a.holo", "the file was deleted, moved or replaced"]);

    let (process, _) = filling(&place);
    File::options().write(true).open(&path).unwrap().set_len(40_000).unwrap();
    process.wait().failed(1, &["a.holo", "the file was cut off at 40000 of"]);
}

#[test]
fn a_fill_at_the_limit_of_file_sizes_waits_and_goes_on_when_the_limit_is_raised() {
    let place = Place::new();
    let path = place.path("a.holo");
    let (process, children) = filling(&place);
    let server = children.iter().find(|(id, _)| {
        let line = fs::read(format!("/proc/{id}/cmdline")).unwrap_or_default();
        line.split(|byte| *byte == 0).any(|word| word == b"holoserver")
    });
    let (server, _) = server.expect("one of the children is a server");
    let server = Pid::from_raw(i32::try_from(*server).unwrap());
    let usual = getrlimit(Resource::Fsize);
    let bytes = fs::metadata(&path).unwrap().len() + 50_000;
    prlimit(server, Resource::Fsize, Rlimit { current: Some(bytes), ..usual }).unwrap();
    wait_until("the server to meet the limit", || {
        process.stderr().contains("File too large").then_some(())
    });
    let before = count(&path);
    prlimit(server, Resource::Fsize, usual).unwrap();
    wait_until("the fill to go on", || (count(&path) > before + 20_000).then_some(()));
    let summary = process.end(Signal::INT).ok().json();
    let stored = stored(&path);
    assert_eq!(summary["samples"], stored.count());
    stored.assert_no_gaps();
    place.run(&["verify", "{}/a.holo"]).ok();
}

#[test]
fn samples_that_a_picture_lacks_because_they_are_damaged_are_named() {
    let place = Place::new();
    place.fill_small("a.holo", "40k");
    let picture = ["picture", "{}/a.holo", "-o", "{}/a.pfm", "--driver", "quadtree"];
    let whole = place.run(&[&picture[..], &VIEW].concat()).ok();
    assert!(!whole.stderr.contains("damaged"), "{}", whole.stderr);
    // The last block is read when the file is opened, so its damage would be found in any case.
    place.fill_small("a.holo", "1k");
    let places = first_samples(&place.path("a.holo"));
    flip(&place.path("a.holo"), &places);
    let replay = ["replay", "{}/a.holo", "--headless", "--time", "0.1", "-o", "{}/b.pfm"];
    for words in [&picture[..], &replay] {
        let ended = place.run(&[words, &VIEW].concat()).ok();
        let mut lines = ended.stderr.lines();
        let named = lines.any(|line| line.contains("a.holo: ") && line.contains("left out"));
        assert!(named, "{}", ended.stderr);
    }
}

#[test]
fn one_damaged_copy_of_the_description_or_the_scene_costs_nothing_and_is_named() {
    let place = Place::new();
    place.fill_small("a.holo", "20k");
    let path = place.path("a.holo");
    let picture = ["picture", "{}/a.holo", "-o", "{}/a.pfm", "--json"];
    let whole = place.run(&[&picture[..], &VIEW].concat()).ok().json();
    let good = fs::read(&path).unwrap();
    for (blob, bytes) in [("holodeck", &b"\"sections\""[..]), ("scene", b"holoscn")] {
        let copies = occurrences(&path, bytes);
        assert_eq!(copies.len(), 2, "copies of blob {blob}");
        flip(&path, &copies[1..]);
        let ended = place.run(&[&picture[..], &VIEW].concat()).ok();
        assert!(ended.stderr.contains(&format!("a copy of blob `{blob}`")), "{}", ended.stderr);
        assert!(ended.stderr.contains("a.holo"), "{}", ended.stderr);
        let report = ended.json();
        for field in ["driver", "stored", "uncovered_pixels"] {
            assert_eq!(report[field], whole[field], "{field}");
        }
        flip(&path, &copies[..1]);
        place.run(&["verify", "{}/a.holo"]).failed(1, &["a.holo"]);
        if blob == "holodeck" {
            place
                .run(&[&picture[..], &VIEW].concat())
                .failed(1, &["a.holo", "blob `holodeck` is damaged"]);
        }
        fs::write(&path, &good).unwrap();
    }
}
