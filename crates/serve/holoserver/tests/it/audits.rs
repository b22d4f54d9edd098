//! Workers that return wrong samples: compared with others, dropped, named, and forgotten.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::{collections::BTreeSet, net::SocketAddr};

use crate::common::{Peer, Place, Server, in_time, results, run, work_as_named, work_named};
use holo_beamfile::Maker;
use holo_net::Message;
use holo_proto::{
    bulk::{Packet, Results, WorkPackets},
    control::{Control, Farewell},
    frame::FrameKind,
    hello::Role,
    report::StatusReport,
};
use holo_section::{RayCoords, Sample};
use holo_server::Holodeck;

async fn report(server: &Server) -> StatusReport {
    let mut admin = Peer::join(server.address, Role::Admin).await;
    admin.outbox.control(&Control::ReportWanted).unwrap();
    let is_report = |message: &Message| matches!(message, Message::Control(Control::Report(_)));
    match admin.wait_for(is_report).await {
        Message::Control(Control::Report(report)) => *report,
        other => panic!("{other:?}"),
    }
}

/// The right samples, four times as bright.
fn bright(work: &WorkPackets) -> Results {
    let mut results = results(&work.packets, true);
    for sample in &mut results.samples {
        let [red, green, blue, exponent] = sample.rgbe;
        *sample = Sample::from_codes(
            sample.coords,
            [red, green, blue, exponent + 2],
            sample.distance_code(),
        );
    }
    results
}

#[test]
fn a_worker_whose_light_is_wrong_is_dropped_named_kept_out_and_forgotten() {
    run(async {
        let place = Place::of(b"a scene", [4; 3]);
        let server = place.serve(|config| config.fill = true).await;
        let sound: Vec<_> = ["a", "b", "c"]
            .into_iter()
            .map(|name| tokio::spawn(work_named(server.address, name)))
            .collect();
        let broken = work_as_named(server.address, "rtworker on d #7", bright);
        let reason = in_time(broken).await.expect("it is told why").to_string();
        assert!(
            reason.contains("red light is") && reason.contains("times that of others"),
            "{reason}"
        );

        let again = in_time(work_as_named(server.address, "rtworker on d #8", bright)).await;
        assert!(
            again.unwrap().to_string().contains("its machine seems to be broken"),
            "another process of it"
        );
        // The others go on, so that their samples follow those of the broken one.
        let report = loop {
            let report = report(&server).await;
            if report.traced > 100_000 {
                break report;
            }
        };
        let [fault] = &report.faults[..] else { panic!("{report:?}") };
        assert!(fault.is_dropped && fault.name == "rtworker on d" && fault.maker > 0);
        assert_eq!(report.workers.len(), 3, "the sound ones stay");
        assert!(report.workers.iter().all(|worker| worker.maker != fault.maker));
        server.end().await;
        for worker in sound {
            in_time(worker).await.unwrap();
        }

        let bad = |sample: &Sample| sample.rgbe[3] == 130;
        let (wrong, all) = count(&place, bad);
        assert!(wrong > 0 && wrong < all, "{wrong} of {all}");
        let forgotten = Holodeck::forget(&place.file(), &[Maker(fault.maker)]).unwrap();
        assert_eq!((forgotten.samples, forgotten.left), (wrong, all - wrong));
        assert_eq!(count(&place, bad), (0, all - wrong));
        let twice = Holodeck::forget(&place.file(), &[Maker(fault.maker)]).unwrap_err();
        assert!(twice.to_string().contains("knows no worker"), "{twice}");
        let others = Holodeck::open_read_only(&place.file(), 0).unwrap();
        let names: BTreeSet<_> = others.makers().iter().map(|maker| maker.name.clone()).collect();
        assert_eq!(names, ["a", "b", "c"].map(str::to_owned).into());

        // The numbers that are missing are traced first.
        let numbers = |place: &Place| {
            let holodeck = Holodeck::open_read_only(&place.file(), 0).unwrap();
            let mut holes = 0;
            holodeck.file.for_each_beam(&mut |key, samples| {
                holes += u64::from(holodeck.file.counts(key).uniform) - samples;
            });
            holes
        };
        let holes = numbers(&place);
        assert!(holes > 0);
        let server = place
            .serve(|config| {
                config.fill = true;
                config.samples = Some(wrong);
            })
            .await;
        let worker = tokio::spawn(work_named(server.address, "a"));
        server.ended().await;
        in_time(worker).await.unwrap();
        assert!(numbers(&place) < holes, "{} of {holes}", numbers(&place));
    });
}

