//! Peers that know the protocol and mean harm: over real sockets, to a server in this process.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::BTreeSet;

use crate::common::{self, Peer, Place, Server, in_time, run, view};
use holo_net::Message;
use holo_proto::{
    bulk::{RaysWanted, Results, WantedRay, WorkPackets},
    control::{Control, Farewell},
    frame::FrameKind,
    hello::Role,
};
use holo_section::{RayCoords, Sample, SampleKind};
use holo_server::Holodeck;
use tokio::{net::TcpStream, task::JoinHandle};

#[test]
fn a_worker_that_answers_pings_and_returns_nothing_hangs_nobody() {
    run(async {
        let place = Place::new();
        let server = place.serve(|_| {}).await;
        // It says that it has more threads than any machine.
        let mut silent = Peer::join(server.address, Role::Worker).await;
        silent.outbox.control(&Control::Ready { threads: u16::MAX }).unwrap();
        let mut display = Peer::join(server.address, Role::Display).await;
        display.send(FrameKind::View, &view(1, 500));
        let held = silent.work().await;
        assert!(!held.is_empty());
        // An honest worker joins. It traces the packets that the silent one holds, or they are no
        // longer waited for.
        let honest = tokio::spawn(common::work(server.address));
        display.samples(200).await;
        display.outbox.control(&Control::Settle { view: 1 }).unwrap();
        display
            .wait_for(|message| *message == Message::Control(Control::Settled { view: 1 }))
            .await;
        assert!(held.len() <= 1024, "{} packets", held.len());
        server.end().await;
        honest.await.unwrap();
    });
}

#[test]
fn a_display_that_floods_delays_no_other_and_leaves_nothing_behind() {
    run(async {
        let place = Place::new();
        let server = place.serve(|_| {}).await;
        let honest = tokio::spawn(common::work(server.address));
        let flood = Peer::join(server.address, Role::Display).await;
        // Views without end, as fast as the server takes them.
        let flood = tokio::spawn(async move {
            for number in 1.. {
                flood.send(FrameKind::View, &view(number, 2000));
                while flood.outbox.queued_bytes() > 8 << 20 {
                    tokio::task::yield_now().await;
                }
            }
        });
        let mut display = Peer::join(server.address, Role::Display).await;
        display.send(FrameKind::View, &view(1, 10));
        display.samples(1).await;
        assert!(!flood.is_finished(), "it was served beside the flood");
        flood.abort();
        display.send(FrameKind::View, &view(2, 10));
        display
            .wait_for(|message| *message == Message::Control(Control::StoredSent { view: 2 }))
            .await;
        server.end().await;
        honest.await.unwrap();
    });
}

#[test]
fn a_worker_that_traces_other_rays_than_it_is_given_is_dropped_and_others_trace_them() {
    run(async {
        let place = Place::new();
        let server = place.serve(|_| {}).await;
        // Its samples are all of one ray.
        let liar = tokio::spawn(common::work_as(server.address, |work| {
            common::results(&work.packets, true)
        }));
        let mut display = Peer::join(server.address, Role::Display).await;
        display.send(FrameKind::View, &view(1, 1));
        let rays =
            (1..=40).map(|at| WantedRay { key: common::beam(0), coords: RayCoords([at; 4]) });
        display.send(FrameKind::Rays, &RaysWanted { view: 1, rays: rays.collect() }.encode());
        let reason = in_time(liar).await.unwrap().expect("it is told why").to_string();
        assert!(reason.contains("other rays"), "{reason}");
        // An honest one gets them, and returns what they name.
        let honest = tokio::spawn(common::work_as(server.address, |work| {
            let mut results = common::results(&work.packets, true);
            let mut samples = results.samples.iter_mut();
            for packet in &work.packets {
                for at in 0..usize::from(packet.count) {
                    let sample = samples.next().unwrap();
                    sample.coords = packet.rays.map_or(sample.coords, |rays| rays[at]);
                }
            }
            results
        }));
        let mut seen = BTreeSet::new();
        while seen.len() < 40 {
            let is_samples = |message: &Message| matches!(message, Message::Samples(_));
            let Message::Samples(samples) = display.wait_for(is_samples).await else { continue };
            let mut rest = samples.samples.as_slice();
            for run in &samples.runs {
                let (these, after) = rest.split_at(run.count as usize);
                rest = after;
                if run.kind == SampleKind::SingleRay {
                    seen.extend(these.iter().map(|sample| sample.coords.0));
                }
            }
        }
        assert_eq!(seen, (1..=40).map(|at| [at; 4]).collect());
        server.end().await;
        honest.await.unwrap();
    });
}

