//! Files that are only shown.

use std::{
    collections::{BTreeMap, BTreeSet},
    net::SocketAddr,
};

use holo_net::Message;
use holo_proto::{
    LEAST_TRACED_WEIGHT,
    bulk::{RequestedBeam, ViewRequest},
    control::Control,
    frame::FrameKind,
    hello::Role,
};
use holo_section::{BeamKey, Viewpoint};
use holo_tests::{CORNELL_SMALL_SECTION, LIMIT, Place, analytic::join, stored};
use rustix::process::Signal;

const VIEW: [&str; 6] = ["--vp", "2.78,2.73,-2", "--size", "48x48", "--json", "-o"];

#[test]
fn a_file_that_is_only_shown_takes_no_workers_and_any_number_of_readers() {
    let place = Place::new();
    place.fill_small("a.holo", "50k");
    let before = std::fs::read(place.path("a.holo")).unwrap();
    let one = place.server("a.holo", &["--display-only"]);
    let two = place.server("a.holo", &["--display-only"]);
    place.worker(one.address, &[]).wait().failed(1, &["refused", "only shows"]);
    for (server, name) in [(&one, "one.pfm"), (&two, "two.pfm")] {
        let output = place.text(name);
        let report =
            place.viewer(server.address, &[&VIEW[..], &[&output]].concat()).wait().ok().json();
        assert!(report["stored"].as_u64().unwrap() > 0, "{report}");
        assert_eq!(report["traced"], 0);
    }
    let read = |name: &str| std::fs::read(place.path(name)).unwrap();
    assert!(read("one.pfm") == read("two.pfm"), "two readers show different pictures");
    one.process.end(Signal::INT).ok();
    two.process.end(Signal::TERM).ok();
    assert!(read("a.holo") == before, "the file has changed");
}

#[test]
fn a_file_is_read_while_another_process_fills_it() {
    let place = Place::new();
    place.fill_small("a.holo", "10k");
    let earlier = stored(&place.path("a.holo")).count();
    let writer = place.server("a.holo", &["--fill", "--json"]);
    let _worker = place.worker(writer.address, &[]);
    let reader = place.server("a.holo", &["--display-only"]);
    let output = place.text("a.pfm");
    // The reader sees more and more of what the writer adds.
    let mut last = 0;
    holo_tests::wait_until("a reader to see what the writer adds", || {
        let report =
            place.viewer(reader.address, &[&VIEW[..], &[&output]].concat()).wait().ok().json();
        let samples = report["stored"].as_u64().unwrap();
        assert!(samples >= last, "{samples} after {last}");
        let grown = last > 0 && samples > last;
        last = samples;
        grown.then_some(())
    });
    // A second writer is refused, and nothing happens to the first.
    let file = place.text("a.holo");
    let words = ["holoserver", &file, "--listen", "127.0.0.1:0", "--with-parent"];
    place.run(&words).failed(1, &["a.holo"]);
    let fill =
        ["fill", "--config", "{}/cornell.toml", "--section", CORNELL_SMALL_SECTION, "-o", &file];
    place.run(&[&fill[..], &["--samples", "1k"]].concat()).failed(1, &["a.holo"]);
    let summary = writer.process.end(Signal::INT).ok().json();
    let after = stored(&place.path("a.holo"));
    assert_eq!(summary["samples"], after.count());
    assert!(after.count() > earlier);
    after.assert_no_gaps();
}

/// Returns the beams of stored samples that a server sends for a view, in order of arrival, and how
/// many samples arrive together.
async fn sent(address: SocketAddr, beams: Vec<RequestedBeam>) -> Vec<(BeamKey, usize)> {
    let (mut inbox, outbox, _) = join(address, Role::Display).await;
    let viewpoint = Viewpoint { eye: [2.0, 2.0, -1.0], radius: 0.01 };
    outbox.send(FrameKind::View, &ViewRequest { view: 1, viewpoint, beams }.encode()).unwrap();
    let mut arrived = Vec::new();
    loop {
        match tokio::time::timeout(LIMIT, inbox.next()).await.expect("in time").unwrap() {
            Message::Samples(samples) => {
                arrived.extend(samples.iter().map(|(run, samples)| (run.key, samples.len())));
            }
            Message::Control(Control::StoredSent { view: 1 }) => return arrived,
            _ => {}
        }
    }
}