/// Returns how many samples of a file are such, and how many it has.
fn count(place: &Place, is_such: impl Fn(&Sample) -> bool) -> (u64, u64) {
    let holodeck = Holodeck::open_read_only(&place.file(), 0).unwrap();
    let mut keys = Vec::new();
    holodeck.file.for_each_beam(&mut |key, _| keys.push(key));
    let beams = keys.iter().map(|&key| holodeck.file.read(key).unwrap());
    beams.fold((0, 0), |(such, all), beam| {
        let found = beam.samples.iter().filter(|sample| is_such(sample)).count() as u64;
        (such + found, all + beam.samples.len() as u64)
    })
}

#[test]
fn of_two_workers_that_differ_both_stay_and_the_report_says_so() {
    run(async {
        let place = Place::new();
        let server = place.serve(|config| config.fill = true).await;
        let workers = [
            tokio::spawn(async move { work_as_named(server.address, "a", bright).await }),
            tokio::spawn(async move {
                work_as_named(server.address, "b", |work| results(&work.packets, true)).await
            }),
        ];
        let faults = loop {
            let report = report(&server).await;
            assert!(report.faults.iter().all(|fault| !fault.is_dropped), "{report:?}");
            if !report.faults.is_empty() {
                break report.faults;
            }
        };
        let [fault] = &faults[..] else { panic!("{faults:?}") };
        assert!(["a and b", "b and a"].contains(&fault.name.as_str()) && fault.maker == 0);
        assert!(fault.reason.contains("red light of") && fault.reason.contains("a third worker"));
        server.end().await;
        for worker in workers {
            assert_eq!(in_time(worker).await.unwrap(), Some(Farewell::SessionOver));
        }
    });
}

/// Checks that the server answers a worker instead of ending its connection.
async fn assert_admitted(mut worker: Peer) {
    worker.outbox.control(&Control::Ping(7)).unwrap();
    worker.wait_for(|message| *message == Message::Control(Control::Pong(7))).await;
}

/// Joins as a worker with `answer` again and again, each time for so few packets that they prove
/// nothing. Returns why it is no longer admitted.
async fn come_and_go(
    server: SocketAddr,
    name: &str,
    answer: impl Fn(&WorkPackets) -> Results,
) -> String {
    for _ in 0..10_000 {
        let Peer { mut inbox, outbox, .. } = Peer::named(server, Role::Worker, name).await;
        outbox.control(&Control::Ready { threads: 1 }).unwrap();
        for messages in 0.. {
            match in_time(inbox.next()).await {
                Ok(Message::Work(work)) => {
                    outbox.send(FrameKind::Results, &answer(&work).encode()).unwrap();
                }
                Ok(Message::Control(Control::Bye(farewell))) => return farewell.to_string(),
                Ok(_) => {}
                Err(_) => break,
            }
            if messages == 3 {
                outbox.drained().await;
                break;
            }
        }
    }
    panic!("it is never found");
}