#[test]
fn workers_whose_results_no_tracer_makes_are_dropped_at_once_and_others_trace_their_packets() {
    run(async {
        let place = Place::new();
        let server = place.serve(|_| {}).await;
        let mut display = Peer::join(server.address, Role::Display).await;
        display.send(FrameKind::View, &view(1, 50));
        let nothing = u16::MAX;
        for (colour, distance, words) in [
            ([200, 0, 0, 255], 77, "brighter than any lamp"),
            ([128, 64, 32, 128], nothing, "other light than the sky's"),
            ([128, 64, 32, 128], 5000, "beyond the bounds"),
        ] {
            let reason = common::work_as(server.address, |work| {
                let mut results = common::results(&work.packets, true);
                let last = results.samples.last_mut().unwrap();
                *last = Sample::from_codes(last.coords, colour, distance);
                results
            });
            let reason = in_time(reason).await.expect("it is told why").to_string();
            assert!(reason.contains(words), "{reason}");
        }
        // An honest worker traces the packets of the dropped ones.
        let honest = tokio::spawn(common::work(server.address));
        display.samples(500).await;
        let summary = server.end().await;
        honest.await.unwrap();
        assert!(summary.samples >= 500);
    });
}

#[test]
fn strangers_that_say_nothing_lock_nobody_out() {
    run(async {
        let place = Place::new();
        let server = place.serve(|_| {}).await;
        let mut silent = Vec::new();
        for _ in 0..400 {
            silent.push(in_time(TcpStream::connect(server.address)).await.unwrap());
        }
        // Both are admitted, although no other peer has left.
        let display = Peer::join(server.address, Role::Display).await;
        let worker = Peer::join(server.address, Role::Worker).await;
        drop((silent, display, worker));
        server.end().await;
    });
}

#[test]
fn a_flood_of_named_views_and_scenes_takes_one_thread_and_little_of_the_file() {
    run(async {
        let place = Place::new();
        let server = place.serve(|_| {}).await;
        let mut flood = Peer::join(server.address, Role::Display).await;
        let before = std::fs::metadata(place.file()).unwrap().len();
        let options = format!("-vp {}", "1".repeat(500));
        for number in 0..20_000 {
            let name = format!("view {}", number % 200);
            let keep = Control::KeepView { name, options: options.clone() };
            flood.outbox.control(&keep).unwrap();
            flood.outbox.control(&Control::SceneWanted).unwrap();
            flood.outbox.control(&Control::Settle { view: 0 }).unwrap();
        }
        // Others join meanwhile, and are served.
        let mut display = Peer::join(server.address, Role::Display).await;
        let keep = Control::KeepView { name: "mine".into(), options: "-vtv".into() };
        display.outbox.control(&keep).unwrap();
        display.outbox.control(&Control::Ping(7)).unwrap();
        display.wait_for(|message| *message == Message::Control(Control::Pong(7))).await;
        let threads = std::fs::read_dir("/proc/self/task").unwrap().count();
        flood.outbox.control(&Control::Ping(8)).unwrap();
        flood.wait_for(|message| *message == Message::Control(Control::Pong(8))).await;
        server.end().await;
        let cores = std::thread::available_parallelism().unwrap().get();
        assert!(threads < 64 + 64 * cores, "{threads}");
        let after = std::fs::metadata(place.file()).unwrap().len();
        // 64 views at a time, and not more often than twice a second.
        assert!(after - before < 8 << 20, "{} bytes", after - before);
    });
}

