//! Reports on a server's state, which only administrators receive.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common::{self, Peer, Place, run, view};
use holo_net::Message;
use holo_proto::{control::Control, frame::FrameKind, hello::Role, report::StatusReport};

async fn ask(admin: &mut Peer) -> StatusReport {
    admin.outbox.control(&Control::ReportWanted).unwrap();
    let is_report = |message: &Message| matches!(message, Message::Control(Control::Report(_)));
    match admin.wait_for(is_report).await {
        Message::Control(Control::Report(report)) => *report,
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_administrator_hears_of_every_worker_and_display() {
    run(async {
        let place = Place::new();
        let server = place.serve(|_| {}).await;
        let mut admin = Peer::join(server.address, Role::Admin).await;
        let alone = ask(&mut admin).await;
        assert_eq!((alone.workers.len(), alone.displays.len(), alone.samples), (0, 0, 0));
        assert!(alone.file.ends_with("a.holo") && alone.file_bytes > 0, "{alone:?}");

        let mut silent = Peer::join(server.address, Role::Worker).await;
        silent.outbox.control(&Control::Ready { threads: 3 }).unwrap();
        let mut display = Peer::join(server.address, Role::Display).await;
        display.send(FrameKind::View, &view(1, 70));
        let held = silent.work().await.len() as u32;
        let _worker = tokio::spawn(common::work(server.address));
        display.samples(50).await;

        let report = ask(&mut admin).await;
        let [silent, busy] = &report.workers[..] else { panic!("{report:?}") };
        assert_eq!((silent.threads, silent.rays), (3, 0));
        assert!(silent.packets >= held && silent.rays_per_second == 0.0, "{silent:?}");
        assert!(busy.rays >= 50 && busy.rays_per_second > 0.0 && busy.latency > 0.0, "{busy:?}");
        assert_eq!(report.displays.len(), 1);
        assert_eq!((report.displays[0].beams, report.displays[0].is_read_only), (70, false));
        assert!(report.traced >= 50 && report.samples == report.traced);
        server.end().await;
    });
}

#[test]
fn others_are_told_nothing() {
    run(async {
        let place = Place::new();
        let server = place.serve(|_| {}).await;
        let mut display = Peer::join(server.address, Role::Display).await;
        display.outbox.control(&Control::ReportWanted).unwrap();
        let reason = display.expelled().await.expect("it is told why");
        assert!(reason.contains("not for a server"), "{reason}");
        server.end().await;
    });
}

#[test]
fn a_worker_that_returns_nothing_does_not_hold_up_the_end() {
    run(async {
        let place = Place::new();
        let server = place.serve(|config| config.fill = true).await;
        let mut silent = Peer::join(server.address, Role::Worker).await;
        silent.outbox.control(&Control::Ready { threads: 3 }).unwrap();
        assert!(!silent.work().await.is_empty());
        assert_eq!(server.end().await.added, 0);
        assert_eq!(silent.expelled().await.as_deref(), Some("the session is over"));
    });
}