#[test]
fn a_liar_that_comes_and_goes_is_found_and_listed_and_its_name_accuses_nobody_else() {
    run(async {
        let place = Place::new();
        let server = place.serve(|config| config.fill = true).await;
        let sound: Vec<_> = ["a", "b"]
            .into_iter()
            .map(|name| tokio::spawn(work_named(server.address, name)))
            .collect();
        let reason = come_and_go(server.address, "rtworker on d #1", bright).await;
        assert!(reason.contains("red light"), "{reason}");
        let report = report(&server).await;
        let [fault] = &report.faults[..] else { panic!("{report:?}") };
        assert!(fault.is_dropped && fault.name == "rtworker on d", "{fault:?}");
        // Another machine that has the same name is not refused.
        let joined = holo_net::connect(server.address, Role::Worker, "rtworker on d #1").await;
        let (inbox, outbox, welcome) = joined.unwrap();
        assert_admitted(Peer { inbox, outbox, welcome }).await;
        server.end().await;
        for worker in sound {
            in_time(worker).await.unwrap();
        }
        // A later server of the file refuses it, too, until it is forgotten.
        let server = place.serve(|_| {}).await;
        let again = in_time(work_as_named(server.address, "rtworker on d #2", bright)).await;
        assert!(again.unwrap().to_string().contains("its machine seems to be broken"));
        server.end().await;
        Holodeck::forget(&place.file(), &[Maker(fault.maker)]).unwrap();
        let server = place.serve(|_| {}).await;
        let back = Peer::named(server.address, Role::Worker, "rtworker on d #3").await;
        assert_admitted(back).await;
        server.end().await;
    });
}

#[test]
fn impossible_results_are_listed_and_their_machine_is_refused_on_return() {
    run(async {
        let place = Place::new();
        let server = place.serve(|config| config.fill = true).await;
        let outside = |work: &WorkPackets| {
            let mut results = results(&work.packets, true);
            results.samples[0] = Sample::from_codes(RayCoords::default(), [128; 4], 40_000);
            results
        };
        let said = in_time(work_as_named(server.address, "d", outside)).await;
        let said = said.expect("it is told why").to_string();
        let again = in_time(work_as_named(server.address, "d", outside)).await;
        assert!(again.unwrap().to_string().contains("its machine seems to be broken"));
        let report = report(&server).await;
        let [fault] = &report.faults[..] else { panic!("{report:?}") };
        assert!(fault.is_dropped && fault.name == "d" && said.contains(&fault.reason), "{fault:?}");
        server.end().await;
        // One ray does not condemn a machine for ever.
        let server = place.serve(|_| {}).await;
        let back = Peer::named(server.address, Role::Worker, "d").await;
        assert_admitted(back).await;
        server.end().await;
    });
}

#[test]
fn what_a_worker_finds_to_see_nothing_is_forgotten_with_its_samples() {
    run(async {
        let place = Place::new();
        let server = place.serve(|config| config.fill = true).await;
        let claims = |work: &WorkPackets| Results {
            unseen: work.packets.iter().map(|packet| packet.id).collect(),
            ..Results::default()
        };
        let claimer = tokio::spawn(async move { work_as_named(server.address, "a", claims).await });
        while report(&server).await.unseen_beams == 0 {}
        server.end().await;
        in_time(claimer).await.unwrap();
        let unseen = || Holodeck::open_read_only(&place.file(), 0).unwrap().unseen().count();
        let found = unseen();
        assert!(found > 0);
        let server = place
            .serve(|config| {
                config.fill = true;
                config.samples = Some(1);
            })
            .await;
        // It agrees, and hits something elsewhere.
        let claimed = Holodeck::open_read_only(&place.file(), 0).unwrap().unseen().clone();
        let agrees = move |work: &WorkPackets| {
            let is_claimed = |packet: &&Packet| claimed.contains(packet.key);
            let (unseen, others): (Vec<&Packet>, Vec<&Packet>) =
                work.packets.iter().partition(is_claimed);
            let unseen = unseen.iter().map(|packet| packet.id).collect();
            Results { unseen, ..results(others, true) }
        };
        let worker = work_as_named(server.address, "b", agrees);
        let worker = tokio::spawn(worker);
        assert!(server.ended().await.added > 0);
        in_time(worker).await.unwrap();
        let kept = Holodeck::forget(&place.file(), &[Maker(2)]).unwrap();
        assert_eq!((kept.unseen, unseen()), (0, found), "another worker found them");
        let forgotten = Holodeck::forget(&place.file(), &[Maker(1)]).unwrap();
        assert_eq!((forgotten.unseen, unseen()), (found, 0));
    });
}