/// A worker that calls everything unseen.
fn nothing_there(work: &WorkPackets) -> Results {
    Results { unseen: work.packets.iter().map(|packet| packet.id).collect(), ..Default::default() }
}

/// Serves, and waits until a worker that calls everything unseen has done so with many beams.
async fn deceived(place: &Place) -> (Server, JoinHandle<Option<Farewell>>) {
    let server = place.serve(|config| config.fill = true).await;
    let (sender, mut claims) = tokio::sync::mpsc::unbounded_channel();
    let liar = tokio::spawn(common::work_as(server.address, move |work| {
        // A test that has seen enough does not listen.
        let _ = sender.send(work.packets.len());
        nothing_there(work)
    }));
    let mut claimed = 0;
    while claimed < 20_000 {
        claimed += in_time(claims.recv()).await.unwrap();
    }
    (server, liar)
}

/// Returns how many unseen beams the file has.
fn unseen(place: &Place) -> u64 {
    Holodeck::open_read_only(&place.file(), 0).unwrap().unseen().count()
}

#[test]
fn what_a_worker_calls_unseen_is_checked_by_the_next_and_undone() {
    run(async {
        let place = Place::new();
        let (server, _liar) = deceived(&place).await;
        let honest = tokio::spawn(common::work(server.address));
        // The next worker traces in the beams that had been excluded.
        in_time(async {
            while stored_beams(&place) < 1000 {
                tokio::task::yield_now().await;
            }
        })
        .await;
        server.end().await;
        assert_eq!(unseen(&place), 0, "the claims are undone in the file, too");
        honest.await.unwrap();
    });
}

#[test]
fn unchecked_claims_are_checked_after_a_restart_by_whoever_comes() {
    run(async {
        // The machine of the liar may have been repaired, and another one may come.
        for name in ["liar", "another"] {
            let place = Place::of(b"a scene", [4; 3]);
            let server = place
                .serve(|config| {
                    config.fill = true;
                    config.samples = Some(1);
                })
                .await;
            let lies = common::work_as_named(server.address, "liar", nothing_there);
            let lies = tokio::spawn(lies);
            // There is nothing to trace, as the only worker says, so the fill ends.
            assert_eq!(server.ended().await.added, 0);
            in_time(lies).await.unwrap();
            let opened = Holodeck::open_read_only(&place.file(), 0).unwrap();
            let all = opened.sections[0].beam_count();
            assert_eq!((opened.unseen().count(), opened.unproven().count()), (all, all));
            drop(opened);
            let server = place
                .serve(|config| {
                    config.fill = true;
                    config.samples = Some(20_000);
                })
                .await;
            let address = server.address;
            let honest = tokio::spawn(async move { common::work_named(address, name).await });
            assert!(server.ended().await.added >= 20_000, "{name}");
            honest.await.unwrap();
            assert_eq!(unseen(&place), 0, "{name}");
        }
    });
}

#[test]
fn a_fill_that_had_ended_by_false_claims_goes_on_once_they_are_undone() {
    run(async {
        let place = Place::of(b"a scene", [2; 3]);
        let server = place.serve(|config| config.fill = true).await;
        let liar = tokio::spawn(common::work_as(server.address, nothing_there));
        // All 480 beams are claimed, and the fill has nothing left to do.
        in_time(async {
            let mut admin = Peer::join(server.address, Role::Admin).await;
            loop {
                admin.outbox.control(&Control::ReportWanted).unwrap();
                let message = admin.inbox.next().await.unwrap();
                if let Message::Control(Control::Report(report)) = message
                    && report.unseen_beams == 480
                    && report.workers.iter().all(|worker| worker.packets == 0)
                {
                    return;
                }
            }
        })
        .await;
        let honest = tokio::spawn(common::work(server.address));
        in_time(async {
            while stored_beams_of(&place, 480) < 480 {
                tokio::task::yield_now().await;
            }
        })
        .await;
        server.end().await;
        honest.await.unwrap();
        in_time(liar).await.unwrap();
    });
}

