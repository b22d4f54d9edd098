//! A file written anew in order, and rays copied into other sections.

use std::{
    collections::BTreeMap,
    path::Path,
    time::{Duration, Instant},
};

use holo_beamfile::BeamFile;
use holo_picture::{Picture, compare};
use holo_section::{BeamKey, Sample, SampleKind};
use holo_tests::{CORNELL_SMALL_SECTION, Place};
use rustix::process::Signal;

const VIEW: [&str; 10] =
    ["--vp", "2.78,2.73,-2", "--vd", "0,0,1", "--vu", "0,1,0", "--vh", "60", "--size", "64x64"];

/// Every sample that counts, with the paths in it, by beam, kind and number.
type Samples = BTreeMap<(BeamKey, SampleKind, u32), (u16, Sample)>;

fn samples(path: &Path) -> Samples {
    let file = BeamFile::open_read_only(path, 1 << 20).unwrap();
    let mut keys = Vec::new();
    file.for_each_beam(&mut |key, _| keys.push(key));
    let mut samples = Samples::new();
    for key in keys {
        for (run, of_run) in file.read(key).unwrap().iter() {
            for (number, sample) in (run.first..).zip(of_run) {
                samples.insert((key, run.kind, number), (run.paths, *sample));
            }
        }
    }
    samples
}

fn picture(place: &Place, file: &str, driver: &str) -> Picture {
    let output = place.text(&format!("{file}-{driver}.pfm"));
    let words = ["picture", &place.text(file), "--driver", driver, "--denoise", "off", "-o"];
    place.run(&[&words[..], &[&output], &VIEW].concat()).ok();
    Picture::read(&output).unwrap()
}

/// Makes a file whose beams lie in several places, with superseded samples.
fn scattered(place: &Place, file: &str) {
    for samples in ["20k", "20k", "20k"] {
        place.fill_small(file, samples);
    }
}

#[test]
fn an_optimized_file_has_the_same_samples_and_pictures_in_fewer_places() {
    let place = Place::new();
    scattered(&place, "a.holo");
    let (before, shown) = (samples(&place.path("a.holo")), picture(&place, "a.holo", "quadtree"));
    let info =
        |what: &str| place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json()[what].clone();
    let known = ["unseen_beams", "samples", "workers"].map(info);
    let gained = place.run(&["optimize", "{}/a.holo", "--json"]).ok().json();
    let pair = |name: &str| [0, 1].map(|at| gained[name][at].as_u64().unwrap());
    let ([scattered, joined], [large, small]) = (pair("extents"), pair("bytes"));
    assert!(scattered > 3 * joined && small < large, "{gained}");
    assert_eq!(gained["samples"], before.len());
    assert!(samples(&place.path("a.holo")) == before);
    assert_eq!(["unseen_beams", "samples", "workers"].map(info), known);
    assert!(picture(&place, "a.holo", "quadtree").pixels == shown.pixels);
    assert_eq!(std::fs::metadata(place.path("a.holo")).unwrap().len(), small);
    assert!(!place.path("a.holo.new").exists());
    place.run(&["verify", "{}/a.holo"]).ok();
    // It is an ordinary file, and once more there is nothing to gain.
    place.fill_small("a.holo", "1k");
    place.run(&["optimize", "{}/a.holo"]).ok();
    let words = place.run(&["optimize", "{}/a.holo"]).ok().stdout;
    assert!(words.contains(" -> ") && words.contains("samples lie in"), "{words}");
}

#[test]
fn a_file_in_use_a_file_that_is_none_and_a_damaged_one_are_not_optimized() {
    let place = Place::new();
    place.fill_small("a.holo", "5k");
    let server = place.server("a.holo", &[]);
    place.run(&["optimize", "{}/a.holo"]).failed(1, &["a.holo", "another process"]);
    server.process.end(Signal::TERM).ok();
    place.write("b.holo", "no holodeck at all");
    place.run(&["optimize", "{}/b.holo"]).failed(1, &["b.holo"]);
    place.run(&["optimize", "{}/c.holo"]).failed(1, &["c.holo"]);
    place.fill_small("a.holo", "60k");
    let mut bytes = std::fs::read(place.path("a.holo")).unwrap();
    // The middle of the file is samples.
    let middle = bytes.len() / 2;
    bytes[middle..middle + 64].iter_mut().for_each(|byte| *byte ^= 0x55);
    std::fs::write(place.path("a.holo"), &bytes).unwrap();
    assert_ne!(place.run(&["verify", "{}/a.holo"]).code(), Some(0));
    place.run(&["optimize", "{}/a.holo"]).failed(1, &["damaged", "verify"]);
    assert!(std::fs::read(place.path("a.holo")).unwrap().len() >= bytes.len());
    assert!(!place.path("a.holo.new").exists());
}