#[test]
fn a_display_is_sent_no_beam_of_which_it_holds_all_samples() {
    let place = Place::new();
    place.fill_small("a.holo", "50k");
    let mut all: BTreeMap<BeamKey, usize> = BTreeMap::new();
    for ((key, _), samples) in &stored(&place.path("a.holo")).beams {
        *all.entry(*key).or_default() += samples.len();
    }
    let server = place.server("a.holo", &["--display-only"]);
    // The display holds no samples of every third beam, all except one of others, and all of the
    // rest.
    let held = |(at, (&key, &count)): (usize, (&BeamKey, &usize))| {
        (key, [0, count - 1, count][at % 3] as u16)
    };
    let held: BTreeMap<BeamKey, u16> = all.iter().enumerate().map(held).collect();
    let wanted = |(&key, &held): (&BeamKey, &u16)| RequestedBeam {
        key,
        weight: 1.0,
        held,
        has_earlier: false,
    };
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let mut arrived = BTreeMap::new();
    for (key, count) in runtime.block_on(sent(server.address, held.iter().map(wanted).collect())) {
        *arrived.entry(key).or_default() += count;
    }
    let expected = all.into_iter().filter(|(key, count)| usize::from(held[key]) < *count);
    assert_eq!(arrived, expected.collect());
    server.process.end(Signal::INT).ok();
}

#[test]
fn a_display_is_sent_some_samples_of_every_beam_of_its_view_then_more_and_then_other_beams() {
    let place = Place::new();
    place.fill_small("a.holo", "50k");
    let file = stored(&place.path("a.holo"));
    let keys: BTreeSet<BeamKey> = file.beams.keys().map(|(key, _)| *key).collect();
    // In the order of their names, and so in the file, the weights alternate.
    let weight = |at: usize| [1e-6, 20.0, 1e-5, 400.0][at % 4];
    let weights: BTreeMap<BeamKey, f32> =
        keys.into_iter().enumerate().map(|(at, key)| (key, weight(at))).collect();
    let wanted = |(&key, &weight): (&BeamKey, &f32)| RequestedBeam {
        key,
        weight,
        held: 0,
        has_earlier: false,
    };
    let server = place.server("a.holo", &["--display-only"]);
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let arrived = runtime.block_on(sent(server.address, weights.iter().map(wanted).collect()));
    let is_of_view = |key: &BeamKey| weights[key] >= LEAST_TRACED_WEIGHT;
    let of_view = arrived.partition_point(|(key, _)| is_of_view(key));
    let (of_view, others) = arrived.split_at(of_view);
    assert!(others.iter().all(|(key, _)| !is_of_view(key)));
    assert!(others.is_sorted_by(|(one, _), (next, _)| weights[one] >= weights[next]));
    // The first round sends 8 samples of a beam, or a sixteenth of a sample per pixel.
    let mut lacking: BTreeSet<BeamKey> =
        weights.keys().copied().filter(|key| is_of_view(key)).collect();
    let mut counts = BTreeMap::<BeamKey, usize>::new();
    let mut later = 0;
    for &(key, count) in of_view {
        *counts.entry(key).or_default() += count;
        let first_round = if weights[&key] > 100.0 { 25 } else { 8 };
        later += usize::from(counts[&key] > first_round);
        lacking.remove(&key);
        assert!(lacking.is_empty() || later == 0, "{} beams have none", lacking.len());
    }
    assert!(lacking.is_empty() && later > 0);
    let beams: BTreeSet<BeamKey> = arrived.into_iter().map(|(key, _)| key).collect();
    assert_eq!(beams.len(), weights.len());
    server.process.end(Signal::INT).ok();
}
