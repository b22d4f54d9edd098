//! Parts of a file that no view requested: over real sockets, from a server in this process.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::HashSet;
use std::time::Duration;

use crate::common::{self, Peer, Place, run, view};
use holo_net::Message;
use holo_proto::{
    bulk::SampleSource,
    control::{Control, MAX_PART},
    frame::FrameKind,
    hello::Role,
};
use holo_section::{BeamKey, SampleKind};

/// Returns the names of a part's samples, and the number of the next beam.
async fn part(
    display: &mut Peer,
    first: u64,
    samples: u32,
) -> (Vec<(BeamKey, SampleKind, u32)>, Option<u64>) {
    part_of(display, first, samples, false).await
}

/// As [`part`], of the file as it was when the display settled if `as_settled`.
async fn part_of(
    display: &mut Peer,
    first: u64,
    samples: u32,
    as_settled: bool,
) -> (Vec<(BeamKey, SampleKind, u32)>, Option<u64>) {
    let wanted = Control::PartWanted { section: 0, first, samples, as_settled };
    display.outbox.control(&wanted).unwrap();
    let mut names = Vec::new();
    loop {
        let is_of = |message: &Message| {
            matches!(message, Message::Samples(samples) if samples.source == SampleSource::Part)
                || matches!(message, Message::Control(Control::PartSent { .. }))
        };
        match display.wait_for(is_of).await {
            Message::Samples(samples) => {
                for (run, _) in samples.iter() {
                    names
                        .extend((run.first..run.first + run.count).map(|n| (run.key, run.kind, n)));
                }
            }
            Message::Control(Control::PartSent { section: 0, next }) => return (names, next),
            other => panic!("{other:?}"),
        }
    }
}

/// Returns the names of all samples of the section.
async fn all_parts(display: &mut Peer, as_settled: bool) -> HashSet<(BeamKey, SampleKind, u32)> {
    let (mut all, mut next) = (HashSet::new(), Some(0));
    while let Some(first) = next {
        let (names, after) = part_of(display, first, MAX_PART, as_settled).await;
        all.extend(names);
        next = after;
    }
    all
}

#[test]
fn a_display_that_settles_beside_a_fill_gets_what_the_file_held_then() {
    run(async {
        let place = Place::of(b"a scene", [2; 3]);
        let server = place.serve(|config| config.fill = true).await;
        // As slow as tracing is. All beams would have their samples before the display has settled
        // otherwise, and the file would grow by better samples only.
        let worker = tokio::spawn(common::work_as(server.address, |work| {
            std::thread::sleep(Duration::from_millis(1));
            common::results(&work.packets, true)
        }));
        let mut display = Peer::join(server.address, Role::Display).await;
        display.send(FrameKind::View, &view(1, 10));
        display.samples(50).await;
        display.outbox.control(&Control::Settle { view: 1 }).unwrap();
        let settled = Message::Control(Control::Settled { view: 1 });
        display.wait_for(|message| *message == settled).await;
        let first = all_parts(&mut display, true).await;
        // The file goes on growing.
        let mut now = all_parts(&mut display, false).await;
        while now.len() <= first.len() + 1000 {
            now = all_parts(&mut display, false).await;
        }
        assert!(!first.is_empty() && first.is_subset(&now));
        assert!(all_parts(&mut display, true).await == first, "nothing came, nothing went");
        server.end().await;
        worker.await.unwrap();
    });
}

#[test]
fn a_file_that_is_cut_off_under_its_displays_ends_the_server_and_is_named() {
    run(async {
        let place = Place::of(b"a scene", [2; 3]);
        let server = place
            .serve(|config| {
                config.fill = true;
                config.samples = Some(20_000);
            })
            .await;
        let worker = tokio::spawn(common::work(server.address));
        server.ended().await;
        worker.await.unwrap();
        for display_only in [true, false] {
            let whole = std::fs::read(place.file()).unwrap();
            let server = place.serve(|config| config.display_only = display_only).await;
            let mut display = Peer::join(server.address, Role::Display).await;
            let file = std::fs::File::options().write(true).open(place.file()).unwrap();
            file.set_len(40_000).unwrap();
            display.send(FrameKind::View, &view(1, 300));
            let said = display.expelled().await.expect("it is told why");
            assert!(said.contains("a.holo") && said.contains("cut off at 40000 of"), "{said}");
            assert!(server.failed().await.contains("cut off at 40000 of"));
            std::fs::write(place.file(), whole).unwrap();
        }
    });
}

#[test]
fn the_parts_of_a_section_are_all_of_its_samples_each_once() {
    run(async {
        let place = Place::new();
        let server = place.serve(|_| {}).await;
        let worker = tokio::spawn(common::work(server.address));
        let mut display = Peer::join(server.address, Role::Display).await;
        display.send(FrameKind::View, &view(1, 300));
        display.samples(3000).await;
        display.outbox.control(&Control::Settle { view: 1 }).unwrap();
        let settled = Message::Control(Control::Settled { view: 1 });
        display.wait_for(|message| *message == settled).await;
        drop(display);
        server.end().await;
        worker.await.unwrap();

        // Nothing is traced any more.
        let server = place.serve(|_| {}).await;
        let mut display = Peer::join(server.address, Role::Display).await;
        let (mut names, mut next, mut parts) = (Vec::new(), Some(0), 0);
        while let Some(first) = next {
            let (more, then) = part(&mut display, first, 500).await;
            assert!(then.is_none_or(|then| then > first));
            names.extend(more);
            (next, parts) = (then, parts + 1);
        }
        assert!(parts > 5, "{parts}");
        assert_eq!(names.len() as u64, display.welcome.samples);
        assert_eq!(names.iter().collect::<HashSet<_>>().len(), names.len());
        let (whole, end) = part(&mut display, 0, MAX_PART).await;
        assert_eq!((whole, end), (names, None));
        drop(display);
        server.end().await;
    });
}

/// Requests a part of each of these sections, all at once. Returns why the server ends the
/// connection; `None` if it sends every part.
async fn refusal(display: &mut Peer, sections: &[u16]) -> Option<String> {
    for &section in sections {
        let part = Control::PartWanted { section, first: 0, samples: MAX_PART, as_settled: false };
        display.outbox.control(&part).unwrap();
    }
    let is_answer = |message: &Message| {
        matches!(message, Message::Control(Control::PartSent { .. } | Control::Bye(_)))
    };
    for _ in sections {
        if let Message::Control(Control::Bye(why)) = display.wait_for(is_answer).await {
            return Some(why.to_string());
        }
    }
    None
}

#[test]
fn who_asks_for_two_parts_at_once_or_for_another_section_is_sent_away() {
    run(async {
        let place = Place::new();
        let server = place.serve(|_| {}).await;
        let mut display = Peer::join(server.address, Role::Display).await;
        let why = refusal(&mut display, &[1]).await.expect("it is sent away");
        assert!(why.contains("it asked for a section that does not exist"), "{why}");
        // The file is empty, so the first part may be sent before the second request is read.
        let mut refused = None;
        for _ in 0..100 {
            let mut display = Peer::join(server.address, Role::Display).await;
            refused = refusal(&mut display, &[0, 0]).await;
            if refused.is_some() {
                break;
            }
        }
        let why = refused.expect("it is sent away");
        assert!(why.contains("it asked for a part of the file before"), "{why}");
        // Others are served on, also from beyond the last beam.
        let mut display = Peer::join(server.address, Role::Display).await;
        assert_eq!(part(&mut display, u64::MAX, 10).await, (vec![], None));
        drop(display);
        server.end().await;
    });
}