#[test]
fn whenever_it_is_killed_no_sample_is_lost() {
    let place = Place::new();
    scattered(&place, "a.holo");
    let before = samples(&place.path("a.holo"));
    let start = Instant::now();
    place.run(&["optimize", "{}/a.holo"]).ok();
    let whole = start.elapsed();
    let mut killed = 0;
    for part in 0..12 {
        let process = place.start(&["optimize", "{}/a.holo"]);
        std::thread::sleep(whole.mul_f64(f64::from(part) / 12.0).max(Duration::from_millis(1)));
        killed += u32::from(process.end(Signal::KILL).signal().is_some());
        assert!(samples(&place.path("a.holo")) == before, "killed in part {part} of {whole:?}");
    }
    assert!(killed > 3, "{killed} of 12 were killed before they had ended");
    place.run(&["optimize", "{}/a.holo"]).ok();
    assert!(samples(&place.path("a.holo")) == before && !place.path("a.holo.new").exists());
    place.run(&["verify", "{}/a.holo"]).ok();
}

#[test]
fn another_grid_of_a_section_gets_most_rays_and_shows_nearly_the_same_pictures() {
    let place = Place::new();
    place.fill_small("a.holo", "400k");
    let finer = format!("{} 11,10,9", grouped(CORNELL_SMALL_SECTION));
    let copied = place
        .run(&["copy", "{}/a.holo", "--section", &finer, "-o", "{}/b.holo", "--json"])
        .ok()
        .json();
    let count = |name: &str| copied[name].as_u64().unwrap();
    assert_eq!(count("samples"), samples(&place.path("a.holo")).len() as u64);
    assert!(copied["share"].as_f64().unwrap() >= 0.8, "{copied}");
    assert!(count("kept") <= count("samples") && count("stored") >= count("kept"), "{copied}");
    assert_eq!(count("stored"), samples(&place.path("b.holo")).len() as u64);
    place.run(&["verify", "{}/b.holo"]).ok();
    let render = ["render", "--config", "{}/cornell.toml", "--spp", "400", "-o", "{}/truth.pfm"];
    place.run(&[&render[..], &VIEW].concat()).ok();
    let truth = Picture::read(place.path("truth.pfm")).unwrap();
    for driver in ["quadtree", "surfaces"] {
        let quality = |file| compare(&picture(&place, file, driver), &truth).unwrap().psnr_disp;
        let (old, new) = (quality("a.holo"), quality("b.holo"));
        println!("{driver}: {old:.2} dB, {new:.2} dB from the copy, {copied}");
        assert!(new > old - 0.5, "{driver}: {old} dB, and {new} dB from the copy");
    }
    // A fill goes on with the copy.
    let section = ["fill", "--config", "{}/cornell.toml", "--section", &finer, "-q", "-o"];
    place.run(&[&section[..], &["{}/b.holo", "--samples", "500k"]].concat()).ok();
    assert!(samples(&place.path("b.holo")).len() as u64 > count("stored"));
}

#[test]
fn copies_into_places_that_cannot_be_are_refused_and_leave_nothing() {
    let place = Place::new();
    place.fill_small("a.holo", "5k");
    let copy = |section: &str, to: &str| {
        place.run(&["copy", "{}/a.holo", "--section", section, "-o", &place.text(to)])
    };
    copy("0,0,0 1,0,0 0,1,0 0,0,1", "a.holo").failed(1, &["a.holo", "exists"]);
    copy("0,0,0 1,0,0 2,0,0 0,0,1", "b.holo").failed(1, &["section 0", "degenerate"]);
    copy("500,500,500 1,0,0 0,1,0 0,0,1", "b.holo").failed(1, &["none of the"]);
    place.run(&["copy", "{}/a.holo", "-o", "{}/b.holo"]).failed(2, &["--section"]);
    let missing = ["copy", "{}/x.holo", "--section", "0,0,0 1,0,0 0,1,0 0,0,1", "-o", "{}/b.holo"];
    place.run(&missing).failed(1, &["x.holo"]);
    assert!(!place.path("b.holo").exists());
}

/// Returns a section's option without its grid.
fn grouped(section: &str) -> String {
    section.split_whitespace().take(4).collect::<Vec<_>>().join(" ")
}