#[test]
fn true_claims_are_proven_by_another_machine_and_stored_as_such() {
    run(async {
        let place = Place::of(b"a scene", [2; 3]);
        let serve = || {
            place.serve(|config| {
                config.fill = true;
                config.samples = Some(1);
            })
        };
        let unproven = || Holodeck::open_read_only(&place.file(), 0).unwrap().unproven().count();
        let server = serve().await;
        let first = common::work_as_named(server.address, "a", nothing_there);
        let first = tokio::spawn(first);
        server.ended().await;
        in_time(first).await.unwrap();
        assert_eq!((unseen(&place), unproven()), (480, 480));
        let server = serve().await;
        let second = common::work_as_named(server.address, "b", nothing_there);
        let second = tokio::spawn(second);
        server.ended().await;
        in_time(second).await.unwrap();
        assert_eq!((unseen(&place), unproven()), (480, 0));
    });
}

/// The reason if the comparison of samples finds a liar before the check of claims does.
const BY_SAMPLES: &str = "of its rays hit something else than others'";

#[test]
fn of_three_workers_the_one_that_lies_is_named_and_dropped() {
    run(async {
        let place = Place::new();
        let (server, liar) = deceived(&place).await;
        let honest = [(); 2].map(|()| tokio::spawn(common::work(server.address)));
        let reason = in_time(liar).await.unwrap().expect("it is told why").to_string();
        let by_claims = reason.contains("sees nothing, and two others hit there");
        assert!(by_claims || reason.contains(BY_SAMPLES), "{reason}");
        server.end().await;
        for worker in honest {
            worker.await.unwrap();
        }
    });
}

#[test]
fn newcomers_do_not_outvote_a_worker_that_has_returned_much() {
    run(async {
        let place = Place::new();
        // It is honest: nothing is in the scene.
        let (server, honest) = deceived(&place).await;
        let mut newcomers = Vec::new();
        for number in 0..20 {
            let name = format!("newcomer {number}");
            let mut newcomer = Peer::named(server.address, Role::Worker, &name).await;
            newcomer.outbox.control(&Control::Ready { threads: 1 }).unwrap();
            // The first packets may be no checks. The last come after results were taken.
            for _ in 0..4 {
                let packets = newcomer.work().await;
                let first = common::results(&packets[..packets.len().min(20)], true);
                newcomer.send(FrameKind::Results, &first.encode());
            }
            newcomers.push(newcomer);
        }
        assert!(!honest.is_finished());
        server.end().await;
        let farewell = in_time(honest).await.unwrap();
        assert!(!format!("{farewell:?}").contains("broken"), "{farewell:?}");
    });
}

#[test]
fn a_worker_that_hits_something_where_two_others_hit_nothing_is_dropped() {
    run(async {
        let place = Place::new();
        let server = place.serve(|config| config.fill = true).await;
        let liar = tokio::spawn(common::work_as(server.address, |work| {
            common::results(&work.packets, true)
        }));
        let honest = [(); 2].map(|()| tokio::spawn(common::work_as(server.address, nothing_there)));
        let reason = in_time(liar).await.unwrap().expect("it is told why").to_string();
        let by_claims = reason.contains("it hit something in beam");
        assert!(by_claims || reason.contains(BY_SAMPLES), "{reason}");
        server.end().await;
        for worker in honest {
            worker.await.unwrap();
        }
    });
}

/// Returns how many beams have samples in the file.
fn stored_beams(place: &Place) -> usize {
    stored_beams_of(place, 5000)
}

/// As [`stored_beams`], among the first of the file.
fn stored_beams_of(place: &Place, beams: u64) -> usize {
    let holodeck = Holodeck::open_read_only(&place.file(), 0).unwrap();
    (0..beams).filter(|&number| holodeck.file.count(common::beam(number)) > 0).count()
}
